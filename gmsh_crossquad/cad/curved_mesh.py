"""Triangulate the curved faces of the current Gmsh model.

Gmsh meshes them where they are, with everything it knows about seams, poles and trimmed parameter planes.  The nodes on the
curves are given and put there first; Gmsh meshes only what is still empty: seams, then the faces.  Plane faces are hidden
meanwhile.  The user's mesh and the visibility of entities are put back.  A face where the mesh does not have the given nodes on
its boundary or is no manifold is made again with another algorithm, then in its parameter plane (`parameter_plane`), and at last
as Gmsh would by itself, with the greatest size of the face everywhere.  Around points that must be vertices the triangles are
small from the start; the points are put in afterwards (`curved_seeds`).

Measured: a terrain of 496 nodes on its boundary is not done after 25,000 calls of the size function (ordinary faces make fewer
than 2,000) and takes 0.6 s in its parameter plane.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from types import MappingProxyType

import gmsh
import numpy as np

from ..errors import MeshError
from ..records import Float, Model
from . import session
from .curved_seeds import with_vertices
from .curved_sizes import PER_TURN, Sizes
from .curved_triangles import CurvedMesh, GivenNodes, check, collected, curves_of
from .parameter_plane import parameter_mesh
from .sample import evaluate
from .seeds import InnerPoints

__all__ = ["triangulate_curved"]

ALGORITHMS = (6, 5, 1)  # frontal Delaunay, Delaunay, MeshAdapt; the first two do not end on some surfaces
POINT, LINE = 15, 1
PLAIN = {"Mesh.MeshSizeFromCurvature": 0}
NONE: Mapping[int, InnerPoints] = MappingProxyType({})
OPTIONS: dict[str, float] = {
    "Mesh.AlgorithmSwitchOnFailure": 1,
    "Mesh.ElementOrder": 1,
    "Mesh.IgnorePeriodicity": 1,
    "Mesh.MaxNumThreads1D": 1,
    "Mesh.MaxNumThreads2D": 1,
    "Mesh.MeshOnlyEmpty": 1,
    "Mesh.MeshOnlyVisible": 1,
    "Mesh.MeshSizeExtendFromBoundary": 0,
    "Mesh.MeshSizeFactor": 1,
    "Mesh.MeshSizeFromCurvature": PER_TURN,
    "Mesh.MeshSizeFromParametricPoints": 0,
    "Mesh.MeshSizeFromPoints": 0,
    "Mesh.MeshSizeMax": 1e22,
    "Mesh.MeshSizeMin": 0,
    "Mesh.Optimize": 0,
    "Mesh.RandomFactor": 1e-9,
    "Mesh.RandomSeed": 1,
    "Mesh.RecombineAll": 0,
    "Mesh.Renumber": 0,
    "Mesh.SaveAll": 0,
    "Mesh.Smoothing": 1,
    "Mesh.SubdivisionAlgorithm": 0,
    "General.AbortOnError": 0,
    "General.Terminal": 0,
}


def triangulate_curved(
    model: Model,
    rows: Sequence[int],
    spacing: tuple[Float, ...],
    sizes: Float,
    inner: Mapping[int, InnerPoints] = NONE,
) -> list[CurvedMesh]:
    """Triangles of the faces `rows`.

    Parameters
    ----------
    model : Model
        Of the current Gmsh model.
    rows : sequence of int
        Curved faces.
    spacing : tuple of (k + 1,) float64
        Arc lengths of the nodes of every curve.
    sizes : (f,) float64, scaled
        Greatest size of triangles in every face.
    inner : mapping of int to InnerPoints, optional
        Points inside faces that must be vertices, by row.

    Raises
    ------
    MeshError
        Where no algorithm gives a valid mesh.
    """
    if not rows:
        return []
    done: dict[int, CurvedMesh] = {}
    problem: dict[int, str] = {}
    snapshot = session.MeshSnapshot.take()
    try:
        with session.options(**OPTIONS):
            for plain in (False, True):
                stopped: set[int] = set()
                for algorithm in ALGORITHMS:
                    todo = [r for r in rows if r not in done and r not in stopped]
                    if not todo:
                        break
                    own = {"Mesh.Algorithm": algorithm, **(PLAIN if plain else {})}
                    with session.options(**own), _only(model, todo):
                        given = _generate(model, todo, spacing, sizes, inner, plain)
                    stopped |= {r for r in todo if not given.endless.isdisjoint(model.faces[r].tags)}
                    for row in todo:
                        try:
                            done[row] = _seeded(collected(model, row, spacing, given), inner.get(row))
                        except MeshError as error:
                            problem[row] = error.what
                for row in rows if not plain else []:
                    try:
                        if row not in done:
                            done[row] = _seeded(parameter_mesh(model, row, spacing, float(sizes[row])), inner.get(row))
                    except MeshError:
                        continue  # the next thing to try is more general
    finally:
        snapshot.restore()
    for row in rows:
        if row not in done:
            remedy = "check this surface in Gmsh: it must be able to triangulate it"
            raise MeshError(f"no valid background triangles ({problem[row]})", entity=(2, model.faces[row].tag), remedy=remedy)
    return [done[r] for r in rows]


@contextmanager
def _only(model: Model, rows: Sequence[int]) -> Iterator[None]:
    """Show these faces and their curves only; of curves that the model has left out only seams and joints."""
    known = {c.tag for c in model.curves} | set(model.ignored_curves)
    shown: set[tuple[int, int]] = set()
    for tag in (tag for row in rows for tag in model.faces[row].tags):
        bound = Counter(abs(c) for _, c in gmsh.model.getBoundary([(2, tag)], combined=False, oriented=False))
        shown |= {(2, tag), *((1, c) for c, n in bound.items() if c in known or n % 2 == 0)}
        shown |= set(gmsh.model.mesh.getEmbedded(2, tag))
    with session.visible(shown):
        yield


def _generate(
    model: Model, rows: Sequence[int], spacing: tuple[Float, ...], sizes: Float, inner: Mapping[int, InnerPoints], plain: bool
) -> GivenNodes:
    """Put the given nodes on the curves and let Gmsh mesh what is empty."""
    mesh = gmsh.model.mesh
    used = {c for r in rows for c in curves_of(model, r)}
    vertices = {v for c in used for v in (model.curves[c].start, model.curves[c].end)}
    vertices |= {v for r in rows for v in model.faces[r].embedded_points}
    with session.gmsh_errors("preparing the background mesh"):
        mesh.clear()
        # vertices of the CAD that the model has left out get their node from Gmsh
        for v in sorted(vertices):
            tag = int(model.vertex_tags[v])
            if tag >= 0:
                point = model.vertices[v] * model.scale + model.origin
                mesh.addNodes(0, tag, [v + 1], point)
                mesh.addElementsByType(tag, POINT, [v + 1], [v + 1])
        own_nodes = np.array([len(s) - 2 for s in spacing], np.int64)
        first = len(model.vertices) + 1 + np.cumsum(own_nodes) - own_nodes
        given = GivenNodes(first, len(model.vertices) + int(own_nodes.sum()))
        element = len(model.vertices) + 1
        for c in sorted(used):
            curve, s = model.curves[c], spacing[c]
            tags = given.chain(model, c, len(s))
            at = np.interp(s, curve.arclength, curve.parameters)
            start = 0 if model.vertex_tags[curve.start] < 0 else 1
            own = slice(start, -1)
            if len(tags[own]):
                mesh.addNodes(1, curve.tag, tags[own], evaluate(curve.tag, at[own]).ravel(), at[own])
            ends = np.stack([tags[:-1], tags[1:]], axis=1)
            mesh.addElementsByType(curve.tag, LINE, element + np.arange(len(ends)), ends.ravel())
            element += len(ends)
    before = getattr(gmsh, "api_callback_", None)
    size = Sizes(model, rows, spacing, sizes, inner, plain)
    mesh.setSizeCallback(size)
    try:
        mesh.generate(1)
        mesh.generate(2)
    finally:
        mesh.removeSizeCallback()
        if before is not None:
            gmsh.api_callback_ = before
    return replace(given, endless=size.endless)


def _seeded(mesh: CurvedMesh, inner: InnerPoints | None) -> CurvedMesh:
    """The mesh with the seeds among its vertices."""
    if inner is None or not (inner.seed >= 0).any():
        return mesh
    own = inner.seed >= 0
    fixed = mesh.vertex >= 0
    fixed[mesh.segments] = True
    points, triangles, rows = with_vertices(mesh.points, mesh.triangles, fixed, mesh.segments, inner.points[own])
    more = len(points) - len(mesh.points)
    seed = np.full(len(points), -1)
    seed[rows] = inner.seed[own]
    uv = np.concatenate([mesh.parameters, np.full((more, 2), np.nan)])
    uv[rows] = np.nan
    vertex = np.concatenate([mesh.vertex, np.full(more, -1)])
    out = replace(mesh, points=points, parameters=uv, triangles=triangles, vertex=vertex, seed=seed)
    check(out)
    return out
