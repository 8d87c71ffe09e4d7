"""The size of background triangles on curved faces, from the sizes on their curves.

The size at x is ``min(limit, min_i h_i + g |x - x_i|)`` over the given nodes i on the curves, as in the plane (`size_field`).
Gmsh asks for it once per triangle that it makes, from C; values are kept per cube of about their own size, so that the nearest
nodes are looked up once per cube.
"""

from __future__ import annotations

from math import floor, log2

import numpy as np

from ..records import Float

__all__ = ["SpaceSize"]

GROWTH = 0.4
NEIGHBOURS = 6


class SpaceSize:
    """Size as a function of place in space.

    Parameters
    ----------
    points : (n, 3) float64
        Nodes with a known size; may be none.
    sizes : (n,) float64
    """

    def __init__(self, points: Float, sizes: Float) -> None:
        from ..spatial import cKDTree

        self._tree = cKDTree(points) if len(points) else None
        self._sizes = sizes
        self._known: dict[tuple[int, int, int, int], float] = {}
        self._levels: list[int] = []
        self._last = 0

    def __call__(self, x: float, y: float, z: float, limit: float) -> float:
        """Size at a point, at most `limit`."""
        if self._tree is None:
            return limit
        for level in sorted(self._levels, key=lambda k: abs(k - self._last)):
            w = 2.0**level
            h = self._known.get((level, floor(x / w), floor(y / w), floor(z / w)))
            if h is not None:
                self._last = level
                return min(h, limit)
        distance, near = self._tree.query((x, y, z), k=min(NEIGHBOURS, len(self._sizes)))
        h = float(np.min(self._sizes[near] + GROWTH * np.asarray(distance)))
        level = floor(log2(h))
        w = 2.0**level
        self._known[level, floor(x / w), floor(y / w), floor(z / w)] = h
        if level not in self._levels:
            self._levels.append(level)
        self._last = level
        return min(h, limit)
