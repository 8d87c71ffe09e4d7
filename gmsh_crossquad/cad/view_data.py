"""The values of a Gmsh view of the session as a cross field.

A view with vectors holds one direction of the cross, with tensors (9 components) principal directions, with scalars angles in
radians from the x axis.  Its values may be its own list of triangles and quadrangles, or lie on the nodes, the elements or the
elements' nodes of a mesh.  Gmsh does not tell which model's mesh that is: it is looked for among all models of the session, by
the tags of its nodes or elements, then by the bounding box that the view has.  Of several time steps the one shown is taken.

A trap of Gmsh 4.15.2: asking for the mesh data of a view that has a list ends the process, so the list is asked for first.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import gmsh
import numpy as np

from ..errors import FieldError, InputError
from ..records import Float, Int
from ..source.samples import Samples
from ..source.values import Kind
from . import session

__all__ = ["shaped", "surface_mesh", "view_samples"]

KINDS: dict[int, Kind] = {1: "angle", 3: "direction", 9: "tensor"}
LETTERS = {"S": 1, "V": 3, "T": 9}
NODES = {2: 3, 3: 4, 9: 6, 16: 8, 10: 9}
"""Nodes of the elements that are used whole; of others the corners."""
SAME_BOX = 1e-6  # of the box


def view_samples(view: int | str) -> Samples:
    """The values of a view of the current Gmsh session.

    Parameters
    ----------
    view : int or str
        Its tag or its name.

    Raises
    ------
    InputError
        If there is no such view.
    FieldError
        If its values are none that can be used.
    """
    names = {int(t): gmsh.view.option.getString(int(t), "Name") for t in gmsh.view.getTags()}
    found = [t for t, name in names.items() if view in (t, name)]
    if len(found) != 1:
        have = ", ".join(f"{t} ({name})" for t, name in names.items()) or "none"
        what = f"there is no view {view}" if not found else f"there are {len(found)} views {view!r}"
        raise InputError(what, remedy=f"the views are: {have}")
    tag = found[0]
    step = int(gmsh.view.option.getNumber(tag, "TimeStep"))
    lists = _lists(tag)
    return _from_lists(tag, step, lists) if lists is not None else _from_model(tag, step)


def _lists(tag: int) -> dict[str, Float] | None:
    """Lists of a view by type, one row per element; None where it has values on a mesh."""
    try:
        types, counts, data = gmsh.view.getListData(tag)
    except Exception as error:
        if type(error) is not Exception:
            raise
        return None
    return {t: np.asarray(d, float).reshape(int(n), -1) for t, n, d in zip(types, counts, data, strict=True) if n}


def _from_lists(tag: int, step: int, lists: dict[str, Float]) -> Samples:
    """Samples of a view with its own triangles (ST, VT, TT) and quadrangles (SQ, VQ, TQ)."""
    used = {t: rows for t, rows in lists.items() if len(t) == 2 and t[0] in LETTERS and t[1] in "TQ"}
    kinds = {LETTERS[t[0]] for t in used}
    if len(kinds) != 1:
        what = "several kinds of values" if kinds else "no triangles or quadrangles"
        raise FieldError(f"view {tag} has {what}", remedy="give one with vectors, tensors or angles on triangles")
    (parts,) = kinds
    points, cells, values, first = [], [], [], 0
    for t, rows in used.items():
        n = 3 if t[1] == "T" else 4
        points.append(rows[:, : 3 * n].reshape(-1, 3, n).transpose(0, 2, 1).reshape(-1, 3))
        start = 3 * n + step * n * parts
        values.append(rows[:, start : start + n * parts].reshape(-1, parts))
        cells.append(first + np.arange(len(rows) * n).reshape(-1, n))
        first += len(rows) * n
    return Samples(np.concatenate(points), cells, shaped(np.concatenate(values), parts), KINDS[parts])


def shaped(values: Float, parts: int) -> Float:
    """Values (n,) of one component, else (n, parts)."""
    return values[:, 0] if parts == 1 else values


def _from_model(tag: int, step: int) -> Samples:
    """Samples of a view with values on a mesh."""
    with session.gmsh_errors(f"reading view {tag}"):
        kind, tags, flat, _, parts = gmsh.view.getHomogeneousModelData(tag, step)
    if not len(tags):
        raise FieldError(f"view {tag} has no values at its time step {step}", remedy="show another step")
    if parts not in KINDS or kind not in ("NodeData", "ElementData", "ElementNodeData"):
        raise FieldError(f"view {tag} has {parts} components ({kind})", remedy="give vectors (3), tensors (9) or angles (1)")
    order = np.argsort(tags, kind="stable")
    numbers = np.asarray(tags, np.int64)[order]
    with _model_of(tag, numbers, kind == "NodeData"):
        node_tags, points, blocks = surface_mesh()
    rows = [np.minimum(np.searchsorted(numbers, nodes if kind == "NodeData" else own), len(numbers) - 1) for own, nodes in blocks]
    given = [numbers[r] == (nodes if kind == "NodeData" else own) for r, (own, nodes) in zip(rows, blocks, strict=True)]
    keep = [g.reshape(len(g), -1).all(axis=1) for g in given]
    cells = [nodes[k] for (_, nodes), k in zip(blocks, keep, strict=True)]
    if not any(map(len, cells)):
        raise FieldError(f"view {tag} has no values on triangles or quadrangles", remedy="give a view on a surface mesh")
    place = np.full(int(node_tags.max()) + 1, -1, np.int64)
    place[node_tags] = np.arange(len(node_tags))
    picked = [r[k] for r, k in zip(rows, keep, strict=True)]
    if kind == "ElementNodeData":  # every element has nodes of its own
        data = gmsh.view.getModelData(tag, step)[2]
        corner = np.concatenate([c.ravel() for c in cells])
        values = [data[i][: c.shape[1] * parts] for r, c in zip(picked, cells, strict=True) for i in order[r].tolist()]
        starts = np.cumsum([0, *(c.size for c in cells)])[:-1]
        alone = [s + np.arange(c.size).reshape(c.shape) for s, c in zip(starts, cells, strict=True)]
        return Samples(points[place[corner]], alone, shaped(np.concatenate(values).reshape(-1, parts), parts), KINDS[parts])
    table = np.asarray(flat, float).reshape(len(numbers), parts)[order]
    used = np.unique(np.concatenate([c.ravel() for c in cells]))
    local = [np.searchsorted(used, c) for c in cells]
    if kind == "NodeData":
        return Samples(points[place[used]], local, shaped(table[np.searchsorted(numbers, used)], parts), KINDS[parts])
    return Samples(points[place[used]], local, shaped(table[np.concatenate(picked)], parts), KINDS[parts], "cells")


def surface_mesh() -> tuple[Int, Float, list[tuple[Int, Int]]]:
    """Tags and places of the nodes of the current model, and of every type of surface elements the tags and nodes (m, k)."""
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    blocks = []
    for kind in gmsh.model.mesh.getElementTypes(2):
        elements, nodes = gmsh.model.mesh.getElementsByType(kind)
        corners = NODES.get(int(kind)) or int(gmsh.model.mesh.getElementProperties(kind)[5])
        if corners in (3, 4, 6, 8, 9):
            blocks.append((np.asarray(elements, np.int64), np.asarray(nodes, np.int64).reshape(len(elements), -1)[:, :corners]))
    return np.asarray(tags, np.int64), np.asarray(coordinates, float).reshape(-1, 3), blocks


@contextmanager
def _model_of(view: int, tags: Int, nodes: bool) -> Iterator[None]:
    """Make the model current whose mesh a view is on."""
    box = np.array([gmsh.view.option.getNumber(view, f"{end}{axis}") for end in ("Min", "Max") for axis in "XYZ"])
    before = gmsh.model.getCurrent()
    fitting: list[tuple[bool, int, str]] = []
    try:
        for name in dict.fromkeys([before, *gmsh.model.list()]):
            gmsh.model.setCurrent(name)
            have = gmsh.model.mesh.getNodes()[0] if nodes else np.concatenate([[0], *gmsh.model.mesh.getElements()[1]])
            if len(have) and np.isin(tags, np.asarray(have).astype(np.int64)).all():
                away = np.abs(np.array(gmsh.model.getBoundingBox(-1, -1)) - box).max()
                fitting.append((bool(away > SAME_BOX * np.abs(box).max()), len(fitting), name))
        if not fitting:
            raise FieldError(f"the mesh of view {view} is in no model of the session", remedy="open the file that has both")
        gmsh.model.setCurrent(min(fitting)[2])
        yield
    finally:
        gmsh.model.setCurrent(before)
