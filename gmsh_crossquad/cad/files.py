"""Files through Gmsh: opening a model, writing the mesh of the current model, reading a mesh as arrays.

Gmsh raises an exception at the first error in a .geo file, but stays quiet about an empty or a binary file: a model without
entities is reported by whoever needs some.
"""

from __future__ import annotations

import os
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path

import gmsh
import numpy as np

from ..errors import GeometryError, MeshError
from ..formats import check_input
from ..records import Float, Int
from .discrete import classify
from .onelab import forget_options
from .session import gmsh_errors, options

__all__ = ["MeshArrays", "is_running", "open_model", "physical_groups", "read_mesh", "write_mesh"]

_CORNERS = {1: 2, 8: 2, 26: 2, 2: 3, 9: 3, 21: 3, 3: 4, 10: 4, 16: 4, 36: 4, 15: 1}
"""Corners of Gmsh's lines, triangles, quads (orders 1 to 3) and points, by element type."""
_CURVED = (10, 16, 36)  # quads of order 2 and 3


def is_running() -> bool:
    """Whether a Gmsh session is open in this process."""
    return bool(gmsh.isInitialized())


def open_model(path: str | os.PathLike[str]) -> None:
    """Open a file as a new model of the current session.

    Raises
    ------
    GeometryError
        With Gmsh's message, if Gmsh cannot read it.
    """
    check_input(path)
    forget_options()
    with options(**{"General.AbortOnError": 2}):
        try:
            gmsh.open(os.fspath(path))
            if not gmsh.model.getEntities():
                gmsh.model.occ.synchronize()
            if any(gmsh.model.getType(*entity).startswith("Partition") for entity in gmsh.model.getEntities()):
                gmsh.model.mesh.unpartition()  # parts of a mesh, not of the geometry
            classify()
        except Exception as error:
            if type(error) is not Exception:
                raise
            message = " ".join((str(error) or gmsh.logger.getLastError()).split())
            raise GeometryError(f"Gmsh cannot read {os.fspath(path)!r} ({message})", remedy="correct the file") from error


def write_mesh(path: str | os.PathLike[str]) -> None:
    """Write the mesh of the current model in the format of the extension, with Gmsh's rule for physical groups.

    Gmsh saves the elements in physical groups where there are any.  A model with groups of points and curves only would be
    saved without a single quad, an extruded one with groups of surfaces only without hexahedra: there everything is saved.

    Raises
    ------
    MeshError
        If the file cannot be written in full.
    """
    highest = 3 if len(gmsh.model.mesh.getElementTypes(3)) else 2
    save_all = 1.0 if not gmsh.model.getPhysicalGroups(highest) else gmsh.option.getNumber("Mesh.SaveAll")
    if Path(path).suffix.lower() == ".vtu":
        from .vtu_mesh import write_vtu_mesh

        write_vtu_mesh(path, bool(save_all))
    else:
        with options(**{"Mesh.SaveAll": save_all}), gmsh_errors(f"writing {os.fspath(path)!r}"):
            gmsh.write(os.fspath(path))
    _check_written(path)


def _check_written(path: str | os.PathLike[str]) -> None:
    """A full disk shows in the missing end of the file or at the latest when it is flushed."""
    try:
        with open(path, "rb+") as file:
            size = file.seek(0, os.SEEK_END)
            file.seek(max(0, size - 64))
            tail = file.read()
            os.fsync(file.fileno())
    except OSError as error:
        raise MeshError(f"the mesh could not be written ({error.strerror})", remedy="free some space on the disk") from None
    if size == 0 or (Path(path).suffix.lower().startswith(".msh") and b"$end" not in tail.lower()):
        raise MeshError("the mesh file was not written in full", remedy="free some space on the disk")


@dataclass(frozen=True)
class MeshArrays:
    """A mesh as read from a file; of higher-order elements the corners only.

    Attributes
    ----------
    points : (n, 3) float64
    quads, triangles, lines : (q, 4), (t, 3), (l, 2) int64
    quad_entity, triangle_entity, line_entity : (q,), (t,), (l,) int64
        Gmsh tag of the surface or curve.
    groups : dict of (dim, name) -> tuple of entity tags
        Physical groups; an unnamed one goes by its number.
    physical : dict of (dim, entity tag) -> physical number
        The first group of an entity.
    folded : int
        Quads of order 2 and 3 whose Jacobian is not positive everywhere (Gmsh's "minDetJac").
    """

    points: Float
    quads: Int
    triangles: Int
    lines: Int
    quad_entity: Int
    triangle_entity: Int
    line_entity: Int
    groups: dict[tuple[int, str], tuple[int, ...]]
    physical: dict[tuple[int, int], int]
    folded: int = 0


def physical_groups() -> dict[tuple[int, str], tuple[int, ...]]:
    """Entity tags of the physical groups of the current model, by (dimension, name); an unnamed one goes by its number."""
    groups: dict[tuple[int, str], tuple[int, ...]] = {}
    for dim, tag in gmsh.model.getPhysicalGroups():
        name = gmsh.model.getPhysicalName(dim, tag) or str(tag)
        entities = tuple(int(e) for e in gmsh.model.getEntitiesForPhysicalGroup(dim, tag))
        groups[dim, name] = groups.get((dim, name), ()) + entities
    return groups


def _cells(row: Int, dim: int) -> dict[int, tuple[Int, Int]]:
    """Corners and entity of the elements of a dimension, by number of corners."""
    found = defaultdict(list)
    for _, tag in gmsh.model.getEntities(dim):
        for kind, elements, nodes in zip(*gmsh.model.mesh.getElements(dim, tag), strict=True):
            if kind in _CORNERS:
                corners = row[np.asarray(nodes, np.int64).reshape(len(elements), -1)[:, : _CORNERS[kind]]]
                found[_CORNERS[kind]].append((corners, np.full(len(corners), tag, np.int64)))
    return {k: (np.concatenate([c for c, _ in v]), np.concatenate([e for _, e in v])) for k, v in found.items()}


def read_mesh() -> MeshArrays:
    """The mesh of the current model as arrays.

    Raises
    ------
    MeshError
        If it has no nodes.
    """
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    if not len(tags):
        raise MeshError("there is no mesh", remedy="give a file with a mesh in it")
    tags = np.asarray(tags, np.int64)
    row = np.full(int(tags.max()) + 1, -1, np.int64)
    row[tags] = np.arange(len(tags))
    none = {k: (np.zeros((0, k), np.int64), np.zeros(0, np.int64)) for k in (2, 3, 4)}
    cells = none | _cells(row, 1) | _cells(row, 2)
    physical: dict[tuple[int, int], int] = {}
    for dim, tag in gmsh.model.getPhysicalGroups():
        for entity in gmsh.model.getEntitiesForPhysicalGroup(dim, tag):
            physical.setdefault((dim, int(entity)), int(tag))
    return MeshArrays(
        points=np.asarray(coordinates, float).reshape(-1, 3),
        quads=cells[4][0],
        triangles=cells[3][0],
        lines=cells[2][0],
        quad_entity=cells[4][1],
        triangle_entity=cells[3][1],
        line_entity=cells[2][1],
        groups=physical_groups(),
        physical=physical,
        folded=_folded(),
    )


def _folded() -> int:
    """Number of the quads of order 2 and 3 that have a place without a positive Jacobian."""
    tags = [gmsh.model.mesh.getElementsByType(kind)[0] for kind in gmsh.model.mesh.getElementTypes(2) if kind in _CURVED]
    return sum(int(np.sum(np.asarray(gmsh.model.mesh.getElementQualities(t, "minDetJac")) <= 0.0)) for t in tags)
