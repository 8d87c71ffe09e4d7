"""Nodes of the background mesh on the curves: fine where the field needs it, and no finer.

The spacing h along the curves is the greatest function that keeps

- the size of the faces beside the curve (`face_sizes`),
- a bounded turning per segment, and a least number of segments per curve,
- a part of the gap between boundary parts that face each other (`gaps`),
- a part of all this at sharp and re-entrant corners and at the tips of cracks, where the field is singular,
- the sizes at points inside the faces where the field may be singular (`seeds`),

and that grows with a bounded slope: ``h(x) <= h(y) + g |x - y|``.  That bound is a shortest-path problem: on the graph of
neighbouring cells, with edge weights ``g |x - y|`` and an edge of weight h(y) from a source to every y, h is the distance from
the source (one run of Dijkstra's algorithm).  Cells are refined and measured again until they are as fine as the spacing.
"""

from __future__ import annotations

import numpy as np

from ..options import MeshOptions
from ..records import Float, Int, Model
from .cells import Cells, Track
from .gaps import Neighbours, Uses, neighbours
from .seeds import InnerPoints, inner_points

__all__ = ["curve_spacing", "face_sizes"]

DIVISIONS, FEW_DIVISIONS = 40.0, 16.0  # of a face's diameter in a model of up to MANY faces, and of very many
FEWER_DIVISIONS = 11.0  # of very many, some of them curved
CURVED = 0.7  # of these on a curved face, whose field takes four times as long and whose extent is measured in space
MANY = 10
DIRECTIONS = np.stack([np.cos(np.pi / 16 * np.arange(16)), np.sin(np.pi / 16 * np.arange(16))], axis=1)  # to measure diameters
TRIANGLES, FACE_TRIANGLES = 3000.0, 100.0  # wanted in the model, and at least in a face, where there are many
GROWTH = 0.3
TURN, TURN_SMALL = np.radians(12.0), np.radians(22.5)  # per segment: usually, and where segments are small anyway
SMALL_TURN = 0.004  # least spacing because of turning, over that elsewhere
GAP = 0.5  # spacing over gap
CORNER = 0.5  # spacing at sharp and re-entrant corners over that elsewhere
TIP = 0.35
SHARP, REENTRANT = np.radians(60.0), np.radians(200.0)
ROUNDS = 6
WANTED_NODES, MAX_NODES = 2_000.0, 4_000.0  # beyond the least numbers of the curves
WIDE_GAP = 2.0  # spacing over gap that is accepted to have no more than the wanted nodes
SHORT = 0.4  # length over face size of a curve that may be a single segment
STRAIGHT = np.radians(25.0)  # greatest bend at its ends
SMALLEST = 1e-7  # of the model


def face_sizes(model: Model, options: MeshOptions) -> Float:
    """Greatest triangle size of every face.

    A 40th of its diameter; in a model of many faces coarser, down to about 100 triangles in a face.

    Parameters
    ----------
    model : Model
    options : MeshOptions

    Returns
    -------
    (f,) float64, scaled
    """
    out = np.zeros(len(model.faces))
    few = FEWER_DIVISIONS if any(face.curved for face in model.faces) else FEW_DIVISIONS
    divisions = max(few, DIVISIONS * min(1.0, float(np.sqrt(MANY / max(1, len(model.faces))))))
    wanted = max(FACE_TRIANGLES, TRIANGLES / len(model.faces))
    for row, face in enumerate(model.faces):
        if face.curved:
            even = np.sqrt(2.3 * face.area / wanted) if np.isfinite(face.area) else np.inf
            out[row] = max(face.extent / (CURVED * divisions), min(face.extent / 8.0, even))
            continue
        area, low, high = 0.0, np.full(len(DIRECTIONS), np.inf), np.full(len(DIRECTIONS), -np.inf)
        for loop in face.loops:
            for c, sign in loop:
                xy = face.local(model.curves[c].points)
                x, y = xy.T
                area += 0.5 * sign * float(np.sum(x[:-1] * y[1:] - x[1:] * y[:-1]))
                along = xy @ DIRECTIONS.T
                low, high = np.minimum(low, along.min(axis=0)), np.maximum(high, along.max(axis=0))
        diameter = float((high - low).max())
        even = np.sqrt(2.3 * abs(area) / wanted)
        out[row] = max(diameter / divisions, min(diameter / 8.0, even))
    return out * options.background


def curve_spacing(
    model: Model, options: MeshOptions, sizes: Float | None = None, inner: tuple[InnerPoints, ...] | None = None
) -> tuple[Float, ...]:
    """Background nodes of all curves, the same for all faces of a curve.

    Parameters
    ----------
    model : Model
    options : MeshOptions
        `background` is a factor on all sizes.
    sizes : (f,) float64, optional
        What `face_sizes` returns.
    inner : tuple of InnerPoints, optional
        Those of all faces; default: the embedded CAD points.

    Returns
    -------
    tuple of (k + 1,) float64
        For every curve increasing arc lengths, 0 and the length included; at least 8 segments on a closed curve, 2 on
        others, 1 on a short piece of a chain that hardly bends.
    """
    sizes = face_sizes(model, options) if sizes is None else sizes
    inner = inner_points(model, sizes) if inner is None else inner
    if not model.curves:
        return ()
    track, uses = Track(model), Uses.of(model)
    coarsest = np.full(len(model.curves), np.inf)
    np.minimum.at(coarsest, uses.curve, sizes[uses.face])
    least = _least_segments(model, uses, track.length / coarsest)
    base = np.minimum(coarsest, track.length / least)
    corner = _corner_sizes(model, uses, base)

    density = track.s / (0.8 * base)[track.curve] + track.turning / np.radians(12.0)
    share = density[track.last] - density[track.first]
    s, curve = track.divide(density, np.maximum(least, np.ceil(share)).astype(np.int64), track.curve, track.s)
    cells = track.cells(s, curve)
    budget = WANTED_NODES + float(least.sum())
    factor = GAP * options.background
    for round_ in range(ROUNDS):
        near = neighbours(model, cells, uses)
        most = np.minimum(base[cells.curve], _beside(model, cells, uses, inner))
        for _ in range(20):
            h = _limited(model, track, cells, near, base, most, corner, factor, options.background)
            nodes = float((cells.length / h).sum())
            # too many: what narrow gaps ask for may be coarser, a little in favour of speed, much to stay within bounds
            if nodes <= budget or (factor >= WIDE_GAP * options.background and nodes <= MAX_NODES + budget):
                break
            factor *= 1.5
        crowded = round_ > 0 and factor > WIDE_GAP * options.background  # gaps are not resolved: no need to know them better
        if crowded or round_ + 1 == ROUNDS or (cells.length <= 1.2 * h).all():
            break
        s, curve = _divide(track, cells, h / 1.3, least)
        cells = track.cells(s, curve)
    s, curve = _divide(track, cells, h, least)
    return tuple(np.split(s, np.flatnonzero(np.diff(curve)) + 1))


def _least_segments(model: Model, uses: Uses, relative: Float) -> Int:
    """Least number of segments (c,) of every curve; `relative` are their lengths over the size of their faces."""
    ends = np.array([(c.start, c.end) for c in model.curves])
    closed = ends[:, 0] == ends[:, 1]
    out = np.where(closed, 8, np.where(relative > 1.0, 4, np.where(relative > 0.5, 3, 2)))
    bent = np.zeros(len(model.vertices), bool)
    for vertex, angle in _corners(model):
        bent[vertex[np.abs(angle - np.pi) > STRAIGHT]] = True
    embedded = uses.curve[uses.sign == 0]
    bent[ends[embedded].ravel()] = True
    # two curves between the same vertices must not become the same segment
    pair = np.sort(ends, axis=1)
    _, inverse, count = np.unique(pair[:, 0] * len(model.vertices) + pair[:, 1], return_inverse=True, return_counts=True)
    chain = (relative < SHORT) & ~bent[ends].any(axis=1) & ~closed & (count[inverse] == 1)
    return np.where(chain, 1, out)


def _corners(model: Model) -> list[tuple[Int, Float]]:
    """For every loop of every face its vertices and the angles there, of the sampled curves."""
    ends = np.array([(c.start, c.end) for c in model.curves])
    first = np.stack([c.points[1] - c.points[0] for c in model.curves])
    last = np.stack([c.points[-2] - c.points[-1] for c in model.curves])
    out = []
    for face in model.faces:
        leave = np.stack([first @ face.axes.T, last @ face.axes.T], axis=1)
        for loop in face.loops:
            rows, signs = np.array(loop).T
            begin, end = np.where(signs > 0, 0, 1), np.where(signs > 0, 1, 0)
            outgoing, incoming = leave[rows, begin], np.roll(leave[rows, end], 1, axis=0)
            if face.curved:  # without the side of the face: the angle between the curves
                cross = np.linalg.norm(np.cross(outgoing, incoming), axis=1)
            else:
                cross = outgoing[:, 0] * incoming[:, 1] - outgoing[:, 1] * incoming[:, 0]
            dot = np.einsum("ij,ij->i", outgoing, incoming)
            out.append((ends[rows, begin], np.mod(np.arctan2(cross, dot), 2 * np.pi)))
    return out


def _divide(track: Track, cells: Cells, h: Float, least: Int) -> tuple[Float, Int]:
    """Divide all curves by the density 1 / h given on cells."""
    first = cells.first[:-1]
    pieces = cells.length / h
    total = np.cumsum(pieces)
    # cumulative density at both ends of every cell; only differences on one curve count
    density = np.stack([total - pieces, total], axis=1).ravel()
    share = np.add.reduceat(pieces, first)
    counts = np.maximum(least, np.ceil(share - 1e-9)).astype(np.int64)
    s = np.stack([cells.start, cells.end], axis=1).ravel()
    return track.divide(density, counts, np.repeat(cells.curve, 2), s)


def _corner_sizes(model: Model, uses: Uses, base: Float) -> Float:
    """Spacing (v,) at CAD vertices, infinite where nothing asks for it."""
    ends = np.array([(c.start, c.end) for c in model.curves])
    local = np.full(len(model.vertices), np.inf)
    np.minimum.at(local, ends.ravel(), np.repeat(base, 2))
    out = np.full(len(model.vertices), np.inf)
    for vertex, angle in _corners(model):
        special = (angle < SHARP) | (angle > REENTRANT)
        np.minimum.at(out, vertex[special], CORNER * local[vertex[special]])
    tips = ends[uses.curve[uses.sign == 0]].ravel()
    np.minimum.at(out, tips, TIP * local[tips])
    return out


def _beside(model: Model, cells: Cells, uses: Uses, inner: tuple[InnerPoints, ...]) -> Float:
    """Spacing (n,) that the points inside the faces of a cell's curve ask for, infinite where they do not."""
    out = np.full(len(cells.curve), np.inf)
    for row, (face, own) in enumerate(zip(model.faces, inner, strict=True)):
        mine = np.flatnonzero(np.isin(cells.curve, uses.curve[uses.face == row]))
        middle = face.local(cells.middle[mine])
        for point, size in zip(own.points, own.size.tolist(), strict=True):
            out[mine] = np.minimum(out[mine], size + GROWTH * np.sqrt(((middle - point) ** 2).sum(axis=1)))
    return out


def _limited(
    model: Model,
    track: Track,
    cells: Cells,
    near: Neighbours,
    base: Float,
    most: Float,
    corner: Float,
    factor: float,
    background: float,
) -> Float:
    """Spacing (n,) on every cell; `most` is the greatest one allowed."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import dijkstra

    n, v = len(cells.curve), len(model.vertices)
    h = np.concatenate([most, corner])
    # a turn that is far smaller than the cells around it (a knot of a spline) is passed over
    rate = np.clip(track.turning_rate(cells), 1e-12, TURN / (SMALL_TURN * base[cells.curve]))
    small = base[cells.curve] / 3.0
    h[:n] = np.minimum(h[:n], background * np.clip(small / background, TURN / rate, TURN_SMALL / rate))
    narrow = np.isfinite(near.gap)
    pair, width = near.pair[narrow], factor * near.gap[narrow]
    # curves that meet have no gap where they meet: there a part of the spacing is the limit
    size = np.where(pair < n, base[cells.curve[np.minimum(pair, n - 1)]], np.inf).min(axis=1)
    width = np.maximum(width, np.where(near.joined[narrow], TIP * size, SMALLEST))
    np.minimum.at(h, pair.ravel(), np.repeat(width, 2))

    inner = np.setdiff1d(np.arange(n), cells.first[:-1])
    ends = np.array([(c.start, c.end) for c in model.curves])
    a = np.concatenate([near.pair[:, 0], inner - 1, cells.first[:-1], cells.first[1:] - 1])
    b = np.concatenate([near.pair[:, 1], inner, n + ends[:, 0], n + ends[:, 1]])
    half = 0.5 * cells.length
    weight = np.concatenate([near.distance, half[inner - 1] + half[inner], half[cells.first[:-1]], half[cells.first[1:] - 1]])
    key = np.minimum(a, b) * (n + v) + np.maximum(a, b)
    order = np.lexsort((weight, key))
    order = order[np.concatenate([[True], np.diff(key[order]) > 0])]
    a, b, weight = a[order], b[order], GROWTH * weight[order]
    known = np.flatnonzero(np.isfinite(h))
    rows = np.concatenate([a, b, np.full(len(known), n + v)])
    columns = np.concatenate([b, a, known])
    values = np.concatenate([weight, weight, h[known]])
    graph = coo_array((values, (rows, columns)), shape=(n + v + 1, n + v + 1)).tocsr()
    return np.asarray(dijkstra(graph, indices=[n + v]))[0, :n]
