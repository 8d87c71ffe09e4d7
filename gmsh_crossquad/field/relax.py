"""Move singularities to where the aligned field is smooth and blocks are not thin.

The smooth field has thick cores and places singularities well, except that it puts some close to holes and corners.  Those
that are too close to the boundary move: every round solves once, moves each of them along its force (see `forces`) by at most
half its clearance, and then away from the boundary to the distance it should keep (see `clearance`).  The index sits at the
vertex nearest to the position so found and is moved by whole quarter turns along edges, so that no round can change what the
indices add up to.

A singularity that a corner would absorb, because the field alone prefers another number of quads there, is not left to the
force: it goes onto the corner's bisector (a geodesic on curved faces), at 0.6 of the length over which the sector is free, and
stays there.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..records import Bool, CrossField, Float, Int
from .align import Aligner
from .clearance import Clearance
from .forces import forces
from .geodesic import geodesic
from .singularities import QUARTER, move_index, singular_vertices, walk
from .surface_mesh import SurfaceMesh
from .tangents import length, tangential

__all__ = ["leave_corners", "relax_singularities"]

#: energy that a quarter-turn singularity gains per factor e of core size
_UNIT = np.pi / 16
_ROUNDS = 8


def leave_corners(
    mesh: SurfaceMesh, clearance: Clearance, rotation: Float, wanted: Int, corners: Int, avoid: Bool
) -> tuple[Float, list[int]]:
    """Put singularities that lie near a corner which would absorb them onto its bisector.

    Parameters
    ----------
    rotation : (m, 3) float64
        With singularities at vertices only.
    wanted : (n,) int64
        Boundary indices.
    corners : (k,) int64
        Boundary vertices to look at.
    avoid : (n,) bool
        Vertices that no singularity may be put on.

    Returns
    -------
    (m, 3) float64, list of int
        The new rotation, and the vertices of singularities that the force would pull back into their corner.
    """
    out = rotation.copy()
    held: list[int] = []
    vertices, index = singular_vertices(mesh, rotation)
    for v in corners.tolist():
        angle = float(mesh.angle_sum[v])
        pull = {sign: attraction(angle, 2 - int(wanted[v]), sign) for sign in (1, -1)}
        signs = [sign for sign in (1, -1) if pull[sign] > -0.25 * _UNIT and np.any(index * sign > 0)]
        if not signs:
            continue
        free, goal = _bisector(mesh, clearance, v)
        distance = length(mesh.points[vertices] - mesh.points[v])
        for sign in signs:
            near = np.flatnonzero((index * sign > 0) & (distance < 0.4 * free) & ~np.isin(vertices, held))
            if not len(near):
                continue
            k = int(near[np.argmin(distance[near])])
            barred = mesh.boundary_vertex | avoid
            barred[np.delete(vertices, k)] = True
            path = walk(mesh, int(vertices[k]), goal, barred)
            move_index(mesh, out, path, int(index[k]))
            vertices[k] = path[-1]
            if pull[sign] > _UNIT:
                held.append(int(vertices[k]))
    return out, held


def _bisector(mesh: SurfaceMesh, clearance: Clearance, corner: int) -> tuple[float, Float]:
    """Length over which the bisector of a corner is free, and the point (d,) at 0.6 of it."""
    origin, angle = mesh.points[corner], float(mesh.angle_sum[corner])
    start = mesh.points[mesh.neighbours(corner)[0]] - origin
    spread, first = float(np.sin(0.5 * min(angle, np.pi))), float(length(start))
    if len(origin) == 3:
        line = geodesic(mesh, corner, 0.5 * angle, 2.0 * clearance.extent)
        free = clearance.free_along(line.at, spread, first)
        return free, line.at(np.array([0.6 * free]))[0]
    bisector = np.arctan2(start[1], start[0]) + 0.5 * angle
    direction = np.array([np.cos(bisector), np.sin(bisector)])
    free = clearance.free_length(origin, direction, spread, first)
    return free, origin + 0.6 * free * direction


def attraction(angle: float, quads: int, sign: int) -> float:
    """Energy per factor e of distance that a corner with `quads` quads loses by absorbing a singularity of this sign.

    A sector of opening angle b with n quads turns the field by ``n pi/2 - b``, which costs ``(n pi/2 - b)^2 / (2 b)``.
    """
    before, after = quads * QUARTER - angle, (quads - sign) * QUARTER - angle
    return (before**2 - after**2) / (2.0 * angle)


def relax_singularities(aligner: Aligner, clearance: Clearance, field: CrossField, held: list[int], avoid: Bool) -> CrossField:
    """Move the singularities that are too close to the boundary to a better place.

    Parameters
    ----------
    aligner : Aligner
    clearance : Clearance
    field : CrossField
        Aligned and harmonic.
    held : list of int
        Singular vertices that do not move.
    avoid : (n,) bool
        Vertices that no singularity may be put on.

    Returns
    -------
    CrossField
        Aligned and harmonic, with as many singularities of the same indices.
    """
    mesh = aligner.mesh
    vertices, index = singular_vertices(mesh, field.rotation)
    here = mesh.points[vertices]
    keep = clearance.wanted(here) if len(here) else np.zeros(0)
    moving = ~np.isin(vertices, held) & (clearance.distance(here)[0] < keep)
    if not np.any(moving):
        return field
    pace = np.full(len(vertices), 0.25)
    previous = np.zeros_like(here)
    for _ in range(_ROUNDS):
        here = mesh.points[vertices]
        clear = clearance.room(here)
        force = tangential(mesh, vertices, forces(mesh, field.rotation, here, 0.9 * clear))
        turned = np.sum(force * previous, axis=1) < 0
        pace = np.where(turned, 0.5 * pace, pace)
        previous = force
        step = force * (pace * clear**2 / (_UNIT * index**2))[:, None]
        step *= np.minimum(1.0, 0.5 * clear / np.maximum(length(step), np.finfo(float).tiny))[:, None]
        goal = here + step
        for _ in range(3):
            depth, away = clearance.distance(goal)
            goal += np.maximum(keep - depth, 0.0)[:, None] * away
        rotation = field.rotation.copy()
        barred = mesh.boundary_vertex | avoid
        barred[vertices] = True
        longest = 0
        for k in np.flatnonzero(moving).tolist():
            path = walk(mesh, int(vertices[k]), goal[k], barred)
            move_index(mesh, rotation, path, int(index[k]))
            barred[vertices[k]] = avoid[vertices[k]]
            vertices[k] = path[-1]
            barred[vertices[k]] = True
            longest = max(longest, len(path) - 1)
        if longest == 0:
            return field
        field = aligner.rotate(replace(field, rotation=rotation)).field
        if longest == 1:
            return field
    return field
