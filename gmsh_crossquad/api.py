"""`mesh`: the whole pipeline on the user's current Gmsh model, in place; `cross_field`: its first stages alone."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from .arguments import check_options
from .cad.files import is_running
from .cad.high_order import element_order, raise_order
from .cad.joined_surfaces import cad_surfaces
from .cad.put import put_mesh
from .cad.session import MeshSnapshot, gmsh_errors, guest
from .errors import InputError
from .face_field import face_field
from .faces_stage import face_fields
from .field_result import FieldResult
from .result import MeshResult
from .session_options import session_options
from .stages import block_mesh
from .watch import Watch

__all__ = ["cross_field", "mesh"]


def mesh(size: float | None = None, *, progress: Callable[[str], None] | None = None, **options: Any) -> MeshResult:
    """Mesh the current Gmsh model with quads, in place.

    The mesh goes on the model's own entities: physical groups survive, and `gmsh.write` or a 3D mesh on top work as after
    ``gmsh.model.mesh.generate(2)``.  Faces in physical surfaces are meshed where there are any, else all.
    If anything goes wrong, the model's former mesh, the options and the current model are as before.

    Parameters
    ----------
    size : float, optional
        Target edge length in the model's units; default: the sizes of the model (points, fields, ``Mesh.MeshSizeMax``).
    progress : callable, optional
        Called with the name of every stage when it starts.
    **options
        Further fields of `MeshOptions`: `field`, `boundary_index`, `fix_indices`, `relax`, `order`, `incomplete`,
        `feature_angle`, `max_quads`, `block_size`, `background`.  What is not given here may be set in the model, as ONELAB
        parameters "CrossQuad/...".

    Returns
    -------
    MeshResult

    Raises
    ------
    InputError
        For a bad option, or without an initialized Gmsh session.
    FieldError
        For a cross field that cannot be used.
    GeometryError
        For a model that cannot be meshed as it is.
    LayoutError, MeshError
        If no mesh was found.
    """
    check_options(size=size, **options)
    _check_session()
    watch = Watch(progress)
    with guest():
        checked = session_options(size=size, **options)
        order, incomplete = element_order(checked.order, checked.incomplete)
        snapshot = MeshSnapshot.take()
        try:
            snapshot.clear()
            stages = block_mesh(checked, watch)
            with watch.stage("put"), gmsh_errors("putting the mesh on the model"):
                put_mesh(stages.model, stages.mesh)
            raised: tuple[str, ...] = ()
            if order > 1:
                with watch.stage("order"):
                    surfaces = cad_surfaces(stages.model, stages.meshes)
                    raised = raise_order(stages.model, surfaces, stages.mesh, order, incomplete=incomplete)
        except BaseException:
            snapshot.restore()
            raise
    notes = tuple(dict.fromkeys((*stages.notes, *stages.mesh.notes, *raised)))
    return MeshResult(stages, dict(watch.seconds), notes, order, incomplete)


def cross_field(size: float | None = None, *, progress: Callable[[str], None] | None = None, **options: Any) -> FieldResult:
    """The aligned cross field of the current Gmsh model; model and mesh stay as they are.

    Parameters
    ----------
    size, progress, **options
        As for `mesh`.

    Returns
    -------
    FieldResult

    Raises
    ------
    CrossQuadError
        As for `mesh`.
    """
    check_options(size=size, **options)
    _check_session()
    watch = Watch(progress)
    with guest():
        model, meshes, fields, notes = face_fields(session_options(size=size, **options), watch)
    faces = tuple(face_field(model, m, a) for m, a in zip(meshes, fields, strict=True))
    return FieldResult(faces, dict(watch.seconds), tuple(dict.fromkeys(notes)))


def _check_session() -> None:
    if not is_running():
        raise InputError("there is no Gmsh session", remedy="call gmsh.initialize() and open a model first")
