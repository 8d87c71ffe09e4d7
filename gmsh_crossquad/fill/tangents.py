"""Tangents at the ends of guide edges, so that grid lines run smoothly from cell to cell.

Lines of the grid continue through regular vertices (inside a face, on no curve, four quads).  With the chord vectors d1, d2
of the two edges that meet there, lengths l1, l2 and divisions k1, k2, the direction is the three-point difference on the
non-uniform grid

    t = (l2 / (l1 + l2)) d1 / l1 + (l1 / (l1 + l2)) d2 / l2

and both sides share one speed per fine step, the harmonic mean 2 h1 h2 / (h1 + h2) with h = l / k, so that neither the
direction nor the size of the fine edges jumps.  Where a line ends the cubic has no curvature there (a natural spline):
1.5 d - 0.5 t.  Speeds stay below twice the chord, which keeps the cubics free of loops (monotone up to three times the
chord: F. N. Fritsch, R. E. Carlson, Monotone piecewise cubic interpolation, SIAM J. Numer. Anal. 17, 1980).
"""

from __future__ import annotations

import numpy as np

from ..records import Float, Int
from .numbering import GuideTopology

__all__ = ["continuation", "cubic", "end_tangents"]


def continuation(quads: Int, topology: GuideTopology) -> Int:
    """Edge that continues each edge straight on, at both of its ends.

    Parameters
    ----------
    quads : (q, 4) int64
    topology : GuideTopology

    Returns
    -------
    (e, 2) int64
        -1 where the line ends.
    """
    edges, quad_edges = topology.edges, topology.quad_edges
    n, n_edges = len(topology.vertex_on_curve), len(edges)
    valence = np.bincount(quads.ravel(), minlength=n)
    regular = ~topology.vertex_on_curve & (valence == 4)
    # at a regular vertex the four edges are e, its two neighbours in the adjacent quads, and the one sought
    after, before = quad_edges.ravel(), np.roll(quad_edges, 1, axis=1).ravel()
    corner = quads.ravel()
    total = np.zeros(n, np.int64)
    np.add.at(total, corner, after + before)
    total //= 2
    neighbours = np.zeros((n_edges, 2), np.int64)
    for e, other in ((after, before), (before, after)):
        np.add.at(neighbours, (e, (edges[e, 1] == corner).astype(np.int64)), other)
    return np.where(regular[edges], total[edges] - neighbours - np.arange(n_edges)[:, None], -1)


def end_tangents(points: Float, edges: Int, divisions: Int, following: Int) -> Float:
    """Derivatives of every edge at both ends, its parameter running from 0 to 1.

    Parameters
    ----------
    points : (n, 3) float64
    edges : (e, 2) int64; divisions : (e,) int64
    following : (e, 2) int64
        From `continuation`.

    Returns
    -------
    (e, 2, 3) float64
    """
    d = points[edges[:, 1]] - points[edges[:, 0]]
    length = np.linalg.norm(d, axis=1)
    step = length / divisions
    out = np.repeat(d[:, None], 2, axis=1)
    tiny = np.finfo(float).tiny
    for end, sign in ((0, 1.0), (1, -1.0)):
        e = np.flatnonzero(following[:, end] >= 0)
        g = following[e, end]
        # w and d leave the common vertex along the two edges
        w = d[g] * np.where(edges[g, 0] == edges[e, end], 1.0, -1.0)[:, None]
        le, lg = length[e], length[g]
        total = np.maximum(le + lg, tiny)
        t = sign * d[e] * (lg / total / np.maximum(le, tiny))[:, None] - w * (le / total / np.maximum(lg, tiny))[:, None]
        speed = 2 * step[e] * step[g] / np.maximum(step[e] + step[g], tiny) * divisions[e]
        out[e, end] = t * (sign * speed / np.maximum(np.linalg.norm(t, axis=1), tiny))[:, None]
    for end in (0, 1):
        e = np.flatnonzero((following[:, end] < 0) & (following[:, 1 - end] >= 0))
        out[e, end] = 1.5 * d[e] - 0.5 * out[e, 1 - end]
    return out


def cubic(start: Float, end: Float, tangents: Float, count: int) -> Float:
    """Inner points (m, count - 1, 3) of Hermite cubics from `start` (m, 3) to `end` (m, 3), `tangents` (m, 2, 3)."""
    u = (np.arange(1, count) / count)[None, :, None]
    v = 1.0 - u
    out: Float = (
        (1 + 2 * u) * v * v * start[:, None]
        + u * v * v * tangents[:, None, 0]
        + u * u * (3 - 2 * u) * end[:, None]
        - u * u * v * tangents[:, None, 1]
    )
    return out
