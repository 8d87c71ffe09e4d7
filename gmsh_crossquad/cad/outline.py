"""The nodes and segments from which the background mesh of a face is made."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..records import Float, Int, Model
from .seeds import InnerPoints

__all__ = ["Outline", "outline"]


@dataclass(frozen=True)
class Outline:
    """Polygons of a face with all that is embedded in it.

    Attributes
    ----------
    points : (n, 2) float64
        Local coordinates.
    vertex : (n,) int64
        Row of `Model.vertices`, -1 for inner nodes of curves.
    segments : (k, 2) int64
        Pairs of points in the direction of their curve.
    curve : (k,) int64
        Row of `Model.curves`.
    arclength : (k, 2) float64
        Arc length on it at both ends.
    loops : tuple of (segment rows, +1 or -1)
        Outer loop first; the sign tells whether the loop runs against the curve.
    embedded : (j,) int64
        Segments inside the face.
    embedded_points : (i,) int64
        Points inside the face that are on no curve of it.
    inner : InnerPoints
        The same points: what they are, and how fine the triangles are there.
    area : float
        Area of the polygons.
    """

    points: Float
    vertex: Int
    segments: Int
    curve: Int
    arclength: Float
    loops: tuple[tuple[Int, Int], ...]
    embedded: Int
    embedded_points: Int
    inner: InnerPoints
    area: float


def outline(
    model: Model, row: int, spacing: tuple[Float, ...], inner: InnerPoints, local: Callable[[Float], Float] | None = None
) -> Outline:
    """Nodes and segments of face `row`.

    Parameters
    ----------
    model : Model
    row : int
    spacing : tuple of (k + 1,) float64
        Arc lengths of the nodes of every curve, 0 and the length included.
    inner : InnerPoints
        Those of the face.
    local : callable, optional
        Takes points (n, 3) of the model to where the outline has them; default: the plane of the face.
    """
    face = model.faces[row]
    used = list(dict.fromkeys([c for loop in face.loops for c, _ in loop] + list(face.embedded_curves)))
    ends = [v for c in used for v in (model.curves[c].start, model.curves[c].end)]
    vertex = np.array(list(dict.fromkeys(ends + list(face.embedded_points))), np.int64)
    point_of = {v: i for i, v in enumerate(vertex.tolist())}
    world, segments, curve, arclength = [model.vertices[vertex]], [], [], []
    rows: dict[int, Int] = {}
    n_points, n_segments = len(vertex), 0
    for c in used:
        record, s = model.curves[c], spacing[c]
        between = n_points + np.arange(len(s) - 2)
        chain = np.concatenate([[point_of[record.start]], between, [point_of[record.end]]])
        world.append(record.at(s[1:-1]))
        segments.append(np.stack([chain[:-1], chain[1:]], axis=1))
        curve.append(np.full(len(s) - 1, c))
        arclength.append(np.stack([s[:-1], s[1:]], axis=1))
        rows[c] = n_segments + np.arange(len(s) - 1)
        n_points += len(between)
        n_segments += len(s) - 1
    seeded = inner.seed >= 0
    points = np.concatenate([(local or face.local)(np.concatenate(world)), inner.points[seeded]])
    pairs = np.concatenate(segments)
    loops = []
    area = 0.0
    for loop in face.loops:
        order = np.concatenate([rows[c] if sign > 0 else rows[c][::-1] for c, sign in loop])
        signs = np.concatenate([np.full(len(rows[c]), sign) for c, sign in loop])
        p, q = points[pairs[order, 0]], points[pairs[order, 1]]
        area += 0.5 * float(np.sum(signs * (p[:, 0] * q[:, 1] - q[:, 0] * p[:, 1])))
        loops.append((order, signs))
    return Outline(
        points=points,
        vertex=np.concatenate([vertex, np.full(len(points) - len(vertex), -1)]),
        segments=pairs,
        curve=np.concatenate(curve),
        arclength=np.concatenate(arclength),
        loops=tuple(loops),
        embedded=np.concatenate([rows[c] for c in face.embedded_curves]) if face.embedded_curves else np.zeros(0, np.int64),
        embedded_points=np.array([*(point_of[v] for v in face.embedded_points), *range(n_points, len(points))], np.int64),
        inner=inner,
        area=area,
    )
