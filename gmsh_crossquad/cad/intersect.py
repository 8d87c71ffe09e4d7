"""Where do plane polylines touch?

Chunks of `CHUNK` consecutive segments get a box; boxes are paired by a sweep over their left sides; only overlapping
boxes are opened.  A piece of curve that turns by less than pi cannot meet itself, so a chunk is not compared with
itself or with its neighbour unless it turns more.  Pairs of segments that come closer than the sampling error are
looked at again with both replaced by `FINE` pieces of the cubic through their samples (fourth order, so that tangent
circles are told from nearly tangent ones), and count as touching if these cross or come closer than `TOUCH`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..records import Bool, Float, Int

__all__ = ["Contact", "contacts"]

CHUNK = 16
CLOSE = 4e-6  # of the model: twice the deviation of the samples of two curves, and a margin
TOUCH = 1e-9  # of the model
FINE = 64  # leaves 1/4096 of the samples' deviation
BLOCK = 1 << 20  # pairs handled at once


class Contact(NamedTuple):
    """A place where two polylines (or two parts of one) touch or cross; `segments` holds the row of each."""

    first: int
    second: int
    point: Float
    segments: tuple[int, int]


def contacts(polylines: Sequence[Float], ends: Sequence[tuple[int, int]]) -> list[Contact]:
    """Contacts of polylines, except in common ends.

    Parameters
    ----------
    polylines : sequence of (n, 2) float64
        In units of the model's size.
    ends : sequence of (int, int)
        Identifiers of the end points; polylines that share one may touch there.

    Returns
    -------
    list of Contact
        One for each touching pair of polylines, sorted.
    """
    start, stop, curve, node = _segments(polylines, ends)
    i, j = _candidates(polylines, start, stop)
    adjacent = (node[i][:, :, None] == node[j][:, None, :]).any((1, 2))
    offset = np.searchsorted(curve, np.arange(len(polylines)))
    found: dict[tuple[int, int], Contact] = {}
    for touching in (True, False):
        rows = np.flatnonzero(adjacent == touching)
        for begin in range(0, len(rows), BLOCK):
            a, b = i[rows[begin : begin + BLOCK]], j[rows[begin : begin + BLOCK]]
            hit, where = _overlap(start, stop, node, a, b) if touching else _near(polylines, start, stop, curve, a, b)
            for k in np.flatnonzero(hit):
                sides = sorted((int(curve[row]), int(row - offset[curve[row]])) for row in (a[k], b[k]))
                (first, p), (second, q) = sides
                found.setdefault((first, second), Contact(first, second, where[k], (p, q)))
    return [found[pair] for pair in sorted(found)]


def _segments(polylines: Sequence[Float], ends: Sequence[tuple[int, int]]) -> tuple[Float, Float, Int, Int]:
    """Starts, ends, polyline and node identifiers (two per segment) of all segments."""
    nodes = []
    fresh = 1 + max((max(pair) for pair in ends), default=0)
    for p, (a, b) in zip(polylines, ends):
        inner = np.arange(fresh, fresh + len(p) - 2)
        fresh += len(p) - 2
        nodes.append(np.concatenate([[a], inner, [b]]))
    start = np.concatenate([p[:-1] for p in polylines])
    stop = np.concatenate([p[1:] for p in polylines])
    curve = np.repeat(np.arange(len(polylines)), [len(p) - 1 for p in polylines])
    node = np.concatenate([np.stack([n[:-1], n[1:]], axis=1) for n in nodes])
    return start, stop, curve, node


def _candidates(polylines: Sequence[Float], start: Float, stop: Float) -> tuple[Int, Int]:
    """Pairs of segments whose boxes come closer than CLOSE."""
    counts = np.array([len(p) - 1 for p in polylines])
    offset = np.concatenate([[0], np.cumsum(counts)])
    first = np.concatenate([np.arange(o, o + n, CHUNK) for o, n in zip(offset, counts)])
    owner = np.repeat(np.arange(len(counts)), -(-counts // CHUNK))
    last = np.minimum(first + CHUNK, offset[owner + 1])
    turning = _turning(start, stop, offset)
    low = np.minimum.reduceat(np.minimum(start, stop), first) - CLOSE
    high = np.maximum.reduceat(np.maximum(start, stop), first)
    one, two = _box_pairs(low, high)
    neighbour = (owner[one] == owner[two]) & (np.abs(one - two) <= 1)
    total = np.concatenate([[0.0], np.cumsum(turning)])
    straight = total[np.maximum(last[one], last[two]) - 1] - total[np.minimum(first[one], first[two])] < np.pi
    keep = ~(neighbour & straight)
    return _open(one[keep], two[keep], first, last, start, stop)


def _turning(start: Float, stop: Float, offset: Int) -> Float:
    """Absolute turn from every segment to the next one of its polyline (0 at its end)."""
    d = stop - start
    cross = d[:-1, 0] * d[1:, 1] - d[:-1, 1] * d[1:, 0]
    turn = np.append(np.abs(np.arctan2(cross, (d[:-1] * d[1:]).sum(1))), 0.0)
    turn[offset[1:] - 1] = 0.0
    return turn


def _box_pairs(low: Float, high: Float) -> tuple[Int, Int]:
    """Pairs (including each with itself) of overlapping boxes, by a sweep over the left sides."""
    order = np.argsort(low[:, 0], kind="stable")
    reach = np.searchsorted(low[order, 0], high[order, 0], side="right")
    count = reach - np.arange(len(order))
    one, two = [], []
    bounds = np.searchsorted(np.cumsum(count), np.arange(BLOCK, int(count.sum()) + BLOCK, BLOCK))
    begin = 0
    for end in [*(bounds + 1).tolist(), len(order)]:
        end = min(end, len(order))
        if end <= begin:
            continue
        rows = np.repeat(np.arange(begin, end), count[begin:end])
        within = np.arange(len(rows)) - np.repeat(np.cumsum(count[begin:end]) - count[begin:end], count[begin:end])
        a, b = order[rows], order[rows + within]
        hit = (low[a, 1] <= high[b, 1]) & (low[b, 1] <= high[a, 1])
        one.append(a[hit])
        two.append(b[hit])
        begin = end
    return np.concatenate(one), np.concatenate(two)


def _open(one: Int, two: Int, first: Int, last: Int, start: Float, stop: Float) -> tuple[Int, Int]:
    """Pairs of segments with overlapping boxes in pairs of chunks, every pair once."""
    low, high = np.minimum(start, stop) - CLOSE, np.maximum(start, stop)
    k = np.arange(CHUNK)
    left, right = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)]
    step = max(1, BLOCK // CHUNK**2)
    for begin in range(0, len(one), step):
        a = first[one[begin : begin + step], None, None] + k[:, None]
        b = first[two[begin : begin + step], None, None] + k[None, :]
        a, b = np.broadcast_arrays(a, b)
        valid = (a < last[one[begin : begin + step], None, None]) & (b < last[two[begin : begin + step], None, None])
        same = (one == two)[begin : begin + step, None, None]
        valid &= ~same | (a < b)
        a, b = a[valid], b[valid]
        hit = (low[a] <= high[b]).all(1) & (low[b] <= high[a]).all(1)
        left.append(a[hit])
        right.append(b[hit])
    return np.concatenate(left), np.concatenate(right)


def _point_segment(p: Float, a: Float, b: Float) -> Float:
    """Distance of points from segments."""
    d = b - a
    length = (d**2).sum(-1)
    t = np.divide(((p - a) * d).sum(-1), length, out=np.zeros(np.broadcast(p[..., 0], length).shape), where=length > 0)
    gap = p - a - np.clip(t, 0.0, 1.0)[..., None] * d
    return np.sqrt((gap**2).sum(-1))


def _cross(u: Float, v: Float) -> Float:
    return u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]


def _separation(a: Float, b: Float, c: Float, d: Float) -> Float:
    """Distance of segments (a, b) and (c, d); 0 where they cross."""
    points = ((a, c, d), (b, c, d), (c, a, b), (d, a, b))
    apart = np.minimum.reduce([_point_segment(*p) for p in points])
    crossing = (_cross(b - a, c - a) * _cross(b - a, d - a) < 0) & (_cross(d - c, a - c) * _cross(d - c, b - c) < 0)
    return np.where(crossing, 0.0, apart)


def _meeting(a: Float, b: Float, c: Float, d: Float) -> Float:
    """Where segments (a, b) meet segments (c, d): their intersection, or a where they are parallel."""
    slope = _cross(b - a, d - c)
    t = np.divide(_cross(c - a, d - c), slope, out=np.zeros(len(a)), where=slope != 0)
    return a + np.clip(t, 0.0, 1.0)[:, None] * (b - a)


def _overlap(start: Float, stop: Float, node: Int, i: Int, j: Int) -> tuple[Bool, Float]:
    """Segments with a common node that also touch elsewhere: the far end of one lies on the other."""
    hit = np.zeros(len(i), bool)
    where = np.zeros((len(i), 2))
    for p, q in ((i, j), (j, i)):
        for side, ends in enumerate((start, stop)):
            far = (node[p, side, None] != node[q]).all(1)
            on = far & (_point_segment(ends[p], start[q], stop[q]) <= TOUCH)
            where[on & ~hit] = ends[p][on & ~hit]
            hit |= on
    return hit, where


def _near(polylines: Sequence[Float], start: Float, stop: Float, curve: Int, i: Int, j: Int) -> tuple[Bool, Float]:
    """Segments without a common node whose curves touch."""
    hit = np.zeros(len(i), bool)
    where = np.zeros((len(i), 2))
    gap = _separation(start[i], stop[i], start[j], stop[j])
    straight = np.array([_straight(p) for p in polylines])
    exact = straight[curve[i]] & straight[curve[j]]
    hit[exact] = gap[exact] <= TOUCH
    where[exact] = _meeting(start[i[exact]], stop[i[exact]], start[j[exact]], stop[j[exact]])
    close = np.flatnonzero(~exact & (gap <= CLOSE))
    offset = np.searchsorted(curve, np.arange(len(polylines)))
    step = BLOCK // FINE**2
    for begin in range(0, len(close), step):
        block = close[begin : begin + step]
        one, two = (_cubics(polylines, curve[s[block]], s[block] - offset[curve[s[block]]]) for s in (i, j))
        gap = _separation(one[:, :-1, None], one[:, 1:, None], two[:, None, :-1], two[:, None, 1:])
        gap = gap.reshape(len(block), -1)
        best = gap.argmin(1)
        hit[block] = gap.min(1) <= TOUCH
        k, m, n = np.arange(len(block)), best // FINE, best % FINE
        where[block] = _meeting(one[k, m], one[k, m + 1], two[k, n], two[k, n + 1])
    return hit, where


def _straight(p: Float) -> bool:
    """Whether a polyline is a straight line, so that its segments are exact."""
    away = p - p[0]
    far = away[np.argmax((away**2).sum(1))]
    return bool(np.abs(_cross(away, far)).max() <= 1e-15)


def _cubics(polylines: Sequence[Float], curve: Int, row: Int) -> Float:
    """FINE + 1 points (k, FINE + 1, 2) on the cubics through segments `row` of polylines `curve`."""
    t = np.linspace(0.0, 1.0, FINE + 1)[None, :, None]
    out = np.zeros((len(curve), FINE + 1, 2))
    for c in np.unique(curve):
        mine = np.flatnonzero(curve == c)
        p, k = polylines[c], row[mine]
        slope = _slopes(p)
        h = np.sqrt(((p[k + 1] - p[k]) ** 2).sum(1))[:, None, None]
        a, b, u, v = p[k][:, None], p[k + 1][:, None], h * slope[k][:, None], h * slope[k + 1][:, None]
        out[mine] = (2 * t**3 - 3 * t**2 + 1) * a + (t**3 - 2 * t**2 + t) * u + (3 * t**2 - 2 * t**3) * b + (t**3 - t**2) * v
    return out


def _slopes(p: Float) -> Float:
    """Derivative by arc length at the points of a polyline, of parabolas through three points."""
    d = np.diff(p, axis=0)
    h = np.sqrt((d**2).sum(1))[:, None]
    s = np.divide(d, h, out=np.zeros_like(d), where=h > 0)
    if len(p) == 2:
        return np.concatenate([s, s])
    total = h[:-1] + h[1:]
    inner = np.divide(s[:-1] * h[1:] + s[1:] * h[:-1], total, out=s[:-1].copy(), where=total > 0)
    return np.concatenate([2 * s[:1] - inner[:1], inner, 2 * s[-1:] - inner[-1:]])
