"""Add a pair of opposite singularities where those of the field cannot make it integrable.

Where the flux of the aligned field around a hole does not allow a layout (see `flux`) and its singularities must stay where they
are, or there are none, a pair of +1/4 and -1/4 is put where there is most room.  A pair with the separation p changes the flux
by ``(pi/2) (-d_y alpha_i, d_x alpha_i) . p``: the second partner goes where this helps most, and both then move until the
flux vanishes, while everything else is held.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..records import Bool, CrossField
from .align import Aligner
from .clearance import Clearance
from .flux import Moved, excess, flux_slope, vanish_flux
from .singularities import move_index, shortest_path, singular_vertices
from .tangents import length

__all__ = ["add_pair"]


def add_pair(aligner: Aligner, clearance: Clearance, field: CrossField, held: list[int], avoid: Bool) -> Moved | None:
    """Add a pair of singularities that makes the flux around the holes vanish, as far as a single pair can.

    Parameters
    ----------
    aligner : Aligner
        Of a mesh with holes.
    clearance : Clearance
    field : CrossField
        Aligned and harmonic.
    held : list of int
        Singular vertices that do not move.
    avoid : (n,) bool
        Vertices that no singularity may be put on.

    Returns
    -------
    Moved or None
        With the pair in `start` and `end`; None where the face has no room for one.
    """
    mesh = aligner.mesh
    singular, _ = singular_vertices(mesh, field.rotation)
    free = ~(mesh.boundary_vertex | avoid)
    free[singular] = False
    inside = np.flatnonzero(free)
    if not len(inside) or not aligner.holes:
        return None
    room = clearance.distance(mesh.points[inside])[0]
    for v in singular:
        room = np.minimum(room, 0.5 * length(mesh.points[inside] - mesh.points[v]))
    first = int(inside[np.argmax(room)])
    offset = mesh.points[inside] - mesh.points[first]
    distance = length(offset)
    near = (distance > 0) & (distance < 0.7 * room.max())
    if not np.any(near):
        return None
    energy = aligner.harmonic()[1]
    flux = aligner.flux(field.rotation)[aligner.holes]
    slope = flux_slope(aligner, np.array([first]), np.array([-1]))[:, 0]
    left = [excess(energy, flux + slope @ p) for p in offset[near]]
    second = int(inside[near][np.argmin(left)])
    target = np.zeros(len(mesh.points), bool)
    target[second] = True
    path = shortest_path(mesh, [first], target, free, len(mesh.points))
    if not path:
        return None
    rotation = field.rotation.copy()
    move_index(mesh, rotation, path, -1)
    paired = aligner.rotate(replace(field, rotation=rotation)).field
    return vanish_flux(aligner, clearance, paired, held, avoid)
