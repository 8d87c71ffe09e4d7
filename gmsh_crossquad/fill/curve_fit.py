"""How well the edges on CAD curves are graded: a measure of long edges beside crowds of short ones.

For sample points on every curve edge the nearest edges (by their midpoints) are looked up; the distance to the nearest of
these over its length is large where a point on a long edge sees only a crowd of much shorter edges.
"""

from __future__ import annotations

import numpy as np

from ..records import Float, Int, QuadMesh
from ..spatial import cKDTree

__all__ = ["curve_fit", "misfits"]

NEIGHBOURS = 12
SAMPLES = np.array([0.02, 0.06, 0.12, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.88, 0.94, 0.98])


def curve_fit(mesh: QuadMesh) -> float:
    """Greatest distance of a point on a curve edge from its neighbouring edges, in lengths of the nearest; 0 is perfect."""
    if not mesh.curve_nodes:
        return 0.0
    edges: Int = np.concatenate([np.zeros((0, 2), np.int64), *(np.stack([c[:-1], c[1:]], axis=1) for c in mesh.curve_nodes)])
    return float(misfits(mesh.points[edges[:, 0]], mesh.points[edges[:, 1]]).max(initial=0.0))


def misfits(a: Float, b: Float) -> Float:
    """The same for every edge (e,) from `a` to `b`, both (e, 3)."""
    out = np.zeros(len(a))
    length = np.linalg.norm(b - a, axis=1)
    k = min(NEIGHBOURS, len(a))
    # only an edge much longer than its surroundings can be at fault
    tree = cKDTree(0.5 * (a + b))
    _, near = tree.query(0.5 * (a + b), k=k)
    long = np.flatnonzero(length > 2.0 * length[near.reshape(len(a), -1)].min(axis=1))
    if not len(long):
        return out
    points: Float = (a[long, None] + SAMPLES[:, None] * (b - a)[long, None]).reshape(-1, 3)
    _, near = tree.query(points, k=k)
    near = near.reshape(len(points), -1)
    start, along = a[near], (b - a)[near]
    t = ((points[:, None] - start) * along).sum(-1) / np.maximum((along**2).sum(-1), np.finfo(float).tiny)
    distance = np.linalg.norm(start + np.clip(t, 0, 1)[..., None] * along - points[:, None], axis=-1)
    best = distance.argmin(axis=1)
    rows = np.arange(len(points))
    out[long] = (distance[rows, best] / length[near[rows, best]]).reshape(len(long), -1).max(axis=1)
    return out
