"""Widths of a model's faces between parts of their boundary that face each other.

The middles of all cells of a face are joined by a Delaunay triangulation; its edges lead from every boundary part to the nearest
ones all round.  An edge spans a *gap* where it leaves its cells into the face and where the boundary between them is much longer
than the edge.  The width is the distance of the two cells as straight segments, so that it is right for coarse cells, too.
All plane faces are triangulated at once: each is scaled to the unit square and put into a place of its own in a grid.  In a
curved face the neighbours of a cell are the nearest ones in space, on whatever side.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..records import Bool, Float, Int, Model
from .cells import Cells

__all__ = ["Neighbours", "Uses", "neighbours"]

TOUCHING = 1e-9  # of the model
NEAREST = 12  # cells of a curved face that are looked at from each
FOLD = 0.55  # an edge shorter than this part of the boundary between its ends is no neighbour along the boundary


@dataclass(frozen=True)
class Uses:
    """Every use of a curve by a face.

    Attributes
    ----------
    face, curve, sign, loop, offset : (u,)
        Sign 0 for embedded curves; `loop` numbers the loops of all faces, embedded curves follow as open loops of their
        own; `offset` is the length of the loop before this use.
    around : (l,) float64
        Lengths of the loops, infinite for open ones.
    """

    face: Int
    curve: Int
    sign: Int
    loop: Int
    offset: Float
    around: Float

    @classmethod
    def of(cls, model: Model) -> Uses:
        rows: list[tuple[int, int, int, int, float]] = []
        around: list[float] = []
        for row, face in enumerate(model.faces):
            for sides in face.loops:
                offset = 0.0
                for curve, side in sides:
                    rows.append((row, curve, side, len(around), offset))
                    offset += model.curves[curve].length
                around.append(offset)
            for curve in face.embedded_curves:
                rows.append((row, curve, 0, len(around), 0.0))
                around.append(model.curves[curve].length if model.curves[curve].closed else np.inf)
        columns = list(zip(*rows, strict=True))
        f, c, sign, loop = (np.array(columns[k], np.int64) for k in range(4))
        return cls(f, c, sign, loop, np.array(columns[4], float), np.array(around))


@dataclass(frozen=True)
class Neighbours:
    """Pairs of cells that are neighbours in a face.

    Attributes
    ----------
    pair : (k, 2) int64
        Cells, or vertices as ``len(cells) + row``.
    distance : (k,) float64
        Between the middles.
    gap : (k,) float64
        Width where the pair spans a gap, else infinite.
    joined : (k,) bool
        True where the curves of the pair share a vertex or are the same.
    """

    pair: Int
    distance: Float
    gap: Float
    joined: Bool


def _segment_distance(a: Float, b: Float, c: Float, d: Float) -> Float:
    """Distance of segments a b and c d that do not cross."""

    def to_segment(x: Float, p: Float, q: Float) -> Float:
        e = q - p
        t = np.einsum("ij,ij->i", x - p, e) / np.maximum(np.einsum("ij,ij->i", e, e), 1e-300)
        return np.linalg.norm(x - p - np.clip(t, 0.0, 1.0)[:, None] * e, axis=1)

    return np.minimum.reduce([to_segment(a, c, d), to_segment(b, c, d), to_segment(c, a, b), to_segment(d, a, b)])


def neighbours(model: Model, cells: Cells, uses: Uses) -> Neighbours:
    """Neighbouring cells through all faces.

    Parameters
    ----------
    model : Model
    cells : Cells
    uses : Uses
    """
    count = np.diff(cells.first)
    use = np.repeat(np.arange(len(uses.curve)), count[uses.curve])
    begin = np.concatenate([[0], np.cumsum(count[uses.curve])[:-1]])
    cell = cells.first[uses.curve[use]] + np.arange(len(use)) - begin[use]
    face, sign, loop = uses.face[use], uses.sign[use], uses.loop[use]
    middle = 0.5 * (cells.start + cells.end)[cell]
    curve_length = np.array([c.length for c in model.curves])
    place = uses.offset[use] + np.where(sign < 0, curve_length[cells.curve[cell]] - middle, middle)
    p, q = cells.p[cell], cells.q[cell]
    # embedded points are cells without extent, with a loop each
    points = [(f, v) for f, record in enumerate(model.faces) for v in record.embedded_points]
    if points:
        pf, pv = np.array(points).T
        extra = len(pf)
        face, cell = np.concatenate([face, pf]), np.concatenate([cell, len(cells.curve) + pv])
        sign, place = np.concatenate([sign, np.zeros(extra, np.int64)]), np.concatenate([place, np.zeros(extra)])
        loop = np.concatenate([loop, len(uses.around) + np.arange(extra)])
        p, q = np.concatenate([p, model.vertices[pv]]), np.concatenate([q, model.vertices[pv]])
    around = np.concatenate([uses.around, np.full(len(points), np.inf)])

    curved = np.array([f.curved for f in model.faces])
    axes = np.stack([np.zeros((2, 3)) if f.curved else f.axes for f in model.faces])
    origin = np.stack([f.origin for f in model.faces])

    def local(x: Float) -> Float:
        return np.einsum("ik,ijk->ij", x - origin[face], axes[face])

    a, b = local(p), local(q)
    tangent = (b - a) * sign[:, None]
    tangent /= np.maximum(np.linalg.norm(tangent, axis=1), 1e-300)[:, None]
    normal = np.stack([-tangent[:, 1], tangent[:, 0]], axis=1)
    xy = 0.5 * (a + b)

    i, j = (np.concatenate(ends) for ends in zip(_plane_pairs(xy, face, curved), _curved_pairs(p, q, face, curved)))
    keep = (face[i] == face[j]) & (cell[i] != cell[j])
    i, j = i[keep], j[keep]

    bent = curved[face[i]]
    d = xy[j] - xy[i]
    size = np.linalg.norm(d, axis=1)
    size[bent] = 0.5 * np.linalg.norm((p + q)[j[bent]] - (p + q)[i[bent]], axis=1)
    size = np.maximum(size, 1e-300)
    out_i, out_j = np.einsum("ij,ij->i", d, normal[i]), -np.einsum("ij,ij->i", d, normal[j])
    opposed = np.einsum("ij,ij->i", normal[i], normal[j]) < -0.5
    inward = (out_i > np.where(opposed, 1e-9, 0.2) * size) | (sign[i] == 0)
    inward &= (out_j > np.where(opposed, 1e-9, 0.2) * size) | (sign[j] == 0)
    along = np.abs(place[i] - place[j])
    along = np.minimum(along, around[loop[i]] - along)
    inward |= bent
    facing = inward & ((loop[i] != loop[j]) | (size < FOLD * along))
    gap = np.full(len(i), np.inf)
    flat, round_ = facing & ~bent, facing & bent
    gap[flat] = _segment_distance(a[i[flat]], b[i[flat]], a[j[flat]], b[j[flat]])
    gap[round_] = _segment_distance(p[i[round_]], q[i[round_]], p[j[round_]], q[j[round_]])

    gap[gap < TOUCHING] = np.inf  # a vertex in common, or the lips of a crack

    ends = np.array([(c.start, c.end) for c in model.curves])
    ends = np.concatenate([ends[cells.curve], np.repeat(np.arange(len(model.vertices))[:, None], 2, axis=1)])
    ei, ej = ends[cell[i]], ends[cell[j]]
    joined = (ei[:, :, None] == ej[:, None, :]).any(axis=(1, 2))
    return Neighbours(np.stack([cell[i], cell[j]], axis=1), size, gap, joined)


def _plane_pairs(xy: Float, face: Int, curved: Bool) -> tuple[Int, Int]:
    """Edges of a Delaunay triangulation of the cells of every plane face."""
    from ..spatial import Delaunay

    mine = np.flatnonzero(~curved[face])
    if not len(mine):
        return mine, mine
    faces, row = np.unique(face[mine], return_inverse=True)
    order = np.argsort(row, kind="stable")
    starts = np.searchsorted(row[order], np.arange(len(faces)))
    points = xy[mine]
    low, high = np.minimum.reduceat(points[order], starts), np.maximum.reduceat(points[order], starts)
    columns = int(np.ceil(np.sqrt(len(faces))))
    slot = np.stack(np.divmod(np.arange(len(faces)), columns), axis=1) * 3.0
    unit = (points - low[row]) / (high - low).max(axis=1)[row][:, None] + slot[row]
    triangles = Delaunay(unit).simplices.astype(np.int64)
    half = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    key = np.unique(half.min(axis=1) * len(unit) + half.max(axis=1))
    i, j = np.divmod(key, len(unit))
    return mine[i], mine[j]


def _curved_pairs(p: Float, q: Float, face: Int, curved: Bool) -> tuple[Int, Int]:
    """Nearest cells in space of the cells of every curved face."""
    from ..spatial import cKDTree

    first, second = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)]
    for f in np.flatnonzero(curved).tolist():
        mine = np.flatnonzero(face == f)
        if len(mine) < 2:
            continue
        middle = 0.5 * (p[mine] + q[mine])
        near = np.asarray(cKDTree(middle).query(middle, k=min(NEAREST, len(mine)))[1])[:, 1:]
        i, j = np.repeat(mine, near.shape[1]), mine[near.ravel()]
        pair = np.unique(np.minimum(i, j) * len(face) + np.maximum(i, j))
        first.append(pair // len(face))
        second.append(pair % len(face))
    return np.concatenate(first), np.concatenate(second)
