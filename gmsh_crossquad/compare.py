"""Judging a surface mesh against the model that it is a mesh of.

Every CAD vertex is a node, every edge with a single cell follows a curve at which the model's faces end and these curves are
followed by such edges, the nodes lie on the faces, the area is the model's, and every physical group is carried in full.
"""

from __future__ import annotations

from dataclasses import asdict, replace
from typing import TYPE_CHECKING

import numpy as np

from .check import TOUCH, Report, free_edges
from .records import Curve, Float, Int, Model
from .surfaces import Surfaces

if TYPE_CHECKING:
    from .cad.files import MeshArrays

__all__ = ["compare"]

_MEASURE = 0.02
"""Relative difference of a length or area that a mesh may have from its model, besides the segments cut off by chords."""

_SAMPLES = 200  # of a curve
_ON_CURVE = 1e-5  # of the model: the samples of a curve may be that far from it
_ON_FACE = 1e-5  # of the model
_LOOKED_UP = 2_000  # nodes of surfaces that are none of the model's for which its faces are searched


def compare(
    report: Report,
    mesh: MeshArrays,
    model: Model,
    surfaces: Surfaces,
    groups: dict[tuple[int, str], tuple[int, ...]],
    curved_areas: Float,
) -> Report:
    """Add what is wrong with respect to the model.

    Parameters
    ----------
    report : Report
    mesh : MeshArrays
    model : Model
    surfaces : Surfaces
        Its faces.
    groups : dict of (dim, name) -> entity tags
        The model's physical groups.
    curved_areas : (f,) float64, scaled
        Areas of the curved faces; those of plane ones are inside their loops.

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
    left = _left_curves(points, free_edges(mesh), model)
    if left:
        faults.append("the boundary does not follow curve " + ", ".join(map(str, left)))
    off = _off_faces(points, mesh, model, surfaces)
    if off:
        faults.append(f"{off} nodes are not on the faces of the model")
    areas = np.array([a if f.curved else _face_area(model, row) for row, (f, a) in enumerate(zip(model.faces, curved_areas))])
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


def _off_faces(points: Float, mesh: MeshArrays, model: Model, surfaces: Surfaces) -> int:
    """Nodes of quads that are on no curve and no face of a model with curved ones: of the faces first that with the tag of their
    surface, then any."""
    if not surfaces.curved.any() or not len(mesh.quads):
        return 0
    row = {tag: f for f, face in enumerate(model.faces) for tag in face.tags}
    face = np.repeat([row.get(t, -1) for t in mesh.quad_entity.tolist()], 4)
    node, first = np.unique(mesh.quads.ravel(), return_index=True)
    face = face[first]
    known = np.flatnonzero(face >= 0)
    far = np.ones(len(node), bool)
    feet = surfaces.feet(face[known], points[node[known]])
    far[known] = np.linalg.norm(feet - points[node[known]], axis=1) > _ON_FACE
    left = node[far]
    curves = [c for c in model.curves if len(c.points) > 1]
    if len(left) and curves:  # the CAD may have a curve off its faces; its nodes are right on the one as on the others
        ends = np.concatenate([c.points[:-1] for c in curves]), np.concatenate([c.points[1:] for c in curves])
        left = left[_distance(points[left], *ends)[0] > _ON_CURVE]
    wanted = left[:: max(1, -(-len(left) // _LOOKED_UP))]
    for f in range(len(model.faces)):
        if not len(wanted):
            break
        away = np.linalg.norm(surfaces.feet(np.full(len(wanted), f), points[wanted]) - points[wanted], axis=1)
        wanted = wanted[away > _ON_FACE]
    return len(wanted)


def _ends_of_faces(model: Model) -> list[Curve]:
    """The curves that bound one face once."""
    uses = np.zeros(len(model.curves), np.int64)
    for face in model.faces:
        for loop in face.loops:
            for curve, _ in loop:
                uses[curve] += 1
    return [c for c, u in zip(model.curves, uses, strict=True) if u == 1]


def _loose_edges(points: Float, edges: Int, model: Model) -> int:
    """Edges with a single cell whose ends are not both on one of the curves that bound one face only."""
    curves = _ends_of_faces(model)
    if not len(edges):
        return 0
    if not curves:
        return len(edges)
    a, b = np.concatenate([c.points[:-1] for c in curves]), np.concatenate([c.points[1:] for c in curves])
    ends = np.unique(edges)
    shortest = np.full(len(points), np.inf)
    np.minimum.at(shortest, edges, np.linalg.norm(points[edges[:, 1]] - points[edges[:, 0]], axis=1)[:, None])
    on = np.zeros(len(points), bool)
    on[ends] = _distance(points[ends], a, b)[0] < np.maximum(_ON_CURVE, 0.05 * shortest[ends])
    return int(np.count_nonzero(~on[edges].all(axis=1)))


def _left_curves(points: Float, edges: Int, model: Model) -> list[int]:
    """Tags of curves that bound one face only and stray from the edges with a single cell by more than half of their length."""
    curves = _ends_of_faces(model)
    if not curves or not len(edges):
        return []
    a, b = points[edges[:, 0]], points[edges[:, 1]]
    places = [c.at(np.linspace(0.0, c.length, _SAMPLES)) for c in curves]
    distance, length = _distance(np.concatenate(places), a, b)
    far = np.flatnonzero((distance > 0.5 * length).reshape(len(curves), _SAMPLES).any(axis=1))
    return sorted(curves[i].tag for i in far.tolist())


def _distance(points: Float, a: Float, b: Float) -> tuple[Float, Float]:
    """Distance of points (n, 3) from the nearest segment a-b, and that segment's length.

    The segments are cut into pieces of at most 0.01.  Of every class of pieces of about one length the nearest are looked at, so
    that many short ones do not hide a long one.
    """
    from .spatial import cKDTree

    length = np.linalg.norm(b - a, axis=1)
    pieces = np.maximum(1, np.ceil(length / 0.01).astype(np.int64))
    row = np.repeat(np.arange(len(a)), pieces)
    place = (np.arange(len(row)) - np.repeat(np.cumsum(pieces) - pieces, pieces) + 0.5) / pieces[row]
    middle = a[row] + place[:, None] * (b - a)[row]
    kind = np.floor(np.log2(np.maximum(length / pieces, 1e-12)) / 2)[row]
    distance, nearest = np.full(len(points), np.inf), np.zeros(len(points), np.int64)
    for k in np.unique(kind):
        mine = np.flatnonzero(kind == k)
        near = row[mine[cKDTree(middle[mine]).query(points, k=min(8, len(mine)))[1].reshape(len(points), -1)]]
        offset, side = points[:, None] - a[near], (b - a)[near]
        t = np.clip(np.einsum("nkc,nkc->nk", offset, side) / np.maximum(length[near] ** 2, np.finfo(float).tiny), 0.0, 1.0)
        away = np.linalg.norm(offset - t[..., None] * side, axis=2)
        best = away.argmin(axis=1)[:, None]
        found = np.take_along_axis(away, best, axis=1)[:, 0]
        closer = found < distance
        distance[closer] = found[closer]
        nearest[closer] = np.take_along_axis(near, best, axis=1)[closer, 0]
    return distance, length[nearest]


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
        more = any(e not in truth[dim] for e in entities)  # curves on no face, faces that are not meshed
        if actual < expected - tolerance or (actual > expected + tolerance and not more):
            faults.append(f"the physical {'curve' if dim == 1 else 'surface'} {name!r} is not carried in full")
    return faults
