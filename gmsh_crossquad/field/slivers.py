"""Flip away triangles without area.

A mesher that works in the parameter plane leaves triangles whose three corners lie on a straight line in space (along a seam).
Such a triangle is flat against its longest edge: the edge is flipped, which joins the corner opposite of it with the far corner
of the neighbour.
"""

from __future__ import annotations

import numpy as np

from ..records import Bool, Float, Int
from .surface_mesh import SurfaceMesh

__all__ = ["without_slivers"]

FLAT = 1e-5
ROUNDS = 10


def without_slivers(points: Float, triangles: Int, kept: Int) -> Int:
    """Triangles (m, 3) in which those without area are flipped away where that is possible.

    Parameters
    ----------
    points : (n, d) float64
    triangles : (m, 3) int64
        Manifold, oriented.
    kept : (k, 2) int64
        Edges that must not be flipped.
    """
    n = len(points)
    fixed = {(min(a, b), max(a, b)) for a, b in kept.tolist()}
    triangles = triangles.copy()
    for _ in range(ROUNDS):
        bad = np.flatnonzero(_flat(points, triangles))
        if not len(bad):
            break
        mesh = SurfaceMesh(points, triangles)
        busy: set[int] = set()
        flips = 0
        for t in bad.tolist():
            corner = triangles[t]
            length = np.linalg.norm(points[np.roll(corner, -1)] - points[corner], axis=1)
            k = int(np.argmax(length))
            a, c, b = (int(corner[(k + j) % 3]) for j in range(3))
            twin = int(mesh.twin[3 * t + k])
            if twin < 0 or (min(a, c), max(a, c)) in fixed:
                continue
            s, j = divmod(twin, 3)
            d = int(triangles[s, (j + 2) % 3])
            if t in busy or s in busy or d == b or mesh.half_edge_between(b, d) >= 0 or mesh.half_edge_between(d, b) >= 0:
                continue
            triangles[t], triangles[s] = (a, d, b), (d, c, b)
            busy |= {t, s} | {int(h) // 3 for v in (a, b, c, d) for h in mesh.star(v)}
            flips += 1
        if not flips:
            break
    assert triangles.max(initial=-1) < n
    return triangles


def _flat(points: Float, triangles: Int) -> Bool:
    p = points[triangles]
    side = np.linalg.norm(np.roll(p, -1, axis=1) - p, axis=2)
    a, b = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]
    gram = (a * a).sum(1) * (b * b).sum(1) - (a * b).sum(1) ** 2
    out: Bool = np.sqrt(np.maximum(gram, 0.0)) < FLAT * side.max(axis=1) ** 2
    return out
