"""Triangulate the curved faces of the current Gmsh model.

Gmsh meshes them where they are, with everything it knows about seams, poles and trimmed parameter planes.  The nodes on the
curves are given and put there first; Gmsh meshes only what is still empty: seams, then the faces.  Plane faces are hidden
meanwhile.  The user's mesh and the visibility of entities are put back.  A face where the mesh does not have the given nodes on
its boundary, is no manifold or has the wrong Euler characteristic is made again with another algorithm.  Around points that must
be vertices the triangles are small from the start; the points are put in afterwards (`curved_seeds`).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import gmsh
import numpy as np

from ..errors import MeshError
from ..field.slivers import without_slivers
from ..records import Bool, Float, Int, Model, Parts
from . import session
from .curved_seeds import with_vertices
from .part_meshes import joined, part_nodes, parts_of
from .sample import evaluate
from .seeds import GROWTH, InnerPoints
from .space_size import SpaceSize

__all__ = ["CurvedMesh", "triangulate_curved"]

ALGORITHMS = (6, 5, 1)  # frontal Delaunay, Delaunay, MeshAdapt; the first two do not end on some surfaces
PER_TURN = 16  # triangles per full turn of the surface
MOST_TRIANGLES, FEW_TRIANGLES = 8_000.0, 250.0  # in the model, and of a face of a large one, because of curvature
MOST_CALLS, ENDLESS = 25_000, 1e22  # of the size function for a face, before it is told to stop; the size that tells it
POINT, LINE, TRIANGLE, QUAD = 15, 1, 2, 3
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


@dataclass(frozen=True)
class CurvedMesh:
    """Triangles of a curved face.

    Attributes
    ----------
    points : (n, 3) float64, scaled
    parameters : (n, 2) float64
        NaN where Gmsh gives none.
    triangles : (m, 3) int64
        Oriented as the CAD normal.
    vertex : (n,) int64
        Row of `Model.vertices` or -1.
    segments : (k, 2) int64; curve : (k,) int64; arclength : (k, 2) float64
        Segments of all curves of the face, in the direction of their curve, as in `outline.Outline`.
    seed : (n,) int64
        Row of the face's seeds or -1; all -1 where it is left out.
    parts : Parts or None
        Of a face that is made of several.
    """

    points: Float
    parameters: Float
    triangles: Int
    vertex: Int
    segments: Int
    curve: Int
    arclength: Float
    seed: Int = field(default_factory=lambda: np.zeros(0, np.int64))
    parts: Parts | None = None

    def __post_init__(self) -> None:
        if not len(self.seed):
            object.__setattr__(self, "seed", np.full(len(self.points), -1))


@dataclass(frozen=True)
class _Given:
    """The nodes that are given: tags from 1 on, vertices first, then those inside every curve."""

    first: Int  # tag of the first inner node of every curve
    count: int
    endless: frozenset[int] = frozenset()  # faces whose mesher had to be stopped

    def chain(self, model: Model, row: int, nodes: int) -> Int:
        """Tags of all `nodes` nodes of a curve."""
        curve = model.curves[row]
        inner = self.first[row] + np.arange(nodes - 2)
        return np.concatenate([[curve.start + 1], inner, [curve.end + 1]])


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
        with session.options(**OPTIONS), _only(model, rows):
            for algorithm in ALGORITHMS:
                todo = [r for r in rows if r not in done]
                if not todo:
                    break
                with session.options(**{"Mesh.Algorithm": algorithm}):
                    given = _generate(model, todo, spacing, sizes, inner)
                for row in todo:
                    try:
                        done[row] = _seeded(_collect(model, row, spacing, given), inner.get(row))
                    except MeshError as error:
                        problem[row] = error.what
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
    model: Model, rows: Sequence[int], spacing: tuple[Float, ...], sizes: Float, inner: Mapping[int, InnerPoints]
) -> _Given:
    """Put the given nodes on the curves and let Gmsh mesh what is empty."""
    mesh = gmsh.model.mesh
    used = {c for r in rows for c in _curves(model, r)}
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
        given = _Given(first, len(model.vertices) + int(own_nodes.sum()))
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
    limit, floor = _limits(model, rows, sizes)
    least, lowest = min(limit.values()), min(floor.values())
    near = {model.faces[r].tag: _curve_sizes(model, _curves(model, r), spacing) for r in rows}
    before = getattr(gmsh, "api_callback_", None)

    around = _around(model, rows, inner)
    asked: Counter[int] = Counter()

    def size(dim: int, tag: int, x: float, y: float, z: float, lc: float) -> float:
        if dim == 2:
            asked[tag] += 1
            if asked[tag] > MOST_CALLS:
                return ENDLESS
            if tag not in near:
                return least
            wanted = near[tag](x, y, z, min(max(lc, floor[tag]), limit[tag]))
        else:  # seams: the size from curvature vanishes at an apex
            wanted, tag = min(max(lc, lowest), least), 0
        if tag in around:
            places, most = around[tag]
            away = np.sqrt(((places - (x, y, z)) ** 2).sum(axis=1))
            wanted = min(wanted, float((most + GROWTH * away).min()))
        return wanted

    mesh.setSizeCallback(size)
    try:
        mesh.generate(1)
        mesh.generate(2)
    finally:
        mesh.removeSizeCallback()
        if before is not None:
            gmsh.api_callback_ = before
    return replace(given, endless=frozenset(tag for tag, count in asked.items() if count > MOST_CALLS))


def _around(model: Model, rows: Sequence[int], inner: Mapping[int, InnerPoints]) -> dict[int, tuple[Float, Float]]:
    """Places and greatest sizes of the points inside, in the user's units, by face tag; of all faces by 0."""
    out = {}
    for r in rows:
        if r in inner and len(inner[r].points):
            places = model.origin + model.scale * inner[r].points, model.scale * inner[r].size
            out.update(dict.fromkeys(model.faces[r].tags, places))
    if out:
        own = [out[model.faces[r].tag] for r in rows if model.faces[r].tag in out]
        places, sizes = zip(*own, strict=True)
        out[0] = np.concatenate(places), np.concatenate(sizes)
    return out


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
    _check(out)
    return out


def _curve_sizes(model: Model, rows: Sequence[int], spacing: tuple[Float, ...]) -> SpaceSize:
    """Sizes that the nodes on the curves `rows` ask for, in the user's units."""
    points, sizes = [np.zeros((0, 3))], [np.zeros(0)]
    for c in rows:
        step = np.diff(spacing[c]) * model.scale
        points.append(model.curves[c].at(spacing[c]) * model.scale + model.origin)
        sizes.append(0.5 * (np.concatenate([step[:1], step]) + np.concatenate([step, step[-1:]])))
    return SpaceSize(np.concatenate(points), np.concatenate(sizes))


def _limits(model: Model, rows: Sequence[int], sizes: Float) -> tuple[dict[int, float], dict[int, float]]:
    """Greatest size of triangles by face tag, and the size below which the curvature of the surface counts no more."""
    limit = {tag: float(sizes[r]) * model.scale for r in rows for tag in model.faces[r].tags}
    most = max(MOST_TRIANGLES / len(model.faces), FEW_TRIANGLES)
    wanted = {r: float(np.sqrt(2.3 * model.faces[r].area / most)) * model.scale for r in rows}
    floor = {tag: wanted[r] for r in rows for tag in model.faces[r].tags}
    return limit, {tag: min(size, limit[tag]) if np.isfinite(size) else 0.1 * limit[tag] for tag, size in floor.items()}


def _curves(model: Model, row: int) -> list[int]:
    """Rows of the curves of a face, embedded ones included."""
    face = model.faces[row]
    return list(dict.fromkeys([c for loop in face.loops for c, _ in loop] + list(face.embedded_curves)))


def _collect(model: Model, row: int, spacing: tuple[Float, ...], given: _Given) -> CurvedMesh:
    """The mesh that Gmsh made of a face, checked."""
    face = model.faces[row]
    if face.tag in given.endless:
        raise MeshError("Gmsh's mesher did not end")
    with session.gmsh_errors("reading the background mesh", entity=(2, face.tag)):
        own = [part_nodes(model, tag, _triangles(tag)) for tag in face.tags]
        whole = own[0] if len(own) == 1 else joined(own, [part.turned for part in face.parts])
        parts = parts_of(model, face, own) if face.parts else None
    tags, points, uv, triangles = whole
    # Gmsh counts embedded points neither among the nodes of the face nor among those of its boundary
    inner = np.setdiff1d(np.array(face.embedded_points, np.int64) + 1, tags)
    order = np.argsort(np.concatenate([tags, inner]))
    tags = np.concatenate([tags, inner])[order]
    points = np.concatenate([points, model.vertices[inner - 1]])[order]
    uv = np.concatenate([uv, np.full((len(inner), 2), np.nan)])[order]
    used = np.unique(triangles)
    place = np.searchsorted(tags, used)
    if (tags[np.minimum(place, len(tags) - 1)] != used).any():
        raise MeshError("a triangle has a node that is not of the face")
    points, uv, tags = points[place], uv[place], used
    triangles = np.searchsorted(tags, triangles)
    vertex = np.where(tags <= len(model.vertices), tags - 1, -1)
    segments, curve, arclength = [], [], []
    for c in _curves(model, row):
        s = spacing[c]
        chain = given.chain(model, c, len(s))
        place = np.searchsorted(tags, chain)
        if (tags[np.minimum(place, len(tags) - 1)] != chain).any():
            raise MeshError(f"nodes of curve {model.curves[c].tag} are missing")
        segments.append(np.stack([place[:-1], place[1:]], axis=1))
        curve.append(np.full(len(s) - 1, c))
        arclength.append(np.stack([s[:-1], s[1:]], axis=1))
    for v in face.embedded_points:
        if not np.any(vertex == v):
            raise MeshError("an embedded point is missing")
    out = CurvedMesh(
        points,
        uv,
        triangles,
        vertex,
        np.concatenate(segments) if segments else np.zeros((0, 2), np.int64),
        np.concatenate(curve) if curve else np.zeros(0, np.int64),
        np.concatenate(arclength) if arclength else np.zeros((0, 2)),
        parts=parts,
    )
    _check(out)
    flipped = without_slivers(out.points, out.triangles, out.segments)
    if not np.array_equal(flipped, out.triangles):
        out = replace(out, triangles=flipped)
        _check(out)
    return out


def _triangles(tag: int) -> Int:
    """Triangles (m, 3) of a face, quads cut in two."""
    out = []
    types, _, nodes = gmsh.model.mesh.getElements(2, tag)
    for kind, flat in zip(types, nodes):
        if kind == TRIANGLE:
            out.append(np.asarray(flat, np.int64).reshape(-1, 3))
        elif kind == QUAD:
            q = np.asarray(flat, np.int64).reshape(-1, 4)
            out += [q[:, :3], q[:, [0, 2, 3]]]
    return np.concatenate(out) if out else np.zeros((0, 3), np.int64)


def _check(mesh: CurvedMesh) -> None:
    """Every edge has two triangles, run both ways, or one and lies on a curve; curves are edges.

    Raises
    ------
    MeshError
    """
    n = len(mesh.points)
    half = np.stack([mesh.triangles, np.roll(mesh.triangles, -1, axis=1)], axis=2).reshape(-1, 2)
    directed, count = np.unique(half[:, 0] * n + half[:, 1], return_counts=True)
    if (count > 1).any() or (half[:, 0] == half[:, 1]).any():
        raise MeshError("the triangles are not oriented alike or fold back")
    back = directed % n * n + directed // n
    alone = directed[~np.isin(back, directed)]
    ends = np.sort(mesh.segments, axis=1)
    segment = ends[:, 0] * n + ends[:, 1]
    lone = np.minimum(alone // n, alone % n) * n + np.maximum(alone // n, alone % n)
    if not np.isin(lone, segment).all():
        raise MeshError("a boundary edge is on no curve")
    edges = np.unique(np.minimum(half[:, 0], half[:, 1]) * n + np.maximum(half[:, 0], half[:, 1]))
    if not np.isin(segment, edges).all():
        raise MeshError("a segment of a curve is no edge")


def boundary_of(mesh: CurvedMesh) -> Bool:
    """(k,) segments that have triangles on one side only."""
    n = len(mesh.points)
    half = np.stack([mesh.triangles, np.roll(mesh.triangles, -1, axis=1)], axis=2).reshape(-1, 2)
    key = np.minimum(half[:, 0], half[:, 1]) * n + np.maximum(half[:, 0], half[:, 1])
    values, count = np.unique(key, return_counts=True)
    ends = np.sort(mesh.segments, axis=1)
    out: Bool = count[np.searchsorted(values, ends[:, 0] * n + ends[:, 1])] == 1
    return out
