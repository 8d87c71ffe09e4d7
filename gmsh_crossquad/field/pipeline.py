"""The field stage of one face: from background triangles to a boundary-aligned cross field."""

from __future__ import annotations

import numpy as np

from ..records import AlignedField, CrossField, FaceMesh, Int
from .align import Aligner, align
from .boundary import correct_boundary
from .cancel import cancel_pairs
from .clearance import Clearance
from .corners import boundary_indices
from .operators import FieldOperators
from .relax import leave_corners, relax_singularities
from .singularities import snap_to_vertices
from .smooth import smooth_field
from .surface_mesh import SurfaceMesh

__all__ = ["aligned_field"]


def aligned_field(mesh: FaceMesh, field: CrossField | None = None, boundary_index: Int | None = None) -> AlignedField:
    """The aligned cross field of a face.

    Parameters
    ----------
    mesh : FaceMesh
    field : CrossField, optional
        Any cross field; its singularities are kept, so they must satisfy Poincaré–Hopf with the boundary indices.  By default the
        smooth field, whose singularities are adapted to the boundary indices and to the room there is for blocks.
    boundary_index : (n,) int64, optional
        Wanted indices of the boundary vertices in quarter turns; by default from the opening angles of the CAD vertices.

    Returns
    -------
    AlignedField

    Raises
    ------
    LayoutError
    """
    surface = SurfaceMesh(mesh.points, mesh.triangles)
    operators = FieldOperators(surface)
    wanted = boundary_indices(mesh) if boundary_index is None else boundary_index
    if field is not None:
        return align(surface, operators, CrossField(field.theta, snap_to_vertices(surface, field.rotation)), wanted)

    aligner = Aligner(surface, operators, wanted)
    smooth = smooth_field(surface, operators)
    rotation = snap_to_vertices(surface, correct_boundary(surface, smooth.rotation, wanted), mesh.port)
    current = cancel_pairs(aligner, aligner.rotate(CrossField(smooth.theta, rotation))[0])
    clearance = Clearance(surface, [aligner.loops[i].vertices for i in aligner.holes])
    corners = np.flatnonzero(surface.boundary_vertex & np.isfinite(mesh.opening_angle))
    rotation, held = leave_corners(surface, clearance, current.rotation, wanted, corners, mesh.port)
    current = aligner.rotate(CrossField(current.theta, rotation))[0]
    current = relax_singularities(aligner, clearance, current, held, mesh.port)
    return aligner.finish(*aligner.rotate(current))
