"""Separation cuts: which integer arcs must grow so that critical things stay apart.

A class of the quotient may hold at most one critical thing: one interior singularity, or one *boundary group* (boundary
points connected through zero arcs on curves) with at most one critical node.  Where a class holds more, every path of joins
between two of them must be broken: the zero arcs on the path together with the widths of the degenerate patches that it
crosses must add up to at least 1, or a crossing must land elsewhere on the far side (a disjunction, for landings inside an arc).
The cuts are found lazily, after a solution without them (Lyon, Campen, Kobbelt 2021, section 5).
"""

from __future__ import annotations

from collections import defaultdict, deque
from dataclasses import dataclass

import numpy as np

from ..records import Bool, Int, TMesh
from .quotient import Join, Quotient

__all__ = ["Cut", "PathCut", "separation_cuts"]

Expression = dict[int, int]


@dataclass(frozen=True)
class Cut:
    """A disjunction: at least one of ``sum(coefficient * n[arc]) >= bound`` must hold.

    Attributes
    ----------
    options : tuple of (tuple of (arc, coefficient), bound)
    """

    options: tuple[tuple[tuple[tuple[int, int], ...], int], ...]


def _boundary_groups(tmesh: TMesh, q: Quotient) -> tuple[Bool, Int]:
    """Which elements are on CAD curves, and their group: connected through zero arcs on curves."""
    on_curve = np.zeros(q.n_joinable, bool)
    group = list(range(q.n_joinable))

    def find(x: int) -> int:
        while group[x] != x:
            group[x] = group[group[x]]
            x = group[x]
        return x

    for arc in np.flatnonzero(tmesh.arc_curve >= 0).tolist():
        a, b = tmesh.arcs[arc].tolist()
        on_curve[[a, b]] = True
        n = int(q.divisions[arc])
        on_curve[q.offset[arc] : q.offset[arc] + max(n - 1, 0)] = True
        if n == 0:
            group[find(a)] = find(b)
    return on_curve, np.array([find(i) for i in range(q.n_joinable)], np.int64)


def separation_cuts(tmesh: TMesh, q: Quotient) -> list[Cut]:
    """Cuts that the current quotient violates (empty: nothing critical is merged)."""
    on_curve, group = _boundary_groups(tmesh, q)
    order = np.argsort(q.representative, kind="stable")
    splits = np.flatnonzero(np.diff(q.representative[order])) + 1
    neighbours: dict[int, list[tuple[int, Join]]] = defaultdict(list)
    for j in q.joins:
        neighbours[j.a].append((j.b, j))
        neighbours[j.b].append((j.a, j))
    finder = PathCut(tmesh, q, neighbours)
    cuts: list[Cut] = []
    for members in np.split(order, splits):
        if len(members) < 2:
            continue
        things: dict[tuple[int, int], list[int]] = defaultdict(list)
        for i in members.tolist():
            if on_curve[i]:
                things[0, int(group[i])].append(i)
            elif i < len(tmesh.position) and tmesh.critical[i]:
                things[1, i].append(i)
        for (kind, _), elements in things.items():
            if kind == 0:
                corners = [i for i in elements if i < len(tmesh.position) and tmesh.critical[i]]
                if len(corners) > 1:
                    cuts.append(finder.cut(corners[:1], set(corners[1:]), on_curves_only=True))
        keys = list(things)
        if len(keys) > 1:
            for k in range(len(keys) - 1 if len(keys) < 6 else 1):
                targets = {i for other in keys if other != keys[k] for i in things[other]}
                cuts.append(finder.cut(things[keys[k]], targets))
    return list(dict.fromkeys(cuts))


def _frozen(expression: Expression, sign: int = 1) -> tuple[tuple[int, int], ...]:
    return tuple(sorted((arc, sign * c) for arc, c in expression.items() if c))


class PathCut:
    """Shortest join paths and the linear conditions that break them."""

    def __init__(self, tmesh: TMesh, q: Quotient, neighbours: dict[int, list[tuple[int, Join]]]) -> None:
        self.tmesh, self.q, self.neighbours = tmesh, q, neighbours

    def cut(self, sources: list[int], targets: set[int], on_curves_only: bool = False) -> Cut:
        """Cut along the shortest path between two sets of elements."""
        return self.along(self._path(sources, targets, on_curves_only))

    def along(self, path: list[tuple[int, Join, int]]) -> Cut:
        """Cut along a path of joins, each (element, join, next element)."""
        widths: Expression = defaultdict(int)
        options: list[tuple[tuple[tuple[int, int], ...], int]] = []
        n_nodes = len(self.tmesh.position)
        leaf: Expression | None = None  # offset on the current arc at which a chain of crossings arrived
        leaf_arc = -1
        for x, join, y in path:
            if join.arc >= 0:
                widths[join.arc] += 1
                leaf = None
                continue
            sides = self.tmesh.patches[join.patch]
            for arc, _ in sides[join.axis]:
                widths[arc] += 1
            near, far = self.sides(join, x, y)
            here, there = self.height(near, x), self.height(far, y)
            if here is None or there is None:
                leaf = None
                continue
            value: Expression = defaultdict(int, here[0])
            if leaf is not None and x >= n_nodes and here[1] == leaf_arc:
                if here[2] > 0:
                    for arc, c in leaf.items():
                        value[arc] += c
                else:
                    value[leaf_arc] += 1
                    for arc, c in leaf.items():
                        value[arc] -= c
            for arc, c in there[0].items():
                value[arc] -= c
            # value: height of the crossing minus that of the landing node, or of the start of the landing arc
            if y < n_nodes:
                options += [(_frozen(value), 1), (_frozen(value, -1), 1)]
                leaf = None
                continue
            arc_y = there[1]
            beyond: Expression = defaultdict(int, value)
            beyond[arc_y] -= 1
            options += [(_frozen(value, -1), 1), (_frozen(beyond), 1)]
            if there[2] > 0:
                leaf = value
            else:
                leaf = defaultdict(int)
                leaf[arc_y] += 1
                for arc, c in value.items():
                    leaf[arc] -= c
            leaf_arc = arc_y
        return Cut(((_frozen(widths), 1), *options))

    def _path(self, sources: list[int], targets: set[int], on_curves_only: bool) -> list[tuple[int, Join, int]]:
        before: dict[int, tuple[int, Join] | None] = dict.fromkeys(sources)
        queue = deque(sources)
        end = -1
        while queue:
            x = queue.popleft()
            if x in targets:
                end = x
                break
            for y, join in self.neighbours[x]:
                if on_curves_only and (join.arc < 0 or self.tmesh.arc_curve[join.arc] < 0):
                    continue
                if y not in before:
                    before[y] = (x, join)
                    queue.append(y)
        path: list[tuple[int, Join, int]] = []
        while (step := before[end]) is not None:
            path.append((step[0], step[1], end))
            end = step[0]
        return path[::-1]

    def sides(self, join: Join, x: int, y: int) -> tuple[tuple[tuple[int, int], ...], tuple[tuple[int, int], ...]]:
        """The two long sides of a degenerate patch, running alike: the one that holds x, the one that holds y."""
        sides = self.tmesh.patches[join.patch]
        one = sides[1 - join.axis]
        two = tuple((arc, -way) for arc, way in reversed(sides[3 - join.axis]))
        return (one, two) if (x, y) == (join.a, join.b) else (two, one)

    def height(self, side: tuple[tuple[int, int], ...], element: int) -> tuple[Expression, int, int] | None:
        """Divisions before `element` on a side, and the arc that holds it with its way (-1, 0 for a node)."""
        total: Expression = defaultdict(int)
        for arc, way in side:
            start, end = self.tmesh.arcs[arc][::way].tolist()
            if start == element:
                return total, -1, 0
            n, first = int(self.q.divisions[arc]), int(self.q.offset[arc])
            if first <= element < first + n - 1:
                return total, arc, way
            total[arc] += 1
            if end == element:
                return total, -1, 0
        return None
