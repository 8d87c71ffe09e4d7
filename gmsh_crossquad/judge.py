"""The work of ``gmsh-crossquad check``: a mesh file by itself (`check`), then against its model (`compare`)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from .check import check_mesh, format_report
from .compare import compare

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = ["check_task"]


def check_task(job: dict[str, Any], emit: Callable[[str], None]) -> dict[str, Any]:
    """The work of ``gmsh-crossquad check``, in the child process: the table as text, and the faults."""
    from .cad.files import open_model, physical_groups, read_mesh
    from .cad.session import guest

    with guest():
        emit("open the mesh")
        open_model(job["mesh"])
        mesh = read_mesh()
        report = check_mesh(mesh)
        if job["model"]:
            from .cad.read import read_model
            from .options import MeshOptions

            emit("open the model")
            open_model(job["model"])
            report = compare(report, mesh, read_model(MeshOptions()), physical_groups())
    return {"table": format_report(report, job["mesh"]), "faults": list(report.faults)}
