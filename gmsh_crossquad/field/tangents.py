"""Tangent vectors of plane and of curved surfaces.

In the plane vectors have two components and are turned about the z axis; on a surface in space they have three and are turned
about a normal.
"""

from __future__ import annotations

import numpy as np

from ..records import Float, Int
from .surface_mesh import SurfaceMesh

__all__ = ["length", "quarter_turn", "settled", "tangential"]


def length(vectors: Float) -> Float:
    """Lengths (...) of vectors (..., 2) or (..., 3)."""
    if vectors.shape[-1] == 2:
        return np.hypot(vectors[..., 0], vectors[..., 1])
    return np.linalg.norm(vectors, axis=-1)


def quarter_turn(vectors: Float, normal: Float | None) -> Float:
    """Vectors (..., 2) turned counter-clockwise by 90 degrees, or the tangential parts of vectors (..., 3) about a `normal`."""
    if normal is None:
        return np.stack([-vectors[..., 1], vectors[..., 0]], axis=-1)
    out: Float = np.cross(normal, vectors)
    return out


def tangential(mesh: SurfaceMesh, vertices: Int, vectors: Float) -> Float:
    """The parts (k, d) of `vectors` (k, d) in the tangent planes at `vertices` (k,)."""
    if mesh.vertex_normal is None:
        return vectors
    n = mesh.vertex_normal[vertices]
    return vectors - np.sum(vectors * n, axis=1)[:, None] * n


def settled(mesh: SurfaceMesh, vertices: Int, places: Float) -> Float:
    """The feet (k, d) of `places` (k, d) on the tangent planes at `vertices` (k,)."""
    if mesh.vertex_normal is None:
        return places
    origin = mesh.points[vertices]
    return origin + tangential(mesh, vertices, places - origin)
