"""Triangulate the polygons of one face with Gmsh, in a scratch model of its own.

The face is moved and scaled into the square [-1, 1] x [-1, 1], so that Gmsh's absolute tolerances mean the same for every face.
One straight line of the built-in kernel per segment, one element per line: the boundary of the mesh is the outline, node for
node.  The result is checked (orientation, boundary, Euler characteristic, area) and made again with another algorithm where a
check fails.
"""

from __future__ import annotations

import gmsh
import numpy as np

from ..errors import MeshError
from ..records import Float, Int
from . import session
from .outline import Outline
from .size_field import SizeField

__all__ = ["OPTIONS", "triangulate"]

ALGORITHMS = (6, 5, 1)  # frontal Delaunay, Delaunay, MeshAdapt
# the options under which `triangulate` must be called
OPTIONS: dict[str, float] = {
    "Mesh.AlgorithmSwitchOnFailure": 0,
    "Mesh.ElementOrder": 1,
    "Mesh.MaxNumThreads1D": 1,
    "Mesh.MaxNumThreads2D": 1,
    "Mesh.MeshOnlyEmpty": 0,
    "Mesh.MeshOnlyVisible": 0,
    "Mesh.MeshSizeExtendFromBoundary": 0,
    "Mesh.MeshSizeFactor": 1,
    "Mesh.MeshSizeFromCurvature": 0,
    "Mesh.MeshSizeFromParametricPoints": 0,
    "Mesh.MeshSizeFromPoints": 0,
    "Mesh.MeshSizeMax": 1e22,
    "Mesh.MeshSizeMin": 0,
    "Mesh.Optimize": 0,
    "Mesh.RandomFactor": 1e-9,
    "Mesh.RecombineAll": 0,
    "Mesh.Renumber": 1,
    "Mesh.SaveAll": 0,
    "Mesh.Smoothing": 1,
    "Mesh.SubdivisionAlgorithm": 0,
    "General.AbortOnError": 0,
    "Mesh.RandomSeed": 1,
    "General.Terminal": 0,
}


def triangulate(shape: Outline, h_max: float, tag: int) -> tuple[Float, Int]:
    """Triangles of a face.

    Parameters
    ----------
    shape : Outline
    h_max : float
        Greatest size of triangles, in local coordinates.
    tag : int
        Gmsh tag of the face, for errors.

    Returns
    -------
    points : (n, 2) float64
        Local coordinates; the first ones are those of the outline, bit for bit.
    triangles : (m, 3) int64
        Counter-clockwise.

    Raises
    ------
    MeshError
        Where no algorithm gives a valid mesh.
    """
    low, high = shape.points.min(axis=0), shape.points.max(axis=0)
    centre, scale = 0.5 * (low + high), 0.5 * float((high - low).max())
    unit = (shape.points - centre) / scale
    length = np.linalg.norm(unit[shape.segments[:, 1]] - unit[shape.segments[:, 0]], axis=1)
    total = np.bincount(shape.segments.ravel(), np.repeat(length, 2), len(unit))
    count = np.bincount(shape.segments.ravel(), minlength=len(unit))
    known = count > 0
    inner = shape.inner.size / scale
    places = np.concatenate([unit[known], unit[shape.embedded_points]])
    size = SizeField(places, np.concatenate([total[known] / count[known], inner]), h_max / scale)
    problem = ""
    for algorithm in ALGORITHMS:
        try:
            points, triangles = _generate(shape, unit, size, algorithm, tag)
        except MeshError as error:
            problem = error.what
            continue
        problem = _problem(shape, unit, points, triangles)
        if not problem:
            return np.concatenate([shape.points, points[len(unit) :] * scale + centre]), triangles
    raise MeshError(f"no valid background triangles ({problem})", entity=(2, tag), remedy="check the boundary of this surface")


def _generate(shape: Outline, unit: Float, size: SizeField, algorithm: int, tag: int) -> tuple[Float, Int]:
    """One call of Gmsh's mesher."""
    before = getattr(gmsh, "api_callback_", None)
    with (
        session.gmsh_errors("triangulating", entity=(2, tag)),
        session.options(**{"Mesh.Algorithm": algorithm}),
        session.scratch_model(),
    ):
        geo, mesh = gmsh.model.geo, gmsh.model.mesh
        for i, (x, y) in enumerate(unit.tolist()):
            geo.addPoint(x, y, 0.0, 0.0, i + 1)
        for i, (a, b) in enumerate(shape.segments.tolist()):
            geo.addLine(a + 1, b + 1, i + 1)
        loops = [geo.addCurveLoop(((rows + 1) * signs).tolist()) for rows, signs in shape.loops]
        surface = geo.addPlaneSurface(loops)
        geo.synchronize()
        for i in range(len(shape.segments)):
            mesh.setTransfiniteCurve(i + 1, 2)
        if len(shape.embedded):
            mesh.embed(1, (shape.embedded + 1).tolist(), 2, surface)
        if len(shape.embedded_points):
            mesh.embed(0, (shape.embedded_points + 1).tolist(), 2, surface)
        mesh.setSizeCallback(lambda dim, tag, x, y, z, lc: size(x, y))
        try:
            mesh.generate(2)
            tags, coordinates, _ = mesh.getNodes()
            corner_tags, _, _ = mesh.getNodes(0)
            _, nodes = mesh.getElementsByType(2)
        finally:
            mesh.removeSizeCallback()
            if before is not None:
                gmsh.api_callback_ = before  # Gmsh's Python module keeps alive only the last callback, also that of another model
    if len(corner_tags) != len(unit) or not len(nodes) or len(tags) < len(unit):
        raise MeshError("the mesher left nodes out", entity=(2, tag))
    row_of = np.full(int(tags.max()) + 1, -1, np.int64)
    row_of[corner_tags.astype(np.int64)] = np.arange(len(unit))
    others = tags[row_of[tags.astype(np.int64)] < 0].astype(np.int64)
    row_of[others] = len(unit) + np.arange(len(others))
    xy = np.zeros((len(tags), 2))
    xy[row_of[tags.astype(np.int64)]] = coordinates.reshape(-1, 3)[:, :2]
    if not np.allclose(xy[: len(unit)], unit, rtol=0.0, atol=1e-13):
        raise MeshError("the mesher moved nodes", entity=(2, tag))
    xy[: len(unit)] = unit
    return xy, row_of[nodes.astype(np.int64)].reshape(-1, 3)


def _problem(shape: Outline, unit: Float, points: Float, triangles: Int) -> str:
    """What is wrong with a mesh, empty where nothing is.  Turns clockwise triangles round as a whole."""
    a, b, c = points[triangles[:, 0]], points[triangles[:, 1]], points[triangles[:, 2]]
    twice = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    if (twice < 0).all():
        triangles[:] = triangles[:, ::-1].copy()
        twice = -twice
    if not (twice > 0).all():
        return "turned triangles"
    if len(np.unique(triangles)) != len(points):
        return "nodes that no triangle uses"
    n = len(points)
    half = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2).reshape(-1, 2)
    directed = half[:, 0] * n + half[:, 1]
    if len(np.unique(directed)) != len(directed):
        return "an edge with two triangles on one side"
    alone = np.setdiff1d(directed, half[:, 1] * n + half[:, 0])
    wanted = []
    for rows, signs in shape.loops:
        p, q = shape.segments[rows].T
        wanted.append(np.where(signs > 0, p * n + q, q * n + p))
    if not np.array_equal(alone, np.sort(np.concatenate(wanted))):
        return "a boundary that is not the outline"
    inner = shape.segments[shape.embedded]
    if not np.isin(inner[:, 0] * n + inner[:, 1], directed).all():
        return "an embedded curve that is not made of edges"
    scale = float(np.ptp(shape.points, axis=0).max()) / 2
    if abs(0.5 * twice.sum() - shape.area / scale**2) > 1e-9 * max(1.0, 0.5 * twice.sum()):
        return "a wrong area"
    edges = len(directed) - (len(directed) - len(alone)) // 2
    touching = len(np.concatenate(wanted)) - len(np.unique(np.concatenate([shape.segments[r].ravel() for r, _ in shape.loops])))
    # every loop is a circle; a vertex where the boundary touches itself counts once as a point and once more per touch
    if n - edges + len(triangles) != 2 - len(shape.loops) - touching:
        return "a wrong Euler characteristic"
    return ""
