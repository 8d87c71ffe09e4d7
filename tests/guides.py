"""Hand-made guide grids for tests."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from gmsh_crossquad.records import Curve, Float, Guide, Int, Model

from . import models


def make_guide(
    model: Model,
    xy: Sequence[Sequence[float]] | Float,
    quads: Sequence[Sequence[int]] | Int,
    chains: Sequence[Sequence[int]],
    face: Sequence[int] | Int = 0,
) -> Guide:
    """A guide from points in the model's plane z = 0 (user's units), quads and the vertices of every curve in order."""
    xyz = np.zeros((len(xy), 3))
    xyz[:, : np.shape(xy)[1]] = xy
    points = (xyz - model.origin) / model.scale
    q = np.asarray(quads, np.int64)
    curve, arclength = np.full(len(points), -1), np.zeros(len(points))
    cad = np.full(len(points), -1)
    for row, chain in enumerate(chains):
        c = model.curves[row]
        cad[chain[0]], cad[chain[-1]] = c.start, c.end
        for v in chain[1:-1]:
            curve[v], arclength[v] = row, project(c, points[v])
    return Guide(
        points=points,
        curve=curve,
        arclength=arclength,
        fixed=cad >= 0,
        cad_vertex=cad,
        quads=q,
        quad_face=np.broadcast_to(np.asarray(face), len(q)).astype(np.int64),
        quad_block=np.arange(len(q)),
        quad_size=np.ones((len(q), 2)),
        chains=tuple(np.asarray(c, np.int64) for c in chains),
    )


def project(curve: Curve, point: Float) -> float:
    """Arc length of the place on the curve's polyline that is closest to `point`."""
    a, d = curve.points[:-1], np.diff(curve.points, axis=0)
    t = np.clip(((point - a) * d).sum(1) / (d * d).sum(1), 0, 1)
    k = int(np.argmin(((a + t[:, None] * d - point) ** 2).sum(1)))
    return float(curve.arclength[k] + t[k] * (curve.arclength[k + 1] - curve.arclength[k]))


def straight(model: Model) -> Callable[[int, Float], Float]:
    """Evaluator of models of which all curves are polylines over their parameters."""

    def evaluate(row: int, t: Float) -> Float:
        c = model.curves[row]
        return np.stack([np.interp(t, c.parameters, c.points[:, k]) for k in range(3)], 1) * model.scale + model.origin

    return evaluate


def grid(nx: int, ny: int, width: float = 1.0, height: float = 1.0) -> tuple[Model, Guide]:
    """A rectangle with nx x ny guide quads."""
    model = models.polygon([(0, 0), (width, 0), (width, height), (0, height)])
    g = np.arange((nx + 1) * (ny + 1)).reshape(nx + 1, ny + 1)
    x, y = np.meshgrid(np.linspace(0, width, nx + 1), np.linspace(0, height, ny + 1), indexing="ij")
    quads = np.stack([g[:-1, :-1], g[1:, :-1], g[1:, 1:], g[:-1, 1:]], axis=2).reshape(-1, 4)
    chains = [g[:, 0], g[-1], g[::-1, -1], g[0, ::-1]]
    return model, make_guide(model, np.stack([x.ravel(), y.ravel()], 1), quads, chains)


def ring(
    n: int = 8, layers: int = 1, inner: float = 0.5, outer: float = 1.0
) -> tuple[Model, Guide, Callable[[int, Float], Float]]:
    """An annulus with n x layers guide quads and its exact evaluator; curve 0 is the outer circle."""
    model = models.annulus(inner, outer)
    a = 2 * np.pi * np.arange(n) / n
    r = np.linspace(inner, outer, layers + 1)
    xy = (r[:, None, None] * np.stack([np.cos(a), np.sin(a)], 1)[None]).reshape(-1, 2)
    g = np.arange(n * (layers + 1)).reshape(layers + 1, n)
    g = np.concatenate([g, g[:, :1]], axis=1)
    quads = np.stack([g[:-1, :-1], g[1:, :-1], g[1:, 1:], g[:-1, 1:]], axis=2).reshape(-1, 4)

    def evaluate(row: int, t: Float) -> Float:
        radius = (outer, inner)[row]
        return radius * np.stack([np.cos(2 * np.pi * t), np.sin(2 * np.pi * t), 0 * t], axis=1)

    return model, make_guide(model, xy, quads, [g[-1], g[0]]), evaluate


def hole_in_plate(n: int = 1) -> tuple[Model, Guide, Callable[[int, Float], Float]]:
    """The unit square with a hole of radius .2: 8 n x n guide quads between the square and the circle."""
    model = models.plate_with_holes([(0.5, 0.5, 0.2)])
    corner = np.array([(1, 0.5), (1, 1), (0.5, 1), (0, 1), (0, 0.5), (0, 0), (0.5, 0), (1, 0), (1, 0.5)], float)
    t = np.arange(8 * n) / n
    outer = np.stack([np.interp(t, np.arange(9), corner[:, c]) for c in (0, 1)], 1)
    a = 2 * np.pi * np.arange(8 * n) / (8 * n)
    hole = 0.5 + 0.2 * np.stack([np.cos(a), np.sin(a)], 1)
    w = (np.arange(n + 1) / n)[:, None, None]
    xy = ((1 - w) * hole + w * outer).reshape(-1, 2)
    g = np.arange(8 * n * (n + 1)).reshape(n + 1, 8 * n)
    g = np.concatenate([g, g[:, :1]], axis=1)
    quads = np.stack([g[:-1, :-1], g[1:, :-1], g[1:, 1:], g[:-1, 1:]], axis=2).reshape(-1, 4)
    o, m = g[-1], 8 * n

    def side(first: int, last: int) -> list[int]:
        return [int(o[i % m]) for i in range(first, last + 1)]

    chains = [side(5 * n, 7 * n), side(7 * n, 9 * n), side(n, 3 * n), side(3 * n, 5 * n), g[0].tolist()]
    flat = straight(model)

    def evaluate(row: int, t: Float) -> Float:
        if row < 4:
            return flat(row, t)
        return np.stack([0.5 + 0.2 * np.cos(2 * np.pi * t), 0.5 + 0.2 * np.sin(2 * np.pi * t), 0 * t], axis=1)

    return model, make_guide(model, xy, quads, chains), evaluate
