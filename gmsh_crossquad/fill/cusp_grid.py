"""Structured grids in cusps, between two curves that touch in a corner and part slowly.

Coons' rule puts node (1, 1) beside the corner at the sum of the steps along both curves, about twice as far from it as nodes
(1, 0) and (0, 1) are: beyond one of the curves where they bend by more than they part.  Here the nodes lie on rings across the
gap instead: with A(r) and B(r) the places on the curves at the share r of the sides' nodes, ring r is the line

    A(r) -> D(r) -> B(r),      D(r) = (A(r) + B(r)) / 2 + s |A(r) - B(r)| d(r),

where d(r) is the direction in which the middle of the gap runs and s the share by which the corner opposite to the cusp lies
beyond the middle of its neighbours.  Node (u, v) is on ring max(u, v), from A at v / u of the way to D, or from B at u / v.
Every quad lies between two rings, so no node is outside the gap at any ratio of bending and parting.
"""

from __future__ import annotations

import numpy as np

from ..records import Float

__all__ = ["cusp_grid"]

LEAST = 0.2  # s, at least: the quads between two rings at their corner D are the flatter the smaller it is


def cusp_grid(bottom: Float, right: Float, top: Float, left: Float) -> Float:
    """Fill a grid with its cusp between `bottom` and `left`.

    Parameters
    ----------
    bottom, top : (d, ku + 1) float64
        Sides along u; `bottom` lies on a curve.
    right, left : (d, kv + 1) float64
        Sides along v; `left` lies on a curve.

    Returns
    -------
    (d, ku + 1, kv + 1) float64
        The sides included.
    """
    ku, kv = bottom.shape[1] - 1, left.shape[1] - 1
    rings = np.unique(np.concatenate([np.arange(ku + 1) * kv, np.arange(kv + 1) * ku]))
    share = rings / (ku * kv)
    a, b = _at(bottom, share * ku), _at(left, share * kv)
    middle = 0.5 * (a + b)
    along = np.gradient(middle, axis=1)
    along /= np.maximum(np.linalg.norm(along, axis=0), np.finfo(float).tiny)
    gap = np.linalg.norm(a - b, axis=0)
    beyond = float((right[:, -1] - middle[:, -1]) @ along[:, -1]) / max(float(gap[-1]), np.finfo(float).tiny)
    ridge = middle + max(beyond, LEAST) * gap * along
    ridge[:, -1] = right[:, -1]
    i, j = np.arange(ku + 1)[:, None] * kv, np.arange(kv + 1)[None, :] * ku
    ring, low = np.maximum(i, j), np.minimum(i, j)
    row = np.searchsorted(rings, ring)
    t = low / np.maximum(ring, 1)
    start = np.where(i >= j, a[:, row], b[:, row])
    out: Float = start + t * (ridge[:, row] - start)
    out[:, :, 0], out[:, :, -1], out[:, 0, :], out[:, -1, :] = bottom, top, left, right
    return out


def _at(line: Float, place: Float) -> Float:
    """Points (d, n) of a polyline (d, k + 1) at places from 0 to k."""
    return np.stack([np.interp(place, np.arange(line.shape[1]), x) for x in line])
