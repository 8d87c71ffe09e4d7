"""Triangulate a face in its parameter plane.

For faces that Gmsh's mesher of surfaces does not get done: sides of an extrusion with layers, which it meshes only from the
nodes of the layers, and B-splines with very uneven nodes on their curves.  The nodes on the curves are taken to the parameter
plane of the CAD, which an affine map turns into one where lengths are right on average (the root of the mean first fundamental
form); `triangulate` fills it as any plane face, and the CAD takes the new nodes into space.  There sides are flipped until the
triangles are Delaunay, which makes up for a plane that is stretched.

It works where the parameter plane is not cut open: seams inside the face, whole turns and curves used twice are refused.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import gmsh
import numpy as np

from ..errors import MeshError
from ..field.delaunay import delaunay_flips
from ..records import Float, Model
from . import session
from .bounds import kept_bounds
from .crossings import crossings
from .curved_triangles import CurvedMesh, check, curves_of
from .outline import Outline, outline
from .seeds import InnerPoints
from .triangulate import OPTIONS, triangulate

__all__ = ["parameter_mesh"]

SAMPLES = 12  # a side, of the first fundamental form
OFF = 0.1  # of the distance to the next node: distance of a node from the point of the surface at its parameters


def parameter_mesh(model: Model, row: int, spacing: tuple[Float, ...], size: float) -> CurvedMesh:
    """Triangles of the face `row` of the current Gmsh model.

    Parameters
    ----------
    model : Model
    row : int
    spacing : tuple of (k + 1,) float64
        Arc lengths of the nodes of every curve.
    size : float, scaled
        Greatest size of triangles.

    Raises
    ------
    MeshError
        Where the parameter plane is cut open, or the triangles are not valid.
    """
    face = model.faces[row]
    used = Counter(c for loop in face.loops for c, _ in loop)
    if len(face.tags) > 1 or not used or max(used.values()) > 1 or gmsh.model.getType(2, face.tag).startswith("Discrete"):
        raise MeshError("the face has no parameter plane of its own")
    with session.gmsh_errors("meshing the parameter plane", entity=(2, face.tag)):
        form = _mean_form(model, face.tag)
        inner = _embedded(model, row, size)
        world = outline(model, row, spacing, inner, lambda points: points)
        shape = _flat(world, _parameters(model, row, spacing, world) @ form)
        if shape.area < 0:
            form = form * (1.0, -1.0)
            shape = _flat(world, shape.points * (1.0, -1.0))
        if len(crossings(shape)):
            raise MeshError("the boundary crosses itself in the parameter plane")
        with session.options(**OPTIONS), kept_bounds():
            plane, triangles = triangulate(shape, size, face.tag)
        uv = plane @ np.linalg.inv(form)
        points = (np.asarray(gmsh.model.getValue(2, face.tag, uv.ravel())).reshape(-1, 3) - model.origin) / model.scale
        normal = np.asarray(gmsh.model.getNormal(face.tag, uv.ravel())).reshape(-1, 3)
    given, ends = world.points, world.segments
    step = np.full(len(given), np.inf)
    length = np.linalg.norm(given[ends[:, 1]] - given[ends[:, 0]], axis=1)
    np.minimum.at(step, ends.ravel(), np.repeat(length, 2))
    if (np.linalg.norm(points[: len(given)] - given, axis=1) > OFF * step).any():
        raise MeshError("the nodes of the curves are not where their parameters are")
    p = points[triangles]
    up = np.einsum("ij,ij->i", np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), normal[triangles].sum(axis=1))
    if up.sum() < 0:
        triangles = triangles[:, ::-1]
    vertex = np.concatenate([shape.vertex, np.full(len(points) - len(shape.vertex), -1)])
    triangles = delaunay_flips(points, triangles, shape.segments)
    out = CurvedMesh(points, uv, triangles, vertex, shape.segments, shape.curve, shape.arclength)
    check(out)
    return out


def _mean_form(model: Model, tag: int) -> Float:
    """(2, 2) root of the mean first fundamental form of a surface, in the model's scale."""
    low, high = gmsh.model.getParametrizationBounds(2, tag)
    at = (np.arange(SAMPLES) + 0.5) / SAMPLES
    uv = np.stack(np.meshgrid(*(low[k] + at * (high[k] - low[k]) for k in range(2)), indexing="ij"), axis=-1).reshape(-1, 2)
    d = np.asarray(gmsh.model.getDerivative(2, tag, uv.ravel())).reshape(-1, 2, 3) / model.scale
    values, vectors = np.linalg.eigh(np.einsum("nik,njk->ij", d, d) / len(d))
    if not np.isfinite(values).all() or values[0] <= 1e-12 * values[1]:
        raise MeshError("the surface has no regular parameters")
    root: Float = (vectors * np.sqrt(values)) @ vectors.T
    return root


def _parameters(model: Model, row: int, spacing: tuple[Float, ...], shape: Outline) -> Float:
    """Parameters (n, 2) of the points of an outline on the surface of its face."""
    tag = model.faces[row].tag
    out = np.full((len(shape.points), 2), np.nan)
    for c in curves_of(model, row):
        curve = model.curves[c]
        own = shape.segments[shape.curve == c]
        at = np.interp(spacing[c], curve.arclength, curve.parameters)
        out[np.append(own[:, 0], own[-1, 1])] = np.asarray(gmsh.model.reparametrizeOnSurface(1, curve.tag, at, tag)).reshape(
            -1, 2
        )
    lone = np.isnan(out[:, 0])
    if lone.any():
        world = shape.points[lone] * model.scale + model.origin
        out[lone] = np.asarray(gmsh.model.getParametrization(2, tag, world.ravel())).reshape(-1, 2)
    return out


def _embedded(model: Model, row: int, size: float) -> InnerPoints:
    """The CAD points inside a face; no seeds."""
    vertex = np.array(model.faces[row].embedded_points, np.int64)
    return InnerPoints(model.vertices[vertex], vertex, np.full(len(vertex), -1), np.full(len(vertex), size))


def _flat(world: Outline, plane: Float) -> Outline:
    """An outline in space as one in the plane, where its points are `plane`; the loop with the greatest area comes first."""
    areas = []
    for rows, signs in world.loops:
        p, q = plane[world.segments[rows, 0]], plane[world.segments[rows, 1]]
        areas.append(0.5 * float(np.sum(signs * (p[:, 0] * q[:, 1] - q[:, 0] * p[:, 1]))))
    order = np.argsort(-np.abs(areas), kind="stable")
    return replace(world, points=plane, loops=tuple(world.loops[k] for k in order.tolist()), area=float(sum(areas)))
