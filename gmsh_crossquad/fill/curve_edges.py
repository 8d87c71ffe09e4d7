"""Chords of a guide grid that should get more edges, judged by the guide's edges on CAD curves.

An edge of length l over which the curve turns by t bulges by l t / 8 from its chord.  Where that is much of the height of the
cell beside it the cell folds: the edge needs division, the height none.  Final edges may turn by no more than a limit, and an
edge far from its neighbours, measured in their lengths (`curve_fit`), is halved without smoothing again.
"""

from __future__ import annotations

import numpy as np

from ..layout.divisions import cumulative_turning
from ..records import Float, Guide, Int, Model
from .curve_fit import misfits
from .numbering import guide_chords

__all__ = ["chords_to_divide", "graded", "steep_chords"]

# greatest turning of a final edge on a curve; the smaller one where the edges lose more than this part of a face's area
STEEP = np.radians(60.0)
STEEP_ROUND = np.radians(20.0)
LOST = 0.016
# bulge of a curve over an edge, of the height of the bad cell beside it, from which only the edge is divided
BULGE = 0.3
# edges on curves this far from their neighbours, in lengths of these, are halved a few times, while the mesh grows by no more
MISFIT = 0.25
GRADINGS = 6
MOST_GRADED = 1.5


def chords_to_divide(model: Model, guide: Guide, bad: Int) -> Int:
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


def steep_chords(model: Model, guide: Guide, fine: Int) -> Int:
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


def graded(model: Model, guide: Guide, fine: Int) -> Int:
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
