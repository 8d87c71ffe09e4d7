"""Patches of a curved face that bend too much for one grid, and where to cut them.

A grid is laid into a patch by interpolation between its four sides, in space, and then put on the surface.  That works where
the patch bends in one direction only (a cylinder cut open once) or little in both (a sixth of a sphere), not where it wraps
around in both (a torus, a bent pipe).  Such a patch is cut across the direction that turns most, in the middle of its turning.

The turning of a side is that of a polyline of a few chords through it: the kinks of a trace at the edges of the background do
not count.  A patch whose normals hardly differ is as good as plane, whatever its sides do.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ..records import Float, Int

__all__ = ["bent_patches", "lengths", "middle", "resampled", "turning", "vertex_normals"]

LONG_TURN = np.radians(120.0)
CROSS_TURN = np.radians(50.0)
SPREAD = np.radians(60.0)
CHORDS = 12


def vertex_normals(points: Float, triangles: Int) -> Float:
    """(n, 3) unit normals at the vertices of a triangulated surface, weighted by area."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    area = np.repeat(np.cross(b - a, c - a), 3, axis=0)
    out = np.stack([np.bincount(triangles.ravel(), area[:, k], len(points)) for k in range(3)], axis=1)
    length = np.linalg.norm(out, axis=1, keepdims=True)
    unit: Float = out / np.where(length > 0.0, length, 1.0)
    return unit


def resampled(lines: Sequence[Float], chords: Int) -> tuple[Float, Int]:
    """Every polyline (k, 3) at `chords` + 1 (l,) places of even arc lengths: all points, each first row and the end."""
    count = np.array([len(line) for line in lines], np.int64)
    points = np.concatenate(lines)
    step = np.linalg.norm(np.diff(points, axis=0), axis=1)
    ends = np.cumsum(count)
    step[ends[:-1] - 1] = 1.0  # sets the lines apart
    s = np.concatenate([[0.0], np.cumsum(step)])
    low, length = s[ends - count], s[ends - 1] - s[ends - count]
    first = np.concatenate([[0], np.cumsum(chords + 1)])
    row = np.repeat(np.arange(len(lines)), chords + 1)
    t = (np.arange(first[-1]) - first[row]) / chords[row]
    at = low[row] + t * length[row]
    return np.stack([np.interp(at, s, points[:, k]) for k in range(points.shape[1])], axis=1), first


def turning(samples: Float, first: Int) -> Float:
    """(n,) angle between the chords at the inner points of polylines of more than one chord; the first and the last have none."""
    d = np.diff(samples, axis=0)
    length = np.linalg.norm(d, axis=1)
    d = d / np.where(length > 0.0, length, 1.0)[:, None]
    angle = 2.0 * np.arctan2(np.linalg.norm(d[1:] - d[:-1], axis=1), np.linalg.norm(d[1:] + d[:-1], axis=1))
    out = np.zeros(len(samples))
    out[1:-1] = np.where((length[1:] > 0.0) & (length[:-1] > 0.0), angle, 0.0)
    out[first[:-1]] = out[first[1:] - 1] = 0.0
    return out


def lengths(lines: Sequence[Float]) -> Float:
    """(l,) lengths of polylines."""
    return np.array([float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum()) for line in lines])


def bent_patches(sides: Sequence[Float], normals: Callable[[Float], Float]) -> dict[int, list[int]]:
    """Patches that should be divided, and from which of their sides, the better one first.

    Parameters
    ----------
    sides : (k, 3) float64 each
        Four polylines per patch, counter-clockwise around it.
    normals : callable
        Unit normals (n, 3) of the surface near points (n, 3).
    """
    samples, first = resampled(sides, np.full(len(sides), CHORDS))
    total = np.add.reduceat(turning(samples, first), first[:-1]).reshape(-1, 4) * (CHORDS / (CHORDS - 1))
    turn = 0.5 * (total[:, :2] + total[:, 2:])
    out: dict[int, list[int]] = {}
    for p in np.flatnonzero((turn.max(axis=1) >= LONG_TURN) & (turn.min(axis=1) >= CROSS_TURN)).tolist():
        n = normals(samples[first[4 * p] : first[4 * p + 4]])
        if float((n @ n.T).min()) > np.cos(SPREAD):
            continue
        long = int(turn[p, 1] > turn[p, 0])
        one, two = lengths([sides[4 * p + long], sides[4 * p + long + 2]]).tolist()
        out[p] = [long, long + 2] if one >= two else [long + 2, long]
    return out


def middle(side: Float) -> float:
    """Arc length at which a side has half of its turning (a fifth of it counted by length)."""
    share = turning(*resampled([side], np.array([CHORDS])))
    weight = 0.5 * (share[1:] + share[:-1])
    total = weight.sum()
    weight = weight * (0.8 / total if total > 0.0 else 0.0) + 0.2 / CHORDS
    grown = np.concatenate([[0.0], np.cumsum(weight)])
    return float(np.interp(0.5 * grown[-1], grown, np.linspace(0.0, float(lengths([side])[0]), CHORDS + 1)))
