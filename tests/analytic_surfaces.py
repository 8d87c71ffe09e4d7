"""Surfaces with known nearest points and normals, and guide grids on them, for tests without a CAD kernel."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from gmsh_crossquad.records import Bool, Face, Float, Guide, Int, Model
from tests.smoothing_grids import Mapping, build, grid_quads, mapped_grid

CURVED = (np.zeros(3), np.eye(3))
"""Frame of a curved face for `smoothing_grids.build`."""
Grid = tuple[Guide, Model, "Analytic"]


class Shape(Protocol):
    """One surface."""

    def foot(self, x: Float) -> Float:
        """Nearest points (n, 3)."""

    def normal(self, x: Float) -> Float:
        """Unit normals (n, 3) at points near the surface."""


def unit(x: Float) -> Float:
    """Rows over their lengths."""
    return x / np.linalg.norm(x, axis=1)[:, None]


@dataclass(frozen=True)
class Plane:
    """z = 0."""

    def foot(self, x: Float) -> Float:
        return x * [1.0, 1.0, 0.0]

    def normal(self, x: Float) -> Float:
        return np.tile([0.0, 0.0, 1.0], (len(x), 1))


@dataclass(frozen=True)
class Sphere:
    """About the origin, normal outwards."""

    radius: float = 1.0

    def foot(self, x: Float) -> Float:
        return self.radius * unit(x)

    def normal(self, x: Float) -> Float:
        return unit(x)


@dataclass(frozen=True)
class Cylinder:
    """About the z axis, normal outwards, or with `side` -1 inwards."""

    radius: float = 1.0
    side: float = 1.0

    def normal(self, x: Float) -> Float:
        return self.side * unit(x * [1.0, 1.0, 0.0])

    def foot(self, x: Float) -> Float:
        return self.side * self.radius * self.normal(x) + x * [0.0, 0.0, 1.0]


@dataclass(frozen=True)
class Torus:
    """About the z axis, normal outwards."""

    ring: float
    tube: float

    def _centre(self, x: Float) -> Float:
        return self.ring * unit(x * [1.0, 1.0, 0.0])

    def normal(self, x: Float) -> Float:
        return unit(x - self._centre(x))

    def foot(self, x: Float) -> Float:
        return self._centre(x) + self.tube * self.normal(x)


@dataclass(frozen=True)
class Graph:
    """z = height (x^2 - y^2) / 2 (a saddle) or, with `sign` +1, a paraboloid; normal upwards."""

    height: float
    sign: float = -1.0

    def _slope(self, p: Float) -> Float:
        return self.height * p * [1.0, self.sign]

    def normal(self, x: Float) -> Float:
        return unit(np.column_stack([-self._slope(x[:, :2]), np.ones(len(x))]))

    def foot(self, x: Float) -> Float:
        """Newton's method for the nearest point in the two coordinates."""
        p = x[:, :2].copy()
        curvature = self.height * np.array([1.0, self.sign])
        for _ in range(30):
            slope, off = self._slope(p), 0.5 * (p * self._slope(p)).sum(axis=1) - x[:, 2]
            gradient = p - x[:, :2] + off[:, None] * slope
            matrix = slope[:, :, None] * slope[:, None] + (np.ones(2) + off[:, None] * curvature)[:, :, None] * np.eye(2)
            p -= np.linalg.solve(matrix, gradient[:, :, None])[:, :, 0]
        return np.column_stack([p, 0.5 * (p * self._slope(p)).sum(axis=1)])


@dataclass(frozen=True)
class Analytic:
    """Surfaces of a model; the plane one is the only one that is not curved."""

    shapes: tuple[Shape, ...]

    @property
    def curved(self) -> Bool:
        return np.array([not isinstance(shape, Plane) for shape in self.shapes])

    def feet(self, face: Int, points: Float) -> Float:
        out = np.full_like(points, np.nan)
        for row, shape in enumerate(self.shapes):
            out[face == row] = shape.foot(points[face == row])
        return out

    def normals(self, face: Int, points: Float) -> Float:
        out = np.full_like(points, np.nan)
        for row, shape in enumerate(self.shapes):
            out[face == row] = shape.normal(points[face == row])
        return out


def on(guide: Guide, model: Model, shape: Shape) -> Grid:
    """The grid of one plane face as that of one curved face."""
    return guide, replace(model, faces=(Face(1, *CURVED, ()),)), Analytic((shape,))


def mapped(mapping: Mapping, nu: int, nv: int, shape: Shape) -> Grid:
    """One block: the image of the unit square, on the surface."""
    return on(*mapped_grid(mapping, nu, nv), shape)


def tube(mapping: Mapping, nu: int, nv: int, shape: Shape) -> Grid:
    """The image of the unit square, closed in v, between two closed curves u = 0 and u = 1."""
    index = np.arange((nu + 1) * nv).reshape(nu + 1, nv)
    u, v = np.meshgrid(np.arange(nu + 1) / nu, np.arange(nv) / nv, indexing="ij")
    chains = [
        ([*index[row].tolist(), int(index[row, 0])], lambda t, at=at: mapping(at + 0.0 * t, t))
        for row, at in ((0, 0.0), (nu, 1.0))
    ]
    return on(*build(mapping(u.ravel(), v.ravel()), _wrapped(index, nu, nv), chains), shape)


def bowl(n: int) -> Grid:
    """A quarter of a plane annulus z = 0, .4 < r < 1, and of the cylinder r = 1, 0 < z < .6 on its outer side."""
    index = np.arange((2 * n + 1) * (n + 1)).reshape(2 * n + 1, n + 1)
    u, v = np.meshgrid(np.linspace(-1, 1, 2 * n + 1), np.linspace(0, 1, n + 1), indexing="ij")

    def at(u: Float, v: Float) -> Float:
        r, angle = 1 + 0.6 * np.minimum(u, 0.0), 0.5 * np.pi * v
        return np.column_stack([r * np.cos(angle), r * np.sin(angle), 0.6 * np.maximum(u, 0.0)])

    one = np.ones_like
    chains = [
        (index[: n + 1, 0].tolist(), lambda t: at(t - 1, 0 * t)),
        (index[n:, 0].tolist(), lambda t: at(t, 0 * t)),
        (index[: n + 1, -1].tolist(), lambda t: at(t - 1, one(t))),
        (index[n:, -1].tolist(), lambda t: at(t, one(t))),
        *((index[row].tolist(), lambda t, u=u: at(u * one(t), t)) for row, u in ((0, -1.0), (n, 0.0), (2 * n, 1.0))),
    ]
    frames = ((np.zeros(3), np.eye(3)[:2]), CURVED)
    guide, model = build(at(u.ravel(), v.ravel()), grid_quads(2 * n, n), chains, np.repeat([0, 1], n * n), frames)
    return guide, model, Analytic((Plane(), Cylinder(side=-1.0)))


def _wrapped(index: Int, nu: int, nv: int) -> Int:
    i, j = (a.ravel() for a in np.meshgrid(np.arange(nu), np.arange(nv), indexing="ij"))
    n = len(index)
    return np.column_stack([index[i, j], index[(i + 1) % n, j], index[(i + 1) % n, (j + 1) % nv], index[i, (j + 1) % nv]])


def closed_torus(nu: int, nv: int, shape: Torus) -> Grid:
    """A whole torus: one block, no boundary."""
    u, v = (2 * np.pi * a.ravel() for a in np.meshgrid(np.arange(nu) / nu, np.arange(nv) / nv, indexing="ij"))
    points = torus_points(shape, u, v)
    quads = _wrapped(np.arange(nu * nv).reshape(nu, nv), nu, nv)
    return on(*build(points, quads, []), shape)


def torus_points(shape: Torus, u: Float, v: Float) -> Float:
    """Angles u around the axis, v around the tube."""
    r = shape.ring + shape.tube * np.cos(v)
    return np.column_stack([r * np.cos(u), r * np.sin(u), shape.tube * np.sin(v)])


def _welded(blocks: Sequence[Float], n: int) -> tuple[Float, Int]:
    """Points and quads of grids ((n + 1)^2, 3) that are joined where points coincide."""
    every = np.concatenate(blocks)
    _, first, number = np.unique(np.round(every, 9) + 0.0, axis=0, return_index=True, return_inverse=True)
    quads = np.concatenate([grid_quads(n, n) + k * (n + 1) ** 2 for k in range(len(blocks))])
    return every[first], number.ravel()[quads]


def cube_sphere(n: int) -> Grid:
    """A whole sphere: six blocks, no boundary."""
    a, b = (x.ravel() for x in np.meshgrid(np.linspace(-1, 1, n + 1), np.linspace(-1, 1, n + 1), indexing="ij"))
    sides = []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            side = np.empty((len(a), 3))
            side[:, axis], side[:, (axis + 1) % 3], side[:, (axis + 2) % 3] = sign, sign * a, b
            sides.append(side)
    points, quads = _welded(sides, n)
    return on(*build(unit(points), quads, []), Sphere())


def octant(n: int) -> Grid:
    """An octant of the unit sphere: three blocks of n x n quads around an irregular vertex of valence 3."""
    s, t = (x.ravel()[:, None] for x in np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, n + 1), indexing="ij"))
    x, y, z = np.eye(3)
    centre = unit(np.ones((1, 3)))[0]
    blocks = []
    for a, b, c in ((x, y, z), (y, z, x), (z, x, y)):
        after, before = unit((a + b)[None])[0], unit((a + c)[None])[0]
        blocks.append(unit((1 - s) * (1 - t) * a + s * (1 - t) * after + s * t * centre + (1 - s) * t * before))
    points, quads = _welded(blocks, n)
    key = {tuple(p): row for row, p in enumerate(np.round(points, 9) + 0.0)}
    chains = []
    for a, b in ((x, y), (y, z), (z, x)):

        def arc(u: Float, a: Float = a, b: Float = b) -> Float:
            angle = 0.5 * np.pi * u[:, None]
            return np.cos(angle) * a + np.sin(angle) * b

        w = np.linspace(0, 1, n + 1)[:, None]
        middle = unit((a + b)[None])[0]
        line = np.concatenate([unit((1 - w) * a + w * middle), unit((1 - w) * middle + w * b)[1:]])
        chains.append(([key[tuple(p)] for p in np.round(line, 9) + 0.0], arc))
    return on(*build(points, quads, chains), Sphere())


def shaken(grid: Grid, amplitude: float, seed: int) -> Guide:
    """Random displacements of the free interior vertices, which stay on their surface."""
    guide, _, surfaces = grid
    random = np.random.default_rng(seed)
    points = guide.points.copy()
    face = np.zeros(len(points), np.int64)
    face[guide.quads] = guide.quad_face[:, None]
    free = np.flatnonzero((guide.curve < 0) & ~guide.fixed)
    points[free] = surfaces.feet(face[free], points[free] + random.normal(scale=amplitude, size=(len(free), 3)))
    return replace(guide, points=points)
