"""The background triangles of a curved face, as a record: collected from Gmsh's mesh and checked.

Every edge must have two triangles, run both ways, or one and lie on a curve; the nodes that were given must all be there.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import gmsh
import numpy as np

from ..errors import MeshError
from ..field.slivers import without_slivers
from ..records import Bool, Float, Int, Model, Parts
from . import session
from .part_meshes import joined, part_nodes, parts_of

__all__ = ["CurvedMesh", "GivenNodes", "boundary_of", "check", "collected", "curves_of"]

TRIANGLE, QUAD = 2, 3


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
class GivenNodes:
    """The nodes that are given: tags from 1 on, vertices first, then those inside every curve."""

    first: Int  # tag of the first inner node of every curve
    count: int
    endless: frozenset[int] = frozenset()  # faces whose mesher had to be stopped

    def chain(self, model: Model, row: int, nodes: int) -> Int:
        """Tags of all `nodes` nodes of a curve."""
        curve = model.curves[row]
        inner = self.first[row] + np.arange(nodes - 2)
        return np.concatenate([[curve.start + 1], inner, [curve.end + 1]])


def curves_of(model: Model, row: int) -> list[int]:
    """Rows of the curves of a face, embedded ones included."""
    face = model.faces[row]
    return list(dict.fromkeys([c for loop in face.loops for c, _ in loop] + list(face.embedded_curves)))


def collected(model: Model, row: int, spacing: tuple[Float, ...], given: GivenNodes) -> CurvedMesh:
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
    for c in curves_of(model, row):
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
    check(out)
    flipped = without_slivers(out.points, out.triangles, out.segments)
    if not np.array_equal(flipped, out.triangles):
        out = replace(out, triangles=flipped)
        check(out)
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


def check(mesh: CurvedMesh) -> None:
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
