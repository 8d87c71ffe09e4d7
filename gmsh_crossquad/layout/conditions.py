"""What the divisions of a T-mesh must fulfil before anything is known of its corners."""

from __future__ import annotations

import scipy.sparse as sp

from ..records import Model, TMesh
from .cuts import Cut

__all__ = ["at_least", "balance"]


def balance(tmesh: TMesh) -> sp.csr_array:
    """(2 p, a) rows of (sum of a side) - (sum of the opposite side): sides 0 and 2 of a patch, then its sides 1 and 3."""
    rows, columns, values = [], [], []
    k = 0
    for sides in tmesh.patches:
        for i in (0, 1):
            for j, sign in ((i, 1.0), (i + 2, -1.0)):
                for arc, _ in sides[j]:
                    rows.append(k)
                    columns.append(arc)
                    values.append(sign)
            k += 1
    return sp.csr_array((values, (rows, columns)), shape=(k, len(tmesh.length)))


def at_least(tmesh: TMesh, model: Model) -> list[Cut]:
    """Minimum divisions of CAD curves and boundary loops, as cuts with one option."""
    out = []
    for curve, pieces in zip(model.curves, tmesh.pieces):
        out.append(Cut(((tuple((arc, 1) for arc in pieces), 3 if curve.closed else 1),)))
    for _, arcs in tmesh.loops:
        count: dict[int, int] = {}
        for arc in arcs:
            count[arc] = count.get(arc, 0) + 1
        out.append(Cut(((tuple(count.items()), 3),)))
    return out
