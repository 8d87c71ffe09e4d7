"""Flip the sides of triangles in space until they are Delaunay.

A side is flipped where the two angles opposite of it sum to more than pi; its cotangent weight is then negative.  In one round
all sides are flipped that are the worst of both their triangles, so that none of them touches another; a flip that would turn
a triangle over or double an edge is left out.  In the plane this is Lawson's algorithm [1]_.

References
----------
.. [1] C. L. Lawson, "Software for C1 surface interpolation", Mathematical Software III, 1977, pp. 161-194.
"""

from __future__ import annotations

import numpy as np

from ..records import Float, Int

__all__ = ["delaunay_flips"]

ROUNDS = 60
BLUNT = 1e-9  # radians over pi
UPRIGHT = 0.5  # least cosine between the new triangles' normals and that of the two old ones


def delaunay_flips(points: Float, triangles: Int, kept: Int) -> Int:
    """Triangles (m, 3) with sides flipped; every triangle keeps its orientation.

    Parameters
    ----------
    points : (n, 3) float64
    triangles : (m, 3) int64
        Manifold, oriented.
    kept : (k, 2) int64
        Edges that must not be flipped.
    """
    n, triangles = len(points), triangles.copy()
    fixed = np.minimum(kept[:, 0], kept[:, 1]) * n + np.maximum(kept[:, 0], kept[:, 1])
    for _ in range(ROUNDS):
        a, b = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
        key = np.minimum(a, b) * n + np.maximum(a, b)
        order = np.argsort(key, kind="stable")
        same = np.flatnonzero(key[order[1:]] == key[order[:-1]])
        h, g = order[same], order[same + 1]
        free = ~np.isin(key[h], fixed)
        h, g = h[free], g[free]
        # triangle a b c with the neighbour b a d
        a, b, c, d = a[h], b[h], _opposite(triangles, h), _opposite(triangles, g)
        excess = _angle(points, c, a, b) + _angle(points, d, b, a) - np.pi
        new = np.minimum(c, d) * n + np.maximum(c, d)
        bad = (excess > BLUNT) & (c != d) & ~np.isin(new, key) & _upright(points, a, b, c, d)
        rank = np.full(len(triangles), np.inf)
        place = np.empty(int(bad.sum()))
        place[np.argsort(-excess[bad], kind="stable")] = np.arange(len(place))
        t, s = h[bad] // 3, g[bad] // 3
        np.minimum.at(rank, t, place)
        np.minimum.at(rank, s, place)
        chosen = np.flatnonzero((rank[t] == place) & (rank[s] == place))
        if not len(chosen):
            break
        chosen = chosen[np.unique(new[bad][chosen], return_index=True)[1]]
        a, b, c, d = (x[bad][chosen] for x in (a, b, c, d))
        triangles[t[chosen]] = np.stack([a, d, c], axis=1)
        triangles[s[chosen]] = np.stack([d, b, c], axis=1)
    return triangles


def _opposite(triangles: Int, half: Int) -> Int:
    """Corners opposite of half-edges."""
    out: Int = triangles[half // 3, (half + 2) % 3]
    return out


def _angle(points: Float, at: Int, p: Int, q: Int) -> Float:
    u, v = points[p] - points[at], points[q] - points[at]
    out: Float = np.arctan2(np.linalg.norm(np.cross(u, v), axis=1), np.einsum("ij,ij->i", u, v))
    return out


def _upright(points: Float, a: Int, b: Int, c: Int, d: Int) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    """Whether both triangles a d c and d b c look to the side of the triangles a b c and b a d."""

    def area(p: Int, q: Int, r: Int) -> Float:
        out: Float = np.cross(points[q] - points[p], points[r] - points[p])
        return out

    old = area(a, b, c) + area(b, a, d)
    size = np.linalg.norm(old, axis=1)
    cosine = [np.einsum("ij,ij->i", x, old) - UPRIGHT * size * np.linalg.norm(x, axis=1) for x in (area(a, d, c), area(d, b, c))]
    return np.minimum(*cosine) > 0
