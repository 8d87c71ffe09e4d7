"""Give every boundary vertex of an aligned field its wanted index, by integer moves.

The smooth field chooses its own indices where the boundary turns.  Where they differ from the wanted ones the difference is
moved between the boundary vertex and a triangle of its star; it then belongs to a singularity inside, which
`snap_to_vertices` puts on a vertex.
"""

from __future__ import annotations

import numpy as np

from ..records import Float, Int
from .singularities import QUARTER, to_integer, triangle_index, vertex_index
from .surface_mesh import SurfaceMesh

__all__ = ["correct_boundary"]


def correct_boundary(mesh: SurfaceMesh, rotation: Float, boundary_index: Int) -> Float:
    """Copy of `rotation` (m, 3) with the indices `boundary_index` (n,) on the boundary.

    A unit goes to the triangle of the star whose own index it cancels, else to the one through whose corner the cross turns most,
    where taking it away lowers the energy most.

    Raises
    ------
    LayoutError
        If the field is not aligned with the boundary (its boundary indices are not whole).
    """
    out = rotation.copy()
    on = np.flatnonzero(mesh.boundary_vertex)
    missing = boundary_index[on] - to_integer(vertex_index(mesh, rotation)[on], "the index of a boundary vertex", mesh.points[on])
    triangle = triangle_index(rotation)
    for v, amount in zip(on[missing != 0].tolist(), missing[missing != 0].tolist()):
        sign = 1 if amount > 0 else -1
        corners = [(h // 3, (h % 3 + 2) % 3) for h in mesh.star(v)]
        for _ in range(abs(amount)):
            t, k = max(corners, key=lambda c: (bool(triangle[c[0]] * sign > 0), sign * float(out[c])))
            out[t, k] -= sign * QUARTER
            triangle[t] -= sign
    return out
