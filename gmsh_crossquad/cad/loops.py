"""Boundary loops of a planar face, the face on the left.

The input is the multiset of curves that bound the face; nothing is assumed about their order or signs.

1. A curve that occurs an even number of times has the face on both sides: it is no boundary but embedded (a slit, or
   the bridge between the outer loop and a hole).
2. The others form chains between the vertices where not exactly two of them meet.  A ray from the middle of a chain to
   its left crosses all chains an odd number of times if and only if the face is on the left (even-odd rule).
3. Where more than two chain ends meet, loops must not cross: the follower of an incoming end is the next end clockwise,
   so that the sector between them belongs to the face.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Sequence

import numpy as np

from ..errors import GeometryError
from ..records import Curve, Float

__all__ = ["boundary_loops", "polygon", "signed_area"]

Loop = tuple[tuple[int, int], ...]


def signed_area(points: Float) -> float:
    """Signed area of a closed polygon (n, 2), the last point joined to the first."""
    p = points - points[0]
    q = np.roll(p, -1, axis=0)
    return 0.5 * float((p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]).sum())


def polygon(loop: Loop, flat: dict[int, Float]) -> Float:
    """Points (n, 2) of a loop in order, every point once."""
    return np.concatenate([(flat[c] if sign > 0 else flat[c][::-1])[:-1] for c, sign in loop])


def boundary_loops(
    rows: Sequence[int], curves: Sequence[Curve], flat: dict[int, Float], tag: int, vertices: Float
) -> tuple[tuple[Loop, ...], tuple[int, ...]]:
    """Assemble the loops of a face.

    Parameters
    ----------
    rows : sequence of int
        Rows of the curves in the face's boundary, repeated where they occur repeatedly.
    curves : sequence of Curve
    flat : dict
        Curve row to its samples (n, 2) in the frame of the face.
    tag : int
        Gmsh tag of the face, for errors.
    vertices : (v, 3) float64
        Of the model, in the user's coordinates, for errors.

    Returns
    -------
    loops : tuple of loops
        Outer loop (the greatest) first and counter-clockwise, holes clockwise, in the order of their first curve.
    inner : tuple of int
        Curves that the face has on both sides.

    Raises
    ------
    GeometryError
        Where a chain of curves does not close or the boundary crosses itself in a vertex.
    """
    count = Counter(rows)
    single = [c for c in count if count[c] % 2]
    inner = tuple(c for c in count if not count[c] % 2)
    ends: dict[int, list[tuple[int, int]]] = defaultdict(list)
    for c in single:
        ends[curves[c].start].append((c, 0))
        ends[curves[c].end].append((c, 1))
    for vertex, there in ends.items():
        if len(there) % 2:
            raise GeometryError(
                "the boundary does not close", entity=(2, tag), location=vertices[vertex], remedy="close the curve loop there"
            )
    directed = _direct(single, ends, curves, flat)
    following = _followers(ends, curves, directed, flat, tag, vertices)
    loops = []
    seen: set[int] = set()
    for first in single:
        if first in seen:
            continue
        loop, c = [], first
        while c not in seen:
            seen.add(c)
            loop.append((c, directed[c]))
            c = following[c]
        loops.append(tuple(loop))
    areas = [signed_area(polygon(loop, flat)) for loop in loops]
    outer = sorted((i for i in range(len(loops)) if areas[i] > 0), key=lambda i: -areas[i])
    holes = [i for i in range(len(loops)) if areas[i] <= 0]
    return tuple(loops[i] for i in outer + holes), inner


def _direct(
    single: list[int], ends: dict[int, list[tuple[int, int]]], curves: Sequence[Curve], flat: dict[int, Float]
) -> dict[int, int]:
    """Direction +-1 of every curve for the face to be on its left."""
    a = np.concatenate([flat[c][:-1] for c in single]) if single else np.zeros((0, 2))
    b = np.concatenate([flat[c][1:] for c in single]) if single else np.zeros((0, 2))
    directed: dict[int, int] = {}
    for first in single:
        if first in directed:
            continue
        directed[first] = _side(flat[first], a, b)
        stack = [first]
        while stack:  # along the chain: where exactly two ends meet, the face stays on the same side
            c = stack.pop()
            for vertex in (curves[c].start, curves[c].end):
                if len(ends[vertex]) != 2:
                    continue
                (p, ep), (q, eq) = ends[vertex] if ends[vertex][0][0] == c else ends[vertex][::-1]
                if q not in directed:
                    directed[q] = directed[p] if ep != eq else -directed[p]
                    stack.append(q)
    return directed


def _side(points: Float, a: Float, b: Float) -> int:
    """+1 if the face is on the left of a curve: parity of the crossings of a ray from its longest segment.

    The ray starts in the middle of the segment along the coordinate axis that is more across it.
    """
    d = np.diff(points, axis=0)
    k = int(np.argmax((d**2).sum(1)))
    across = int(abs(d[k, 1]) < abs(d[k, 0]))
    x, y = 1 - across, across
    middle = 0.5 * (points[k] + points[k + 1])
    rows = np.flatnonzero((a[:, x] > middle[x]) != (b[:, x] > middle[x]))
    rows = rows[((a[rows] != points[k]) | (b[rows] != points[k + 1])).any(1)]
    p, q = a[rows], b[rows]
    height = p[:, y] + (middle[x] - p[:, x]) * (q[:, y] - p[:, y]) / (q[:, x] - p[:, x])
    inside = int((height > middle[y]).sum()) % 2 == 1  # on the side to which coordinate y grows
    left = (d[k, x] > 0) if across else (d[k, x] < 0)
    return 1 if inside == left else -1


def _followers(
    ends: dict[int, list[tuple[int, int]]],
    curves: Sequence[Curve],
    directed: dict[int, int],
    flat: dict[int, Float],
    tag: int,
    vertices: Float,
) -> dict[int, int]:
    """Curve that follows every curve in its loop."""
    following: dict[int, int] = {}
    for vertex, there in ends.items():
        arriving = [(c, e) for c, e in there if (directed[c] > 0) == (e == 1)]
        leaving = [(c, e) for c, e in there if (directed[c] > 0) == (e == 0)]
        if len(there) == 2 and len(arriving) == 1:
            following[arriving[0][0]] = leaving[0][0]
            continue
        if len(arriving) != len(leaving):
            raise GeometryError(
                "the boundary crosses itself", entity=(2, tag), location=vertices[vertex], remedy="split the surface there"
            )
        reach = 0.05 * min(curves[c].length for c, _ in there)
        angle = {end: _chord_angle(curves[end[0]], flat[end[0]], end[1], reach) for end in there}
        for end in arriving:
            turn = {other: (angle[end] - angle[other]) % (2 * np.pi) for other in leaving}
            best = min(leaving, key=lambda other: turn[other])
            following[end[0]] = best[0]
            leaving.remove(best)
    return following


def _chord_angle(curve: Curve, flat: Float, end: int, reach: float) -> float:
    """Angle of the chord from an end of a curve to its point at arc length `reach` from there."""
    s = reach if end == 0 else curve.length - reach
    p = np.array([np.interp(s, curve.arclength, flat[:, k]) for k in range(2)])
    d = p - (flat[0] if end == 0 else flat[-1])
    return float(np.arctan2(d[1], d[0]))
