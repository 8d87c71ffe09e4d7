"""Cuts that keep the handles of curved faces open.

No loop that cannot be drawn together on its face may shrink to a point in the quotient.  Around a hole the boundary loop is kept
by its least number of divisions, but a torus has no boundary, and nothing critical either.  A class of joined elements holds
such a loop if one of the cycles of its joins is not homologous to zero; homology modulo 2 is enough, since a simple closed curve
that is no boundary of a part of the face is odd in it.  The widths on the cycle must add up to 1; that it lands elsewhere
(`cuts`) is no way out here, since it would wind around the handle.  Nor may an arc with divisions become a loop that can be drawn
together: where nothing critical is near, a face would collapse into such loops.

Every arc gets a bit per independent class of loops, such that the bits around every patch cancel: arcs of a spanning tree have
none, those of the other arcs follow by elimination.  An element inside an arc counts as the start of the arc.
"""

from __future__ import annotations

import itertools
from collections import defaultdict, deque

import numpy as np

from ..records import Model, TMesh
from .cuts import Cut, PathCut
from .quotient import Join, Quotient, arc_points

__all__ = ["handle_cuts", "homology"]


def homology(model: Model, tmesh: TMesh) -> dict[int, int]:
    """Bits of every arc of the curved faces that have loops which cannot be drawn together; other arcs are left out.

    Bits are those of one face: no arc inside a face is in another one, and arcs on curves get those of the last face.
    """
    out: dict[int, int] = {}
    shift = 0
    for f in range(len(model.faces)):
        if not model.faces[f].curved or tmesh.euler[f] > 0:
            continue
        patches = [tmesh.patches[p] for p in np.flatnonzero(tmesh.patch_face == f).tolist()]
        bits, count = _cocycles(tmesh, patches)
        out.update({arc: value << shift for arc, value in bits.items()})
        shift += count
    return out


def _cocycles(tmesh: TMesh, patches: list[tuple[tuple[tuple[int, int], ...], ...]]) -> tuple[dict[int, int], int]:
    """Bits of the arcs of some patches that cancel around each of them, and their number."""
    arcs = sorted({arc for patch in patches for side in patch for arc, _ in side})
    parent = {node: node for arc in arcs for node in tmesh.arcs[arc].tolist()}

    def find(x: int) -> int:
        while parent[x] != x:
            parent[x] = parent[parent[x]]
            x = parent[x]
        return x

    column: dict[int, int] = {}
    for arc in arcs:
        a, b = (find(x) for x in tmesh.arcs[arc].tolist())
        if a == b:
            column[arc] = len(column)
        parent[a] = b
    pivots: dict[int, int] = {}  # reduced rows by their highest column
    for patch in patches:
        row = 0
        for side in patch:
            for arc, _ in side:
                row ^= 1 << column[arc] if arc in column else 0
        while row and (top := row.bit_length() - 1) in pivots:
            row ^= pivots[top]
        if row:
            pivots[row.bit_length() - 1] = row
    value = [0] * len(column)
    count = 0
    for c in range(len(column)):
        if c not in pivots:
            value[c] = 1 << count
            count += 1
            continue
        rest = pivots[c] ^ (1 << c)
        while rest:
            top = rest.bit_length() - 1
            value[c] ^= value[top]
            rest ^= 1 << top
    return {arc: value[column[arc]] if arc in column else 0 for arc in arcs}, count


def handle_cuts(tmesh: TMesh, q: Quotient, bits: dict[int, int]) -> list[Cut]:
    """Cuts that the current quotient violates (empty: no handle is closed).

    Parameters
    ----------
    tmesh : TMesh
    q : Quotient
    bits : dict of arc -> int
        Of `homology`.
    """
    if not bits:
        return []
    neighbours: dict[int, list[tuple[int, Join]]] = defaultdict(list)
    for join in q.joins:
        neighbours[join.a].append((join.b, join))
        neighbours[join.b].append((join.a, join))
    finder = PathCut(tmesh, q, neighbours)
    label = {join: _label(tmesh, finder, join, bits) for join in q.joins}
    before: dict[int, tuple[int, Join] | None] = {}
    sum_to: dict[int, int] = {}
    depth: dict[int, int] = {}
    for root in sorted(neighbours):
        if root in before:
            continue
        before[root], sum_to[root], depth[root] = None, 0, 0
        queue = deque([root])
        while queue:
            x = queue.popleft()
            for y, join in neighbours[x]:
                if y not in before:
                    before[y], sum_to[y], depth[y] = (x, join), sum_to[x] ^ label[join], depth[x] + 1
                    queue.append(y)
    shortest: dict[tuple[int, int], tuple[int, Join]] = {}
    for join in q.joins:
        if mask := sum_to[join.a] ^ sum_to[join.b] ^ label[join]:
            key = int(q.representative[join.a]), mask
            length = depth[join.a] + depth[join.b]
            if key not in shortest or length < shortest[key][0]:
                shortest[key] = length, join
    cuts = [Cut(((_widths(tmesh, [join, *_way(join.a, join.b, before)]), 1),)) for _, join in shortest.values()]
    for arc, value in bits.items() if not cuts else ():
        points = arc_points(tmesh, q.divisions, q.offset, arc)
        for x, y in itertools.pairwise(points):
            if q.representative[x] != q.representative[y]:
                continue
            if sum_to[x] ^ sum_to[y] == (value if y == points[-1] else 0):
                cuts.append(Cut(((_widths(tmesh, _way(x, y, before)), 1), (((arc, -1),), 0))))
    return list(dict.fromkeys(cuts))


def _widths(tmesh: TMesh, way: list[Join]) -> tuple[tuple[int, int], ...]:
    """The zero arcs on a way and the sides of the patches that it crosses, with their numbers."""
    out: dict[int, int] = defaultdict(int)
    for join in way:
        for arc in [join.arc] if join.arc >= 0 else [arc for arc, _ in tmesh.patches[join.patch][join.axis]]:
            out[arc] += 1
    return tuple(sorted(out.items()))


def _label(tmesh: TMesh, finder: PathCut, join: Join, bits: dict[int, int]) -> int:
    """Bits of the way that a join makes on its face."""
    if join.arc >= 0:
        return bits.get(join.arc, 0)
    total = 0
    for arc, _ in tmesh.patches[join.patch][join.axis]:
        total ^= bits.get(arc, 0)
    for side, element in zip(finder.sides(join, join.a, join.b), (join.a, join.b)):
        height = finder.height(side, element)
        assert height is not None  # the joins of a patch are between elements of its sides
        for arc, count in height[0].items():
            total ^= bits.get(arc, 0) if count % 2 else 0
        total ^= bits.get(height[1], 0) if height[2] < 0 else 0
    return total


def _way(a: int, b: int, before: dict[int, tuple[int, Join] | None]) -> list[Join]:
    """Joins on the way from `a` to `b` in the forest of `before`."""
    ways: list[list[Join]] = []
    for end in (a, b):
        way = []
        while (step := before[end]) is not None:
            way.append(step[1])
            end = step[0]
        ways.append(way)
    up, down = ways
    while up and down and up[-1] is down[-1]:
        up.pop()
        down.pop()
    return up + down
