"""Starting positions for the smoother.

`spread_chains` gives the vertices on every CAD curve a strict order.  Between two fixed vertices the gaps g_i are blended
with the even gap g, (1 - t) g_i + t g, with the least t that leaves every gap at least `LEAST_GAP` of the even one: a
chain in good order stays as it is, ties are opened and wrong orders undone.

`laplace_start` is the twist-free start: even gaps everywhere (t = 1), and in the interior the solution of

    sum over the neighbours w of v of (x_w - x_v) = 0,

the uniform Laplace equation of the edge graph (a Tutte embedding of every face).  A curved face would be cut off by that; here
the vertices make `STEPS` implicit steps of the flow towards the harmonic map into the surface,

    (deg v + ANCHOR) x_v - sum x_w = ANCHOR y_v,    y <- nearest point of the surface to x,

from where they are.

References
----------
.. [1] W. T. Tutte, "How to draw a graph", Proceedings of the London Mathematical Society 13, 1963, 743-767.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from ..errors import MeshError
from ..quad_edges import edges_of_quads
from ..records import Float, Guide, Model
from ..surfaces import Surfaces
from .curve_table import CurveTable

__all__ = ["chain_arclengths", "laplace_start", "spread_chains"]

ANCHOR = 0.1
"""Weight of a vertex's own place, over that of one neighbour; one step reaches about three edges far."""
STEPS = 20
LEAST_GAP = 0.05
"""Least gap between neighbours on a curve at the start, over the even gap."""


def chain_arclengths(guide: Guide, model: Model, row: int) -> Float:
    """Arc lengths (k + 1,) of the vertices of a curve's chain; 0 and the curve's length at its ends."""
    places: Float = guide.arclength[guide.chains[row]].copy()
    places[0], places[-1] = 0.0, model.curves[row].length
    return places


def spread_chains(guide: Guide, model: Model, table: CurveTable, even: bool = False) -> Guide:
    """Bring the vertices on every curve into strict order, changing as little as possible.

    Parameters
    ----------
    guide : Guide
    model : Model
    table : CurveTable
        Of the model's curves.
    even : bool
        Even gaps between the fixed vertices instead.

    Returns
    -------
    Guide
        With new `arclength`, and `points` of the vertices on curves.

    Raises
    ------
    MeshError
        Where fixed vertices on a curve are not in strict order.
    """
    arclength = guide.arclength.copy()
    for row, chain in enumerate(guide.chains):
        if len(chain) == 0:
            continue
        places = chain_arclengths(guide, model, row)
        fixed = guide.fixed[chain].copy()
        fixed[[0, -1]] = True
        at = np.flatnonzero(fixed)
        span = np.diff(places[at])
        if not span.min() > 0.0:
            here = model.curves[row].at(places[at[np.argmin(span)]][None])[0]
            raise MeshError(
                "prescribed nodes are not in order along a curve",
                entity=(1, model.curves[row].tag),
                location=here * model.scale + model.origin,
                remedy="remove the Transfinite Curve command or the points embedded there",
            )
        count = np.diff(at)
        mean = np.repeat(span / count, count)
        gap = np.diff(places)
        short = gap < LEAST_GAP * mean
        lack = np.divide(LEAST_GAP * mean - gap, mean - gap, out=np.zeros_like(gap), where=short)
        blend = np.repeat(np.ones(len(span)) if even else np.maximum.reduceat(lack, at[:-1]), count)
        gap = np.where(blend > 0.0, (1.0 - blend) * gap + blend * mean, gap)
        for low, high in pairwise(at.tolist()):
            if blend[low] > 0.0:
                arclength[chain[low + 1 : high]] = places[low] + np.cumsum(gap[low : high - 1])
    free = np.flatnonzero((guide.curve >= 0) & ~guide.fixed)
    points = guide.points.copy()
    points[free] = table.at(guide.curve[free], arclength[free])[0][:, :3]
    return replace(guide, points=points, arclength=arclength)


def laplace_start(guide: Guide, model: Model, surfaces: Surfaces, table: CurveTable) -> Guide:
    """Even gaps on the curves, uniform Laplace in the interior.

    Parameters
    ----------
    guide : Guide
    model : Model
    surfaces : Surfaces
    table : CurveTable
        Of the model's curves.

    Returns
    -------
    Guide
        With new `points` and `arclength`.
    """
    from scipy.sparse import csc_array
    from scipy.sparse.linalg import splu

    guide = spread_chains(guide, model, table, even=True)
    edges, _ = edges_of_quads(guide.quads)
    n = len(guide.points)
    free = np.zeros(n, dtype=bool)
    free[guide.quads] = True
    free &= (guide.curve < 0) & ~guide.fixed
    if not free.any():
        return guide
    rows, cols = np.concatenate([edges[:, 0], edges[:, 1]]), np.concatenate([edges[:, 1], edges[:, 0]])
    number = np.cumsum(free) - 1
    degree = np.bincount(rows, minlength=n)[free].astype(float)
    k = len(degree)
    face = np.zeros(n, dtype=np.int64)
    face[guide.quads] = guide.quad_face[:, None]
    face = face[free]
    bent = surfaces.curved[face]
    anchor = np.where(bent, ANCHOR, 0.0)
    inner = free[rows] & free[cols]
    outer = free[rows] & ~free[cols]
    diagonal = np.arange(k)
    matrix = csc_array(
        (
            np.concatenate([degree + anchor, np.full(int(inner.sum()), -1.0)]),
            (np.concatenate([diagonal, number[rows[inner]]]), np.concatenate([diagonal, number[cols[inner]]])),
        ),
        shape=(k, k),
    )
    load = np.column_stack([np.bincount(number[rows[outer]], guide.points[cols[outer], c], minlength=k) for c in range(3)])
    points = guide.points.copy()
    lu = splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    place = points[free]
    for _ in range(STEPS if bent.any() else 1):
        place = lu.solve(load + anchor[:, None] * place)
        if bent.any():
            place[bent] = surfaces.feet(face[bent], place[bent])
    points[free] = place
    return replace(guide, points=points)
