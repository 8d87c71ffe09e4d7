"""Edge frames of hand-made meshes, for the tests of field sources."""

from __future__ import annotations

import numpy as np

from gmsh_crossquad.field.edge_frames import EdgeFrames
from gmsh_crossquad.field.singularities import to_integer, triangle_index, vertex_index
from gmsh_crossquad.field.surface_mesh import SurfaceMesh
from gmsh_crossquad.records import CrossField, Float, Int

XY = np.eye(2, 3)


def frames_of(mesh: SurfaceMesh, axes: Float = XY, origin: tuple[float, ...] = (0.0, 0.0, 0.0), scale: float = 1.0) -> EdgeFrames:
    """Frames of a plane mesh put into space: user's point = origin + scale * (x, y) @ axes."""
    points = np.asarray(origin) + scale * mesh.points @ axes
    return EdgeFrames(1, mesh, points, np.tile(np.cross(*axes), (len(mesh.edges), 1)))


def drift(mesh: SurfaceMesh, field: CrossField) -> float:
    """How far the angles and the rotation of a field disagree, modulo a quarter turn."""
    angle = field.theta[mesh.triangle_edges] + mesh.edge_direction
    off = (np.roll(angle, -1, axis=1) - angle - field.rotation) / (np.pi / 2)
    return float(np.abs(off - np.rint(off)).max())


def inner_indices(mesh: SurfaceMesh, field: CrossField) -> tuple[Int, Int]:
    """Indices of all triangles, and of all vertices (0 on the boundary)."""
    index = np.where(mesh.boundary_vertex, 0.0, vertex_index(mesh, field.rotation))
    return triangle_index(field.rotation), to_integer(index, "index")


def delaunay(points: Float) -> SurfaceMesh:
    """Delaunay triangles of points (n, 2)."""
    from scipy.spatial import Delaunay

    t = Delaunay(points).simplices.astype(np.int64)
    p = points[t]
    a, b = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]
    cross = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    t = np.where(cross[:, None] < 0, t[:, ::-1], t)
    used, t = np.unique(t[np.abs(cross) > 1e-12], return_inverse=True)
    return SurfaceMesh(points[used], t.reshape(-1, 3))


def random_square(n: int, seed: int = 0) -> SurfaceMesh:
    """An unstructured mesh of the unit square with n points inside."""
    s = np.linspace(0, 1, max(3, int(np.sqrt(n))) + 1)[:-1]
    rim = np.concatenate([np.stack(c, axis=1) for c in ((s, 0 * s), (1 + 0 * s, s), (1 - s, 1 + 0 * s), (0 * s, 1 - s))])
    inner = np.random.default_rng(seed).uniform(0.03, 0.97, (n, 2))
    return delaunay(np.concatenate([rim, inner]))
