"""Triangle meshes of simple plane domains, for the tests of the field stage."""

from __future__ import annotations

import numpy as np

from gmsh_crossquad.field.surface_mesh import SurfaceMesh
from gmsh_crossquad.records import CrossField, Float


def disc(rings: int = 12, sectors: int = 32) -> SurfaceMesh:
    """Unit disc: a centre vertex and equally spaced rings; vertex ``1 + (r - 1) * sectors + s`` is at radius r / rings."""
    r, a = np.meshgrid(np.arange(1, rings + 1) / rings, 2 * np.pi * np.arange(sectors) / sectors, indexing="ij")
    points = np.concatenate([[[0.0, 0.0]], np.stack([r * np.cos(a), r * np.sin(a)], axis=2).reshape(-1, 2)])
    s = np.arange(sectors)
    triangles = [np.stack([np.zeros_like(s), 1 + s, 1 + (s + 1) % sectors], axis=1)]
    for k in range(rings - 1):
        triangles += _ring(1 + k * sectors, sectors)
    return SurfaceMesh(points, np.concatenate(triangles))


def annulus(inner: float = 0.4, rings: int = 8, sectors: int = 40) -> SurfaceMesh:
    """Annulus of outer radius 1."""
    r, a = np.meshgrid(np.linspace(inner, 1.0, rings + 1), 2 * np.pi * np.arange(sectors) / sectors, indexing="ij")
    points = np.stack([r * np.cos(a), r * np.sin(a)], axis=2).reshape(-1, 2)
    return SurfaceMesh(points, np.concatenate([t for k in range(rings) for t in _ring(k * sectors, sectors)]))


def _ring(first: int, sectors: int) -> list[np.ndarray]:
    s = np.arange(sectors)
    a, b = first + s, first + (s + 1) % sectors
    c, d = a + sectors, b + sectors
    return [np.stack([a, c, d], axis=1), np.stack([a, d, b], axis=1)]


def grid(nx: int, ny: int, holes: tuple[tuple[int, int, int, int], ...] = ()) -> SurfaceMesh:
    """nx x ny unit squares, each cut into four triangles, without the squares ``x0 <= i < x1, y0 <= j < y1`` of every hole."""
    i, j = np.meshgrid(np.arange(nx), np.arange(ny), indexing="ij")
    keep = np.ones((nx, ny), bool)
    for x0, x1, y0, y1 in holes:
        keep[x0:x1, y0:y1] = False
    i, j = i[keep], j[keep]
    a, b = i * (ny + 1) + j, (i + 1) * (ny + 1) + j
    c, d = b + 1, a + 1
    m = (nx + 1) * (ny + 1) + np.arange(len(i))
    corner = np.stack(np.meshgrid(np.arange(nx + 1), np.arange(ny + 1), indexing="ij"), axis=2).reshape(-1, 2)
    points = np.concatenate([corner, np.stack([i + 0.5, j + 0.5], axis=1)]).astype(float)
    triangles = np.concatenate([np.stack([p, q, m], axis=1) for p, q in ((a, b), (b, c), (c, d), (d, a))])
    used, triangles = np.unique(triangles, return_inverse=True)
    return SurfaceMesh(points[used], triangles.reshape(-1, 3))


def at(mesh: SurfaceMesh, x: float, y: float) -> int:
    """The vertex nearest to a point."""
    return int(np.argmin(np.hypot(mesh.points[:, 0] - x, mesh.points[:, 1] - y)))


def middles(mesh: SurfaceMesh) -> np.ndarray:
    """(e,) edge midpoints as complex numbers."""
    p = mesh.points[mesh.edges].mean(axis=1)
    return p[:, 0] + 1j * p[:, 1]


def prescribed(mesh: SurfaceMesh, angle: Float) -> CrossField:
    """The cross field with these global angles (e,) at the edge midpoints."""
    from gmsh_crossquad.field.smooth import edge_angle, from_angles

    return from_angles(mesh, angle - edge_angle(mesh))


def singular_angle(mesh: SurfaceMesh, vertices: list[int], index: list[int]) -> Float:
    """(e,) ``sum d_k / 4 arg(z - a_k)``."""
    a = mesh.points[vertices] @ np.array([1, 1j])
    return sum(d / 4 * np.angle(middles(mesh) - p) for p, d in zip(a, index))


def square_corners(mesh: SurfaceMesh) -> np.ndarray:
    """(n,) boundary indices of a mesh whose corners are all 90 or 270 degrees."""
    quads = np.rint(mesh.angle_sum / (np.pi / 2)).astype(np.int64)
    return np.where(mesh.boundary_vertex, 2 - quads, 0)
