"""The field stage of one face: from background triangles to a boundary-aligned cross field."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..records import AlignedField, Bool, CrossField, FaceMesh, Float, Int
from .align import Aligner, align, with_parts
from .boundary import correct_boundary
from .cancel import cancel_pairs
from .clearance import Clearance
from .compatibility import Incompatible, add_singularities, change_boundary, misfits
from .corners import boundary_indices
from .flux import vanish_flux
from .operators import FieldOperators
from .orientation import check_oriented
from .relax import leave_corners, relax_singularities
from .singularities import singular_vertices, snap_to_vertices
from .smooth import smooth_field
from .strong import split_strong
from .surface_mesh import SurfaceMesh, surface_of

__all__ = ["aligned_field"]


def aligned_field(
    mesh: FaceMesh,
    field: CrossField | None = None,
    boundary_index: Int | None = None,
    *,
    keep: bool = True,
    relax: bool = False,
    fix: bool = False,
    split: bool = True,
    prescribed: Bool | None = None,
    epsilon: float | None = None,
) -> AlignedField:
    """The aligned cross field of a face.

    Parameters
    ----------
    mesh : FaceMesh
    field : CrossField, optional
        Any cross field; its singularities are kept.  By default the smooth field, whose singularities are adapted to the boundary
        indices and to the room there is for blocks.
    boundary_index : (n,) int64, optional
        Wanted indices of the boundary vertices in quarter turns; by default from the opening angles of the CAD vertices.
    keep : bool
        Rotate a given field by as little as possible; False: make it harmonic, with the same singularities.
    relax : bool
        Move the singularities of a given field until the flux around every hole vanishes; the field becomes harmonic.
    fix : bool
        Where the singularities of a given field do not fit the boundary indices, change as few as possible (see `compatibility`).
    split : bool
        Share indices of 1/2 and more of a given field among several points, as a mesh needs it (see `strong`).  Those that the
        smooth field has by symmetry, or at the apex of a cone, are shared in any case.
    prescribed : (n,) bool, optional
        Boundary vertices whose index the user chose, which `fix` may change.
    epsilon : float, optional
        Core size of the smooth field's energy, in the units of the mesh; by default it is found by diffusion.

    Returns
    -------
    AlignedField

    Raises
    ------
    Incompatible
        If the indices do not add up.
    GeometryError
        If the triangles are no oriented surface.
    LayoutError
    """
    surface = surface_of(mesh)
    check_oriented(surface)
    operators = FieldOperators(surface)
    wanted = boundary_indices(mesh) if boundary_index is None else boundary_index
    if field is not None:
        return _given(surface, operators, mesh, field, wanted, keep and not relax, relax, fix, split, prescribed)
    aligner = Aligner(surface, operators, wanted)
    smooth = smooth_field(surface, operators, epsilon)
    rotation = snap_to_vertices(surface, correct_boundary(surface, smooth.rotation, wanted), mesh.port)
    current = cancel_pairs(aligner, aligner.rotate(CrossField(smooth.theta, rotation)).field)
    clearance = Clearance(surface, aligner.rims)
    rotation, shared = split_strong(surface, clearance, current.rotation, mesh.port)
    if shared:
        current = aligner.rotate(CrossField(current.theta, rotation)).field
    corners = np.flatnonzero(surface.boundary_vertex & np.isfinite(mesh.opening_angle))
    rotation, held = leave_corners(surface, clearance, current.rotation, wanted, corners, mesh.port)
    current = aligner.rotate(CrossField(current.theta, rotation)).field
    current = relax_singularities(aligner, clearance, current, held, mesh.port)
    return aligner.finish(aligner.rotate(current), current)


def _given(
    surface: SurfaceMesh,
    operators: FieldOperators,
    mesh: FaceMesh,
    field: CrossField,
    wanted: Int,
    keep: bool,
    relax: bool,
    fix: bool,
    split: bool,
    prescribed: Bool | None,
) -> AlignedField:
    """Align a given field: its indices onto vertices, checked against the boundary's, then one solve."""
    rotation = snap_to_vertices(surface, field.rotation)
    corner = surface.boundary_vertex & (mesh.vertex >= 0)
    wrong = misfits(surface, _interior(surface, rotation), wanted, corner)
    added: list[int] = []
    for misfit in wrong:
        if not fix:
            raise Incompatible(misfit, mesh.points)
        own = misfits(surface, _interior(surface, rotation), wanted, corner if prescribed is None else corner & prescribed)
        back = next(m for m in own if m.component == misfit.component)
        if back.eases:
            wanted = change_boundary(wanted, back)
        else:
            clearance = Clearance(surface, [])
            rotation, new = add_singularities(surface, clearance, rotation, misfit)
            added += new
    shared: tuple[tuple[int, int], ...] = ()
    if split:
        rotation, shared = split_strong(surface, Clearance(surface, []), rotation, mesh.port)
    start = CrossField(field.theta, rotation)
    if relax:
        aligned = _relaxed(Aligner(surface, operators, wanted), mesh, start, field)
    else:
        aligned = replace(align(surface, operators, start, wanted, field if keep else None), given=field)
    return replace(aligned, added=tuple(added), split=shared)


def _relaxed(aligner: Aligner, mesh: FaceMesh, start: CrossField, given: CrossField) -> AlignedField:
    """The harmonic field without flux around holes, with singularities near those of `start`."""
    clearance = Clearance(aligner.mesh, aligner.rims)
    moved = vanish_flux(aligner, clearance, aligner.rotate(start).field, [], mesh.port)
    aligned = aligner.finish(aligner.rotate(moved.field), moved.field)
    steps = tuple((int(a), int(b)) for a, b in zip(moved.start, moved.end, strict=True) if a != b)
    return replace(with_parts(aligner.operators, aligned, given), moved=steps)


def _interior(surface: SurfaceMesh, rotation: Float) -> Int:
    """(n,) indices of the interior vertices, 0 on the boundary."""
    vertices, index = singular_vertices(surface, rotation)
    out = np.zeros(len(surface.points), np.int64)
    out[vertices] = index
    return out
