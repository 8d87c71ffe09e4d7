"""Patches of a curved face that bend too much for one grid, and where to cut them.

A grid is laid into a patch by interpolation between its four sides, in space, and then put on the surface.  That works where
the patch bends in one direction only (a cylinder cut open once) or little in both (a sixth of a sphere), not where it wraps
around in both (a torus, a bent pipe).  Such a patch is cut across the direction that turns most, in the middle of its turning.

The turning of a side is that of a polyline of a few chords through it: the kinks of a trace at the edges of the background do
not count.  A patch whose normals hardly differ is as good as plane, whatever its sides do.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..records import Float

__all__ = ["bend", "middle", "resampled", "turning", "vertex_normals"]

LONG_TURN = np.radians(120.0)
CROSS_TURN = np.radians(50.0)
SPREAD = np.radians(60.0)
CHORDS = 12


def vertex_normals(points: Float, triangles: np.ndarray) -> Float:
    """(n, 3) unit normals at the vertices of a triangulated surface, weighted by area."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    area = np.repeat(np.cross(b - a, c - a), 3, axis=0)
    out = np.stack([np.bincount(triangles.ravel(), area[:, k], len(points)) for k in range(3)], axis=1)
    length = np.linalg.norm(out, axis=1, keepdims=True)
    unit: Float = out / np.where(length > 0.0, length, 1.0)
    return unit


def resampled(line: Float, chords: int = CHORDS) -> Float:
    """Points (chords + 1, d) at even arc lengths of a polyline."""
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    t = np.linspace(0.0, s[-1], chords + 1)
    return np.stack([np.interp(t, s, line[:, k]) for k in range(line.shape[1])], axis=1)


def turning(samples: Float) -> Float:
    """(k - 1,) angles between consecutive chords of a polyline of k + 1 points; 0 beside chords of no length."""
    d = np.diff(samples, axis=0)
    length = np.linalg.norm(d, axis=1)
    d = d / np.where(length > 0.0, length, 1.0)[:, None]
    angle = 2.0 * np.arctan2(np.linalg.norm(d[1:] - d[:-1], axis=1), np.linalg.norm(d[1:] + d[:-1], axis=1))
    out: Float = np.where((length[1:] > 0.0) & (length[:-1] > 0.0), angle, 0.0)
    return out


def bend(sides: list[Float], normals: Callable[[Float], Float]) -> list[int]:
    """Sides from which a patch should be cut, the better one first; none if it need not.

    Parameters
    ----------
    sides : four (k, 3) float64
        Polylines counter-clockwise around the patch.
    normals : callable
        Unit normals (n, 3) of the surface near points (n, 3).
    """
    samples = [resampled(side) for side in sides]
    total = [float(turning(p).sum()) * CHORDS / (CHORDS - 1) for p in samples]
    turn = [0.5 * (total[0] + total[2]), 0.5 * (total[1] + total[3])]
    long = int(turn[1] > turn[0])
    if turn[long] < LONG_TURN or turn[1 - long] < CROSS_TURN:
        return []
    n = normals(np.concatenate(samples))
    if float((n @ n.T).min()) > np.cos(SPREAD):
        return []
    length = [float(np.linalg.norm(np.diff(side, axis=0), axis=1).sum()) for side in sides]
    return [long, long + 2] if length[long] >= length[long + 2] else [long + 2, long]


def middle(side: Float) -> float:
    """Arc length at which a side has half of its turning (a fifth of it counted by length)."""
    samples = resampled(side)
    share = np.concatenate([[0.0], turning(samples), [0.0]])
    weight = 0.5 * (share[1:] + share[:-1])
    total = weight.sum()
    weight = weight * (0.8 / total if total > 0.0 else 0.0) + 0.2 / CHORDS
    length = float(np.linalg.norm(np.diff(side, axis=0), axis=1).sum())
    grown = np.concatenate([[0.0], np.cumsum(weight)])
    return float(np.interp(0.5 * grown[-1], grown, np.linspace(0.0, length, CHORDS + 1)))
