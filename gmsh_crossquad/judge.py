"""The work of ``gmsh-crossquad check``: a mesh file by itself (`check`), then against its model (`compare`)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from .check import Report, check_mesh, format_report
from .compare import compare
from .surfaces import Planes

if TYPE_CHECKING:
    from collections.abc import Callable

    from .cad.files import MeshArrays

__all__ = ["check_task"]


def check_task(job: dict[str, Any], emit: Callable[[str], None]) -> dict[str, Any]:
    """The work of ``gmsh-crossquad check``, in the child process: the table as text, and the faults."""
    from .cad.files import open_model, read_mesh
    from .cad.session import guest

    with guest():
        emit("open the mesh")
        open_model(job["mesh"])
        mesh = read_mesh()
        report = check_mesh(mesh)
        if job["model"]:
            emit("open the model")
            open_model(job["model"])
            report = _compared(report, mesh, job.get("feature_angle"))
    return {"table": format_report(report, job["mesh"]), "faults": list(report.faults)}


def _compared(report: Report, mesh: MeshArrays, feature_angle: float | None) -> Report:
    """The report with what is wrong with respect to the current Gmsh model."""
    from .cad.areas import curved_areas
    from .cad.background import background_meshes
    from .cad.files import physical_groups
    from .cad.joined_surfaces import cad_surfaces
    from .cad.read import read_model
    from .options import MeshOptions

    options = MeshOptions(feature_angle=feature_angle)
    model = read_model(options)
    if not any(face.curved for face in model.faces):
        return compare(report, mesh, model, Planes(model), physical_groups(), np.full(len(model.faces), np.nan))
    meshes = background_meshes(model, options)
    surfaces = cad_surfaces(model, meshes)
    return compare(report, mesh, model, surfaces, physical_groups(), curved_areas(model, surfaces, meshes))
