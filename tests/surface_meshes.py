"""Triangle meshes of analytic curved surfaces, for the tests of everything that works on curved faces.

Boundary points lie exactly on the surfaces' boundary curves; triangles are counter-clockwise as seen from outside or above.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np

from gmsh_crossquad.field.surface_mesh import SurfaceMesh
from gmsh_crossquad.records import FaceMesh, Float, Int

_OCTAHEDRON = np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, 1], [-1, 0, 0], [0, -1, 0], [0, 0, -1]])


def face_mesh(mesh: SurfaceMesh, corners: dict[int, float] | None = None) -> FaceMesh:
    """The record of a curved face whose CAD vertices are `corners`: boundary vertex -> opening angle."""
    h = mesh.edge_half_edges[mesh.boundary_edge, 0]
    boundary = mesh.half_edges[h]
    curve = np.zeros(len(mesh.points), np.int64)
    for row, loop in enumerate(mesh.loops):
        curve[loop] = row
    opening = np.full(len(mesh.points), np.nan)
    vertex = np.full(len(mesh.points), -1)
    for row, (v, angle) in enumerate((corners or {}).items()):
        opening[v], vertex[v] = angle, row
    return FaceMesh(
        face=0,
        points=mesh.points,
        triangles=mesh.triangles,
        boundary=boundary,
        boundary_curve=curve[boundary[:, 0]],
        boundary_arclength=np.zeros((len(boundary), 2)),
        vertex=vertex,
        opening_angle=opening,
        port=np.zeros(len(mesh.points), bool),
    )


def joined(points: Float, triangles: Int) -> SurfaceMesh:
    """One mesh of triangles whose points are repeated (up to rounding), without unused points; the first of each is kept."""
    key = np.round(points, 9) + 0.0
    _, first, inverse = np.unique(key, axis=0, return_index=True, return_inverse=True)
    used, rows = np.unique(first[inverse.reshape(-1)][triangles], return_inverse=True)
    return SurfaceMesh(points[used], rows.reshape(-1, 3))


def nearest(mesh: SurfaceMesh, point: Sequence[float]) -> int:
    """The vertex nearest to a point."""
    return int(np.argmin(np.linalg.norm(mesh.points - np.asarray(point, float), axis=1)))


def moved(mesh: SurfaceMesh, seed: int = 1) -> SurfaceMesh:
    """`mesh` after a rotation and a shift."""
    q, r = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    q = q * np.sign(np.linalg.det(q))
    return SurfaceMesh(mesh.points @ q.T + np.array([0.3, -2.0, 1.1]), mesh.triangles)


# -- spheres ---------------------------------------------------------------------------------------------------------------


def _subdivided(corners: Float, n: int) -> tuple[Float, Int]:
    """A triangle cut into n^2."""
    row = [np.array([[n - i - j, i, j] for j in range(n + 1 - i)]) / n for i in range(n + 1)]
    start = np.cumsum([0] + [len(r) for r in row])
    triangles = []
    for i in range(n):
        for j in range(n - i):
            a, b = start[i] + j, start[i + 1] + j
            triangles.append([a, b, a + 1])
            if j < n - i - 1:
                triangles.append([b, b + 1, a + 1])
    return np.concatenate(row) @ corners, np.array(triangles)


def _sphere(faces: Sequence[Float], n: int) -> SurfaceMesh:
    points, triangles, count = [], [], 0
    for corners in faces:
        p, t = _subdivided(np.asarray(corners), n)
        points.append(p)
        triangles.append(t + count)
        count += len(p)
    mesh = joined(np.concatenate(points), np.concatenate(triangles))
    return SurfaceMesh(mesh.points / np.linalg.norm(mesh.points, axis=1)[:, None], mesh.triangles)


def octant(n: int = 12) -> SurfaceMesh:
    """The part x, y, z >= 0 of the unit sphere."""
    return _sphere([_OCTAHEDRON[[0, 1, 2]]], n)


def hemisphere(n: int = 10) -> SurfaceMesh:
    """The part z >= 0 of the unit sphere."""
    return _sphere([_OCTAHEDRON[[a, b, 2]] for a, b in ((0, 1), (1, 3), (3, 4), (4, 0))], n)


def sphere(n: int = 8) -> SurfaceMesh:
    """The unit sphere, from an icosahedron."""
    g = 0.5 * (1 + np.sqrt(5))
    p = np.array([[s, t * g, 0.0] for s in (-1, 1) for t in (-1, 1)])
    p = np.concatenate([np.roll(p, k, axis=1) for k in range(3)])
    near = np.abs(np.linalg.norm(p[:, None] - p[None], axis=2) - 2.0) < 1e-9
    faces = [
        (i, j, k)
        for i in range(12)
        for j in range(12)
        for k in range(12)
        if i == min(i, j, k) and near[i, j] and near[j, k] and near[k, i]
    ]
    return _sphere([p[list(f)] for f in faces if np.linalg.det(p[list(f)]) > 0], n)


def holed_sphere(holes: Sequence[tuple[complex, float]], h: float = 0.12) -> SurfaceMesh:
    """The unit sphere without the cap around the north pole that leaves colatitude > 60 degrees, and without circular holes.

    Made in the plane, by stereographic projection from the north pole (which maps circles to circles).

    Parameters
    ----------
    holes : list of (centre, radius) in the plane
    h : float
        Edge length on the sphere.
    """
    from gmsh_crossquad.spatial import Delaunay

    radius = np.sqrt(3.0)

    def circle(centre: complex, r: float) -> Float:
        size = h * (1 + (abs(centre) + 0.5 * r) ** 2) / 2
        z = centre + r * np.exp(2j * np.pi * np.arange(k := max(16, int(np.ceil(2 * np.pi * r / size)))) / k)
        return np.stack([z.real, z.imag], axis=1)

    edge = [circle(0.0, radius)] + [circle(c, r) for c, r in holes]
    rings = [np.zeros((1, 2))]
    r = 0.0
    while (r := r + h * (1 + r * r) / 2) < radius - 0.3 * h * (1 + r * r):
        a = 2 * np.pi * (np.arange(k := max(6, round(4 * np.pi * r / (h * (1 + r * r))))) / k + 0.13 * len(rings))
        rings.append(r * np.stack([np.cos(a), np.sin(a)], axis=1))
    inner = np.concatenate(rings)
    size = h * (1 + np.sum(inner**2, axis=1)) / 2
    clear = np.ones(len(inner), bool)
    for c, s in holes:
        clear &= np.hypot(inner[:, 0] - c.real, inner[:, 1] - c.imag) > s + 0.5 * size
    xy = np.concatenate([*edge, inner[clear]])
    triangles = Delaunay(xy).simplices.astype(np.int64)
    (a, b), (c, d) = ((xy[triangles[:, k]] - xy[triangles[:, 0]]).T for k in (1, 2))
    area = a * d - b * c
    triangles[area < 0] = triangles[area < 0][:, ::-1]
    start = np.cumsum([0] + [len(e) for e in edge])
    for a, b in pairwise(start[1:]):
        triangles = triangles[~((triangles >= a) & (triangles < b)).all(axis=1)]
    square = np.sum(xy**2, axis=1)[:, None]
    # the projection from the north pole turns the orientation around
    points = np.concatenate([2 * xy, square - 1], axis=1) / (square + 1)
    return joined(points, triangles[:, ::-1])


# -- images of a rectangle -----------------------------------------------------------------------------------------------


def patch(
    f: Callable[[Float, Float], Sequence[Float]],
    u: tuple[float, float],
    v: tuple[float, float],
    cells: tuple[int, int],
    holes: Sequence[tuple[int, int, int, int]] = (),
) -> SurfaceMesh:
    """The image of a grid of cells, each cut into four triangles, without the cells of `holes` (i0, i1, j0, j1).

    Sides that fall together are joined; the normal is d/du x d/dv.
    """
    nu, nv = cells
    keep = np.ones(cells, bool)
    for i0, i1, j0, j1 in holes:
        keep[i0:i1, j0:j1] = False
    i, j = np.nonzero(keep)
    a = i * (nv + 1) + j
    d, b = a + 1, a + nv + 1
    c, m = b + 1, (nu + 1) * (nv + 1) + np.arange(len(i))
    g = np.stack(np.meshgrid(np.arange(nu + 1.0), np.arange(nv + 1.0), indexing="ij"), axis=2).reshape(-1, 2)
    g = np.concatenate([g, np.stack([i + 0.5, j + 0.5], axis=1)]) / np.array(cells)
    x = f(u[0] + (u[1] - u[0]) * g[:, 0], v[0] + (v[1] - v[0]) * g[:, 1])
    points = np.stack([np.broadcast_to(np.asarray(q, float), len(g)) for q in x], axis=1)
    triangles = np.concatenate([np.stack([p, q, m], axis=1) for p, q in ((a, b), (b, c), (c, d), (d, a))])
    return joined(points, triangles)


def cylinder(radius: float = 1.0, length: float = 2.0, cells: tuple[int, int] = (24, 8)) -> SurfaceMesh:
    """The side of a cylinder about z."""
    return patch(lambda a, z: (radius * np.cos(a), radius * np.sin(a), z), (0, 2 * np.pi), (0, length), cells)


def frustum(low: float = 1.0, high: float = 0.4, height: float = 1.5, cells: tuple[int, int] = (24, 8)) -> SurfaceMesh:
    """The side of a truncated cone about z."""

    def f(a: Float, t: Float) -> Sequence[Float]:
        r = low + (high - low) * t
        return r * np.cos(a), r * np.sin(a), height * t

    return patch(f, (0, 2 * np.pi), (0, 1), cells)


def torus(
    turn: float = 2 * np.pi,
    radii: tuple[float, float] = (1.0, 0.4),
    cells: tuple[int, int] = (30, 14),
    holes: Sequence[tuple[int, int, int, int]] = (),
) -> SurfaceMesh:
    """A torus about z, or the part of it that turns by less than 2 pi (then with two boundary circles)."""

    def f(a: Float, b: Float) -> Sequence[Float]:
        r = radii[0] + radii[1] * np.cos(b)
        return r * np.cos(a), r * np.sin(a), radii[1] * np.sin(b)

    return patch(f, (0, turn), (0, 2 * np.pi), cells, holes)


def double_torus(cells: tuple[int, int] = (30, 14)) -> SurfaceMesh:
    """A closed surface of genus 2: a torus and its mirror image, joined by a tube with four straight edges."""
    nu, nv = cells
    part = torus(cells=cells, holes=[(0, 2, 0, 2), (nu - 2, nu, 0, 2), (0, 2, nv - 2, nv), (nu - 2, nu, nv - 2, nv)])
    loop = part.loops[0]
    far = 2.2
    n, k = len(part.points), len(loop)
    mirrored = part.points * np.array([-1.0, 1, 1]) + np.array([2 * far, 0, 0])
    layers, steps = [loop], 4
    points = [part.points, mirrored]
    for s in range(1, steps):
        layers.append(2 * n + (s - 1) * k + np.arange(k))
        points.append(part.points[loop] + s / steps * (mirrored[loop] - part.points[loop]))
    layers.append(n + loop)
    triangles = [part.triangles, part.triangles[:, ::-1] + n]
    for a, c in pairwise(layers):
        # the surface is left of the loop, the tube right of it
        b, d = np.roll(a, -1), np.roll(c, -1)
        triangles += [np.stack([b, a, c], axis=1), np.stack([b, c, d], axis=1)]
    return SurfaceMesh(np.concatenate(points), np.concatenate(triangles))


def saddle(n: int = 12, height: float = 0.5) -> SurfaceMesh:
    """``z = height (x^2 - y^2)`` over the square [-1, 1]^2."""
    return patch(lambda x, y: (x, y, height * (x * x - y * y)), (-1, 1), (-1, 1), (n, n))


def bump(n: int = 16, height: float = 0.8) -> SurfaceMesh:
    """A plate [-1, 1]^2 with a smooth bump of radius 0.7 in the middle."""

    def f(x: Float, y: Float) -> Sequence[Float]:
        return x, y, height * np.maximum(1 - (x * x + y * y) / 0.49, 0.0) ** 2

    return patch(f, (-1, 1), (-1, 1), (n, n))
