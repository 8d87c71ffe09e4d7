"""A cross field as Gmsh views: in a file, and in the current session.

In a file the background triangles are quadratic, with the crosses of the Crouzeix–Raviart form at their mid-side nodes, and all
parts of the field are views on the nodes or elements (see `field_arrays`).  The file is binary: numbers come back bit for bit.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

import gmsh
import numpy as np

from ..errors import MeshError
from ..face_field import FaceField, singularities_of
from ..field_arrays import CELL_ARRAYS, POINT_ARRAYS, quadratic
from ..formats import check_output, temporary_beside
from ..records import Float, Int
from ..source.cells import linear_triangles
from . import session
from .bounds import kept_bounds

__all__ = ["add_field_views", "write_field_views"]

POINT, TRIANGLE6 = 15, 9  # Gmsh's element types
FILE_OPTIONS: dict[str, float] = {
    "Mesh.Binary": 1,
    "Mesh.MshFileVersion": 4.1,
    "Mesh.SaveAll": 1,
    "Mesh.ScalingFactor": 1,
    "PostProcessing.SaveMesh": 0,
}
CROSSES: dict[str, float] = {"VectorType": 1, "GlyphLocation": 2, "CenterGlyphs": 1, "ShowScale": 0}
"""Lines, in the vertices, centred."""


def write_field_views(faces: Sequence[FaceField], path: str | os.PathLike[str]) -> None:
    """Write the field of some faces as a Gmsh mesh with views; the file appears only when it is complete.

    Views: those of `field_arrays`, "v across" (the second arm of the aligned cross), and "singularities" with the index in
    quarter turns on point elements.

    Raises
    ------
    InputError
        For a place that cannot be written to.
    MeshError
        If Gmsh fails.
    """
    place = check_output(path)
    unfinished = temporary_beside(place)
    points, cells, data = quadratic(faces)
    try:
        with session.guest(), kept_bounds(), session.options(**FILE_OPTIONS), session.scratch_model() as name:
            before = set(gmsh.view.getTags().tolist())
            try:
                with session.gmsh_errors(f"writing {os.fspath(path)!r}"):
                    marks = _put_mesh(faces, points, cells, data["face"])
                    gmsh.write(str(unfinished))
                    for view in _model_views(name, faces, data, marks):
                        gmsh.view.write(view, str(unfinished), append=True)
            finally:
                for view in set(gmsh.view.getTags().tolist()) - before:
                    gmsh.view.remove(view)
        if b"$EndElementData" not in unfinished.read_bytes()[-64:]:
            raise MeshError("the field file was not written in full", remedy="free some space on the disk")
        os.replace(unfinished, place)
    finally:
        unfinished.unlink(missing_ok=True)


def add_field_views(faces: Sequence[FaceField]) -> dict[str, int]:
    """Show the field of some faces in the current Gmsh session.

    Returns
    -------
    dict of str -> int
        Tags of the views "v", "v across" (the arms of the aligned crosses), "u" (one arm of the given ones), on triangles between
        the places of the crosses, and "singularities" (points with the index in quarter turns).
    """
    points, cells, data = quadratic(faces)
    corner = linear_triangles([cells])[0]
    out = {}
    with session.gmsh_errors("adding views"):
        for name, arms in (("v", data["v"]), ("v across", _across(faces, data["v"])), ("u", data["u"])):
            out[name] = gmsh.view.add(name)
            rows = np.concatenate([points[corner].transpose(0, 2, 1).reshape(-1, 9), arms[corner].reshape(-1, 9)], axis=1)
            gmsh.view.addListData(out[name], "VT", len(rows), rows.ravel())
            for option, value in CROSSES.items():
                gmsh.view.option.setNumber(out[name], option, value)
        found = [(*s.point.tolist(), float(s.index)) for f in faces for s in singularities_of(f)]
        out["singularities"] = gmsh.view.add("singularities")
        gmsh.view.addListData(out["singularities"], "SP", len(found), [x for row in found for x in row])
    return out


def _across(faces: Sequence[FaceField], arms: Float) -> Float:
    """The other arms of crosses at the nodes of all faces."""
    normals = []
    for f in faces:
        own = f.surface.vertex_normal if f.curved else None
        normals += [np.broadcast_to(f.normal, f.points.shape) if own is None else own, f.normals]
    return np.cross(np.concatenate(normals), arms)


def _put_mesh(faces: Sequence[FaceField], points: Float, cells: Int, face: Int) -> list[int]:
    """Put the triangles on discrete surfaces of the current model, and a point element on every singularity: their indices."""
    first, marks = 0, []
    for f in faces:
        n = len(f.points) + len(f.edges)
        mine = np.flatnonzero(face == f.face)
        gmsh.model.addDiscreteEntity(2, f.face)
        gmsh.model.mesh.addNodes(2, f.face, np.arange(first, first + n) + 1, points[first : first + n].ravel())
        gmsh.model.mesh.addElementsByType(f.face, TRIANGLE6, mine + 1, (cells[mine] + 1).ravel())
        for s in singularities_of(f):
            node = first + int(np.linalg.norm(f.points - s.point, axis=1).argmin())
            marks.append(s.index)
            gmsh.model.addDiscreteEntity(0, len(marks))
            gmsh.model.mesh.addElementsByType(len(marks), POINT, [len(cells) + len(marks)], [node + 1])
        first += n
    return marks


def _model_views(name: str, faces: Sequence[FaceField], data: dict[str, Any], marks: list[int]) -> list[int]:
    """Tags of the views of all arrays on the mesh of model `name`; the last ones are on elements."""
    elements = len(data["face"])
    nodes = np.arange(len(data["v"])) + 1
    rows = [(key, "NodeData", nodes, data[key]) for key in POINT_ARRAYS]
    rows.append(("v across", "NodeData", nodes, _across(faces, data["v"])))
    if marks:
        rows.append(("singularities", "ElementData", elements + 1 + np.arange(len(marks)), np.array(marks)))
    rows += [(key, "ElementData", np.arange(elements) + 1, data[key]) for key in CELL_ARRAYS]
    out = []
    for title, kind, tags, values in rows:
        out.append(gmsh.view.add(title))
        parts = 1 if values.ndim == 1 else values.shape[1]
        gmsh.view.addHomogeneousModelData(out[-1], 0, name, kind, tags, np.asarray(values, float).ravel(), 0.0, parts)
    return out
