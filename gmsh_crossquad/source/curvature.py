"""The cross field of the principal directions of curvature.

The bending of the face (the derivative of its unit normal, from the CAD) is a symmetric tensor in the tangent plane; in the frame
of an edge its deviator ``(W_xx - W_yy)/2 + i W_xy`` has twice the angle of the principal directions, and half the difference of
the principal curvatures as its length.

Where that difference is less than a tenth of the greater of them (umbilic points, parts of spheres), where the surface is flat,
and where the directions turn by more than 36 degrees within a triangle (on twisted surfaces they turn by 90 degrees, which makes
the same cross, in a narrow strip where the curvatures change places), no direction is taken.  There the crosses
``z = exp(4 i theta)`` are filled in smoothly: they are harmonic for the connection Laplacian (`connection`), between the places
where the directions are known and the boundary, which they are aligned with.  A face that is umbilic everywhere has the default
smooth field.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..errors import FieldError
from ..field.connection import ConnectionOperators
from ..field.operators import FieldOperators, factor
from ..field.smooth import from_angles
from ..field.surface_mesh import SurfaceMesh
from ..records import Bool, CrossField, Float
from .checks import COARSE_TURN, check_turns

if TYPE_CHECKING:
    from ..field.edge_frames import EdgeFrames

__all__ = ["Curvature"]

#: difference of the principal curvatures over the greater of them, below which a point is umbilic
_UMBILIC = 0.1
#: greater curvature, over the greatest of the face, below which a point is flat; the same over the reciprocal of its extent
_FLAT = 1e-3
_PLANE = 1e-3


@dataclass(frozen=True)
class Curvature:
    """The principal directions of every face."""

    def points(self) -> Float:
        """None: (0, 3)."""
        return np.zeros((0, 3))

    def on(self, frames: EdgeFrames) -> CrossField | None:
        """The field on one face; None (the smooth field) where all its points are umbilic.

        Raises
        ------
        FieldError
            On a face whose CAD gives no curvature, and where the background triangles are too coarse for the directions.
        """
        if not frames.curved:
            return None
        mesh = frames.surface
        bending = None if frames.bending is None else frames.bending()
        if bending is None or not np.isfinite(bending).all():
            what = "a surface without a parametrization has no principal directions"
            raise FieldError(what, entity=(2, frames.face), remedy="use another cross field there")
        xx, yy, xy = bending.T
        deviator = 0.5 * (xx - yy) + 1j * xy
        greater = np.abs(0.5 * (xx + yy)) + np.abs(deviator)
        known = (2.0 * np.abs(deviator) > _UMBILIC * greater) & (greater > max(_FLAT * float(greater.max()), _PLANE))
        theta = 0.5 * np.angle(deviator)
        known &= ~_quick(mesh, theta, known)
        if not np.any(known):
            return None
        if not np.all(known):
            theta = _filled(mesh, np.where(known, theta, 0.0), known | mesh.boundary_edge)
        return check_turns(frames, from_angles(mesh, theta))


def _quick(mesh: SurfaceMesh, theta: Float, known: Bool) -> Bool:
    """(e,) the edges around triangles with known directions that turn too much to tell which way."""
    turn = np.abs(from_angles(mesh, theta).rotation).max(axis=1)
    near = np.zeros(len(mesh.points), bool)
    near[mesh.triangles[(turn > COARSE_TURN) & known[mesh.triangle_edges].all(axis=1)]] = True
    return near[mesh.edges[:, 0]] | near[mesh.edges[:, 1]]


def _filled(mesh: SurfaceMesh, theta: Float, known: Bool) -> Float:
    """Angles (e,) that are harmonic between the known ones."""
    stiffness = ConnectionOperators(FieldOperators(mesh)).stiffness
    z = np.exp(4j * theta)
    free, given = np.flatnonzero(~known), np.flatnonzero(known)
    right = -(stiffness[free][:, given] @ z[given])
    z[free] = factor(stiffness[free][:, free].tocsc()).solve(right)
    return np.where(known, theta, 0.25 * np.angle(z))
