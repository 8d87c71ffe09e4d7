"""Nearest points on triangles: the geometry of faces that have no other."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ..records import Float, Int

__all__ = ["Facets", "closest", "vertex_normals"]

NEAR = 8
MOST = 64


def vertex_normals(points: Float, triangles: Int) -> Float:
    """Unit normals (n, 3) of triangles around points, 0 where they cancel.

    Every corner between edges e and f counts with (e x f) / (|e|^2 |f|^2), which is exact on a sphere [1]_.

    References
    ----------
    .. [1] N. Max, "Weights for computing vertex normals from facet normals", Journal of Graphics Tools 4(2), 1999.
    """
    corner = points[triangles]
    edge = np.roll(corner, -1, axis=1) - corner
    square = np.maximum(np.einsum("nkc,nkc->nk", edge, edge), 1e-300)
    normal = np.cross(edge, -np.roll(edge, 1, axis=1)) / (square * np.roll(square, 1, axis=1))[..., None]
    out = np.stack([np.bincount(triangles.ravel(), normal[..., c].ravel(), len(points)) for c in range(3)], axis=1)
    length = np.linalg.norm(out, axis=1)
    return out / np.where(length > 0, length, 1.0)[:, None]


@dataclass(frozen=True)
class Facets:
    """A surface made of triangles.

    Parameters
    ----------
    points : (n, 3) float64
    triangles : (m, 3) int64
    """

    points: Float
    triangles: Int

    @cached_property
    def _search(self) -> tuple[Any, float]:
        """Tree of the middles, and the greatest distance of a corner from one."""
        from ..spatial import cKDTree

        corner = self.points[self.triangles]
        middle = corner.mean(axis=1)
        return cKDTree(middle), float(np.linalg.norm(corner - middle[:, None], axis=2).max())

    @cached_property
    def point_normals(self) -> Float:
        """Unit normals (n, 3) at the points."""
        return vertex_normals(self.points, self.triangles)

    def nearest(self, x: Float) -> tuple[Float, Int, Float]:
        """Nearest points of the surface.

        The triangles whose middles are nearest are tried, 8 to 64 of them: as many as are needed to be sure that no other is
        nearer.

        Parameters
        ----------
        x : (n, 3) float64

        Returns
        -------
        points : (n, 3) float64
        triangle : (n,) int64
        weights : (n, 3) float64
            Barycentric coordinates.
        """
        tree, reach = self._search
        point, triangle, weight = np.empty((len(x), 3)), np.zeros(len(x), np.int64), np.zeros((len(x), 3))
        todo, k = np.arange(len(x)), min(NEAR, len(self.triangles))
        while len(todo):
            distance, near = tree.query(x[todo], k=k)
            distance, near = distance.reshape(len(todo), k), near.reshape(len(todo), k)
            bary = closest(np.repeat(x[todo], k, axis=0), self.points[self.triangles[near.ravel()]])
            feet = np.einsum("nk,nkc->nc", bary, self.points[self.triangles[near.ravel()]]).reshape(len(todo), k, 3)
            away = np.linalg.norm(feet - x[todo][:, None], axis=2)
            best, row = away.argmin(axis=1), np.arange(len(todo))
            point[todo], triangle[todo] = feet[row, best], near[row, best]
            weight[todo] = bary.reshape(len(todo), k, 3)[row, best]
            if k >= min(MOST, len(self.triangles)):
                break
            todo = todo[distance[:, -1] < away[row, best] + reach]
            k = min(2 * k, len(self.triangles))
        return point, triangle, weight

    def normals(self, x: Float) -> Float:
        """Unit normals (n, 3) near points: those of the corners, interpolated."""
        _, triangle, weight = self.nearest(x)
        out = np.einsum("nk,nkc->nc", weight, self.point_normals[self.triangles[triangle]])
        length = np.linalg.norm(out, axis=1)
        return out / np.where(length > 0, length, 1.0)[:, None]


def closest(x: Float, corner: Float) -> Float:
    """Barycentric coordinates (n, 3) of the nearest point of each triangle (n, 3, 3): inside, else on the nearest edge."""
    edge = np.roll(corner, -1, axis=1) - corner
    along = np.einsum("nkc,nkc->nk", x[:, None] - corner, edge)
    t = np.clip(along / np.maximum(np.einsum("nkc,nkc->nk", edge, edge), 1e-300), 0.0, 1.0)
    away = np.linalg.norm(corner + t[..., None] * edge - x[:, None], axis=2)
    k, row = away.argmin(axis=1), np.arange(len(x))
    out = np.zeros((len(x), 3))
    out[row, k], out[row, (k + 1) % 3] = 1.0 - t[row, k], t[row, k]
    normal = np.cross(edge[:, 0], edge[:, 1])
    twice = np.einsum("nc,nc->n", normal, normal)
    # weight of corner k: the part of the area that is across it
    part = np.stack(
        [np.einsum("nc,nc->n", np.cross(edge[:, (i + 1) % 3], x - corner[:, (i + 1) % 3]), normal) for i in range(3)], axis=1
    )
    inside = (part >= 0).all(axis=1) & (twice > 0)
    out[inside] = part[inside] / twice[inside, None]
    return out
