"""The final mesh from the smoothed guide grid.

Curves first (exact CAD points, monotone spacing), then the inner guide edges (Hermite cubics), then all cells (Coons).  A
cubic that bulges too much folds the cells beside it, and sides of a thin cell that grow differently shear it: where a fine
quad is worse than half its guide quad, the edges of that cell are made straight and even step by step (on CAD curves, even
only).  Only cells that touch a changed edge are computed again.

On a curved face what cubics and Coons' rule give is put on the surface: the nodes inside guide edges first, those inside cells,
which lie between them, afterwards.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ..cusps import cusp_corners
from ..errors import InputError, MeshError
from ..records import Bool, Float, Guide, Int, Model, QuadMesh
from ..surfaces import Surfaces
from .cells import Cells
from .curves import curve_parameters
from .numbering import guide_chords, guide_topology, number
from .skeleton import Frames, Skeleton
from .tangents import continuation, end_tangents

__all__ = ["Placed", "fill", "mesh_of", "placed", "poor_cells", "poor_of", "shown_divisions"]

# rounds of straightening: what each takes off the bulge and the unevenness; all of it where cells are still folded
SHARES = (0.5,) * 6 + (1.0,) * 4
BUNDLE = 256  # edges side by side that may have to be straightened together
BULGE = 0.2  # of a cell's width, up to which an edge beside a straight one may bulge
KEEP = 0.5  # a fine quad should have this part of its guide quad's scaled Jacobian
SHOWN = 8  # divisions that show what any greater number would
POOR = 0.05  # guide quads below this are held to this


def fill(
    model: Model,
    surfaces: Surfaces,
    guide: Guide,
    divisions: Int,
    evaluate: Callable[[int, Float], Float],
    vertices: Float | None = None,
    *,
    filler: str = "numpy",
) -> QuadMesh:
    """Divide a guide grid.

    Parameters
    ----------
    model : Model
    surfaces : Surfaces
        The faces of `model`.
    guide : Guide
    divisions : (c,) int64
        Pieces of the edges of every guide chord (`guide_chords`), at least 1.
    evaluate : callable (curve row, parameters (m,)) -> (m, 3)
        Exact points of a CAD curve, in the user's coordinates.
    vertices : (v, 3) float64, optional
        Exact CAD vertices in the user's coordinates; by default those of `model`.
    filler : {"numpy", "gmsh"}
        Who fills the cells.  Both follow the same rule; Gmsh's transfinite mesher takes longer, and fills
        plane faces only.

    Returns
    -------
    QuadMesh
        Quads are ordered by face and guide quad; nodes by CAD vertex, curve and face.

    Raises
    ------
    MeshError
        A guide quad that is not inverted cannot be filled without inverted quads, or the guide is not conforming.
    InputError
        An unknown filler, or Gmsh for curved faces.
    """
    if filler not in ("numpy", "gmsh"):
        raise InputError(f"unknown filler {filler!r}", remedy='use "numpy" or "gmsh"')
    if filler == "gmsh" and surfaces.curved.any():
        raise InputError("Gmsh's filler cannot fill curved faces", remedy='use "numpy"')
    return mesh_of(placed(model, surfaces, guide, divisions, evaluate, vertices), filler)


def mesh_of(work: Placed, filler: str = "numpy") -> QuadMesh:
    """The mesh of placed nodes; see `fill`."""
    model, cells, points, own = work.model, work.cells, work.points, work.own
    guide = cells.guide
    _refuse_folds(model, guide, own, work.worst)
    if filler == "gmsh":
        from .gmsh_fill import gmsh_cells

        for q, inside in enumerate(gmsh_cells(guide.quads, cells.topology, cells.skeleton)):
            first = cells.numbering.cell_first[q]
            points[first : first + len(inside)] = inside * model.scale + model.origin
    return _record(guide, cells, points, tuple(work.parameters), int(np.count_nonzero(own <= 0)))


def poor_cells(
    model: Model,
    surfaces: Surfaces,
    guide: Guide,
    divisions: Int,
    evaluate: Callable[[int, Float], Float],
    vertices: Float | None = None,
) -> tuple[Int, Int]:
    """Guide quads that come out of `fill` worse than they should: divide their chords and smooth the guide again.

    Parameters
    ----------
    model, surfaces, guide, divisions, evaluate, vertices
        As for `fill`; of more than `SHOWN` divisions the cells are judged at that many, and of one at two, so that an edge
        that cuts across a curve is seen; prescribed nodes are kept.

    Returns
    -------
    poor : (k,) int64
        Rows of ``guide.quads`` with a fine quad worse than half of the guide quad's own scaled Jacobian, although their
        inner edges were straightened; in a cusp those with an inverted one.
    folded : (l,) int64
        Those of them that have an inverted fine quad.
    """
    return poor_of(placed(model, surfaces, guide, shown_divisions(model, guide, divisions), evaluate, vertices))


def poor_of(work: Placed) -> tuple[Int, Int]:
    """The poor and the folded ones of placed cells; see `poor_cells`."""
    return np.flatnonzero(work.worst < work.wanted(work.own)), np.flatnonzero(work.worst <= 0)


def shown_divisions(model: Model, guide: Guide, divisions: Int) -> Int:
    """The divisions (c,) of guide chords at which `poor_cells` judges."""
    shown = np.clip(divisions, 2, SHOWN)
    if all(curve.spacing is None for curve in model.curves):
        return shown
    edges, _, chord, _ = guide_chords(guide.quads)
    n = len(guide.points)
    for curve, chain in zip(model.curves, guide.chains):
        if curve.spacing is not None:
            along = np.minimum(chain[:-1], chain[1:]) * n + np.maximum(chain[:-1], chain[1:])
            own_chords = chord[np.searchsorted(edges[:, 0] * n + edges[:, 1], along)]
            shown[own_chords] = divisions[own_chords]
    return shown


def placed(
    model: Model,
    surfaces: Surfaces,
    guide: Guide,
    divisions: Int,
    evaluate: Callable[[int, Float], Float],
    vertices: Float | None = None,
) -> Placed:
    """All nodes of the mesh in their places; arguments as for `fill`."""
    work = Placed.start(model, surfaces, guide, divisions, evaluate, vertices)
    work.worst[:] = work.place(work.own)
    return work


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
        worst = self._bend(worst, tangents)
        even, wanted = np.zeros(len(edges)), self.wanted(own)
        for share in SHARES:
            bad: Bool = worst <= 0.0 if share == 1.0 else worst < wanted
            soft: Bool = np.zeros(len(edges), bool)
            soft[quad_edges[bad]] = True
            soft &= skeleton.divisions > 1
            if share == 1.0 and np.any(soft):
                soft = _with_bundle(soft, quad_edges, *skeleton.bulges(edges))
            if not np.any(soft):
                continue
            even[soft] += share * (1.0 - even[soft])
            for row, e in enumerate(topology.chain_edges):
                if np.any(soft[e]):
                    self.put_curve(row, even)
            e = np.flatnonzero(soft & ~topology.on_curve)
            chord = skeleton.vertices[edges[e, 1]] - skeleton.vertices[edges[e, 0]]
            tangents[e] += share * (chord[:, None] - tangents[e])
            skeleton.put_cubics(e, topology, tangents, *on_surfaces)
            again = np.flatnonzero(np.any(soft[quad_edges], axis=1))
            worst[again] = cells.place(again, self.points)
        skeleton.write(self.points, cells.guide, cells.numbering, topology, cells.frames)
        return worst

    def _bend(self, worst: Float, tangents: Float) -> Float:
        """Let the inner sides of folded cells run along the CAD curve on the other side, where that is better.

        Between two curves that touch in a corner and part slowly a straight side would cross them at any size of the cells.
        """
        cells, topology, skeleton = self.cells, self.cells.topology, self.cells.skeleton
        for q in np.flatnonzero(worst <= 0.0).tolist():
            for k in range(4):
                e, o = topology.quad_edges[q, k].item(), topology.quad_edges[q, (k + 2) % 4].item()
                if topology.on_curve[e] or not topology.on_curve[o] or skeleton.divisions[e] < 2:
                    continue
                nodes = skeleton.vertices[topology.edges[o]]
                line = np.concatenate([nodes[:1], skeleton.edge(o), nodes[1:]])
                if cells.reverse(np.array([q]), k)[0] != cells.reverse(np.array([q]), (k + 2) % 4)[0]:
                    line = line[::-1]
                ends = skeleton.vertices[topology.edges[e]]
                chord, other = ends[1] - ends[0], line[-1] - line[0]
                ratio = float(np.linalg.norm(chord) / max(float(np.linalg.norm(other)), np.finfo(float).tiny))
                slopes = (len(line) - 1) * np.stack([line[1] - line[0], line[-1] - line[-2]])
                before = tangents[e].copy()
                tangents[e] = chord + ratio * (slopes - other)
                again = np.flatnonzero((topology.quad_edges == e).any(axis=1))
                on_surfaces = cells.frames.curved, cells.surfaces
                skeleton.put_cubics(np.array([e]), topology, tangents, *on_surfaces)
                new = cells.place(again, self.points)
                if new.min() > worst[again].min():
                    worst[again] = new
                else:
                    tangents[e] = before
                    skeleton.put_cubics(np.array([e]), topology, tangents, *on_surfaces)
                    cells.place(again, self.points)
        return worst


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


def _refuse_folds(model: Model, guide: Guide, own: Float, worst: Float) -> None:
    """Raise where fine quads are inverted although their guide quad is not."""
    folded = np.flatnonzero((worst <= 0) & (own > 0))
    if len(folded):
        q = folded[np.argmin(worst[folded])]
        raise MeshError(
            f"{len(folded)} cells fold when they are filled",
            entity=(2, model.faces[guide.quad_face[q]].tag),
            location=guide.points[guide.quads[q]].mean(axis=0) * model.scale + model.origin,
            remedy="use a smaller size",
        )


def _record(guide: Guide, cells: Cells, points: Float, parameters: tuple[Float, ...], inverted: int) -> QuadMesh:
    """Put the parts of the mesh together."""
    numbering, order = cells.numbering, cells.numbering.cell_order
    count = cells.divisions.prod(axis=1)[order]
    notes = (f"{inverted} inverted guide quads were filled as they are",) if inverted else ()
    return QuadMesh(
        points,
        cells.quads(),
        np.repeat(guide.quad_face[order], count),
        np.repeat(guide.quad_block[order], count),
        numbering.vertex_node,
        numbering.curve_nodes,
        parameters,
        numbering.face_nodes,
        notes,
    )
