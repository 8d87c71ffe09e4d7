"""Indices of a cross field in Crouzeix–Raviart form, and integer moves that change where they are.

Between the edges k and k + 1 of triangle t the cross turns by ``rotation[t, k]`` (a real number that passes the corner at
vertex k + 1).  In quarter turns the index of a triangle is ``sum_k rotation / (pi/2)`` and that of a vertex

    (K_v - sum of the rotations that pass its corners) / (pi/2),

with the angle defect ``K_v = 2 pi - sum of angles`` (``pi - sum`` on the boundary, where it is a whole number only if the field
is aligned).  All indices of a component add up to 4 chi whatever the rotations are (Poincaré–Hopf): every edit below moves a
whole number of quarter turns from one place to another, and no index is ever rounded again afterwards.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from ..errors import LayoutError
from ..records import Bool, Float, Int
from .surface_mesh import SurfaceMesh

__all__ = [
    "QUARTER",
    "check_poincare_hopf",
    "corner_rotation",
    "move_index",
    "shortest_path",
    "singular_vertices",
    "snap_to_vertices",
    "to_integer",
    "triangle_index",
    "vertex_index",
    "walk",
]

QUARTER = 0.5 * np.pi


def to_integer(values: Float, what: str, places: Float | None = None) -> Int:
    """Round `values` (k,) that are integers up to rounding error; LayoutError names `what` if they are not.

    `places` (k, d) are their coordinates, for the message.
    """
    out = np.rint(values).astype(np.int64)
    off = np.abs(values - out)
    if np.any(off > 1e-6):
        worst = int(np.argmax(off))
        raise LayoutError(
            f"{what} is not a whole number of quarter turns (off by {off[worst]:.3g})",
            location=None if places is None else places[worst],
            remedy="report the model",
        )
    return out


def triangle_index(rotation: Float) -> Int:
    """(m,) index of every triangle in quarter turns."""
    return to_integer(rotation.sum(axis=1) / QUARTER, "the index of a triangle")


def corner_rotation(mesh: SurfaceMesh, rotation: Float) -> Float:
    """(n,) counter-clockwise rotation of the cross through all corners of every vertex, from its last edge to its first."""
    return np.bincount(mesh.triangles.ravel(), np.roll(rotation, 1, axis=1).ravel(), len(mesh.points)).astype(np.float64)


def vertex_index(mesh: SurfaceMesh, rotation: Float) -> Float:
    """(n,) index of every vertex in quarter turns; whole at interior vertices, and on the boundary of an aligned field."""
    return (mesh.curvature - corner_rotation(mesh, rotation)) / QUARTER


def check_poincare_hopf(mesh: SurfaceMesh, index: Int) -> None:
    """Raise LayoutError unless the vertex indices (n,) of every component add up to 4 times its Euler characteristic."""
    label, euler = mesh.components, mesh.component_euler
    total = np.bincount(label, index, len(euler))
    for c in np.flatnonzero(total != 4 * euler):
        raise LayoutError(
            f"the indices of the cross field add up to {int(total[c])} quarter turns instead of {4 * int(euler[c])}",
            remedy="change the prescribed singularities or boundary indices",
        )


def move_index(mesh: SurfaceMesh, rotation: Float, path: Sequence[int], amount: int) -> None:
    """Move `amount` quarter turns from the first to the last vertex of an edge path, in place.

    Only the corners of the triangles left of the path change (right of it where there is none on the left): between two
    vertices of one triangle the rotation through the first corner grows and that through the second falls.
    """
    for a, b in pairwise(path):
        h = mesh.half_edge_between(a, b)
        if h >= 0:
            t, k = divmod(h, 3)
            at_a, at_b = (k + 2) % 3, k
        else:
            t, k = divmod(mesh.half_edge_between(b, a), 3)
            at_a, at_b = k, (k + 2) % 3
        rotation[t, at_a] += amount * QUARTER
        rotation[t, at_b] -= amount * QUARTER


def shortest_path(mesh: SurfaceMesh, source: Sequence[int], target: Bool, allowed: Bool, limit: int) -> list[int]:
    """Edge path with fewest edges from a vertex of `source` to a vertex of `target`, through `allowed` vertices in between.

    Deterministic (breadth first, neighbours in counter-clockwise order); at most `limit` edges.  Empty if there is none.
    """
    parent = {int(v): -1 for v in source}
    queue = deque((v, 0) for v in parent)
    while queue:
        v, depth = queue.popleft()
        if target[v]:
            path = [v]
            while parent[path[-1]] >= 0:
                path.append(parent[path[-1]])
            return path[::-1]
        if depth == limit or not (allowed[v] or depth == 0):
            continue
        for w in mesh.neighbours(v):
            if w not in parent and (allowed[w] or target[w]):
                parent[w] = v
                queue.append((w, depth + 1))
    return []


def walk(mesh: SurfaceMesh, start: int, goal: Float, barred: Bool) -> list[int]:
    """Edge path from vertex `start` towards the point `goal`, always to the nearest neighbour that is not `barred`.

    Ends where no neighbour is nearer.
    """
    path = [start]
    nearest = float(np.sum((mesh.points[start] - goal) ** 2))
    while True:
        around = [w for w in mesh.neighbours(path[-1]) if not barred[w]]
        if not around:
            return path
        distance = np.sum((mesh.points[around] - goal) ** 2, axis=1)
        best = int(np.argmin(distance))
        if distance[best] >= nearest:
            return path
        nearest = float(distance[best])
        path.append(around[best])


def singular_vertices(mesh: SurfaceMesh, rotation: Float) -> tuple[Int, Int]:
    """Interior vertices with an index, and their indices in quarter turns."""
    inside = np.flatnonzero(~mesh.boundary_vertex)
    index = to_integer(vertex_index(mesh, rotation)[inside], "the index of an interior vertex", mesh.points[inside])
    return inside[index != 0], index[index != 0]


def snap_to_vertices(mesh: SurfaceMesh, rotation: Float, avoid: Bool | None = None) -> Float:
    """Move the index of every singular triangle to one of its interior vertices.

    Preferred is a vertex whose index is cancelled by it, then one that is not in `avoid`, then the corner through which the
    cross turns most (there the move lowers the energy most).  An index that is already at a vertex of `avoid` goes to a regular
    neighbour.

    Parameters
    ----------
    rotation : (m, 3) float64
    avoid : (n,) bool, optional
        Vertices that should stay regular.

    Returns
    -------
    (m, 3) float64
        A new array; all triangle indices are 0.
    """
    out = rotation.copy()
    index = triangle_index(rotation)
    at_vertex = np.where(mesh.boundary_vertex, 0, np.rint(vertex_index(mesh, rotation))).astype(np.int64)
    for t in np.flatnonzero(index).tolist():
        q = int(index[t])
        corners = [k for k in range(3) if not mesh.boundary_vertex[mesh.triangles[t, k]]]
        if not corners:
            raise LayoutError(
                "a singularity lies in a triangle without interior vertex",
                location=mesh.points[mesh.triangles[t]].mean(axis=0),
                remedy="use a finer background mesh",
            )

        def preference(k: int, t: int = t, q: int = q) -> tuple[bool, bool, float]:
            v = mesh.triangles[t, k]
            return bool(at_vertex[v] * q < 0), not (avoid is not None and avoid[v]), q * float(out[t, (k + 2) % 3])

        k = max(corners, key=preference)
        out[t, (k + 2) % 3] -= q * QUARTER
        at_vertex[mesh.triangles[t, k]] += q
    barred = np.zeros(len(mesh.points), bool) if avoid is None else avoid
    for v in np.flatnonzero((at_vertex != 0) & barred).tolist():
        free = [w for w in mesh.neighbours(v) if not (mesh.boundary_vertex[w] or barred[w] or at_vertex[w])]
        if free:
            move_index(mesh, out, [v, free[0]], int(at_vertex[v]))
            at_vertex[free[0]], at_vertex[v] = at_vertex[v], 0
    return out
