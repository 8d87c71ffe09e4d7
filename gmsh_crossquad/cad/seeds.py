"""Points inside faces at which a cross field is singular: they must be vertices of the background mesh, with room around them.

A singularity needs a ring of vertices of its own, with none of the boundary and none of another singularity in it, and triangles
that resolve the field that turns around it.  So the size of the triangles there is at most `ROOM` times the distance to the
nearest curve and to the nearest other such point, also for points that the CAD model embeds; it grows from there as everywhere.

Measured on 160 draws of three points on four domains (two of them, and one and the boundary, 3e-5 to 0.1 of the size apart): with
1/2 a tenth of the rings had another special vertex in them, with 0.4 none; with 0.25 a second ring lies between in 9 of 10 cases,
for 4 % more triangles.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import FieldError
from ..records import Face, Float, Int, Model
from .inside import curve_distance, height, inside

__all__ = ["InnerPoints", "face_seeds", "inner_points"]

ROOM = 0.25
ON_BOUNDARY = 1e-6  # of the face
ON_PLANE = 1e-6  # of the model
SAME = 1e-9  # of the model
VERTICAL = 1e-6  # sine of the angle between a plane and the third axis


@dataclass(frozen=True)
class InnerPoints:
    """Points inside a face, on no curve of it, that its triangles must have as vertices.

    Attributes
    ----------
    points : (k, 2) float64
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


def face_seeds(model: Model, points: Float) -> tuple[Float, ...]:
    """The points that are inside each face.

    Parameters
    ----------
    model : Model
    points : (k, 3) float64
        In the user's coordinates; a third coordinate of NaN stands for "on the face, whatever its height".

    Returns
    -------
    tuple of (k_i, 2) float64
        Local coordinates per face, in the order of `points`, without those at the place of an embedded CAD point.

    Raises
    ------
    FieldError
        For a point on the boundary of a face, and where a face stands upright and the third coordinate is missing.
    """
    points = np.asarray(points, float).reshape(-1, 3)
    out = []
    for row, face in enumerate(model.faces):
        scaled = _lifted(face, (points - model.origin) / model.scale)
        scaled = scaled[np.abs(height(face, scaled)) <= ON_PLANE]
        local = face.local(scaled)
        if len(local):
            _refuse_on_boundary(model, row, local)
            local = local[inside(model, row, local)]
        for vertex in face.embedded_points:
            local = local[np.linalg.norm(local - face.local(model.vertices[vertex]), axis=1) > SAME]
        out.append(local)
    return tuple(out)


def inner_points(model: Model, sizes: Float, seeds: tuple[Float, ...] | None = None) -> tuple[InnerPoints, ...]:
    """Embedded points and seeds of all faces.

    Parameters
    ----------
    model : Model
    sizes : (f,) float64
        Greatest size of triangles in every face.
    seeds : tuple of (k, 2) float64, optional
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
    around = np.concatenate([face.local(model.curves[c].points) for c, _ in face.loops[0]])
    extent = float(np.ptp(around, axis=0).max())
    bad = np.flatnonzero(curve_distance(model, row, points)[0] <= ON_BOUNDARY * extent)
    if len(bad):
        place = model.origin + model.scale * face.world(points[bad[:1]])[0]
        remedy = "give it as a boundary index"
        raise FieldError("a singularity on the boundary", entity=(2, face.tag), location=place.tolist(), remedy=remedy)
