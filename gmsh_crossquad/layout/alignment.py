"""Rows that keep opposite sides of thin strips in step.

The sums over opposite sides of a patch are equal, but a long thin patch (an air gap, a coating, a wall) may have many arcs on
both sides, and nothing else keeps a node on one side opposite to where it belongs on the other: the quads between them
would be sheared by the angle atan(d / w) for a shift d and the width w.  For a node at the fraction f of its side, N_k divisions
into it, the other side has N' = sum of the arcs before f + the same fraction of the arc that holds f.  The shift is
d = (N_k - N') H with H the mean edge there, and the cost is PRICE (d / w - 1) where d > w: one row and two slack columns.
Measured on a motor with an air gap of 1/130 of its length: the greatest shift falls from 31 to 4 widths, and the least scaled
Jacobian of the guide grid rises from .002 to .34.  The two circles of a ring are sides of unlike length, and a ring turned by
half a turn cannot be laid out either: a crankshaft with such rings has 14 inverted cells where they are left out, else none.
A shift of one division is left free.  Less makes the program harder, but the two rings of a capacitor, a third of a division
wide, with rounded corners of one division each, can only be laid out then: free up to .6 the least scaled Jacobian is .60.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from ..records import Float, TMesh

__all__ = ["alignment"]

STRIP = 4.0
PRICE = 0.3
MOST = 40
MOST_ARCS = 2_000  # beyond, the rows, which are no flow rows, make the program much harder: 66 s were seen
LEAST = 1.0
TIGHT_ARCS = 500  # up to which less than that may be free: 30 s were seen on 1,442 arcs, 3 s else
UNLIKE = 4.0


def alignment(tmesh: TMesh, target: Float, least: float = LEAST) -> tuple[sp.csr_array, Float, Float]:
    """Rows of the shift between opposite sides, in divisions.

    Parameters
    ----------
    tmesh : TMesh
    target : (a,) float64
        Wanted divisions of every arc.
    least : float
        Shift, in divisions, that costs nothing however narrow the strip is; `LEAST` where there are more than `TIGHT_ARCS` arcs.

    Returns
    -------
    rows : (k, a) sparse float64
        Divisions up to a node less those up to the place opposite to it.
    free : (k,) float64
        Shift that costs nothing.
    price : (k,) float64
        Cost of a division more.
    """
    row: list[int] = []
    column: list[int] = []
    value: list[float] = []
    free: list[float] = []
    least = least if len(tmesh.length) <= TIGHT_ARCS else LEAST
    for sides in tmesh.patches if len(tmesh.length) <= MOST_ARCS else ():
        length = [float(sum(tmesh.length[arc] for arc, _ in side)) for side in sides]
        for i in (0, 1):
            long, wide = 0.5 * (length[i] + length[i + 2]), 0.5 * (length[i + 1] + length[i - 1])
            unlike = max(length[i], length[i + 2]) > UNLIKE * min(length[i], length[i + 2])
            if long < STRIP * wide or unlike or len(sides[i]) + len(sides[i + 2]) < 3:
                continue
            one = [arc for arc, _ in sides[i]]
            two = [arc for arc, _ in sides[i + 2]][::-1]
            mean = long / max(0.5 * float(target[one].sum() + target[two].sum()), 1.0)
            for here, there in ((one, two), (two, one)):
                places = np.cumsum(tmesh.length[here])[:-1] / tmesh.length[here].sum()
                ends = np.cumsum(tmesh.length[there]) / tmesh.length[there].sum()
                nodes = np.arange(len(places))
                if len(nodes) > MOST:
                    nodes = np.unique(np.linspace(0, len(places) - 1, MOST).astype(int))
                for k in nodes.tolist():
                    j = min(int(np.searchsorted(ends, places[k])), len(there) - 1)
                    begin = ends[j - 1] if j else 0.0
                    n = len(free)
                    row += [n] * (k + j + 2)
                    column += [*here[: k + 1], *there[: j + 1]]
                    value += [1.0] * (k + 1) + [-1.0] * j + [-float((places[k] - begin) / (ends[j] - begin))]
                    free.append(max(wide / mean, least))
    rows = sp.csr_array((value, (row, column)), shape=(len(free), len(tmesh.length)))
    shift = np.array(free)
    return rows, shift, PRICE / shift
