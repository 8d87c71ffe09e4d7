"""Where points are with respect to a planar face: in it, on its curves, off its plane.

The boundary is that of the curves' samples, which stand for the curves to 1e-6 of the model.
"""

from __future__ import annotations

import numpy as np

from ..records import Bool, Face, Float, Int, Model

__all__ = ["curve_distance", "height", "inside"]

CHUNK = 2_000_000  # pairs of a point and a segment at a time


def height(face: Face, points: Float) -> Float:
    """(n,) signed distances of scaled points (n, 3) from the plane of a face."""
    out: Float = (np.asarray(points) - face.origin) @ np.cross(face.axes[0], face.axes[1])
    return out


def inside(model: Model, row: int, points: Float) -> Bool:
    """(n,) whether local coordinates (n, 2) are in face `row`, by the even-odd rule over all its loops."""
    face = model.faces[row]
    lines = [face.local(model.curves[c].points) for loop in face.loops for c, _ in loop]
    p, q = np.concatenate([line[:-1] for line in lines]), np.concatenate([line[1:] for line in lines])
    out = np.zeros(len(points), bool)
    step = max(1, CHUNK // len(p))
    for first in range(0, len(points), step):
        x, y = points[first : first + step].T
        point, segment = np.nonzero((p[:, 1] > y[:, None]) != (q[:, 1] > y[:, None]))
        a, b = p[segment], q[segment]
        right = a[:, 0] + (y[point] - a[:, 1]) * (b[:, 0] - a[:, 0]) / (b[:, 1] - a[:, 1]) > x[point]
        out[first : first + step] = np.bincount(point[right], minlength=len(x)) % 2 == 1
    return out


def curve_distance(model: Model, row: int, points: Float) -> tuple[Float, Int]:
    """Distances of points from the curves of face `row`, embedded ones included.

    Parameters
    ----------
    model : Model
    row : int
    points : (n, 2) or (n, 3) float64
        Local coordinates.

    Returns
    -------
    distance : (n,) float64
    curve : (n,) int64
        Row of the nearest curve, -1 where the face has none.
    """
    face = model.faces[row]
    rows = list(dict.fromkeys([c for loop in face.loops for c, _ in loop] + list(face.embedded_curves)))
    if not rows:
        return np.full(len(points), np.inf), np.full(len(points), -1)
    lines = [face.local(model.curves[c].points) for c in rows]
    owner = np.repeat(rows, [len(line) - 1 for line in lines])
    a = np.concatenate([line[:-1] for line in lines])
    d = np.concatenate([np.diff(line, axis=0) for line in lines])
    square = np.maximum((d**2).sum(axis=1), np.finfo(float).tiny)
    distance, curve = np.full(len(points), np.inf), np.zeros(len(points), np.int64)
    step = max(1, CHUNK // len(a))
    for first in range(0, len(points), step):
        to = points[first : first + step, None] - a
        t = np.clip((to * d).sum(axis=2) / square, 0.0, 1.0)
        away = np.sqrt(((to - t[:, :, None] * d) ** 2).sum(axis=2))
        near = away.argmin(axis=1)
        distance[first : first + step] = away[np.arange(len(near)), near]
        curve[first : first + step] = owner[near]
    return distance, curve
