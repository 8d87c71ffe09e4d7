"""Cracks that are drawn twice: pairs of curves of one face that lie on each other.

Both curves of a pair (`coincident`) get the same nodes (`mirrored`).  The outline for the mesher has coincident nodes merged,
and segments that lie on each other are one embedded segment instead of two boundary ones (`merged`); cutting the mesh open
along it gives the two lips back.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..records import Float, Int, Model
from .outline import Outline

__all__ = ["coincident", "merged", "mirrored"]

COINCIDENT = 1e-6  # of the model
SAMPLES = np.arange(0.5, 8.0) / 8


def coincident(model: Model) -> list[tuple[int, int, bool]]:
    """Curves (first, second) of one face that coincide, and whether they run in opposite directions."""
    out = []
    for face in model.faces:
        rows = list(dict.fromkeys(c for loop in face.loops for c, _ in loop))
        if len(rows) < 2 or face.curved:
            continue
        middles = np.stack([model.curves[c].at(np.array([0.5 * model.curves[c].length]))[0] for c in rows])
        order = np.argsort(middles @ [1.0, 0.7, 0.3], kind="stable")
        sorted_middles = middles[order]
        close = np.flatnonzero(np.linalg.norm(np.diff(sorted_middles, axis=0), axis=1) < COINCIDENT)
        for k in close:
            a, b = sorted((rows[order[k]], rows[order[k + 1]]))
            one, two = model.curves[a], model.curves[b]
            for opposite in (True, False):
                other = two.at((1.0 - SAMPLES if opposite else SAMPLES) * two.length)
                if np.abs(one.at(SAMPLES * one.length) - other).max() < COINCIDENT:
                    out.append((a, b, opposite))
                    break
    return out


def mirrored(model: Model, spacing: tuple[Float, ...], pairs: list[tuple[int, int, bool]]) -> tuple[Float, ...]:
    """Spacing with the same nodes on both curves of every coincident pair."""
    out = list(spacing)
    for a, b, opposite in pairs:
        share = out[a] / out[a][-1]
        s = (1.0 - share[::-1] if opposite else share) * model.curves[b].length
        s[0], s[-1] = 0.0, model.curves[b].length
        out[b] = s
    return tuple(out)


def merged(shape: Outline, pairs: list[tuple[int, int, bool]]) -> tuple[Outline, Int]:
    """The outline for the mesher.

    Returns
    -------
    Outline
        Without coincident points; its segments have the same rows.
    point : (n,) int64
        Its point for every point of `shape`.
    """
    n = len(shape.points)
    first = np.arange(n)
    for a, b, opposite in pairs:
        one, two = (_chain(shape, c) for c in (a, b))
        for p, q in zip(one.tolist(), two[::-1].tolist() if opposite else two.tolist()):
            first[first == max(first[p], first[q])] = min(first[p], first[q])
    if not (first < np.arange(n)).any():
        return shape, np.arange(n)
    kept, point = np.unique(first, return_inverse=True)
    segments = point[shape.segments]
    key = segments.min(axis=1) * n + segments.max(axis=1)
    _, single, inverse, count = np.unique(key, return_index=True, return_inverse=True, return_counts=True)
    loops = []
    for rows, signs in shape.loops:
        once = count[inverse[rows]] == 1
        if once.any():
            loops.append((rows[once], signs[once]))
    double = single[count > 1]
    plain = replace(
        shape,
        points=shape.points[kept],
        vertex=shape.vertex[kept],
        segments=segments,
        loops=tuple(loops),
        embedded=np.concatenate([shape.embedded, double]),
        embedded_points=point[shape.embedded_points],
    )
    return plain, point


def _chain(shape: Outline, curve: int) -> Int:
    """Points on a curve in its direction; empty where it is not in the outline."""
    rows = np.flatnonzero(shape.curve == curve)
    return np.append(shape.segments[rows, 0], shape.segments[rows[-1:], 1])
