"""The background meshes of curved faces as records: cut open, with boundary half-edges and opening angles.

The opening angle of a boundary sector is that between the CAD tangents of its two curve ends, seen along the normal of the
triangles there.  Where these tangents are not in the plane of the normal the surface has none (the apex of a cone); the angle is
then that of the triangles.
"""

from __future__ import annotations

import numpy as np

from ..errors import MeshError
from ..field.surface_mesh import SurfaceMesh
from ..records import FaceMesh, Float, Int, Model
from .curved_mesh import triangulate_curved
from .curved_triangles import CurvedMesh, boundary_of
from .opened import opened
from .seeds import InnerPoints
from .tangents import end_tangents, opening

__all__ = ["curved_meshes"]

STEEP = 0.4  # sine of the angle between a tangent and the surface from which the surface has none


def curved_meshes(
    model: Model, rows: list[int], spacing: tuple[Float, ...], sizes: Float, inner: tuple[InnerPoints, ...] | None = None
) -> list[FaceMesh]:
    """Background meshes of the curved faces `rows`.

    Parameters
    ----------
    model, rows, spacing, sizes
        As for `curved_mesh.triangulate_curved`.
    inner : tuple of InnerPoints, optional
        Points inside every face of the model that must be vertices.

    Raises
    ------
    MeshError
    """
    made = triangulate_curved(model, rows, spacing, sizes, {} if inner is None else {row: inner[row] for row in rows})
    if not made:
        return []
    offset = np.concatenate([[0], np.cumsum([len(m.points) for m in made])])
    points = np.concatenate([m.points for m in made])
    triangles = np.concatenate([m.triangles + o for m, o in zip(made, offset)])
    cuts = np.concatenate([m.segments[~boundary_of(m)] + o for m, o in zip(made, offset)])
    vertex = np.concatenate([m.vertex for m in made])
    parts = opened(points, triangles, cuts, vertex, offset)
    return [_face_mesh(model, row, own, mesh, source) for row, own, (mesh, source) in zip(rows, made, parts, strict=True)]


def _face_mesh(model: Model, row: int, own: CurvedMesh, mesh: SurfaceMesh, source: Int) -> FaceMesh:
    """The record of one face."""
    old = source >= 0
    boundary, curve, arclength = _boundary(own, mesh, source, model.faces[row].tag)
    vertex = np.where(old, own.vertex[np.maximum(source, 0)], -1)
    angle = _opening_angles(model, mesh, boundary, curve, arclength, vertex)
    # a CAD vertex of another face's curve may lie inside this one without belonging to it
    inner = set(model.faces[row].embedded_points)
    alien = (vertex >= 0) & ~mesh.boundary_vertex & ~np.isin(vertex, list(inner) or [-1])
    vertex[alien] = -1
    asked = np.zeros(len(vertex), bool)
    asked[vertex >= 0] = model.vertex_ports[vertex[vertex >= 0]]
    smooth = np.abs(angle - np.pi) < np.pi / 4
    return FaceMesh(
        face=row,
        points=mesh.points,
        triangles=mesh.triangles,
        boundary=boundary,
        boundary_curve=curve,
        boundary_arclength=arclength,
        vertex=vertex,
        opening_angle=angle,
        port=asked & (smooth | ~mesh.boundary_vertex),
        seed=np.where(old, own.seed[np.maximum(source, 0)], -1),
        parameters=np.where(old[:, None], own.parameters[np.maximum(source, 0)], np.nan),
        parts=own.parts,
    )


def _boundary(own: CurvedMesh, mesh: SurfaceMesh, source: Int, tag: int) -> tuple[Int, Int, Float]:
    """Boundary half-edges with their curve and the arc lengths at their ends."""
    half = mesh.half_edges[np.sort(mesh.edge_half_edges[mesh.boundary_edge, 0])]
    if not len(half):
        return half, np.zeros(0, np.int64), np.zeros((0, 2))
    n = len(own.points)
    ends = np.concatenate([own.segments, own.segments[:, ::-1]])
    key = ends[:, 0] * n + ends[:, 1]
    order = np.argsort(key, kind="stable")
    a, b = source[half].T
    wanted = a * n + b
    use = order[np.minimum(np.searchsorted(key[order], wanted), len(key) - 1)]
    if (np.minimum(a, b) < 0).any() or not np.array_equal(key[use], wanted):
        raise MeshError("a boundary edge of the background mesh is on no curve", entity=(2, tag))
    count = len(own.segments)
    s = own.arclength[use % count]
    return half, own.curve[use % count], np.where(use[:, None] < count, s, s[:, ::-1])


def _opening_angles(model: Model, mesh: SurfaceMesh, boundary: Int, curve: Int, arclength: Float, vertex: Int) -> Float:
    """Angles of the boundary sectors at CAD vertices, NaN elsewhere."""
    out = np.full(len(mesh.points), np.nan)
    normal = np.zeros((len(mesh.points), 3))
    p = mesh.points[mesh.triangles]
    across = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    across /= np.maximum(np.linalg.norm(across, axis=1), np.finfo(float).tiny)[:, None]
    for k in range(3):
        np.add.at(normal, mesh.triangles[:, k], across * mesh.corner_angle[:, k, None])
    tangents = {c: end_tangents(model.curves[c]) for c in np.unique(curve).tolist()}
    incoming = {int(v): i for i, v in enumerate(boundary[:, 1])}

    def leaving(half_edge: int, at: int) -> Float:
        c = int(curve[half_edge])
        direction: Float = tangents[c][0 if arclength[half_edge, at] < 0.5 * model.curves[c].length else 1]
        return direction

    for first, v in enumerate(boundary[:, 0].tolist()):
        if vertex[v] < 0:
            continue
        a, b = leaving(first, 0), leaving(incoming[v], 1)
        up = normal[v] / max(float(np.linalg.norm(normal[v])), np.finfo(float).tiny)
        shown = float(mesh.angle_sum[v])
        if max(abs(a @ up), abs(b @ up)) > STEEP:
            out[v] = shown
            continue
        turn = float(np.arctan2(np.cross(a, b) @ up, a @ b - (a @ up) * (b @ up)))
        out[v] = opening(turn + 2 * np.pi * round((shown - turn) / (2 * np.pi)), shown)
    return np.minimum(out, 2 * np.pi)
