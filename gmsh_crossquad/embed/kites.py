"""Rest lengths of quads in cusps.

Such a quad is a kite with angles of 120 degrees everywhere but in the cusp: its edges along the curves have one length L, and
where the gap between the curves has the width g(L) there, both others have g(L) / sqrt(3).  L is the least length for which
these have `WIDTH` of the length of the next edges along the curves, at least that length and at most `LONGEST` times it.
"""

from __future__ import annotations

import numpy as np

from ..cusps import Cusps
from ..records import Bool, Float, Int, Model
from .curve_table import CurveTable

__all__ = ["kites"]

WIDTH = 0.3
LONGEST = 4.0
PLACES = 25
"""Lengths that are tried."""


def kites(
    own: Float, held: Bool, cusps: Cusps, quad_edges: Int, chain_edges: list[Int], model: Model, table: CurveTable
) -> tuple[Float, Bool]:
    """Give the edges of quads in cusps the lengths of kites.

    Parameters
    ----------
    own : (e,) float64
        Logarithms of the edge lengths.
    held : (e,) bool
        Edges that must keep theirs.
    cusps : Cusps
    quad_edges : (q, 4) int64
    chain_edges : list of (k,) int64
        Edges along every curve.
    model : Model
    table : CurveTable

    Returns
    -------
    own : (e,) float64
    held : (e,) bool
        With the edges of the kites.
    """
    new, kept = own.copy(), held.copy()
    for q, k, curve, end in zip(cusps.quad.tolist(), cusps.corner.tolist(), cusps.curve.tolist(), cusps.end.tolist()):
        sides = [(model.curves[c].length, chain_edges[c][:: 1 if e == 0 else -1], c, e) for c, e in zip(curve, end)]
        following = [rows[1] for _, rows, _, _ in sides if len(rows) > 1]
        if not following:
            continue
        beside = float(np.exp(own[following].mean()))
        reach = np.minimum(np.linspace(1.0, LONGEST, PLACES) * beside, 0.5 * min(length for length, _, _, _ in sides))
        a, b = (table.at(np.full(PLACES, c), reach if e == 0 else length - reach)[0][:, :3] for length, _, c, e in sides)
        short = np.linalg.norm(a - b, axis=1) / np.sqrt(3.0)
        i = min(int(np.searchsorted(np.maximum.accumulate(short), WIDTH * beside)), PLACES - 1)
        edges = quad_edges[q, [k, k - 1, k - 2, k - 3]]
        lengths = np.log(np.maximum([reach[i], reach[i], short[i], short[i]], np.finfo(float).tiny))
        new[edges] = np.where(held[edges], own[edges], lengths)
        kept[edges] = True
    return new, kept
