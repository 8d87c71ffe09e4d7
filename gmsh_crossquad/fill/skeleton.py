"""Positions of everything that bounds the cells: guide vertices and the nodes inside guide edges, in scaled coordinates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..records import Bool, Float, Guide, Int, Model
from ..surfaces import Surfaces
from .numbering import GuideTopology, Numbering
from .tangents import cubic

__all__ = ["Frames", "Skeleton"]


@dataclass(frozen=True)
class Frames:
    """Planes of all faces.

    Attributes
    ----------
    origin : (f, 3) float64, scaled; axes : (f, 2, 3) float64
        NaN for curved faces.
    user_origin : (f, 3) float64; user_axes : (f, 2, 3) float64
        Scaled local coordinates to the user's: ``user_origin + x user_axes[0] + y user_axes[1]``.
    curved : (f,) bool
    scale : float; shift : (3,) float64
        Scaled coordinates to the user's.
    """

    origin: Float
    axes: Float
    user_origin: Float
    user_axes: Float
    curved: Bool
    scale: float
    shift: Float

    @classmethod
    def of(cls, model: Model) -> Frames:
        """Frames of the faces of `model`."""
        none = np.full((2, 3), np.nan)
        origin = np.array([f.origin for f in model.faces], float).reshape(-1, 3)
        axes = np.array([none if f.curved else f.axes for f in model.faces], float).reshape(-1, 2, 3)
        curved = np.array([f.curved for f in model.faces], bool)
        user = origin * model.scale + model.origin, axes * model.scale
        return cls(origin, axes, *user, curved, model.scale, model.origin)

    def user_of_scaled(self, points: Float) -> Float:
        """Points (..., 3) in the user's coordinates of scaled ones."""
        out: Float = points * self.scale + self.shift
        return out

    def local(self, points: Float, face: Int) -> Float:
        """Local coordinates (2, m, ...) of scaled points (m, ..., 3), each m in the plane of its face (m,)."""
        one = (slice(None),) + (None,) * (points.ndim - 2)
        p = points - self.origin[face][one]
        axes = self.axes[face]
        return np.stack([(p * axes[:, d][one]).sum(axis=-1) for d in (0, 1)])

    def user(self, local: Float, face: Int) -> Float:
        """Points (m, ..., 3) in the user's coordinates of local ones (2, m, ...)."""
        one = (slice(None),) + (None,) * (local.ndim - 2)
        origin, axes = self.user_origin[face], self.user_axes[face]
        out = np.empty((*local.shape[1:], 3))
        for c in range(3):
            np.multiply(local[0], axes[:, 0, c][one], out=out[..., c])
            out[..., c] += local[1] * axes[:, 1, c][one]
            out[..., c] += origin[:, c][one]
        return out

    def on_face(self, points: Float, face: Int) -> Float:
        """Scaled points (m, 3) in the user's coordinates; those of plane faces in their planes."""
        out = self.user(self.local(points, face), face)
        curved = self.curved[face]
        if curved.any():
            out[curved] = self.user_of_scaled(points[curved])
        return out


@dataclass(frozen=True)
class Skeleton:
    """Guide vertices (n, 3) and the nodes inside guide edges, from the lower vertex, scaled.

    Node j of edge e (1 <= j < divisions) is row ``first[e] + j - 1`` of `inside`.  The arrays are filled in place.
    """

    vertices: Float
    inside: Float
    first: Int
    divisions: Int

    @classmethod
    def start(cls, guide: Guide, divisions: Int) -> Skeleton:
        """Guide vertices where the guide has them; nothing is inside the edges yet."""
        count = divisions - 1
        return cls(guide.points.copy(), np.empty((int(np.sum(count)), 3)), np.cumsum(count) - count, divisions)

    def rows(self, edges: Int, reverse: Bool, count: int) -> Int:
        """Rows (m, count - 1) of `inside`, from the lower vertex or (`reverse`) from the higher."""
        j = np.arange(1, count)
        out: Int = self.first[edges][:, None] + np.where(reverse[:, None], count - j, j) - 1
        return out

    def edge(self, e: int) -> Float:
        """Nodes (divisions - 1, 3) inside edge `e`, from the lower vertex."""
        return self.inside[self.first[e] : self.first[e] + self.divisions[e] - 1]

    def bulges(self, edges: Int) -> tuple[Float, Float]:
        """Greatest distance (e,) of the nodes inside every edge from its chord, and the chord's length."""
        chord = self.vertices[edges[:, 1]] - self.vertices[edges[:, 0]]
        length = np.linalg.norm(chord, axis=1)
        owner, _ = _ragged(self.divisions - 1)
        off = self.inside - self.vertices[edges[owner, 0]]
        along = np.einsum("nc,nc->n", off, chord[owner]) / np.maximum(length[owner] ** 2, np.finfo(float).tiny)
        bulge = np.zeros(len(edges))
        np.maximum.at(bulge, owner, np.linalg.norm(off - along[:, None] * chord[owner], axis=1))
        return bulge, length

    def put_vertices(self, guide: Guide, topology: GuideTopology, surfaces: Surfaces) -> None:
        """Put the guide vertices inside curved faces on these."""
        v = np.flatnonzero((topology.vertex_face >= 0) & (guide.cad_vertex < 0))
        v = v[surfaces.curved[topology.vertex_face[v]]]
        if len(v):
            self.vertices[v] = surfaces.feet(topology.vertex_face[v], self.vertices[v])

    def put_chain(self, chain: Int, edges: Int, forward: Bool, nodes: Float) -> None:
        """Put the `nodes` of a whole CAD curve on its guide vertices `chain` and its `edges`."""
        place = np.concatenate([[0], np.cumsum(self.divisions[edges])])
        self.vertices[chain[:-1]] = nodes[place[:-1]]
        self.vertices[chain[-1]] = nodes[-1]
        owner, j = _ragged(self.divisions[edges] - 1)
        row = self.first[edges][owner] + np.where(forward[owner], j, self.divisions[edges][owner] - 2 - j)
        self.inside[row] = nodes[place[owner] + 1 + j]

    def put_cubics(
        self,
        which: Int,
        topology: GuideTopology,
        tangents: Float,
        curved: Bool,
        surfaces: Surfaces,
        offsets: Float | None = None,
    ) -> None:
        """Put cubics with the given end `tangents` (e, 2, 3) on the edges `which`, shifted by `offsets` (as `inside`), and those
        in `curved` (f,) faces on these."""
        edges = topology.edges
        for count in np.unique(self.divisions[which]).tolist():
            e = which[self.divisions[which] == count]
            rows = self.rows(e, np.zeros(len(e), bool), count)
            self.inside[rows] = cubic(self.vertices[edges[e, 0]], self.vertices[edges[e, 1]], tangents[e], count)
            if offsets is not None:
                self.inside[rows] += offsets[rows]
        bent = which[curved[topology.edge_face[which]]]
        if len(bent):
            owner, j = _ragged(self.divisions[bent] - 1)
            rows, face = self.first[bent[owner]] + j, topology.edge_face[bent[owner]]
            self.inside[rows] = surfaces.feet(face, self.inside[rows])

    def write(self, points: Float, guide: Guide, numbering: Numbering, topology: GuideTopology, frames: Frames) -> None:
        """Write what is inside faces to `points`, in the user's coordinates; in plane faces it lies in their planes."""
        v = np.flatnonzero((topology.vertex_face >= 0) & (guide.cad_vertex < 0))
        points[numbering.vertex_id[v]] = frames.on_face(self.vertices[v], topology.vertex_face[v])
        e = np.flatnonzero(~topology.on_curve)
        owner, j = _ragged(self.divisions[e] - 1)
        e = e[owner]
        on_face = frames.on_face(self.inside[self.first[e] + j], topology.edge_face[e])
        points[numbering.edge_first[e] + numbering.edge_step[e] * j] = on_face


def _ragged(count: Int) -> tuple[Int, Int]:
    """Owner and place of every item of a ragged array with `count` items per owner."""
    owner = np.repeat(np.arange(len(count)), count)
    return owner, np.arange(len(owner)) - (np.cumsum(count) - count)[owner]
