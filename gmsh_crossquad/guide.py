"""From the T-mesh of the model to a smoothed guide grid: quantize, divide the chords, place, smooth, check."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .embed.place import place
from .embed.smooth import smooth
from .errors import LayoutError, MeshError
from .fill.curve_fit import misfits
from .fill.numbering import guide_chords
from .fill.pipeline import poor_cells
from .layout.chords import Chords, arc_divisions, find_chords
from .layout.divisions import ChordDivisions, chord_divisions, cumulative_turning
from .layout.quantize import quantize
from .layout.quotient import Quotient, arc_points, quotient
from .layout.verify import problems
from .records import Float, Guide, Int, Model, TMesh
from .watch import Watch

__all__ = ["GuideResult", "coarse_divisions", "smooth_guide"]

# refinements of a layout: twice as many rounds where only a few folded cells are left, no more cells than this factor allows, and only
# of grids whose scaled Jacobian is worth it
ROUNDS = 3
FEW = 4
GROWTH = 3
WORTH_REFINING = 0.02
MOST_QUADS = 25_000
# greatest turning of a final edge on a curve; the smaller one where the edges lose more than this part of a face's area
STEEP = np.radians(60.0)
STEEP_ROUND = np.radians(20.0)
LOST = 0.016
# bulge of a curve over an edge, of the height of the bad cell beside it, from which only the edge is divided
BULGE = 0.3
# edges on curves this far, in lengths of their neighbours, from these are halved, a few times, while the mesh stays below this factor
MISFIT = 0.25
GRADINGS = 6
MOST_GRADED = 1.5

Evaluate = Callable[[int, Float], Float]


@dataclass(frozen=True)
class GuideResult:
    """A guide grid without inverted cells.

    Attributes
    ----------
    guide : Guide
    fine : (c,) int64
        Final edges per guide edge of every guide chord (`fill.numbering.guide_chords`).
    quality : float
        Minimum scaled Jacobian of the guide.
    notes : tuple of str
    """

    guide: Guide
    fine: Int
    quality: float
    notes: tuple[str, ...]


def coarse_divisions(model: Model, tmesh: TMesh, block: Float) -> Int:
    """Coarse divisions of the arcs for the wanted block edge `block` (a,) along every arc, checked.

    Raises
    ------
    LayoutError
    """
    coarse = quantize(model, tmesh, tmesh.length / block).divisions
    wrong = problems(model, tmesh, quotient(tmesh, 3 * coarse))
    if wrong:
        raise LayoutError(f"the quantized layout is not valid ({wrong[0]})", remedy="another size may help")
    return coarse


def smooth_guide(
    model: Model,
    tmesh: TMesh,
    coarse: Int,
    size: Float,
    guide_size: float,
    evaluate: Evaluate,
    vertices: Float,
    watch: Watch,
    capped: bool = True,
) -> GuideResult:
    """The smoothed guide grid; chords of cells that cannot be filled well get more guide cells.

    Parameters
    ----------
    coarse : (a,) int64
    size : (a,) float64, scaled
    guide_size : float, scaled
    evaluate, vertices
        As for `fill.pipeline.fill`.
    watch : Watch
    capped : bool
        As for `layout.divisions.chord_divisions`.

    Raises
    ------
    LayoutError, MeshError
    """
    with watch.stage("guide"):
        chords = find_chords(tmesh, quotient(tmesh, coarse))
    notes: list[str] = []
    finer: Int | None = None
    best: tuple[tuple[int, int, float], Guide, Int] | None = None
    first = 0
    for round_ in range(2 * ROUNDS):
        with watch.stage("guide"):
            divisions = chord_divisions(model, tmesh, coarse, chords, size, guide_size, finer=finer, capped=capped)
            q = quotient(tmesh, arc_divisions(chords, divisions.guide))
            first = first or len(q.quads)
            if len(q.quads) > min(GROWTH * first, max(first, MOST_QUADS)):
                break
            if len(q.quads) > MOST_QUADS:
                raise LayoutError(
                    f"the guide grid would have {len(q.quads)} cells, more than {MOST_QUADS}",
                    remedy="the model has too many short curves or narrow places for its size",
                )
            wrong = problems(model, tmesh, q)
            if wrong:
                raise LayoutError(f"the guide grid is not valid ({wrong[0]})", remedy="another size may help")
            start = place(model, tmesh, q, tuple(_curve_fine(chords, divisions, pieces) for pieces in tmesh.pieces))
            coarse_chord = _coarse_chords(tmesh, q, chords, divisions)
            fine = divisions.fine[coarse_chord]
        watch.work += len(q.quads)
        with watch.stage("smooth"):
            guide, report = smooth(start, model)
        bad = folded = report.inverted
        steep = np.zeros(0, np.int64)
        if not len(bad):
            with watch.stage("fill"):
                bad, folded = poor_cells(model, guide, fine, evaluate, vertices)
                steep = _steep_chords(model, guide, fine)
        score = (-len(folded), -len(steep), report.min_scaled_jacobian)
        if best is None or score > best[0]:
            best = score, guide, fine
        elif len(report.inverted) > -best[0][0]:
            break
        if round_ + 1 >= ROUNDS and (len(bad) > FEW or not len(folded)):
            break
        if not (len(bad) or len(steep)) or report.min_scaled_jacobian < WORTH_REFINING:
            break
        if round_ + 1 < 2 * ROUNDS:
            what = f"{len(bad)} guide cells could not be filled well" if len(bad) else "curves were not followed well"
            notes.append(f"{what}; chords were refined")
        finer = divisions.guide.copy()
        finer[np.unique(coarse_chord[np.union1d(_chords_of(model, guide, bad), steep)])] *= 2
    assert best is not None
    (folds, _, quality), guide, fine = best
    if folds:
        raise MeshError(
            f"the layout cannot be laid into the faces without inverted cells ({-folds} of {len(guide.quads)})",
            remedy="a smaller size may help",
        )
    with watch.stage("fill"):
        graded = _graded(model, guide, fine)
        if (graded != fine).any() and not len(poor_cells(model, guide, graded, evaluate, vertices)[1]):
            notes.append("edges on curves beside much shorter ones were divided")
            fine = graded
    return GuideResult(guide, fine, quality, tuple(notes))


def _chords_of(model: Model, guide: Guide, bad: Int) -> Int:
    """Chords of the guide whose division makes bad cells better: only that along a curve edge, where the curve bulges over it
    by much of the cell's height; else both."""
    edges, quad_edges, chord, _ = guide_chords(guide.quads)
    bulge = np.zeros(len(edges))
    for row, length, turn in _curve_edges(model, guide, edges):
        bulge[row] = length * turn / 8.0
    length = np.linalg.norm(guide.points[edges[:, 1]] - guide.points[edges[:, 0]], axis=1)
    mine = quad_edges[bad]
    height = np.minimum(length[np.roll(mine, 1, axis=1)], length[np.roll(mine, -1, axis=1)])
    over = bulge[mine] > BULGE * height
    over[~over.any(axis=1)] = True
    return np.unique(chord[mine[over]])


def _curve_edges(model: Model, guide: Guide, edges: Int) -> list[tuple[Int, Float, Float]]:
    """For every curve the rows of `edges` of its guide edges, their arc lengths and their turning."""
    n = len(guide.points)
    keys = edges[:, 0] * n + edges[:, 1]
    out = []
    for curve, chain in zip(model.curves, guide.chains):
        places = np.concatenate([[0.0], guide.arclength[chain[1:-1]], [curve.length]])
        s, total = cumulative_turning(curve.points, curve.arclength)
        row = np.searchsorted(keys, np.minimum(chain[:-1], chain[1:]) * n + np.maximum(chain[:-1], chain[1:]))
        out.append((row, np.diff(places), np.abs(np.diff(np.interp(places, s, total)))))
    return out


def _steep_chords(model: Model, guide: Guide, fine: Int) -> Int:
    """Guide chords of edges on CAD curves that the final edges do not follow well enough.

    An edge may turn by `STEEP`.  An edge of length l that turns by t cuts about l^2 t / 12 off; where that adds up to more than
    `LOST` of the area of a face at the curve, its edges may turn by `STEEP_ROUND`.
    """
    edges, _, chord, _ = guide_chords(guide.quads)
    diagonals = guide.points[guide.quads[:, 2:]] - guide.points[guide.quads[:, :2]]
    areas = 0.5 * np.linalg.norm(np.cross(diagonals[:, 0], diagonals[:, 1]), axis=1)
    face_area = np.bincount(guide.quad_face, areas, minlength=len(model.faces))
    rows, turns = [], []
    lost = np.zeros(len(model.curves))
    for c, (row, length, turn) in enumerate(_curve_edges(model, guide, edges)):
        pieces = fine[chord[row]]
        rows.append(row)
        turns.append(turn / pieces)
        lost[c] = np.sum(length**2 / pieces * turns[-1] / 12)
    limit = np.full(len(model.curves), STEEP)
    for f, face in enumerate(model.faces):
        around = [c for loop in face.loops for c, _ in loop]
        if lost[around].sum() > LOST * face_area[f]:
            limit[around] = STEEP_ROUND
    steep = np.zeros(len(edges), bool)
    for row, turn, most in zip(rows, turns, limit):
        steep[row] = turn > most
    return np.unique(chord[steep])


def _graded(model: Model, guide: Guide, fine: Int) -> Int:
    """Final edges per guide edge of every guide chord, doubled where edges on curves are much longer than those beside them."""
    edges, quad_edges, chord, _ = guide_chords(guide.quads)
    curves = _curve_edges(model, guide, edges)
    prescribed = np.zeros(len(fine), bool)
    for curve, (row, _, _) in zip(model.curves, curves):
        if curve.spacing is not None:
            prescribed[chord[row]] = True

    def size(pieces: Int) -> int:
        return int(np.prod(pieces[chord[quad_edges[:, :2]]], axis=1).sum())

    most = int(MOST_GRADED * size(fine))
    for _ in range(GRADINGS):
        start, end, owner = [], [], []
        for curve, (row, length, _) in zip(model.curves, curves):
            pieces = fine[chord[row]]
            steps = np.concatenate([[0.0], np.cumsum(np.repeat(length / pieces, pieces))])
            points = curve.at(np.minimum(steps, curve.length))
            start.append(points[:-1])
            end.append(points[1:])
            owner.append(np.repeat(row, pieces))
        wrong = chord[np.concatenate(owner)[misfits(np.concatenate(start), np.concatenate(end)) > MISFIT]]
        more = fine.copy()
        more[np.unique(wrong)] *= 2
        more[prescribed] = fine[prescribed]
        if (more == fine).all() or size(more) > most:
            break
        fine = more
    return fine


def _curve_fine(chords: Chords, divisions: ChordDivisions, pieces: tuple[int, ...]) -> Int:
    """Final edges of every guide edge along a curve."""
    segment = np.concatenate([chords.arc_segments[arc] for arc in pieces])
    return np.repeat(divisions.fine[segment], divisions.guide[segment])


def _coarse_chords(tmesh: TMesh, q: Quotient, chords: Chords, divisions: ChordDivisions) -> Int:
    """Coarse chord of every guide chord; every guide chord ends on an arc or crosses one."""
    edges, _, chord, n = guide_chords(q.quads)
    keys = edges[:, 0] * q.n_vertices + edges[:, 1]
    out = np.full(n, -1, np.int64)
    for arc in np.flatnonzero(q.divisions > 0).tolist():
        v = q.vertex[arc_points(tmesh, q.divisions, q.offset, arc)]
        key = np.minimum(v[:-1], v[1:]) * q.n_vertices + np.maximum(v[:-1], v[1:])
        segment = chords.arc_segments[arc]
        out[chord[np.searchsorted(keys, key)]] = np.repeat(segment, divisions.guide[segment])
    return out
