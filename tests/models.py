"""Hand-made `Model` records for tests: planar faces from points, with no CAD kernel.

All builders take coordinates in the user's units and return a model in scaled coordinates (diagonal of the bounding box 1).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gmsh_crossquad.records import Curve, Face, FaceMesh, Float, Model

Loop = Sequence[tuple[int, int]]


def line(a: Sequence[float], b: Sequence[float], n: int = 5) -> Float:
    """n points (n, 2) on a straight line."""
    t = np.linspace(0.0, 1.0, n)[:, None]
    out: Float = np.asarray(a, float) * (1 - t) + np.asarray(b, float) * t
    return out


def arc(centre: Sequence[float], radius: float, start: float, end: float, n: int = 721) -> Float:
    """n points (n, 2) on a circular arc between two angles (radians); counter-clockwise where end > start."""
    a = np.linspace(start, end, n)
    out: Float = np.asarray(centre, float) + radius * np.stack([np.cos(a), np.sin(a)], axis=1)
    if np.isclose(abs(end - start), 2 * np.pi):
        out[-1] = out[0]
    return out


def build(
    vertices: Sequence[Sequence[float]],
    curves: Sequence[tuple[int, int, Float]],
    faces: Sequence[tuple[Sequence[Loop], Sequence[int], Sequence[int]]],
    ports: Sequence[int] = (),
    axes: Float | None = None,
) -> Model:
    """A planar model.

    Parameters
    ----------
    vertices : points (v, 2)
    curves : (start vertex, end vertex, samples (n, 2)) each
    faces : (loops, embedded curves, embedded points) each; loops hold (curve row, +1 or -1), the face on the left
    ports : rows of vertices that are ports; embedded points always are
    axes : (2, 3) orthonormal, the frame of the plane in space (default x, y)
    """
    frame = np.eye(3)[:2] if axes is None else np.asarray(axes, float)
    xy = np.asarray(vertices, float).reshape(-1, 2) @ frame
    samples = [np.asarray(p, float) @ frame for _, _, p in curves]
    cloud = np.concatenate([xy, *samples])
    low, high = cloud.min(axis=0), cloud.max(axis=0)
    origin, scale = 0.5 * (low + high), float(np.linalg.norm(high - low))
    records = []
    for row, ((start, end, _), p) in enumerate(zip(curves, samples, strict=True)):
        q = (p - origin) / scale
        s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(q, axis=0), axis=1))])
        records.append(Curve(row + 1, start, end, q, np.linspace(0.0, 1.0, len(q)), s))
    is_port = np.zeros(len(xy), bool)
    is_port[list(ports)] = True
    for _, _, points in faces:
        is_port[list(points)] = True
    return Model(
        name="test",
        origin=origin,
        scale=scale,
        vertex_tags=np.arange(1, len(xy) + 1),
        vertices=(xy - origin) / scale,
        vertex_ports=is_port,
        curves=tuple(records),
        faces=tuple(
            Face(
                tag=row + 1,
                origin=np.zeros(3),
                axes=frame,
                loops=tuple(tuple((int(c), int(sign)) for c, sign in loop) for loop in loops),
                embedded_curves=tuple(inner),
                embedded_points=tuple(points),
            )
            for row, (loops, inner, points) in enumerate(faces)
        ),
    )


def polygon(
    points: Sequence[Sequence[float]],
    holes: Sequence[Sequence[Sequence[float]]] = (),
    embedded_points: Sequence[Sequence[float]] = (),
) -> Model:
    """One polygonal face; `points` counter-clockwise, every hole clockwise (the face on the left)."""
    vertices: list[Sequence[float]] = []
    curves: list[tuple[int, int, Float]] = []
    loops: list[list[tuple[int, int]]] = []
    for ring in (points, *holes):
        first, n = len(vertices), len(ring)
        vertices.extend(ring)
        loops.append([(len(curves) + i, 1) for i in range(n)])
        for i in range(n):
            curves.append((first + i, first + (i + 1) % n, line(ring[i], ring[(i + 1) % n])))
    inner = list(range(len(vertices), len(vertices) + len(embedded_points)))
    vertices.extend(embedded_points)
    return build(vertices, curves, [(loops, [], inner)])


def square(side: float = 1.0) -> Model:
    """A square."""
    return polygon([(0, 0), (side, 0), (side, side), (0, side)])


def l_shape() -> Model:
    """Three unit squares in an L."""
    return polygon([(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)])


def regular(n: int) -> Model:
    """A regular n-gon of circumradius 1."""
    a = 2 * np.pi * np.arange(n) / n
    return polygon(np.stack([np.cos(a), np.sin(a)], axis=1).tolist())


def disc(radius: float = 1.0, arcs: int = 1) -> Model:
    """A disc, its circle cut into `arcs` arcs (1: one closed curve)."""
    a = 2 * np.pi * np.arange(arcs + 1) / arcs
    vertices = [(radius * np.cos(t), radius * np.sin(t)) for t in a[:-1]]
    curves = [(i, (i + 1) % arcs, arc((0, 0), radius, a[i], a[i + 1])) for i in range(arcs)]
    return build(vertices, curves, [([[(i, 1) for i in range(arcs)]], [], [])])


def annulus(inner: float = 0.4, outer: float = 1.0, centre: Sequence[float] = (0.0, 0.0)) -> Model:
    """An annulus of two closed circles; `centre` moves the inner one.  The inner circle itself runs counter-clockwise."""
    curves = [(0, 0, arc((0, 0), outer, 0, 2 * np.pi)), (1, 1, arc(centre, inner, 0, 2 * np.pi))]
    return build([(outer, 0), (centre[0] + inner, centre[1])], curves, [([[(0, 1)], [(1, -1)]], [], [])])


def plate_with_holes(
    holes: Sequence[tuple[float, float, float]] = ((0.5, 0.5, 0.2),), width: float = 1.0, height: float = 1.0
) -> Model:
    """A rectangle with circular holes (x, y, radius)."""
    ring = [(0.0, 0.0), (width, 0.0), (width, height), (0.0, height)]
    vertices: list[Sequence[float]] = list(ring)
    curves = [(i, (i + 1) % 4, line(ring[i], ring[(i + 1) % 4])) for i in range(4)]
    loops = [[(i, 1) for i in range(4)]]
    for x, y, r in holes:
        loops.append([(len(curves), -1)])
        curves.append((len(vertices), len(vertices), arc((x, y), r, 0, 2 * np.pi)))
        vertices.append((x + r, y))
    return build(vertices, curves, [(loops, [], [])])


def square_with_crack(a: Sequence[float] = (0.3, 0.5), b: Sequence[float] = (0.7, 0.5)) -> Model:
    """The unit square with a straight embedded curve between two points inside it."""
    ring = [(0, 0), (1, 0), (1, 1), (0, 1)]
    curves = [(i, (i + 1) % 4, line(ring[i], ring[(i + 1) % 4])) for i in range(4)] + [(4, 5, line(a, b))]
    return build([*ring, a, b], curves, [([[(i, 1) for i in range(4)]], [4], [])])


def square_with_edge_crack() -> Model:
    """The unit square with an embedded curve from the middle of the bottom side to the centre."""
    ring = [(0, 0), (0.5, 0), (1, 0), (1, 1), (0, 1)]
    curves = [(i, (i + 1) % 5, line(ring[i], ring[(i + 1) % 5])) for i in range(5)] + [(1, 5, line((0.5, 0), (0.5, 0.5)))]
    return build([*ring, (0.5, 0.5)], curves, [([[(i, 1) for i in range(5)]], [5], [])])


def square_with_cross() -> Model:
    """The unit square with four embedded curves that meet in its centre."""
    ring = [(0, 0), (1, 0), (1, 1), (0, 1)]
    tips = [(0.8, 0.5), (0.5, 0.8), (0.2, 0.5), (0.5, 0.2)]
    curves = [(i, (i + 1) % 4, line(ring[i], ring[(i + 1) % 4])) for i in range(4)]
    curves += [(4, 5 + i, line((0.5, 0.5), tip)) for i, tip in enumerate(tips)]
    return build([*ring, (0.5, 0.5), *tips], curves, [([[(i, 1) for i in range(4)]], [4, 5, 6, 7], [])])


def square_with_embedded_circle() -> Model:
    """The unit square with a closed embedded circle: one face, two components after cutting."""
    ring = [(0, 0), (1, 0), (1, 1), (0, 1)]
    curves = [(i, (i + 1) % 4, line(ring[i], ring[(i + 1) % 4])) for i in range(4)]
    curves.append((4, 4, arc((0.5, 0.5), 0.25, 0, 2 * np.pi)))
    return build([*ring, (0.75, 0.5)], curves, [([[(i, 1) for i in range(4)]], [4], [])])


def two_squares() -> Model:
    """Two unit squares that share a side."""
    v = [(0, 0), (1, 0), (2, 0), (2, 1), (1, 1), (0, 1)]
    ends = [(0, 1), (1, 2), (2, 3), (3, 4), (4, 5), (5, 0), (1, 4)]
    curves = [(a, b, line(v[a], v[b])) for a, b in ends]
    left = [(0, 1), (6, 1), (4, 1), (5, 1)]
    right = [(1, 1), (2, 1), (3, 1), (6, -1)]
    return build(v, curves, [([left], [], []), ([right], [], [])])


def two_materials() -> Model:
    """The unit square with a circular inclusion: a square with a hole, and a disc, on one shared closed circle."""
    ring = [(0, 0), (1, 0), (1, 1), (0, 1)]
    curves = [(i, (i + 1) % 4, line(ring[i], ring[(i + 1) % 4])) for i in range(4)]
    curves.append((4, 4, arc((0.5, 0.5), 0.25, 0, 2 * np.pi)))
    matrix = [[(i, 1) for i in range(4)], [(4, -1)]]
    return build([*ring, (0.75, 0.5)], curves, [(matrix, [], []), ([[(4, 1)]], [], [])])


def triple_junction() -> Model:
    """A disc cut into three sectors of 120 degrees."""
    a = np.pi / 2 + 2 * np.pi * np.arange(4) / 3
    vertices = [(0.0, 0.0)] + [(np.cos(t), np.sin(t)) for t in a[:3]]
    curves = [(0, i + 1, line((0, 0), vertices[i + 1])) for i in range(3)]
    curves += [(i + 1, (i + 1) % 3 + 1, arc((0, 0), 1.0, a[i], a[i + 1])) for i in range(3)]
    faces = [([[(i, 1), (3 + i, 1), ((i + 1) % 3, -1)]], [], []) for i in range(3)]
    return build(vertices, curves, faces)


def checkerboard(n: int = 3) -> Model:
    """n x n unit squares."""
    v = [(float(i), float(j)) for j in range(n + 1) for i in range(n + 1)]
    row = {}
    curves = []
    for j in range(n + 1):
        for i in range(n + 1):
            for di, dj in ((1, 0), (0, 1)):
                if i + di <= n and j + dj <= n:
                    a, b = j * (n + 1) + i, (j + dj) * (n + 1) + i + di
                    row[a, b] = len(curves)
                    curves.append((a, b, line(v[a], v[b])))
    faces = []
    for j in range(n):
        for i in range(n):
            a, b, c, d = j * (n + 1) + i, j * (n + 1) + i + 1, (j + 1) * (n + 1) + i + 1, (j + 1) * (n + 1) + i
            faces.append(([[(row[a, b], 1), (row[b, c], 1), (row[d, c], -1), (row[a, d], -1)]], [], []))
    return build(v, curves, faces)


def wedge(angle: float) -> Model:
    """A circular sector of radius 1 with its tip at the origin; `angle` in (0, 2 pi)."""
    tip = [(0.0, 0.0), (1.0, 0.0), (np.cos(angle), np.sin(angle))]
    curves = [(0, 1, line(tip[0], tip[1])), (1, 2, arc((0, 0), 1.0, 0.0, angle)), (2, 0, line(tip[2], tip[0]))]
    return build(tip, curves, [([[(0, 1), (1, 1), (2, 1)]], [], [])])


def moved(model: Model, angle: float) -> Model:
    """The model turned about its centre in the z = 0 plane; records stay scaled."""
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    return replace(
        model,
        vertices=model.vertices @ turn,
        curves=tuple(replace(k, points=k.points @ turn) for k in model.curves),
    )


def background(model: Model, h: float = 0.03) -> tuple[FaceMesh, ...]:
    """Uniform background meshes of edge length `h` (scaled); needs Gmsh."""
    from gmsh_crossquad.cad.background import face_meshes
    from gmsh_crossquad.cad.session import guest

    spacing = tuple(
        np.linspace(0.0, c.length, max(12 if c.closed else 3, int(np.ceil(c.length / h - 1e-9))) + 1) for c in model.curves
    )
    with guest():
        return face_meshes(model, spacing, np.full(len(model.faces), h))
