"""Integer programs that fall into independent parts: one `IntegerProgram` for each, solved one by one.

The parts of an assembly have no arc in common.  In one program a branch that ends nowhere in one part would be taken back
together with choices in others, and every cut of one part would have all of them solved again: only parts with new rows are.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ..records import Float, Int, TMesh
from .integer_program import IntegerProgram, Solution

__all__ = ["SeparableProgram", "parts_of_arcs"]


def parts_of_arcs(tmesh: TMesh) -> Int:
    """Number (a,) of the connected part of the T-mesh that every arc is in; all arcs of a face are in one."""
    n = len(tmesh.position)
    inside = tmesh.arcs[[sides[0][0][0] for sides in tmesh.patches], 0] if tmesh.patches else np.zeros(0, np.int64)
    start = np.concatenate([tmesh.arcs[:, 0], inside])
    end = np.concatenate([tmesh.arcs[:, 1], n + tmesh.patch_face])
    size = n + int(tmesh.patch_face.max(initial=-1)) + 1
    _, part = connected_components(coo_array((np.ones(len(start)), (start, end)), shape=(size, size)), directed=False)
    _, out = np.unique(part[tmesh.arcs[:, 0]], return_inverse=True)
    return out.astype(np.int64)


class SeparableProgram:
    """As `IntegerProgram`, with columns that belong to parts.

    Parameters
    ----------
    cost, upper : (n,) float64
    part : (n,) int64
        Part of every column, from 0.
    """

    def __init__(self, cost: Float, upper: Float, part: Int) -> None:
        none = np.zeros(0)
        self._programs = [IntegerProgram(none, none) for _ in range(int(part.max(initial=0)) + 1)]
        self._solutions: list[Solution | None] = [None] * len(self._programs)
        self._part = np.zeros(0, np.int64)
        self._own = np.zeros(0, np.int64)  # number of every column in the program of its part
        self.add_columns(cost, upper, part)

    @property
    def n_columns(self) -> int:
        """Number of columns."""
        return len(self._part)

    def add_columns(self, cost: Float, upper: Float, part: Int, *, integral: bool = True) -> int:
        """Add columns; returns the number of the first.  Those that are not `integral` may take any value."""
        first, own = self.n_columns, np.empty(len(cost), np.int64)
        for k in np.unique(part).tolist():
            rows = np.flatnonzero(part == k)
            own[rows] = self._programs[k].add_columns(cost[rows], upper[rows], integral=integral) + np.arange(len(rows))
            self._solutions[k] = None
        self._part, self._own = np.concatenate([self._part, part]), np.concatenate([self._own, own])
        return first

    def add_rows(self, lower: Float, upper: Float, start: Int, column: Int, value: Float) -> None:
        """Add rows in compressed form; `start` (rows,) holds the first entry of every row.

        Raises
        ------
        ValueError
            For a row with columns of two parts.
        """
        start, column = np.asarray(start, np.int64), np.asarray(column, np.int64)  # also empty ones
        count = np.diff(np.append(start, len(column)))
        row = np.repeat(np.arange(len(start)), count)
        of_entry = self._part[column]
        part = np.zeros(len(start), np.int64)
        part[row] = of_entry
        if np.any(part[row] != of_entry):
            raise ValueError("a row joins two parts")
        for k in np.unique(part).tolist():
            rows, entries = np.flatnonzero(part == k), np.flatnonzero(part[row] == k)
            own_start = np.concatenate([[0], np.cumsum(count[rows])[:-1]])
            self._programs[k].add_rows(lower[rows], upper[rows], own_start, self._own[column[entries]], value[entries])
            self._solutions[k] = None

    def solve(self) -> Solution | None:
        """A good integer solution, or None when a part has none (see `IntegerProgram.solve`)."""
        programs = 0
        for k, program in enumerate(self._programs):
            if self._solutions[k] is None:
                found = program.solve()
                if found is None:
                    return None
                programs += found.programs
                self._solutions[k] = found
        return self._whole(programs)

    def improved(self, offset: Float) -> Solution:
        """The last solution, made better part by part (see `IntegerProgram.improved`).

        Parameters
        ----------
        offset : (parts,) float64
            Constant part of the cost of every part.
        """
        for k, program in enumerate(self._programs):
            solution = self._solutions[k]
            if solution is None:
                raise ValueError("the program has not been solved")
            self._solutions[k] = program.improved(solution, float(offset[k]))
        return self._whole(0)

    def _whole(self, programs: int) -> Solution:
        """The solutions of all parts as one."""
        found = [s for s in self._solutions if s is not None]
        columns = np.empty(self.n_columns)
        for k, solution in enumerate(found):
            mine = np.flatnonzero(self._part == k)
            columns[mine] = solution.columns[self._own[mine]]
        cost, bound = sum(s.cost for s in found), sum(s.bound for s in found)
        return Solution(np.round(columns).astype(np.int64), columns, cost, bound, programs)
