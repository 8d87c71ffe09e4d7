"""Split singularities of index 1/2 and more into several of 1/4.

Around an interior singularity of index I meet ``4 - 4 I`` blocks: two at I = 1/2, whose angles there add up to a full turn, so
that one of them is not convex whatever the mesh does; at I = 1 none.  The field a little away from such a point is the same if
the index is shared by several points around it: they are put on a circle of 0.35 of the room that there is to the boundary and
to other singularities.
"""

from __future__ import annotations

import numpy as np

from ..errors import LayoutError
from ..records import Bool, Float
from .clearance import Clearance
from .geodesic import geodesic
from .singularities import move_index, singular_vertices, walk
from .surface_mesh import SurfaceMesh

__all__ = ["split_strong"]

_RADIUS = 0.35


def split_strong(
    mesh: SurfaceMesh, clearance: Clearance, rotation: Float, avoid: Bool
) -> tuple[Float, tuple[tuple[int, int], ...]]:
    """Share indices of +1/2 and more among several vertices.

    Parameters
    ----------
    mesh : SurfaceMesh
    clearance : Clearance
        Of the same mesh.
    rotation : (m, 3) float64
        Without singular triangles.
    avoid : (n,) bool
        Vertices that no singularity may be put on.

    Returns
    -------
    (m, 3) float64, tuple of (int, int)
        The new rotation, and from which vertex to which an index of +1/4 was moved.

    Raises
    ------
    LayoutError
        Where the mesh has no room for them.
    """
    vertices, index = singular_vertices(mesh, rotation)
    if not np.any(index > 1):
        return rotation, ()
    out = rotation.copy()
    moved: list[tuple[int, int]] = []
    barred = mesh.boundary_vertex | avoid
    barred[vertices] = True
    room = clearance.room(mesh.points[vertices])
    for v, q, radius in zip(vertices.tolist(), index.tolist(), (_RADIUS * room).tolist()):
        if q <= 1:
            continue
        for part in np.arange(q) / q:
            path = walk(mesh, v, _place(mesh, v, float(part), radius), barred)
            if len(path) < 2:
                raise LayoutError(
                    f"there is no room to split a singularity of index {q}/4",
                    location=mesh.points[v],
                    remedy="use a finer background mesh",
                )
            move_index(mesh, out, path, 1)
            barred[path[-1]] = True
            moved.append((v, path[-1]))
    return out, tuple(moved)


def _place(mesh: SurfaceMesh, vertex: int, part: float, radius: float) -> Float:
    """The point (d,) of a circle around a vertex, a `part` of a full turn from the x axis or, in space, from its first edge."""
    if mesh.points.shape[1] == 3:
        return geodesic(mesh, vertex, part * float(mesh.angle_sum[vertex]), radius).points[-1]
    angle = 2 * np.pi * part
    return mesh.points[vertex] + radius * np.array([np.cos(angle), np.sin(angle)])
