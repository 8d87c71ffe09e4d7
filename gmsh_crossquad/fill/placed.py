"""A mesh in the making: nodes on curves, inside guide edges and inside cells, and what is done where cells come out badly.

A cubic that bulges too much folds the cells beside it, and sides of a thin cell that grow differently shear it: where a fine
quad is worse than half its guide quad, the edges of that cell are made straight and even step by step (on CAD curves, even
only).  Where a curve bulges by much of the height of the cell beside it, straight sides would fold that: the edges above run
along the curve (`bundles`), which takes the place of straight for them.  Cells that straightening has folded get their edges
back, if that leaves fewer folded ones.  Only cells that touch a changed edge are computed again.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ..cusps import cusp_corners
from ..errors import MeshError
from ..records import Bool, Float, Guide, Int, Model
from ..surfaces import Surfaces
from .bundles import bundle_offsets
from .cells import Cells
from .curves import curve_parameters
from .numbering import guide_chords, guide_topology, number
from .skeleton import Frames, Skeleton
from .tangents import continuation, end_tangents

__all__ = ["Placed"]

# rounds of straightening: what each takes off the bulge and the unevenness; all of it where cells are still folded
SHARES = (0.5,) * 6 + (1.0,) * 4
BUNDLE = 256  # edges side by side that may have to be straightened together
BULGE = 0.2  # of a cell's width, up to which an edge beside a straight one may bulge
KEEP = 0.5  # a fine quad should have this part of its guide quad's scaled Jacobian
POOR = 0.05  # guide quads below this are held to this


@dataclass(frozen=True)
class _Shape:
    """Shapes of the guide edges: end tangents (e, 2, 3), how far nodes on curves are in even steps (e,), and how much of the
    `offsets` (as `Skeleton.inside`) is added to the cubics (e,)."""

    tangents: Float
    even: Float
    bend: Float
    offsets: Float

    @classmethod
    def start(cls, tangents: Float, skeleton: Skeleton) -> _Shape:
        """Cubics alone."""
        return cls(tangents, np.zeros(len(tangents)), np.zeros(len(tangents)), np.zeros_like(skeleton.inside))

    def copy(self) -> _Shape:
        """Its own arrays, but for the offsets."""
        return _Shape(self.tangents.copy(), self.even.copy(), self.bend.copy(), self.offsets)


@dataclass(frozen=True)
class Placed:
    """A mesh in the making; all arrays but `own`, and the positions in `cells.skeleton`, are filled in place.

    Attributes
    ----------
    model : Model
    cells : Cells
    evaluate : callable
    points : (n, 3) float64
        Nodes, in the user's coordinates.
    parameters : list of (k,) float64
        Of the nodes of every curve.
    own, worst : (q,) float64
        Scaled Jacobian of every guide quad, and the least one of its fine quads.
    """

    model: Model
    cells: Cells
    evaluate: Callable[[int, Float], Float]
    points: Float
    parameters: list[Float]
    own: Float
    worst: Float

    @classmethod
    def start(
        cls,
        model: Model,
        surfaces: Surfaces,
        guide: Guide,
        divisions: Int,
        evaluate: Callable[[int, Float], Float],
        vertices: Float | None,
    ) -> Placed:
        """Number all nodes and place those on CAD vertices."""
        edges, quad_edges, chord, n_chords = guide_chords(guide.quads)
        if len(divisions) != n_chords:
            raise MeshError(f"{len(divisions)} divisions for {n_chords} guide chords", remedy="report this model")
        topology = guide_topology(guide, edges, quad_edges)
        pieces = np.asarray(divisions, np.int64)[chord]
        numbering = number(guide, topology, pieces, len(model.vertices), len(model.faces))
        points = np.empty((numbering.n_nodes, 3))
        used = numbering.vertex_node >= 0
        exact = model.vertices * model.scale + model.origin if vertices is None else vertices
        points[numbering.vertex_node[used]] = exact[used]
        skeleton = Skeleton.start(guide, pieces)
        skeleton.put_vertices(guide, topology, surfaces)
        cells = Cells(guide, topology, numbering, skeleton, Frames.of(model), surfaces, cusp_corners(guide, model))
        parameters = [np.empty(0)] * len(guide.chains)
        work = cls(model, cells, evaluate, points, parameters, np.empty(0), np.empty(len(guide.quads)))
        for row in range(len(guide.chains)):
            work.put_curve(row, np.zeros(len(edges)))
        return replace(work, own=cells.corner_quality())

    def put_curve(self, row: int, even: Float) -> None:
        """Place the nodes of a CAD curve; `even` (e,) as in `curve_parameters`, per guide edge."""
        cells, model = self.cells, self.model
        curve, chain, nodes = model.curves[row], cells.guide.chains[row], cells.numbering.curve_nodes[row]
        e = cells.topology.chain_edges[row]
        s = cells.guide.arclength[chain]
        s[0], s[-1] = 0.0, curve.length
        t = curve_parameters(curve, s, cells.numbering.divisions[e], even[e])
        if len(t) > 2:
            self.points[nodes[1:-1]] = self.evaluate(row, t[1:-1])
        self.parameters[row] = t
        cells.skeleton.put_chain(chain, e, cells.topology.chain_forward[row], (self.points[nodes] - model.origin) / model.scale)

    def wanted(self, own: Float) -> Float:
        """(q,) Least scaled Jacobian that the fine quads of every cell should have; in cusps any that is positive."""
        out: Float = np.where(self.cells.cusps.any(axis=1), np.finfo(float).tiny, KEEP * np.maximum(own, POOR))
        return out

    def place(self, own: Float) -> Float:
        """Place all that is inside faces, straightening the edges of bad cells; the least scaled Jacobian of every cell."""
        cells, topology, skeleton = self.cells, self.cells.topology, self.cells.skeleton
        edges, quad_edges = topology.edges, topology.quad_edges
        tangents = end_tangents(skeleton.vertices, edges, skeleton.divisions, continuation(cells.guide.quads, topology))
        on_surfaces = cells.frames.curved, cells.surfaces
        skeleton.put_cubics(np.flatnonzero(~topology.on_curve), topology, tangents, *on_surfaces)
        worst = cells.place(np.arange(len(quad_edges)), self.points)
        wanted = self.wanted(own)
        if np.any(worst < wanted):
            worst = self._straighten(worst, wanted, _Shape.start(tangents, skeleton))
        skeleton.write(self.points, cells.guide, cells.numbering, topology, cells.frames)
        return worst

    def _straighten(self, worst: Float, wanted: Float, shape: _Shape) -> Float:
        """Make the edges of bad cells straight, or bent with their bundle; the new least scaled Jacobian of every cell."""
        topology, skeleton = self.cells.topology, self.cells.skeleton
        edges, quad_edges = topology.edges, topology.quad_edges
        first, worst = worst.copy(), worst.copy()
        chord = np.repeat((skeleton.vertices[edges[:, 1]] - skeleton.vertices[edges[:, 0]])[:, None], 2, axis=1)
        shape.offsets[:], bent, needed = bundle_offsets(skeleton, topology, self.cells.guide.quads, worst < wanted)
        changed = shape.copy()
        changed.tangents[needed] = chord[needed]
        changed.bend[needed] = 1.0
        self._put_again(needed, changed, worst)
        for share in SHARES:
            soft: Bool = np.zeros(len(edges), bool)
            soft[quad_edges[worst <= 0.0 if share == 1.0 else worst < wanted]] = True
            soft &= skeleton.divisions > 1
            if share == 1.0 and np.any(soft):
                soft = _with_bundle(soft, quad_edges, *skeleton.bulges(edges))
            if not np.any(soft):
                continue
            changed.even[soft] += share * (1.0 - changed.even[soft])
            changed.bend[soft & bent] += share * (1.0 - changed.bend[soft & bent])
            e = np.flatnonzero(soft & ~topology.on_curve)
            changed.tangents[e] += share * (chord[e] - changed.tangents[e])
            self._put_again(soft, changed, worst)
        return self._restored(worst, first, changed, shape)

    def _restored(self, worst: Float, before: Float, changed: _Shape, first: _Shape) -> Float:
        """Give the edges of cells that were good `before` (q,) and are folded now their `first` shape, where that leaves fewer
        folded cells."""
        quad_edges = self.cells.topology.quad_edges
        back: Bool = np.zeros(len(changed.even), bool)
        shape, result = changed.copy(), worst.copy()
        for _ in range(BUNDLE):
            spoilt = (result <= 0.0) & (before > 0.0)
            if not np.any(spoilt):
                break
            back[quad_edges[spoilt]] = True
            for array, old in ((shape.tangents, first.tangents), (shape.even, first.even), (shape.bend, first.bend)):
                array[back] = old[back]
            self._put_again(back, shape, result)
        if np.count_nonzero(result <= 0.0) >= np.count_nonzero(worst <= 0.0) and np.any(back):
            self._put_again(back, changed, result)
        return result

    def _put_again(self, which: Bool, shape: _Shape, worst: Float) -> None:
        """Place the edges `which` (e,) and the cells beside them again; the quality of these goes to `worst` (q,)."""
        cells, topology, skeleton = self.cells, self.cells.topology, self.cells.skeleton
        for row, e in enumerate(topology.chain_edges):
            if np.any(which[e]):
                self.put_curve(row, shape.even)
        e = np.flatnonzero(which & ~topology.on_curve)
        offsets = np.repeat(shape.bend, skeleton.divisions - 1)[:, None] * shape.offsets
        skeleton.put_cubics(e, topology, shape.tangents, cells.frames.curved, cells.surfaces, offsets)
        again = np.flatnonzero(np.any(which[topology.quad_edges], axis=1))
        worst[again] = cells.place(again, self.points)


def _with_bundle(straight: Bool, quad_edges: Int, bulge: Float, length: Float) -> Bool:
    """Edges to straighten with those given: opposite ones, cell by cell, that bulge by much of the width between the two."""
    out = straight.copy()
    for _ in range(BUNDLE):
        more = np.zeros(len(out), bool)
        for k in range(4):
            here, there = quad_edges[:, k], quad_edges[:, (k + 2) % 4]
            width = 0.5 * (length[quad_edges[:, (k + 1) % 4]] + length[quad_edges[:, (k + 3) % 4]])
            more[there[out[here] & (bulge[there] > BULGE * width)]] = True
        if not np.any(more & ~out):
            break
        out |= more
    return out
