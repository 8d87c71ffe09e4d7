"""`mesh`: the whole pipeline on the user's current Gmsh model, in place."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from .arguments import check_options
from .cad.files import is_running
from .cad.put import put_mesh
from .cad.session import MeshSnapshot, gmsh_errors, guest
from .errors import InputError
from .result import MeshResult
from .stages import Watch, block_mesh

__all__ = ["mesh"]


def mesh(size: float | None = None, *, progress: Callable[[str], None] | None = None, **options: Any) -> MeshResult:
    """Mesh the current Gmsh model with quads, in place.

    The mesh goes on the model's own entities: physical groups survive, and `gmsh.write`, `setOrder` or a 3D mesh on top work
    as after ``gmsh.model.mesh.generate(2)``.  Faces in physical surfaces are meshed where there are any, else all.
    If anything goes wrong, the model's former mesh, the options and the current model are as before.

    Parameters
    ----------
    size : float, optional
        Target edge length in the model's units; default: the sizes of the model (points, fields, ``Mesh.MeshSizeMax``).
    progress : callable, optional
        Called with the name of every stage when it starts.
    **options
        Further fields of `MeshOptions`: `max_quads`, `block_size`, `background`.

    Returns
    -------
    MeshResult

    Raises
    ------
    InputError
        For a bad option, or without an initialized Gmsh session.
    GeometryError
        For a model that cannot be meshed as it is.
    LayoutError, MeshError
        If no mesh was found.
    """
    checked = check_options(size=size, **options)
    if not is_running():
        raise InputError("there is no Gmsh session", remedy="call gmsh.initialize() and open a model first")
    watch = Watch(progress)
    with guest():
        snapshot = MeshSnapshot.take()
        try:
            snapshot.clear()
            stages = block_mesh(checked, watch)
            with watch.stage("put"), gmsh_errors("putting the mesh on the model"):
                put_mesh(stages.model, stages.mesh)
        except BaseException:
            snapshot.restore()
            raise
    return MeshResult(stages, dict(watch.seconds), tuple(dict.fromkeys((*stages.notes, *stages.mesh.notes))))
