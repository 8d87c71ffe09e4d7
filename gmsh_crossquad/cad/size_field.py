"""The size of background triangles inside a face, from the sizes on its boundary.

The size at x is ``min(h_max, min_i h_i + g |x - x_i|)`` over boundary nodes i: it grows with the distance, so a finely divided
boundary does not fill the whole face.  Gmsh asks for it once per triangle that it makes, from C; so the formula is tabulated in a
quadtree whose cells are about as large as the size in them (a look-up is about two dictionary accesses).
"""

from __future__ import annotations

import numpy as np

from ..records import Float

__all__ = ["SizeField"]

GROWTH = 0.4
MAX_LEVEL = 24
NEIGHBOURS = 6


class SizeField:
    """Tabulated size function on the square [-1, 1] x [-1, 1].

    Parameters
    ----------
    points : (n, 2) float64
        Nodes with a known size, inside the square.
    sizes : (n,) float64
    h_max : float
        Greatest size.
    """

    def __init__(self, points: Float, sizes: Float, h_max: float) -> None:
        from ..spatial import cKDTree

        tree = cKDTree(points)
        k = min(NEIGHBOURS, len(points))
        self._leaves: dict[int, float] = {}
        cells = np.zeros((1, 2), np.int64)
        for level in range(MAX_LEVEL + 1):
            width = 2.0 / (1 << level)
            distance, near = tree.query(-1.0 + (cells + 0.5) * width, k=k)
            distance, near = np.reshape(distance, (len(cells), -1)), np.reshape(near, (len(cells), -1))
            h = np.minimum((sizes[near] + GROWTH * distance).min(axis=1), h_max)
            # no boundary node near: the cell is not finer than the least size in it
            leaf = (width <= 1.5 * h) | (level == MAX_LEVEL)
            keys = (level << 50) + (cells[:, 0] << 25) + cells[:, 1]
            self._leaves.update(zip(keys[leaf].tolist(), h[leaf].tolist(), strict=True))
            cells = (2 * cells[~leaf, None, :] + np.array([[0, 0], [1, 0], [0, 1], [1, 1]])).reshape(-1, 2)
            if not len(cells):
                break
        depth = 1 + max(key >> 50 for key in self._leaves)
        # the next point asked for is mostly near the last one, in a cell of the same level
        self._orders = [np.argsort(np.abs(np.arange(depth) - k), kind="stable").tolist() for k in range(depth)]
        self._last = 0

    def __call__(self, x: float, y: float) -> float:
        """Size at a point (clamped to the square)."""
        u = min(max(0.5 * (x + 1.0), 0.0), 1.0 - 1e-9)
        v = min(max(0.5 * (y + 1.0), 0.0), 1.0 - 1e-9)
        for level in self._orders[self._last]:
            n = 1 << level
            h = self._leaves.get((level << 50) + (int(u * n) << 25) + int(v * n))
            if h is not None:
                self._last = level
                return h
        raise AssertionError("the quadtree has no hole")
