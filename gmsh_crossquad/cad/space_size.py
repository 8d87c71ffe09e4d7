"""The size of background triangles on curved faces, from the sizes on their curves.

The size at x is ``min(limit, min_i h_i + g |x - x_i|)`` over the given nodes i on the curves, as in the plane (`size_field`).
Gmsh asks for it once per triangle that it makes, from C; values are kept per cube of about their own size, so that the nearest
nodes are looked up once per cube.
"""

from __future__ import annotations

from math import floor, log2
from typing import Any

import numpy as np

from ..records import Float

__all__ = ["SpaceSize"]

GROWTH = 0.4
NEIGHBOURS = 6
FEW = 1_000  # nodes among which looking at all of them is faster than a tree


class SpaceSize:
    """Size as a function of place in space.

    Parameters
    ----------
    points : (n, 3) float64
        Nodes with a known size; may be none.
    sizes : (n,) float64
    """

    def __init__(self, points: Float, sizes: Float) -> None:
        self._points, self._sizes = points, sizes
        self._tree: Any = None
        if len(points) > FEW:
            from ..spatial import cKDTree

            self._tree = cKDTree(points)
        self._known: dict[tuple[int, int, int, int], float] = {}
        self._levels: list[int] = []
        self._order: list[int] = []  # the same, those near the last one first
        self._last = 0

    def __call__(self, x: float, y: float, z: float, limit: float) -> float:
        """Size at a point, at most `limit`."""
        if not len(self._sizes):
            return limit
        for level in self._order:
            w = 2.0**level
            h = self._known.get((level, floor(x / w), floor(y / w), floor(z / w)))
            if h is not None:
                if level != self._last:
                    self._near(level)
                return min(h, limit)
        h = self._nearest(x, y, z)
        level = floor(log2(h))
        w = 2.0**level
        self._known[level, floor(x / w), floor(y / w), floor(z / w)] = h
        if level not in self._levels:
            self._levels.append(level)
        self._near(level)
        return min(h, limit)

    def _near(self, level: int) -> None:
        """Look at levels near this one first."""
        self._last = level
        self._order = sorted(self._levels, key=lambda k: abs(k - level))

    def _nearest(self, x: float, y: float, z: float) -> float:
        """Least size that the nearest nodes ask for."""
        count = min(NEIGHBOURS, len(self._sizes))
        if self._tree is not None:
            distance, near = self._tree.query((x, y, z), k=count)
        else:
            d = self._points - (x, y, z)
            square = np.einsum("ij,ij->i", d, d)
            near = square.argpartition(count - 1)[:count]
            distance = np.sqrt(square[near])
        return float((self._sizes[near] + GROWTH * distance).min())
