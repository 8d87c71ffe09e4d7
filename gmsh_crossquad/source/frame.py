"""A frame on a curved face: the smoothest field of directions without zeros, which angles are measured from.

It is a trivial connection without singularities, as in `prescribed`, with one more condition: a direction, other than a cross, is
the same after whole turns only, so its rotation along every boundary loop and handle is a multiple of four quarters; of all those
the one of least energy is taken.  It is turned so that on the average it has the direction of the x axis (of y, or of z, where
that is zero on the average).  On a plane that is the x axis everywhere.

A surface has such a frame where it has a boundary, or is a torus; not a sphere.
"""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from ..errors import FieldError
from ..field.operators import FieldOperators
from ..field.singularities import QUARTER, corner_rotation, move_index, shortest_path
from ..field.surface_mesh import SurfaceMesh
from ..records import Bool, Float
from .prescribed import FreeOperators, handle_cocycles, with_indices

if TYPE_CHECKING:
    from ..field.edge_frames import EdgeFrames

__all__ = ["frame_angles", "has_frame"]

#: handles for which all combinations of turns are tried
_MOST_HANDLES = 2
#: a mean direction shorter than this (1: all are parallel) is none
_NO_MEAN = 0.05


def has_frame(mesh: SurfaceMesh) -> bool:
    """Whether every component has a field of directions without zeros."""
    return not bool(np.any(mesh.component_closed & (mesh.component_euler != 0)))


def frame_angles(frames: EdgeFrames) -> Float:
    """Angles (e,) of the frame's direction from the edges of a curved face, modulo a full turn.

    Raises
    ------
    FieldError
        For a closed surface other than a torus, and for one with more than two handles.
    """
    mesh = frames.surface
    if not has_frame(mesh):
        remedy = "give directions instead of angles"
        raise FieldError("a closed surface other than a torus has no frame without zeros", entity=(2, frames.face), remedy=remedy)
    operators = FieldOperators(mesh)
    _, rotation = with_indices(mesh, operators, np.zeros(len(mesh.points), np.int64), frames.face)
    rotation, holes = _whole_turns(mesh, rotation)
    handles = handle_cocycles(mesh)
    rotation = _around_handles(mesh, rotation, handles, frames.face)
    rotation, _ = FreeOperators(operators).least(rotation, holes + handles, 4)
    theta = _integrated(mesh, rotation)[0]
    part = mesh.components[mesh.edges[:, 0]]
    for c in range(len(mesh.component_euler)):
        theta = np.where(part == c, theta + _to_axis(frames, theta, part == c), theta)
    return theta


def _whole_turns(mesh: SurfaceMesh, rotation: Float) -> tuple[Float, list[Float]]:
    """The rotation with whole turns along all loops, and what moves a quarter turn from each to the first of its component."""
    rotation, cocycles = rotation.copy(), []
    through = corner_rotation(mesh, rotation)
    inside = ~mesh.boundary_vertex
    first: dict[int, Bool] = {}
    for loop in mesh.loops:
        c = int(mesh.components[loop[0]])
        if c not in first:
            first[c] = np.zeros(len(mesh.points), bool)
            first[c][loop] = True
            continue
        path = shortest_path(mesh, loop.tolist(), first[c], inside, len(mesh.points))
        cocycles.append(np.zeros(rotation.shape))
        move_index(mesh, cocycles[-1], path, 1)
        quarters = round(float(np.sum(mesh.curvature[loop] - through[loop])) / QUARTER)
        rotation += (quarters - 4 * round(quarters / 4)) * cocycles[-1]
    return rotation, cocycles


def _around_handles(mesh: SurfaceMesh, rotation: Float, handles: list[Float], face: int) -> Float:
    """The rotation with whole turns around the handles."""
    if len(handles) > 2 * _MOST_HANDLES:
        remedy = "give directions instead of angles"
        raise FieldError(f"a surface with {len(handles) // 2} handles has no frame here", entity=(2, face), remedy=remedy)
    off = _integrated(mesh, rotation)[1]
    steps = [_integrated(mesh, rotation + h)[1] - off for h in handles]
    numbers = [np.rint(s / QUARTER).astype(np.int64) for s in (off, *steps)]
    for m in product((0, 1, 2, -1), repeat=len(handles)):
        if not np.any((numbers[0] + sum(k * n for k, n in zip(m, numbers[1:]))) % 4):
            return rotation + sum(k * h for k, h in zip(m, handles))
    raise FieldError("no frame without zeros was found", entity=(2, face), remedy="give directions instead of angles")


def _integrated(mesh: SurfaceMesh, rotation: Float) -> tuple[Float, Float]:
    """Angles (e,) from the edges that turn as `rotation` says along a tree, and how far the turns elsewhere are off (3 m,)."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import breadth_first_order

    a, b = mesh.triangle_edges.ravel(), np.roll(mesh.triangle_edges, -1, axis=1).ravel()
    step = (rotation - np.roll(mesh.edge_direction, -1, axis=1) + mesh.edge_direction).ravel()
    n = len(mesh.edges)
    graph = coo_matrix((np.ones(len(a)), (a, b)), (n, n)).tocsr()
    way = {(i, j): s for i, j, s in zip(a.tolist(), b.tolist(), step.tolist())}
    theta = np.zeros(n)
    for root in np.unique(mesh.components[mesh.edges[:, 0]], return_index=True)[1].tolist():
        order, before = breadth_first_order(graph, root, directed=False)
        angle = {root: 0.0}
        for e, p in zip(order[1:].tolist(), before[order[1:]].tolist()):
            angle[e] = angle[p] + (way[p, e] if (p, e) in way else -way[e, p])
        theta[list(angle)] = list(angle.values())
    return theta, theta[b] - theta[a] - step


def _to_axis(frames: EdgeFrames, theta: Float, own: Bool) -> float:
    """The angle that turns directions `theta` on the edges `own` to the first axis that they can follow on the average."""
    direction = np.exp(1j * theta[own])
    for axis in range(3):
        flat = frames.x[own, axis] + 1j * frames.y[own, axis]
        mean = complex(np.mean(flat * np.conj(direction)))
        if abs(mean) > _NO_MEAN:
            return float(np.angle(mean))
    return 0.0
