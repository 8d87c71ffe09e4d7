"""The conforming quad complex of a T-mesh for given integer arc lengths.

An arc with n divisions carries n - 1 points; a zero arc joins its end nodes, and a patch of a x 0 joins the points of its
two long sides pairwise.  A patch of a x b becomes a grid of quads.  The quotient of all points by these joins is the
conforming complex (Lyon, Campen, Kobbelt 2021; Campen, Bommes, Kobbelt 2015).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import LayoutError
from ..records import Int, TMesh

__all__ = ["Join", "Quotient", "quotient"]


@dataclass(frozen=True)
class Join:
    """One join of two elements: by a zero arc (`arc`), or across a degenerate patch (`patch`, its zero `axis`)."""

    a: int
    b: int
    arc: int = -1
    patch: int = -1
    axis: int = -1


@dataclass(frozen=True)
class Quotient:
    """Elements are nodes, then arc points (arc by arc), then inner patch points.

    Attributes
    ----------
    divisions : (a,) int64
    offset : (a,) int64
        First arc point of every arc.
    n_joinable : int
        Number of nodes and arc points.
    representative : (n_joinable,) int64
        Class of every node and arc point.
    joins : tuple of Join
    vertex : (n_elements,) int64
        Vertex of the quad complex of every element; -1 for elements in no quad.
    n_vertices : int
    quads : (q, 4) int64
    quad_patch : (q,) int64
    grids : tuple of (patch, (a + 1, b + 1) int64 array of elements)
    """

    divisions: Int
    offset: Int
    n_joinable: int
    representative: Int
    joins: tuple[Join, ...]
    vertex: Int
    n_vertices: int
    quads: Int
    quad_patch: Int
    grids: tuple[tuple[int, Int], ...]


def arc_points(tmesh: TMesh, divisions: Int, offset: Int, arc: int) -> list[int]:
    """Elements along an arc from start to end; a zero arc is its start node alone."""
    a, b = tmesh.arcs[arc].tolist()
    n = int(divisions[arc])
    return [a] if n == 0 else [a, *range(int(offset[arc]), int(offset[arc]) + n - 1), b]


def side_points(tmesh: TMesh, divisions: Int, offset: Int, side: tuple[tuple[int, int], ...]) -> list[int]:
    """Elements along the side of a patch; at a joint the element of the arc before it."""
    out: list[int] = []
    for arc, way in side:
        points = arc_points(tmesh, divisions, offset, arc)
        if divisions[arc] == 0:
            points = [int(tmesh.arcs[arc, 0 if way > 0 else 1])]
        elif way < 0:
            points = points[::-1]
        if not out:
            out = points
        elif divisions[arc] > 0:
            out = out + points[1:]
    return out


def _classes(n: int, joins: list[Join]) -> Int:
    """Smallest element of every class."""
    parent = list(range(n))

    def find(x: int) -> int:
        while parent[x] != x:
            parent[x] = parent[parent[x]]
            x = parent[x]
        return x

    for j in joins:
        a, b = find(j.a), find(j.b)
        if a != b:
            parent[max(a, b)] = min(a, b)
    return np.array([find(i) for i in range(n)], np.int64)


def quotient(tmesh: TMesh, divisions: Int) -> Quotient:
    """Build the quad complex.

    Parameters
    ----------
    tmesh : TMesh
    divisions : (a,) int64, >= 0
        Opposite sides of every patch must have equal sums.

    Raises
    ------
    LayoutError
        The sums of two opposite sides differ (an invariant of the quantization).
    """
    divisions = np.asarray(divisions, np.int64)
    counts = np.maximum(divisions - 1, 0)
    n_nodes = len(tmesh.position)
    offset = n_nodes + np.concatenate([[0], np.cumsum(counts)[:-1]]).astype(np.int64)
    n_joinable = n_nodes + int(counts.sum())

    joins = [Join(int(a), int(b), arc=int(i)) for i in np.flatnonzero(divisions == 0) for a, b in [tmesh.arcs[i]]]
    regular: list[tuple[int, int, int]] = []
    for p, sides in enumerate(tmesh.patches):
        total = [sum(int(divisions[arc]) for arc, _ in side) for side in sides]
        if total[0] != total[2] or total[1] != total[3]:
            raise LayoutError(f"opposite sides of layout patch {p} have different divisions {total}")
        a, b = total[0], total[1]
        if a and b:
            regular.append((p, a, b))
        elif a or b:
            axis = 0 if a == 0 else 1
            left = side_points(tmesh, divisions, offset, sides[1 - axis])
            right = side_points(tmesh, divisions, offset, sides[3 - axis])[::-1]
            # the ends are joined by the zero arcs of the short sides
            joins += [Join(x, y, patch=p, axis=axis) for x, y in zip(left[1:-1], right[1:-1])]
    representative = _classes(n_joinable, joins)

    grids: list[tuple[int, Int]] = []
    quads: list[Int] = []
    quad_patch: list[Int] = []
    n_elements = n_joinable
    for p, a, b in regular:
        s = [np.array(side_points(tmesh, divisions, offset, side), np.int64) for side in tmesh.patches[p]]
        grid = np.empty((a + 1, b + 1), np.int64)
        grid[:, 0], grid[a, :], grid[:, b], grid[0, :] = s[0], s[1], s[2][::-1], s[3][::-1]
        inner = (a - 1) * (b - 1)
        grid[1:a, 1:b] = n_elements + np.arange(inner).reshape(a - 1, b - 1)
        n_elements += inner
        grids.append((p, grid))
        quads.append(np.stack([grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]], axis=2).reshape(-1, 4))
        quad_patch.append(np.full(a * b, p, np.int64))
    classes = np.concatenate([representative, np.arange(n_joinable, n_elements)])
    vertex = np.full(n_elements, -1, np.int64)
    if quads:
        used, inverse = np.unique(classes[np.concatenate(quads)], return_inverse=True)
        number = np.full(n_elements, -1, np.int64)
        number[used] = np.arange(len(used))
        vertex = number[classes]
        all_quads, n_vertices = inverse.reshape(-1, 4).astype(np.int64), len(used)
    else:
        all_quads, n_vertices = np.zeros((0, 4), np.int64), 0
    return Quotient(
        divisions=divisions,
        offset=offset,
        n_joinable=n_joinable,
        representative=representative,
        joins=tuple(joins),
        vertex=vertex,
        n_vertices=n_vertices,
        quads=all_quads,
        quad_patch=np.concatenate(quad_patch) if quad_patch else np.zeros(0, np.int64),
        grids=tuple(grids),
    )


def curve_chain(tmesh: TMesh, q: Quotient, curve: int) -> list[int]:
    """Vertices of the quad complex along a CAD curve, from its start to its end."""
    chain: list[int] = []
    for arc in tmesh.pieces[curve]:
        if q.divisions[arc] > 0:
            points = [int(q.vertex[x]) for x in arc_points(tmesh, q.divisions, q.offset, arc)]
            chain += points if not chain else points[1:]
    return chain
