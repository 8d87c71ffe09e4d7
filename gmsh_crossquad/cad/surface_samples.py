"""Samples of curved CAD faces: where the search for nearest points starts, and normals near points.

They are the points of the background mesh that have CAD parameters.  Triangles over which the normal turns by more than .3 get
more samples inside, at the middles of the equal parts into which they are cut, about one for each .3 of a radian.  Each has
the CAD's normal and its derivative, so the normal near it is known to second order.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from ..records import Bool, FaceMesh, Float, Int, Model
from .charts import Charts, runs
from .facets import vertex_normals
from .feet import Start, newton

__all__ = ["SurfaceSamples", "surface_samples"]

POLE = 1e-6  # of the usual |S_u x S_v|
FINE = 0.3  # radians
MOST_PARTS = 6
ROUGH = 2  # rounds
TURN = 0.5  # radians, greatest turn of a sample's normal


@dataclass(frozen=True)
class SurfaceSamples:
    """Samples, sorted by face.

    Attributes
    ----------
    face : (k,) int64
    start : Start
        Values and derivatives in the user's coordinates.
    regular : (k,) bool
        False at poles and apexes, where |S_u x S_v| vanishes.
    usual : (f,) float64
        Median of |S_u x S_v| on every face.
    points : (k, 3) float64, scaled
    normals : (k, 3) float64
        Unit normals on the side of the background triangles.
    turning : (k, 3, 3) float64
        Derivative of the normal by the place, scaled.
    """

    face: Int
    start: Start
    regular: Bool
    usual: Float
    points: Float
    normals: Float
    turning: Float

    @cached_property
    def _trees(self) -> dict[tuple[int, bool], tuple[Any, Int]]:
        return {}

    @cached_property
    def curvature(self) -> Float:
        """(k,) greatest absolute principal curvature, scaled; 0 at poles."""
        mean = np.einsum("ncc->n", self.turning)
        squares = np.einsum("ncd,ncd->n", self.turning, self.turning)
        return 0.5 * (np.abs(mean) + np.sqrt(np.maximum(2 * squares - mean**2, 0.0)))

    def nearest(self, face: Int, points: Float, k: int, regular: bool) -> Int:
        """The k nearest samples (n, k) of scaled points on faces, sorted; the farthest is repeated where there are fewer.

        With `regular` none at a pole, unless there are no others.
        """
        from ..spatial import cKDTree

        out = np.empty((len(points), k), np.int64)
        for row, part in runs(face):
            if (row, regular) not in self._trees:
                a, b = np.searchsorted(self.face, [row, row + 1]).tolist()
                good = self.regular[a:b] if regular and self.regular[a:b].any() else np.ones(b - a, bool)
                rows = a + np.flatnonzero(good)
                self._trees[row, regular] = cKDTree(self.points[rows]), rows
            tree, rows = self._trees[row, regular]
            out[part] = rows[tree.query(points[part], k=np.minimum(np.arange(1, k + 1), len(rows)).tolist())[1]]
        return out

    def normals_near(self, face: Int, points: Float) -> Float:
        """Unit normals (n, 3) near scaled points on faces, sorted."""
        near = self.nearest(face, points, 1, False)[:, 0]
        turn = np.einsum("ncd,nd->nc", self.turning[near], points - self.points[near])
        out = self.normals[near] + turn / np.maximum(np.sqrt(np.einsum("nc,nc->n", turn, turn)) / TURN, 1.0)[:, None]
        return out / np.sqrt(np.einsum("nc,nc->n", out, out))[:, None]

    def at_pole(self, charts: Charts, face: Int, uv: Float) -> Bool:
        """(n,) True where |S_u x S_v| vanishes; only faces with such samples are looked at."""
        poles = np.zeros(len(self.usual), bool)
        poles[self.face[~self.regular]] = True
        out = poles[face]
        rows = np.flatnonzero(out)
        first = charts.derivatives(face[rows], uv[rows])
        out[rows] = np.linalg.norm(np.cross(first[:, 0], first[:, 1]), axis=1) <= POLE * self.usual[face[rows]]
        return out


def surface_samples(model: Model, meshes: tuple[FaceMesh, ...], charts: Charts) -> SurfaceSamples:
    """The samples of all faces that have a chart.

    Parameters
    ----------
    model : Model
    meshes : tuple of FaceMesh
        With parameters on these faces.
    charts : Charts
        Of all faces of the model, which is Gmsh's current one.
    """
    meshes = tuple(sorted((m for m in meshes if np.isfinite(charts.low[m.face, 0])), key=lambda m: m.face))
    keep = [np.flatnonzero(np.isfinite(m.parameters).all(axis=1)) for m in meshes]
    face = np.concatenate([np.full(len(k), m.face) for m, k in zip(meshes, keep)])
    own = np.concatenate([m.parameters[k] for m, k in zip(meshes, keep)])
    own = charts.from_user(face, own)
    uv, _ = charts.moved(face, own, np.zeros_like(own))  # some of Gmsh's are a little out of bounds
    start = _evaluated(charts, face, uv)
    normal = np.cross(start.first[:, 0], start.first[:, 1])
    length = np.linalg.norm(normal, axis=1)
    number = len(model.faces)
    begin = np.searchsorted(face, np.arange(number + 1)).tolist()
    usual = np.array([np.median(length[a:b]) if b > a else 0.0 for a, b in pairwise(begin)])
    regular = length > POLE * usual[face]
    mean = np.concatenate([vertex_normals(m.points, m.triangles)[k] for m, k in zip(meshes, keep)])
    # the side of the CAD's normal is voted for by area: that of the triangles around each point
    area = np.concatenate([_areas(m)[k] for m, k in zip(meshes, keep)])
    side = np.where(np.einsum("nc,nc->n", normal, mean) < 0, -area, area) * regular
    sign = np.where(np.bincount(face, side, number) < 0, -1.0, 1.0)
    base = _samples(model, face, start, usual, sign, mean)
    corner_row = np.concatenate([np.full(1, -1), *(_places(len(m.points), k, a) for m, k, a in zip(meshes, keep, _starts(keep)))])
    first_point = 1 + _starts([m.points for m in meshes])
    corners = np.concatenate([corner_row[m.triangles + o] for m, o in zip(meshes, first_point)])
    more_face, more_uv = _between(model, charts, base, corners[(corners >= 0).all(axis=1)])
    if not len(more_face):
        return base
    order = np.argsort(np.concatenate([face, more_face]), kind="stable")
    face, uv = np.concatenate([face, more_face])[order], np.concatenate([uv, more_uv])[order]
    mean = np.concatenate([base.normals, np.zeros((len(more_face), 3))])[order]
    return _samples(model, face, _evaluated(charts, face, uv), usual, sign, mean)


def _starts(parts: list[Any]) -> Int:
    return np.cumsum([0, *map(len, parts)])[:-1]


def _places(number: int, kept: Int, first: int) -> Int:
    """Sample of every one of `number` points, -1 where it is not kept."""
    out = np.full(number, -1)
    out[kept] = first + np.arange(len(kept))
    return out


def _areas(mesh: FaceMesh) -> Float:
    """(n,) area of the triangles around every point, up to a factor."""
    corner = mesh.points[mesh.triangles]
    area = np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1)
    return np.bincount(mesh.triangles.ravel(), np.repeat(area, 3), len(mesh.points)).astype(np.float64)


def _evaluated(charts: Charts, face: Int, uv: Float) -> Start:
    return Start(uv, charts.values(face, uv), charts.derivatives(face, uv), charts.second_derivatives(face, uv))


def _samples(model: Model, face: Int, start: Start, usual: Float, sign: Float, mean: Float) -> SurfaceSamples:
    """Samples with their normals; `mean` (k, 3) at poles."""
    first, second = start.first, start.second
    cross = np.cross(first[:, 0], first[:, 1])
    length = np.linalg.norm(cross, axis=1)
    regular = length > POLE * usual[face]
    normal = np.where(regular[:, None], cross * (sign[face] / np.where(regular, length, 1.0))[:, None], mean)
    # the Weingarten map -J' I^-1 II I^-1 J in space
    a, b, c = (np.einsum("nc,nc->n", first[:, i], first[:, j]) for i, j in ((0, 0), (0, 1), (1, 1)))
    inverse = np.stack([np.stack([c, -b], axis=1), np.stack([-b, a], axis=1)], axis=1)
    inverse /= np.where(regular, length, 1.0)[:, None, None] ** 2
    dual = np.einsum("nij,njc->nic", inverse, first)
    form = np.einsum("nkc,nc->nk", second, normal)[:, [0, 1, 1, 2]].reshape(-1, 2, 2)
    turning = -np.einsum("nic,nij,njd->ncd", dual, form, dual) * (model.scale * regular)[:, None, None]
    return SurfaceSamples(face, start, regular, usual, (start.point - model.origin) / model.scale, normal, turning)


def _between(model: Model, charts: Charts, base: SurfaceSamples, corners: Int) -> tuple[Int, Float]:
    """Faces (k,) and parameters (k, 2) of more samples in triangles (m, 3) of samples where the normal turns much."""
    normal = base.normals[corners]
    cosine = np.einsum("nkc,nkc->nk", normal, np.roll(normal, -1, axis=1)).min(axis=1)
    parts = np.clip(np.ceil(np.arccos(np.clip(cosine, -1.0, 1.0)) / FINE), 1, MOST_PARTS).astype(np.int64)
    places, begin = [np.zeros((0, 3))], [np.zeros(0, np.int64)]
    for k in range(2, MOST_PARTS + 1):
        mine = corners[parts == k]
        weight = _middles(k)
        places.append(np.einsum("wk,mkc->mwc", weight, base.points[mine]).reshape(-1, 3))
        # search from the corner that weighs most, of those at no pole
        score = weight[None] + base.regular[mine][:, None]
        begin.append(np.take_along_axis(mine[:, None].repeat(len(weight), 1), score.argmax(axis=2)[..., None], 2).ravel())
    at = np.concatenate(begin)
    order = np.argsort(base.face[at], kind="stable")
    at, x = at[order], model.origin + model.scale * np.concatenate(places)[order]
    # any place thereabouts will do
    uv, _, _ = newton(charts, base.face[at], x, base.start[at], model.scale, ROUGH)
    good = ~base.at_pole(charts, base.face[at], uv)
    return base.face[at[good]], uv[good]


def _middles(k: int) -> Float:
    """Barycentric coordinates (k^2, 3) of the middles of the k^2 equal parts of a triangle."""
    i, j = (a.ravel() for a in np.mgrid[0:k, 0:k])
    up, down = i + j < k, i + j < k - 1
    a = np.concatenate([3 * i[up] + 1, 3 * i[down] + 2])
    b = np.concatenate([3 * j[up] + 1, 3 * j[down] + 2])
    return np.stack([a, b, 3 * k - a - b], axis=1) / (3.0 * k)
