"""Points inside faces at which a cross field is singular: they must be vertices of the background mesh, with room around them.

A point belongs to every plane face that it is in, else to the nearest curved face, where its foot is taken; a point that is off
all faces by more than a hundredth of their size is an error where one of them is curved.

A singularity needs a ring of vertices of its own, with none of the boundary and none of another singularity in it, and triangles
that resolve the field that turns around it.  So the size of the triangles there is at most `ROOM` times the distance to the
nearest curve and to the nearest other such point, also for points that the CAD model embeds; it grows from there as everywhere.

Measured on 160 draws of three points on four domains (two of them, and one and the boundary, 3e-5 to 0.1 of the size apart): with
1/2 a tenth of the rings had another special vertex in them, with 0.4 none; with 0.25 a second ring lies between in 9 of 10 cases,
for 4 % more triangles.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import gmsh
import numpy as np

from ..errors import CrossQuadError, FieldError
from ..records import Bool, Face, Float, Int, Model
from .inside import curve_distance, height, inside
from .session import gmsh_errors

__all__ = ["InnerPoints", "face_seeds", "inner_points", "on_curved"]

ROOM = 0.25
GROWTH = 0.3  # of the size of triangles with the distance
OFF_SURFACE = 0.01  # of the face
EMBEDDED = 1e-6  # of the model: distance of embedded points from their curved face
ON_BOUNDARY = 1e-6  # of the face
ON_PLANE = 1e-6  # of the model
SAME = 1e-9  # of the model
VERTICAL = 1e-6  # sine of the angle between a plane and the third axis


@dataclass(frozen=True)
class InnerPoints:
    """Points inside a face, on no curve of it, that its triangles must have as vertices.

    Attributes
    ----------
    points : (k, 2) or (k, 3) float64
        Local coordinates: embedded CAD points, then seeds.
    vertex : (k,) int64
        Row of `Model.vertices` or -1.
    seed : (k,) int64
        Row of the face's seeds or -1.
    size : (k,) float64
        Greatest size of triangles there.
    """

    points: Float
    vertex: Int
    seed: Int
    size: Float


def face_seeds(model: Model, points: Float, rows: Sequence[int] | None = None, strict: bool = False) -> tuple[Float, ...]:
    """The points that are inside each face.

    Parameters
    ----------
    model : Model
    points : (k, 3) float64
        In the user's coordinates; a third coordinate of NaN stands for "on the face, whatever its height".
    rows : sequence of int, optional
        The faces that are asked for; by default all.
    strict : bool
        Refuse points that are on none of the faces, where one of these is curved.

    Returns
    -------
    tuple of (k_i, 2) or (k_i, 3) float64
        Local coordinates per face, in the order of `points`, without those at the place of an embedded CAD point.

    Raises
    ------
    FieldError
        For a point on the boundary of a face or off all faces, and where a face is curved or stands upright and the third
        coordinate is missing.
    """
    points = np.asarray(points, float).reshape(-1, 3)
    rows = range(len(model.faces)) if rows is None else rows
    out = [np.zeros((0, len(face.axes))) for face in model.faces]
    placed = np.zeros(len(points), bool)
    for row in rows:
        if not model.faces[row].curved:
            out[row] = _in_plane(model, row, points, placed)
    curved = [row for row in rows if model.faces[row].curved]
    if curved and not placed.all():
        _on_curved(model, curved, points[~placed], out, strict)
    return tuple(out)


def _in_plane(model: Model, row: int, points: Float, placed: Bool) -> Float:
    """Local coordinates (k, 2) of the points in a plane face; marks them as `placed`."""
    face = model.faces[row]
    scaled = _lifted(face, (points - model.origin) / model.scale)
    here = np.flatnonzero(np.abs(height(face, scaled)) <= ON_PLANE)
    local = face.local(scaled[here])
    if len(local):
        _refuse_on_boundary(model, row, local)
        within = inside(model, row, local)
        here, local = here[within], local[within]
    placed[here] = True
    for vertex in face.embedded_points:
        local = local[np.linalg.norm(local - face.local(model.vertices[vertex]), axis=1) > SAME]
    return local


def _on_curved(model: Model, rows: list[int], points: Float, out: list[Float], strict: bool) -> None:
    """Put the feet of points on the nearest of the curved faces `rows` into `out`."""
    flat = np.isnan(points[:, 2])
    if flat.any() and strict:
        what, remedy = "a singularity with two coordinates on a curved face", "give three coordinates"
        raise FieldError(what, entity=(2, model.faces[rows[0]].tag), location=points[flat][0, :2].tolist(), remedy=remedy)
    points = points[~flat]
    scaled = (points - model.origin) / model.scale
    away, owner, foot = np.full(len(points), np.inf), np.full(len(points), -1), scaled.copy()
    for row in rows:
        at = _feet(model, row, scaled)
        distance = np.linalg.norm(scaled - at, axis=1) / model.faces[row].extent
        nearer = distance < away  # NaN where there is no foot
        away[nearer], owner[nearer], foot[nearer] = distance[nearer], row, at[nearer]
    far = np.flatnonzero(away > OFF_SURFACE)
    if len(far) and strict:
        size = away[far[0]]
        how = f"the nearest is {100 * size:.3g} % of its size away" if np.isfinite(size) else "and near none"
        tags = ", ".join(str(model.faces[row].tag) for row in rows[:12])
        what, remedy = f"a singularity is on no face, {how}", f"put it on a surface ({tags})"
        raise FieldError(what, location=points[far[0]].tolist(), remedy=remedy)
    for row in rows:
        own = foot[(owner == row) & (away <= OFF_SURFACE)]
        for vertex in model.faces[row].embedded_points:
            own = own[np.linalg.norm(own - model.vertices[vertex], axis=1) > EMBEDDED]
        own = own[[i for i in range(len(own)) if not (np.linalg.norm(own[:i] - own[i], axis=1) <= SAME).any()]]
        _refuse_on_boundary(model, row, own)
        out[row] = own


def on_curved(model: Model, row: int, point: Float) -> bool:
    """Whether a scaled point (3,) is on a curved face."""
    foot = _feet(model, row, point[None])[0]
    return bool(np.linalg.norm(foot - point) <= EMBEDDED)


def _feet(model: Model, row: int, points: Float) -> Float:
    """Nearest points (k, 3) of a curved face, scaled; NaN for those that are far from it or beside it."""
    face = model.faces[row]
    out, away = np.full(points.shape, np.nan), np.full(len(points), np.inf)
    for part in face.parts or (face,):
        foot = _feet_of_part(model, part, 10 * OFF_SURFACE * face.extent, points)
        distance = np.linalg.norm(foot - points, axis=1)
        nearer = distance < away
        out[nearer], away[nearer] = foot[nearer], distance[nearer]
    return out


def _feet_of_part(model: Model, face: Face, reach: float, points: Float) -> Float:
    """Nearest points of one CAD face.

    Only points near the face's box are asked for.  Gmsh's nearest point is one of the whole surface; on faces of OpenCASCADE it
    also tells whether that is in the face.  A face without a parametrization takes the points as they are.
    """
    out = np.full(points.shape, np.nan)
    with gmsh_errors("measuring", entity=(2, face.tag)):
        box = (np.array(gmsh.model.getBoundingBox(2, face.tag)).reshape(2, 3) - model.origin) / model.scale
        near = np.flatnonzero(((points >= box[0] - reach) & (points <= box[1] + reach)).all(axis=1))
        if gmsh.model.getType(2, face.tag).startswith("Discrete"):
            out[near] = points[near]
            return out
        trimmed = (2, face.tag) in gmsh.model.occ.getEntities(2)
    for i in near.tolist():
        x = model.origin + model.scale * points[i]
        try:
            with gmsh_errors("projecting a singularity", entity=(2, face.tag)):
                foot = np.asarray(gmsh.model.getClosestPoint(2, face.tag, x.tolist())[0])
                if not trimmed or gmsh.model.isInside(2, face.tag, foot.tolist()):
                    out[i] = (foot - model.origin) / model.scale
        except CrossQuadError:  # it has no foot there
            continue
    return out


def inner_points(model: Model, sizes: Float, seeds: tuple[Float, ...] | None = None) -> tuple[InnerPoints, ...]:
    """Embedded points and seeds of all faces.

    Parameters
    ----------
    model : Model
    sizes : (f,) float64
        Greatest size of triangles in every face.
    seeds : tuple of (k, 2) or (k, 3) float64, optional
        Local coordinates per face; no two coincide.

    Raises
    ------
    FieldError
        For a seed on the boundary of its face.
    """
    out = []
    for row, face in enumerate(model.faces):
        own = np.zeros((0, len(face.axes))) if seeds is None else np.asarray(seeds[row], float).reshape(-1, len(face.axes))
        vertex = np.array([*face.embedded_points, *[-1] * len(own)], np.int64)
        points = np.concatenate([face.local(model.vertices[list(face.embedded_points)]), own])
        size = np.full(len(points), sizes[row])
        if len(points):
            _refuse_on_boundary(model, row, own)
            size = np.minimum(size, ROOM * np.minimum(curve_distance(model, row, points)[0], _next(points)))
        out.append(InnerPoints(points, vertex, np.arange(len(vertex)) - len(face.embedded_points), size))
    return tuple(out)


def _next(points: Float) -> Float:
    """Distance of every point from the nearest other one, infinite for a single one."""
    from ..spatial import cKDTree

    if len(points) < 2:
        return np.full(len(points), np.inf)
    return np.asarray(cKDTree(points).query(points, k=2)[0])[:, 1]


def _lifted(face: Face, points: Float) -> Float:
    """Scaled points with missing third coordinates filled in from the plane of the face."""
    normal = np.cross(face.axes[0], face.axes[1])
    flat = np.isnan(points[:, 2])
    if not flat.any():
        return points
    if abs(normal[2]) < VERTICAL:
        what = "a singularity with two coordinates on an upright face"
        raise FieldError(what, entity=(2, face.tag), remedy="give three coordinates")
    rise = ((face.origin[:2] - points[:, :2]) @ normal[:2]) / normal[2]
    return np.where(flat[:, None], np.column_stack([points[:, :2], face.origin[2] + rise]), points)


def _refuse_on_boundary(model: Model, row: int, points: Float) -> None:
    face = model.faces[row]
    if not len(points):
        return
    if face.curved:
        extent = face.extent
    else:
        around = np.concatenate([face.local(model.curves[c].points) for c, _ in face.loops[0]])
        extent = float(np.ptp(around, axis=0).max())
    bad = np.flatnonzero(curve_distance(model, row, points)[0] <= ON_BOUNDARY * extent)
    if len(bad):
        place = model.origin + model.scale * face.world(points[bad[:1]])[0]
        remedy = "give it as a boundary index"
        raise FieldError("a singularity on the boundary", entity=(2, face.tag), location=place.tolist(), remedy=remedy)
