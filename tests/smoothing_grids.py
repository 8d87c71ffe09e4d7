"""Guide grids with the topology of a few simple blocks, and the models that they belong to, for the smoother's tests."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from gmsh_crossquad.records import Curve, Face, Float, Guide, Int, Model

PLANE = (np.zeros(3), np.eye(3)[:2])
Place = Callable[[Float], Float]
Mapping = Callable[[Float, Float], Float]


def curve_of(function: Place, start: int, end: int, tag: int, samples: int = 65) -> Curve:
    """A curve from a function [0, 1] -> (k, 3)."""
    t = np.linspace(0.0, 1.0, samples)
    points = function(t)
    arclength = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    return Curve(tag, start, end, points, t, arclength)


def build(
    points: Float,
    quads: Int,
    chains: Sequence[tuple[Sequence[int], Place]],
    quad_face: Int | None = None,
    frames: Sequence[tuple[Float, Float]] = (PLANE,),
) -> tuple[Guide, Model]:
    """Guide and model from vertices (n, 3), quads and the curves: vertices in order, and a function [0, 1] -> (k, 3).

    The vertices of a chain lie evenly in the parameter of its function; the ends of chains are CAD vertices.  The rest
    lengths are those of the given positions.
    """
    points = np.array(points, dtype=float)
    n = len(points)
    ends = sorted({v for chain, _ in chains for v in (chain[0], chain[-1])})
    curve, arclength = np.full(n, -1), np.zeros(n)
    fixed, cad_vertex = np.zeros(n, dtype=bool), np.full(n, -1)
    fixed[ends] = True
    cad_vertex[ends] = np.arange(len(ends))
    curves = []
    for row, (chain, function) in enumerate(chains):
        record = curve_of(function, ends.index(chain[0]), ends.index(chain[-1]), row + 1)
        t = np.linspace(0.0, 1.0, len(chain))
        points[list(chain)] = function(t)
        inner = list(chain[1:-1])
        curve[inner], arclength[inner] = row, np.interp(t, record.parameters, record.arclength)[1:-1]
        curves.append(record)
    faces = tuple(Face(k + 1, origin, axes, ()) for k, (origin, axes) in enumerate(frames))
    ports = np.zeros(len(ends), dtype=bool)
    model = Model("test", np.zeros(3), 1.0, np.arange(1, len(ends) + 1), points[ends], ports, tuple(curves), faces)
    edge = np.linalg.norm(points[quads] - np.roll(points[quads], -1, axis=1), axis=2)
    guide = Guide(
        points=points,
        curve=curve,
        arclength=arclength,
        fixed=fixed,
        cad_vertex=cad_vertex,
        quads=np.asarray(quads, dtype=np.int64),
        quad_face=np.zeros(len(quads), dtype=np.int64) if quad_face is None else quad_face,
        quad_block=np.zeros(len(quads), dtype=np.int64),
        quad_size=0.5 * (edge[:, :2] + edge[:, 2:]),
        chains=tuple(np.array(chain, dtype=np.int64) for chain, _ in chains),
    )
    return guide, model


def grid_quads(nu: int, nv: int) -> Int:
    """Quads of a grid of (nu + 1) x (nv + 1) vertices, vertex (i, j) being i * (nv + 1) + j."""
    i, j = np.meshgrid(np.arange(nu), np.arange(nv), indexing="ij")
    a = (i * (nv + 1) + j).ravel()
    return np.column_stack([a, a + nv + 1, a + nv + 2, a + 1])


def mapped_grid(mapping: Mapping, nu: int, nv: int) -> tuple[Guide, Model]:
    """One face, the image of the unit square; four curves; the side 0/2 of a quad runs along u."""
    u, v = np.meshgrid(np.linspace(0, 1, nu + 1), np.linspace(0, 1, nv + 1), indexing="ij")
    points = mapping(u.ravel(), v.ravel())
    index = np.arange((nu + 1) * (nv + 1)).reshape(nu + 1, nv + 1)
    zero, one = np.zeros_like, np.ones_like
    chains = [
        (index[:, 0].tolist(), lambda t: mapping(t, zero(t))),
        (index[-1].tolist(), lambda t: mapping(one(t), t)),
        (index[:, -1].tolist(), lambda t: mapping(t, one(t))),
        (index[0].tolist(), lambda t: mapping(zero(t), t)),
    ]
    return build(points, grid_quads(nu, nv), chains)


def rectangle(width: float = 1.0, height: float = 1.0) -> Mapping:
    """Mapping of the unit square onto a rectangle."""
    return lambda u, v: np.column_stack([width * u, height * v, 0.0 * u])


def sector(inner: float, outer: float, angle: float) -> Mapping:
    """Mapping of the unit square onto an annulus sector; u runs outwards."""

    def mapping(u: Float, v: Float) -> Float:
        r = inner + (outer - inner) * u
        return np.column_stack([r * np.cos(angle * v), r * np.sin(angle * v), 0.0 * u])

    return mapping


def segment(a: Sequence[float], b: Sequence[float]) -> Place:
    """Straight curve from a to b."""
    return lambda t: np.outer(1.0 - t, a) + np.outer(t, b)


def ring(nr: int, na: int, inner: float, outer: float) -> tuple[Guide, Model]:
    """An annulus: two closed curves."""
    index = np.arange((nr + 1) * na).reshape(nr + 1, na)
    r, a = np.meshgrid(np.linspace(inner, outer, nr + 1), 2 * np.pi * np.arange(na) / na, indexing="ij")
    points = np.column_stack([(r * np.cos(a)).ravel(), (r * np.sin(a)).ravel(), np.zeros(r.size)])
    i, j = np.meshgrid(np.arange(nr), np.arange(na), indexing="ij")
    k = (j + 1) % na
    quads = np.column_stack([index[i, j].ravel(), index[i + 1, j].ravel(), index[i + 1, k].ravel(), index[i, k].ravel()])

    def circle(radius: float) -> Place:
        return lambda t: radius * np.column_stack([np.cos(2 * np.pi * t), np.sin(2 * np.pi * t), 0.0 * t])

    chains = [([*index[row].tolist(), int(index[row, 0])], circle(radius)) for row, radius in ((0, inner), (nr, outer))]
    return build(points, quads, chains)


def ell(n: int) -> tuple[Guide, Model]:
    """An L of three squares of n x n quads with side 1."""
    index: dict[tuple[int, int], int] = {}
    points, quads = [], []
    for i in range(2 * n):
        for j in range(2 * n):
            if i >= n and j >= n:
                continue
            quad = []
            for at in ((i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)):
                if at not in index:
                    index[at] = len(points)
                    points.append((at[0] / n, at[1] / n, 0.0))
                quad.append(index[at])
            quads.append(quad)
    corners = [(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)]
    chains = []
    for (ax, ay), (bx, by) in zip(corners, corners[1:] + corners[:1]):
        steps = n * max(abs(bx - ax), abs(by - ay))
        chain = [index[(ax * n + (bx - ax) * n * k // steps, ay * n + (by - ay) * n * k // steps)] for k in range(steps + 1)]
        chains.append((chain, segment((ax, ay, 0.0), (bx, by, 0.0))))
    return build(np.array(points), np.array(quads), chains)


def fold(n: int, angle: float) -> tuple[Guide, Model]:
    """Two unit squares of n x n quads in different planes, sharing the curve x = 0; the second is turned about it."""
    index = np.arange((2 * n + 1) * (n + 1)).reshape(2 * n + 1, n + 1)
    u, v = np.meshgrid(np.linspace(-1, 1, 2 * n + 1), np.linspace(0, 1, n + 1), indexing="ij")
    direction = np.array([np.cos(angle), 0.0, np.sin(angle)])

    def place(x: Float, y: Float) -> Float:
        left = np.column_stack([np.minimum(x, 0.0), y, 0.0 * x])
        return left + np.outer(np.maximum(x, 0.0), direction)

    zero, one = np.zeros_like, np.ones_like
    chains = [
        (index[: n + 1, 0].tolist(), lambda t: place(t - 1.0, zero(t))),
        (index[n:, 0].tolist(), lambda t: place(t, zero(t))),
        (index[: n + 1, -1].tolist(), lambda t: place(t - 1.0, one(t))),
        (index[n:, -1].tolist(), lambda t: place(t, one(t))),
        (index[0].tolist(), lambda t: place(-one(t), t)),
        (index[n].tolist(), lambda t: place(zero(t), t)),
        (index[-1].tolist(), lambda t: place(one(t), t)),
    ]
    frames = (PLANE, (np.zeros(3), np.array([direction, [0.0, 1.0, 0.0]])))
    return build(place(u.ravel(), v.ravel()), grid_quads(2 * n, n), chains, np.repeat([0, 1], n * n), frames)


def shaken(guide: Guide, model: Model, amplitude: float, seed: int, slide: bool = True) -> Guide:
    """Random displacements in the plane of the interior vertices and, if `slide`, random places on the curves."""
    random = np.random.default_rng(seed)
    points, arclength = guide.points.copy(), guide.arclength.copy()
    free = np.flatnonzero((guide.curve < 0) & ~guide.fixed)
    face = np.zeros(len(points), dtype=np.int64)
    face[guide.quads] = guide.quad_face[:, None]
    axes = np.array([f.axes for f in model.faces])[face[free]]
    points[free] += np.einsum("na,nac->nc", random.normal(scale=amplitude, size=(len(free), 2)), axes)
    for row, chain in enumerate(guide.chains):
        inner = chain[1:-1][~guide.fixed[chain[1:-1]]]
        if slide:
            arclength[inner] = random.uniform(0.0, model.curves[row].length, len(inner))
    return replace(guide, points=points, arclength=arclength)


def moved(guide: Guide, model: Model, rotation: Float, shift: Float, scale: float) -> tuple[Guide, Model]:
    """Guide and model after the similarity x -> scale * rotation @ x + shift."""

    def image(points: Float) -> Float:
        return scale * points @ rotation.T + shift

    curves = tuple(replace(c, points=image(c.points), arclength=scale * c.arclength) for c in model.curves)
    faces = tuple(replace(f, origin=image(f.origin), axes=f.axes @ rotation.T) for f in model.faces)
    other = replace(model, vertices=image(model.vertices), curves=curves, faces=faces)
    size, arclength = scale * guide.quad_size, scale * guide.arclength
    return replace(guide, points=image(guide.points), arclength=arclength, quad_size=size), other
