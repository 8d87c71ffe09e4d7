"""Do the segments of an outline cross?

A curve may be valid and the polygon through its background nodes not: where another curve runs closer than the chord's
deviation.  Gmsh's mesher does not return from such input, so it must be found before.  Boxes of segments are paired by a sweep
along x; a pair without a common point crosses where each separates the ends of the other, or touches it.
"""

from __future__ import annotations

import numpy as np

from ..records import Bool, Float, Int
from .outline import Outline

__all__ = ["crossings", "without_crossings"]

BLOCK = 1 << 20


def crossings(shape: Outline) -> Int:
    """Pairs (k, 2) of segments of an outline that cross or touch without a common point."""
    a, b = shape.points[shape.segments[:, 0]], shape.points[shape.segments[:, 1]]
    low, high = np.minimum(a, b), np.maximum(a, b)
    order = np.argsort(low[:, 0], kind="stable")
    reach = np.searchsorted(low[order, 0], high[order, 0], side="right")
    count = reach - np.arange(len(order)) - 1
    found = [np.zeros((0, 2), np.int64)]
    total = np.cumsum(count)
    for begin in range(0, int(total[-1]), BLOCK):
        k = np.arange(begin, min(begin + BLOCK, int(total[-1])))
        first = np.searchsorted(total, k, side="right")
        second = first + 1 + k - (total[first] - count[first])
        i, j = order[first], order[second]
        keep = (low[i, 1] <= high[j, 1]) & (low[j, 1] <= high[i, 1])
        i, j = i[keep], j[keep]
        apart = (shape.segments[i][:, :, None] != shape.segments[j][:, None, :]).all(axis=(1, 2))
        i, j = i[apart], j[apart]
        crossed = _sides(a[i], b[i], a[j], b[j]) & _sides(a[j], b[j], a[i], b[i])
        found.append(np.stack([i[crossed], j[crossed]], axis=1))
    return np.concatenate(found)


def _sides(p: Float, q: Float, a: Float, b: Float) -> Bool:
    """Are a and b on different sides of the lines through p and q (or on them)?"""
    d = q - p
    left = np.sign(d[:, 0] * (a - p)[:, 1] - d[:, 1] * (a - p)[:, 0])
    right = np.sign(d[:, 0] * (b - p)[:, 1] - d[:, 1] * (b - p)[:, 0])
    return np.asarray(left * right <= 0)


def without_crossings(spacing: tuple[Float, ...], shape: Outline, pairs: Int) -> tuple[Float, ...]:
    """Spacing with one more node in the middle of every segment that crosses another."""
    out = list(spacing)
    for row in np.unique(pairs):
        c = int(shape.curve[row])
        out[c] = np.union1d(out[c], shape.arclength[row].mean())
    return tuple(out)
