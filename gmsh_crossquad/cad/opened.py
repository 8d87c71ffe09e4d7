"""Triangle meshes of several faces cut open along embedded curves and split where the field would have no room."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..field.cut import cut_open
from ..field.split import open_up
from ..field.surface_mesh import SurfaceMesh
from ..records import Float, Int

__all__ = ["opened"]


def opened(points: Float, triangles: Int, cuts: Int, vertex: Int, offset: Int) -> Iterator[tuple[SurfaceMesh, Int]]:
    """Cut and split the meshes of several faces together.

    Parameters
    ----------
    points : (n, d) float64
        Of all faces, one behind the other.
    triangles : (m, 3) int64
    cuts : (c, 2) int64
        Edges of embedded curves.
    vertex : (n,) int64
        Row of `Model.vertices` or -1.
    offset : (f + 1,) int64
        First point of every face, and the number of points.

    Yields
    ------
    SurfaceMesh
        Of every face in turn.
    (k,) int64
        The point of the face that each of its points came from, -1 for new ones.
    """
    triangles, source = cut_open(triangles, len(points), cuts)
    on_boundary = SurfaceMesh(points[source], triangles).boundary_vertex
    points, triangles = open_up(points[source], triangles, on_boundary & (vertex[source] >= 0))
    source = np.concatenate([source, np.full(len(points) - len(source), -1)])
    owner = np.full(len(points), -1)
    old = source >= 0
    owner[old] = np.searchsorted(offset, source[old], side="right") - 1
    triangle_owner = owner[triangles].max(axis=1)
    while (triangle_owner < 0).any():  # new points belong to the face of their triangles; each round reaches the next ones
        known = triangle_owner >= 0
        owner[triangles[known]] = triangle_owner[known, None]
        triangle_owner = owner[triangles].max(axis=1)
    owner[triangles] = triangle_owner[:, None]
    order = np.argsort(owner, kind="stable")
    local = np.empty(len(points), np.int64)
    bounds = np.searchsorted(owner[order], np.arange(len(offset)))
    triangle_order = np.argsort(triangle_owner, kind="stable")
    triangle_bounds = np.searchsorted(triangle_owner[triangle_order], np.arange(len(offset)))
    for row in range(len(offset) - 1):
        mine = order[bounds[row] : bounds[row + 1]]
        local[mine] = np.arange(len(mine))
        inside = np.where(source[mine] >= 0, source[mine] - offset[row], -1)
        own = triangle_order[triangle_bounds[row] : triangle_bounds[row + 1]]
        yield SurfaceMesh(points[mine], local[triangles[own]]), inside
