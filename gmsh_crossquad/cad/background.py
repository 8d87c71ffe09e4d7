"""The background triangle mesh of every face.

The nodes on the curves are given (`curve_spacing`), the same for all faces of a curve.  Gmsh triangulates every face
(`triangulate`); the mesh is cut open along embedded curves and where the boundary touches itself (`cut_open`), and split where
the field would have no room (`open_up`).  The opening angle of every boundary sector at a CAD vertex comes from the directions of
the two curve ends that bound it, modulo 2 pi; the mesh only tells which representative it is.
"""

from __future__ import annotations

import numpy as np

from ..errors import MeshError
from ..field.surface_mesh import SurfaceMesh
from ..options import MeshOptions
from ..records import FaceMesh, Float, Int, Model
from . import session
from .bounds import kept_bounds
from .crossings import crossings, without_crossings
from .curved_background import curved_meshes
from .lips import coincident, merged, mirrored
from .opened import opened
from .outline import Outline, outline
from .seeds import InnerPoints, inner_points
from .spacing import curve_spacing, face_sizes
from .tangents import end_directions, opening
from .triangulate import OPTIONS, triangulate

__all__ = ["background_meshes", "face_meshes"]

CROSSING_ROUNDS = 6


def background_meshes(model: Model, options: MeshOptions, seeds: tuple[Float, ...] | None = None) -> tuple[FaceMesh, ...]:
    """Background meshes of all faces; the current Gmsh model and its mesh stay as they are.

    Parameters
    ----------
    model : Model
    options : MeshOptions
        `background` is a factor on all sizes.
    seeds : tuple of (k, 2) float64, optional
        Local coordinates per face of points that must be vertices (`seeds.face_seeds`).

    Returns
    -------
    tuple of FaceMesh
        One per face, in their order; several components where closed embedded curves divide a face.

    Raises
    ------
    MeshError
        Where a face cannot be triangulated.
    FieldError
        For a seed on the boundary of its face.
    """
    sizes = face_sizes(model, options)
    spacing = curve_spacing(model, options, sizes, inner_points(model, sizes, seeds))
    return face_meshes(model, spacing, sizes, seeds)


def face_meshes(
    model: Model, spacing: tuple[Float, ...], sizes: Float, seeds: tuple[Float, ...] | None = None
) -> tuple[FaceMesh, ...]:
    """Background meshes of all faces from given nodes on the curves.

    Parameters
    ----------
    model : Model
    spacing : tuple of (k + 1,) float64
        Arc lengths of the nodes of every curve.
    sizes : (f,) float64
        Greatest size of triangles in every face.
    seeds : tuple of (k, 2) float64, optional
        Local coordinates per face of points that must be vertices.

    Raises
    ------
    MeshError
        Where a face cannot be triangulated.
    FieldError
        For a seed on the boundary of its face.
    """
    points = inner_points(model, sizes, seeds)
    rows = [row for row, face in enumerate(model.faces) if not face.curved]
    curved = [row for row, face in enumerate(model.faces) if face.curved]
    # in the user's model, before the bounding box of a scratch model is that of the session
    out = dict(zip(curved, curved_meshes(model, curved, spacing, sizes, points), strict=True))
    if rows:
        with kept_bounds():
            out.update(zip(rows, _plane_meshes(model, rows, spacing, sizes, points), strict=True))
    return tuple(out[row] for row in range(len(model.faces)))


def _plane_meshes(
    model: Model, rows: list[int], spacing: tuple[Float, ...], sizes: Float, inner: tuple[InnerPoints, ...]
) -> list[FaceMesh]:
    """Background meshes of the plane faces `rows`."""
    whole, shapes, merges = _outlines(model, rows, spacing, inner)
    with session.options(**OPTIONS):
        made = [triangulate(shape, float(sizes[r]), model.faces[r].tag) for shape, r in zip(shapes, rows, strict=True)]
    # everything that follows is done for all faces together
    offset = np.concatenate([[0], np.cumsum([len(p) for p, _ in made])])
    points = np.concatenate([p for p, _ in made])
    triangles = np.concatenate([t + o for (_, t), o in zip(made, offset)])
    cuts = np.concatenate([shape.segments[shape.embedded] + o for shape, o in zip(shapes, offset)])
    vertex = np.full(len(points), -1)
    for shape, o in zip(shapes, offset):
        vertex[o : o + len(shape.vertex)] = shape.vertex
    out = []
    for k, (mesh, source) in enumerate(opened(points, triangles, cuts, vertex, offset)):
        out.append(_face_mesh(model, rows[k], whole[k], merges[k], mesh, source))
    return out


def _outlines(
    model: Model, rows: list[int], spacing: tuple[Float, ...], inner: tuple[InnerPoints, ...]
) -> tuple[list[Outline], list[Outline], list[Int]]:
    """Outlines of the faces `rows`, whole and merged, with the merged points; curves that cross others get more nodes."""
    doubled = coincident(model)
    bad: list[tuple[int, Outline, Int]] = []
    for _ in range(CROSSING_ROUNDS + 1):
        for _, shape, pairs in bad:
            spacing = without_crossings(spacing, shape, pairs)
        nodes = mirrored(model, spacing, doubled)
        whole = [outline(model, row, nodes, inner[row]) for row in rows]
        shapes, merges = zip(*(merged(shape, doubled) for shape in whole), strict=True)
        found = [(row, shape, crossings(shape)) for row, shape in zip(rows, shapes, strict=True)]
        bad = [item for item in found if len(item[2])]
        if not bad:
            return whole, list(shapes), list(merges)
    row, shape, pairs = bad[0]
    face = model.faces[row]
    tags = sorted({model.curves[c].tag for c in shape.curve[pairs[0]]})
    place = model.origin + model.scale * face.world(shape.points[shape.segments[pairs[0, 0], :1]])[0]
    what = f"curve {tags[0]} crosses itself" if len(tags) == 1 else f"curves {tags[0]} and {tags[1]} cross"
    raise MeshError(what, entity=(2, face.tag), location=place, remedy="give them a common point there, or move them apart")


def _face_mesh(model: Model, row: int, shape: Outline, point: Int, mesh: SurfaceMesh, source: Int) -> FaceMesh:
    """The record of one face.

    `point` are the points of the triangulation that the points of the outline became, `source` those that the points of the
    mesh came from, or -1.
    """
    boundary, curve, arclength, start = _boundary(mesh, shape, point, source, model.faces[row].tag)
    vertex, seed = np.full(len(mesh.points), -1), np.full(len(mesh.points), -1)
    for k, inner in enumerate(point[shape.embedded_points].tolist()):
        vertex[source == inner], seed[source == inner] = shape.inner.vertex[k], shape.inner.seed[k]
    vertex[boundary[:, 0]] = shape.vertex[start]
    angle = _opening_angles(model, row, mesh, boundary, curve, arclength, vertex)
    asked = (vertex >= 0) & model.vertex_ports[np.maximum(vertex, 0)]
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
        seed=seed,
    )


def _boundary(mesh: SurfaceMesh, shape: Outline, point: Int, source: Int, tag: int) -> tuple[Int, Int, Float, Int]:
    """Boundary half-edges with their curve, the arc lengths at their ends, and the outline's points at which they start."""
    rows = np.concatenate([rows for rows, _ in shape.loops] + [shape.embedded, shape.embedded])
    sides = [signs for _, signs in shape.loops] + [np.full(len(shape.embedded), side) for side in (1, -1)]
    forward = np.concatenate(sides) > 0
    ends = np.where(forward[:, None], shape.segments[rows], shape.segments[rows][:, ::-1])
    n = len(shape.points)
    key = point[ends[:, 0]] * n + point[ends[:, 1]]
    order = np.argsort(key)
    half = mesh.half_edges[np.sort(mesh.edge_half_edges[mesh.boundary_edge, 0])]
    a, b = source[half].T
    wanted = a * n + b
    use = order[np.minimum(np.searchsorted(key[order], wanted), len(key) - 1)]
    if (np.minimum(a, b) < 0).any() or not np.array_equal(key[use], wanted):
        raise MeshError("a boundary edge of the background mesh is on no curve", entity=(2, tag))
    s = shape.arclength[rows[use]]
    return half, shape.curve[rows[use]], np.where(forward[use, None], s, s[:, ::-1]), ends[use, 0]


def _opening_angles(model: Model, row: int, mesh: SurfaceMesh, boundary: Int, curve: Int, arclength: Float, vertex: Int) -> Float:
    """Angles of the boundary sectors at CAD vertices, NaN elsewhere."""
    out = np.full(len(mesh.points), np.nan)
    outgoing = {v: i for i, v in enumerate(boundary[:, 0].tolist()) if vertex[v] >= 0}
    incoming = {v: i for i, v in enumerate(boundary[:, 1].tolist()) if vertex[v] >= 0}
    direction = end_directions(model, row)

    def leaving(half_edge: int, at: int) -> float:
        """Direction in which the curve of a half-edge leaves its end `at`."""
        c = int(curve[half_edge])
        return direction[c, 0 if arclength[half_edge, at] < 0.5 * model.curves[c].length else 1]

    for v, first in outgoing.items():
        turn = leaving(incoming[v], 1) - leaving(first, 0)
        # the representative nearest to the mesh, but never outside (0, 2 pi]
        turns = round((mesh.angle_sum[v] - turn) / (2 * np.pi))
        out[v] = opening(turn + 2 * np.pi * turns, float(mesh.angle_sum[v]))
    return np.minimum(out, 2 * np.pi)
