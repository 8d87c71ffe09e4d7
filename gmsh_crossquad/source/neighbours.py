"""Cancel singularities of opposite index that are next to each other.

Where a field changes little from edge to edge and is weak, as at a zero of higher order, errors make pairs of singularities of
opposite index.  A pair at the two ends of an edge is no feature of the field that the mesh could resolve.
(Pairs two or three edges apart are left alone: they can be an extremum and a saddle of a high mode.)
"""

from __future__ import annotations

import numpy as np

from ..field.singularities import move_index, shortest_path, singular_vertices, snap_to_vertices
from ..field.surface_mesh import SurfaceMesh
from ..records import Float

__all__ = ["cancel_neighbours"]

_EDGES = 1


def cancel_neighbours(mesh: SurfaceMesh, rotation: Float) -> Float:
    """Copy of `rotation` (m, 3) with all indices at vertices and no opposite indices inside at the two ends of an edge.

    Raises
    ------
    LayoutError
        For a singular triangle without a vertex inside.
    """
    out = snap_to_vertices(mesh, rotation)
    vertices, quarters = singular_vertices(mesh, out)
    index = np.zeros(len(mesh.points), np.int64)
    index[vertices] = quarters
    inside = ~mesh.boundary_vertex
    for v in vertices[quarters > 0].tolist():
        for _ in range(int(index[v])):
            path = shortest_path(mesh, [v], index < 0, inside, _EDGES)
            if not path:
                break
            move_index(mesh, out, path, 1)
            index[path[0]] -= 1
            index[path[-1]] += 1
    return out
