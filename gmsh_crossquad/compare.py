"""Judging a surface mesh against the model that it is a mesh of.

Every CAD vertex is a node, every edge with a single cell follows a curve at which the model's faces end, the area is the
model's, and every physical group is carried in full.
"""

from __future__ import annotations

from dataclasses import asdict, replace
from typing import TYPE_CHECKING

import numpy as np

from .check import TOUCH, Report, free_edges
from .records import Float, Int, Model

if TYPE_CHECKING:
    from .cad.files import MeshArrays

__all__ = ["compare"]

_MEASURE = 0.02
"""Relative difference of a length or area that a mesh may have from its model, besides the segments cut off by chords."""


def compare(report: Report, mesh: MeshArrays, model: Model, groups: dict[tuple[int, str], tuple[int, ...]]) -> Report:
    """Add what is wrong with respect to the model.

    Parameters
    ----------
    report : Report
    mesh : MeshArrays
    model : Model
    groups : dict of (dim, name) -> entity tags
        The model's physical groups.

    Returns
    -------
    Report
    """
    from .spatial import cKDTree

    faults = list(report.faults)
    used = np.unique(np.concatenate([mesh.quads.ravel(), mesh.triangles.ravel()]))
    if not len(used):
        return report
    points = (mesh.points - model.origin) / model.scale
    tree = cKDTree(points[used])
    wanted = np.flatnonzero(model.vertex_tags >= 0)
    missed = int(np.count_nonzero(np.asarray(tree.query(model.vertices[wanted])[0]) > TOUCH))
    if missed:
        faults.append(f"{missed} CAD vertices are no nodes")
    loose = _loose_edges(points, free_edges(mesh), model)
    if loose:
        faults.append(f"{loose} edges with one cell are not on the boundary of the model")
    areas = np.array([_face_area(model, row) for row in range(len(model.faces))])
    area = _cell_areas(points, mesh)
    if abs(area.sum() - areas.sum()) > _MEASURE * areas.sum() + _cut_off(points, mesh):
        faults.append(f"the area is {area.sum() * model.scale**2:.6g} and not {areas.sum() * model.scale**2:.6g}")
    if mesh.groups:
        faults += _lost_groups(mesh, model, groups, areas)
    return Report(**{**asdict(report), "hanging": max(report.hanging, loose), "faults": tuple(faults), "groups": report.groups})


def _cell_areas(points: Float, mesh: MeshArrays) -> Float:
    q, t = points[mesh.quads], points[mesh.triangles]
    quads = 0.5 * np.linalg.norm(np.cross(q[:, 2] - q[:, 0], q[:, 3] - q[:, 1]), axis=1)
    return np.concatenate([quads, 0.5 * np.linalg.norm(np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]), axis=1)])


def _cut_off(points: Float, mesh: MeshArrays) -> float:
    """Bound on the area between the boundary of the cells and the curves that it follows.

    A chord of length l cuts a segment of about l^3 / (12 r) from a circle of radius r: at most l^2 / 12 where it turns by no
    more than a radian.
    """
    edges = free_edges(mesh)
    return float(((points[edges[:, 1]] - points[edges[:, 0]]) ** 2).sum()) / 12


def _face_area(model: Model, row: int) -> float:
    """Area (scaled) inside the loops of a face."""
    face = model.faces[row]
    total = 0.0
    for loop in face.loops:
        for curve, sign in loop:
            p = face.local(model.curves[curve].points)[::sign]
            total += 0.5 * float(np.sum(p[:-1, 0] * p[1:, 1] - p[1:, 0] * p[:-1, 1]))
    return total


def _loose_edges(points: Float, edges: Int, model: Model) -> int:
    """Edges with a single cell whose ends are not both on one of the curves that bound one face only."""
    uses = np.zeros(len(model.curves), np.int64)
    for face in model.faces:
        for loop in face.loops:
            for curve, _ in loop:
                uses[curve] += 1
    a = np.concatenate([c.points[:-1] for c, u in zip(model.curves, uses, strict=True) if u == 1] or [np.zeros((0, 3))])
    b = np.concatenate([c.points[1:] for c, u in zip(model.curves, uses, strict=True) if u == 1] or [np.zeros((0, 3))])
    if not len(edges):
        return 0
    if not len(a):
        return len(edges)
    ends = np.unique(edges)
    on = np.zeros(len(points), bool)
    on[ends] = _distance(points[ends], a, b) < 1e-5
    return int(np.count_nonzero(~on[edges].all(axis=1)))


def _distance(points: Float, a: Float, b: Float) -> Float:
    """Distance of points (n, 3) from the segments a-b, each cut into pieces short enough for a nearest-neighbour search."""
    from .spatial import cKDTree

    length = np.linalg.norm(b - a, axis=1)
    pieces = np.maximum(1, np.ceil(length / 0.01).astype(np.int64))
    row = np.repeat(np.arange(len(a)), pieces)
    place = (np.arange(len(row)) - np.repeat(np.cumsum(pieces) - pieces, pieces) + 0.5) / pieces[row]
    tree = cKDTree(a[row] + place[:, None] * (b - a)[row])
    near = row[tree.query(points, k=min(8, len(row)))[1].reshape(len(points), -1)]
    offset, side = points[:, None] - a[near], (b - a)[near]
    t = np.clip(np.einsum("nkc,nkc->nk", offset, side) / np.maximum(length[near] ** 2, np.finfo(float).tiny), 0.0, 1.0)
    return np.linalg.norm(offset - t[..., None] * side, axis=2).min(axis=1)


def _lost_groups(mesh: MeshArrays, model: Model, groups: dict[tuple[int, str], tuple[int, ...]], areas: Float) -> list[str]:
    """Physical groups of curves and surfaces whose measure the mesh does not carry."""
    points = (mesh.points - model.origin) / model.scale
    cell = _cell_areas(points, mesh)
    cell_entity = np.concatenate([mesh.quad_entity, mesh.triangle_entity])
    line = np.linalg.norm(points[mesh.lines[:, 1]] - points[mesh.lines[:, 0]], axis=1)
    truth = {
        1: {c.tag: c.length for c in model.curves},
        2: {f.tag: float(a) for f, a in zip(model.faces, areas, strict=True)},
    }
    found = {1: (line, mesh.line_entity), 2: (cell, cell_entity)}
    faults = []
    for (dim, name), entities in sorted(groups.items()):
        if dim not in truth:
            continue
        expected = sum(truth[dim].get(e, 0.0) for e in entities)
        measure, owner = found[dim]
        carriers = mesh.groups.get((dim, name), ())
        actual = float(measure[np.isin(owner, carriers)].sum())
        tolerance = _MEASURE * expected
        if dim == 2:
            quads, triangles = np.isin(mesh.quad_entity, carriers), np.isin(mesh.triangle_entity, carriers)
            tolerance += _cut_off(points, replace(mesh, quads=mesh.quads[quads], triangles=mesh.triangles[triangles]))
        if abs(actual - expected) > tolerance:
            faults.append(f"the physical {'curve' if dim == 1 else 'surface'} {name!r} is not carried in full")
    return faults
