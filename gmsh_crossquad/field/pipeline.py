"""The field stage of one face: from background triangles to a boundary-aligned cross field."""

from __future__ import annotations

from ..records import AlignedField, CrossField, FaceMesh, Int
from .align import align
from .boundary import correct_boundary
from .corners import boundary_indices
from .operators import FieldOperators
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
        smooth field, whose singularities are adapted to the boundary indices.
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
    if field is None:
        field = smooth_field(surface, operators)
        field = CrossField(field.theta, correct_boundary(surface, field.rotation, wanted))
    field = CrossField(field.theta, snap_to_vertices(surface, field.rotation, mesh.port))
    return align(surface, operators, field, wanted)
