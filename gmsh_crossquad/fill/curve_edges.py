"""Chords of a guide grid that should get more edges, judged by the guide's edges on CAD curves and in curved faces.

An edge of length l over which the curve turns by t bulges by l t / 8 from its chord.  Where that is much of the height of the
cell beside it the cell folds: the edge needs division, the height none.  An edge far from its neighbours, measured in their
lengths (`curve_fit`), is halved without smoothing again.

Inside a curved face an edge turns as the surface's normal does, from one end to the middle to the other end.
"""

from __future__ import annotations

import numpy as np

from ..layout.divisions import cumulative_turning
from ..records import Float, Guide, Int, Model
from ..surfaces import Surfaces
from .curve_fit import misfits
from .numbering import guide_chords

__all__ = ["chords_to_divide", "edges_on_curves", "graded", "surface_turning"]

# bulge of a curve over an edge, of the height of the bad cell beside it, from which only the edge is divided
BULGE = 0.3
# edges on curves this far from their neighbours, in lengths of these, are halved a few times, while the mesh grows by no more
MISFIT = 0.25
GRADINGS = 6
MOST_GRADED = 1.5


def chords_to_divide(model: Model, surfaces: Surfaces, guide: Guide, bad: Int) -> Int:
    """Chords of the guide whose division makes bad cells better: only that along an edge over which a curve or a curved face
    bulges by much of the cell's height; else both."""
    edges, quad_edges, chord, _ = guide_chords(guide.quads)
    length = np.linalg.norm(guide.points[edges[:, 1]] - guide.points[edges[:, 0]], axis=1)
    row, _, turn = surface_turning(surfaces, guide, edges, quad_edges)
    bulge = np.zeros(len(edges))
    np.maximum.at(bulge, row, length[row] * turn / 8.0)
    for row, arc, turn in edges_on_curves(model, guide, edges):
        bulge[row] = arc * turn / 8.0
    mine = quad_edges[bad]
    height = np.minimum(length[np.roll(mine, 1, axis=1)], length[np.roll(mine, -1, axis=1)])
    over = bulge[mine] > BULGE * height
    over[~over.any(axis=1)] = True
    return np.unique(chord[mine[over]])


def edges_on_curves(model: Model, guide: Guide, edges: Int) -> list[tuple[Int, Float, Float]]:
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


def surface_turning(surfaces: Surfaces, guide: Guide, edges: Int, quad_edges: Int) -> tuple[Int, Int, Float]:
    """Row of every edge of every curved face (ordered by face), that face, and by what its normal turns along the edge."""
    q = np.flatnonzero(surfaces.curved[guide.quad_face])
    if not len(q):
        return np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0)
    face, row = np.divmod(np.unique(guide.quad_face[q, None] * len(edges) + quad_edges[q]), len(edges))
    ends = guide.points[edges[row]]
    places = np.concatenate([ends[:, 0], 0.5 * (ends[:, 0] + ends[:, 1]), ends[:, 1]])
    start, middle, end = surfaces.normals(np.tile(face, 3), places).reshape(3, -1, 3)
    return row, face, _angle(start, middle) + _angle(middle, end)


def _angle(a: Float, b: Float) -> Float:
    """Angles (n,) between unit vectors (n, 3)."""
    out: Float = 2.0 * np.arctan2(np.linalg.norm(a - b, axis=1), np.linalg.norm(a + b, axis=1))
    return out


def graded(model: Model, guide: Guide, fine: Int) -> Int:
    """Final edges per guide edge of every guide chord, doubled where edges on curves are much longer than those beside them."""
    edges, quad_edges, chord, _ = guide_chords(guide.quads)
    curves = edges_on_curves(model, guide, edges)
    if not curves:
        return fine
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
