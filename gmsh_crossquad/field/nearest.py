"""The nearest of many points in the plane.

Importing `scipy.spatial` for its KD-tree takes 0.08 s, more than comparing every pair where there are less than `PAIRS` of them
(1 ns each, by ``|x - p|^2 = |x|^2 - 2 x.p + |p|^2`` with the origin in the middle); only larger searches build a tree.
"""

from __future__ import annotations

import numpy as np

from ..records import Float, Int

__all__ = ["nearest"]

PAIRS = 50_000_000
CHUNK = 1 << 16  # pairs at a time, to stay in the cache


def nearest(points: Float, queries: Float) -> tuple[Float, Int]:
    """Distance and row of the nearest point of every query.

    Parameters
    ----------
    points : (n, 2) float64
        At least one.
    queries : (k, 2) float64

    Returns
    -------
    distance : (k,) float64
    row : (k,) int64
        Of points whose squared distances differ by less than 1e-15 of the squared extent, any.
    """
    if len(points) * len(queries) > PAIRS:
        from scipy.spatial import cKDTree

        distance, row = cKDTree(points).query(queries)
        return np.asarray(distance), np.asarray(row, np.int64)
    middle = points.mean(axis=0)
    p = points - middle
    terms = np.concatenate([-2.0 * p, (p * p).sum(axis=1)[:, None]], axis=1).T
    x = np.concatenate([queries - middle, np.ones((len(queries), 1))], axis=1)
    row = np.empty(len(queries), np.int64)
    step = max(1, CHUNK // len(points))
    for i in range(0, len(queries), step):
        row[i : i + step] = (x[i : i + step] @ terms).argmin(axis=1)
    away = queries - points[row]
    return np.hypot(away[:, 0], away[:, 1]), row
