"""Integer quantization of a T-mesh: one mixed-integer linear program for the whole model.

    min sum_a f_a(n_a),  n_a >= 0 integer,
    equal sums on opposite sides of every patch, every open CAD curve >= 1, closed curve >= 3, boundary loop >= 3,
    separation cuts (modules `cuts`, `handles`), found lazily; shifts between the sides of thin strips cost (module `alignment`).

t_a is the arc's length over the wanted block size, but at least one division per 90 degrees of turning inside a curved face.
The cost is the factor by which edges miss their size, f(n) = t/n - 1 for 1 <= n <= t, (n - t) / max(t, 1/2) for n > t, and
f(0) = 2 t: convex.  It is taken piecewise linear with kinks at integers, n = floor(t) + u + e - d_1 - d_2 - ...; f is exact at
floor(t), floor(t) + 1 and above, and at floor(t) halved again and again.  Every column then meets at most two patch rows with
coefficients +-1, the matrix of a bidirected flow, whose linear relaxation has half-integral vertices (Heistermann, Warnett,
Bommes 2023): little is left to branch and bound.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from ..errors import LayoutError
from ..records import Float, Int, Model, TMesh
from .alignment import LEAST, alignment
from .arc_bends import arc_bends
from .conditions import at_least, balance
from .cuts import Cut, separation_cuts
from .handles import handle_cuts, homology
from .integer_program import Solution
from .quotient import quotient
from .separable import SeparableProgram, parts_of_arcs

__all__ = ["Indivisible", "Quantization", "quantize"]

MAX_ROUNDS = 60
BEND = np.radians(90.0)


@dataclass(frozen=True)
class Quantization:
    """Result of `quantize`.

    Attributes
    ----------
    divisions : (a,) int64
    rounds : int
        Programs that were solved.
    cuts : int
        Separation cuts that were needed.
    cost : float
    """

    divisions: Int
    rounds: int
    cuts: int
    cost: float


class Indivisible(LayoutError):
    """No divisions meet all conditions.

    Attributes
    ----------
    cuts : tuple of Cut
        Separation cuts that were met before.
    """

    cuts: tuple[Cut, ...] = ()


def quantize(
    model: Model,
    tmesh: TMesh,
    target: Float,
    *,
    exact: dict[int, int] | None = None,
    at_most: dict[int, int] | None = None,
    disjunctions: bool = True,
    shift: float = LEAST,
    progress: Callable[[str], None] | None = None,
) -> Quantization:
    """Integer divisions of every arc.

    Parameters
    ----------
    model : Model
    tmesh : TMesh
    target : (a,) float64
        Wanted divisions (arc length over block size), any positive real number.
    exact : dict of curve row -> int, optional
        Prescribed divisions of CAD curves (Transfinite).
    at_most : dict of curve row -> int, optional
        Upper bounds on the divisions of CAD curves.
    shift : float
        Shift between the sides of strips, in divisions, that costs nothing (module `alignment`).
    progress : callable, optional
        Told a line per round.

    Raises
    ------
    Indivisible
        No divisions were found that meet all conditions.
    LayoutError
        The cuts did not come to an end.
    """
    n_arcs = len(tmesh.length)
    target = np.array(target, float)
    for bent, turn in arc_bends(model, tmesh).items():
        target[bent] = max(target[bent], turn[-1] / BEND)
    floor = np.floor(target)
    largest = 4.0 * max(float(target.max(initial=0.0)), 10.0) + 20.0 + len(model.curves)  # opposite a run of short curves
    arc, step, cost, upper = _columns(target, largest)
    expand = sp.csr_array((step, (arc, np.arange(len(arc)))), shape=(n_arcs, len(arc)))
    part = parts_of_arcs(tmesh)
    program = SeparableProgram(cost, upper, part[arc])

    def add(rows: sp.csr_array, lower: Float, most: Float) -> None:
        on_columns = (rows @ expand).tocsr()
        shift = rows @ floor
        start, column = on_columns.indptr[:-1].astype(np.int64), on_columns.indices.astype(np.int64)
        program.add_rows(lower - shift, most - shift, start, column, on_columns.data)

    rows, slack, price = alignment(tmesh, target, shift)
    if len(slack):
        of_row = part[rows.indices[rows.indptr[:-1]]]
        first = program.add_columns(np.repeat(price, 2), np.full(2 * len(slack), np.inf), np.repeat(of_row, 2), integral=False)
        on_columns = (rows @ expand).tocoo()
        k = np.arange(len(slack))
        moved = rows @ floor
        matrix = sp.csr_array(
            (
                np.concatenate([on_columns.data, -np.ones(len(k)), np.ones(len(k))]),
                (
                    np.concatenate([on_columns.row, k, k]),
                    np.concatenate([on_columns.col, first + 2 * k, first + 2 * k + 1]),
                ),
            )
        )
        start, column = matrix.indptr[:-1].astype(np.int64), matrix.indices.astype(np.int64)
        program.add_rows(-slack - moved, slack - moved, start, column, matrix.data)
    sums = balance(tmesh)
    add(sums, np.zeros(sums.shape[0]), np.zeros(sums.shape[0]))
    for bounds, equal in ((exact or {}, True), (at_most or {}, False)):
        if bounds:
            row = np.concatenate([np.full(len(tmesh.pieces[c]), i) for i, c in enumerate(bounds)])
            column = np.concatenate([np.array(tmesh.pieces[c]) for c in bounds])
            count = np.array(list(bounds.values()), float)
            sums = sp.csr_array((np.ones(len(row)), (row, column)), shape=(len(bounds), n_arcs))
            add(sums, count if equal else np.full(len(count), -np.inf), count)

    classes = homology(model, tmesh)
    known: dict[Cut, None] = {}
    new = at_least(tmesh, model)
    base = set(new)
    big = largest + float(floor.max(initial=0.0))

    def result(solution: Solution) -> tuple[Int, list[Cut]]:
        """Divisions, and what they violate."""
        divisions = (floor + expand @ solution.values[: len(arc)]).astype(np.int64)
        found = quotient(tmesh, divisions)
        new = separation_cuts(tmesh, found) or handle_cuts(tmesh, found, classes)
        return divisions, [cut for cut in new if cut not in known]

    offset = np.bincount(part, _cost(target, floor)).astype(float)
    for round_ in range(1, MAX_ROUNDS + 1):
        known.update(dict.fromkeys(new))
        _add_cuts(program, new if disjunctions else [Cut(c.options[:1]) for c in new], expand, floor, big, part)
        solution = program.solve()
        if solution is None:
            error = Indivisible(
                f"no divisions of the layout ({len(tmesh.patches)} patches) keep all corners and singularities apart",
                remedy="another size, or fewer short curves, may help",
            )
            error.cuts = tuple(cut for cut in known if cut not in base)
            raise error
        divisions, new = result(solution)
        if not new:
            solution = program.improved(offset)
            divisions, new = result(solution)
        if progress is not None:
            progress(
                f"quantization round {round_}: cost {solution.cost:.4g}, bound {solution.bound:.4g}, "
                f"{solution.programs} programs, {len(new)} new cuts"
            )
        if not new:
            total = float(_cost(target, divisions.astype(float)).sum())
            return Quantization(divisions, round_, len(known) - len(base), total)
    raise LayoutError(f"the quantization did not settle in {MAX_ROUNDS} rounds", remedy="another size may help")


def _cost(target: Float, n: Float) -> Float:
    """f(n), see the module."""
    above = (n - target) / np.maximum(target, 0.5)
    below = np.where(n >= 1, target / np.maximum(n, 1.0) - 1.0, 2.0 * target)
    return np.where(n > target, above, below)


def _columns(target: Float, largest: float) -> tuple[Int, Float, Float, Float]:
    """Columns of the piecewise linear cost: arc, sign, cost per unit, upper bound."""
    n = len(target)
    floor = np.floor(target)
    every = np.arange(n)
    columns = [
        (every, np.ones(n), _cost(target, floor + 1) - _cost(target, floor), np.ones(n)),
        (every, np.ones(n), 1.0 / np.maximum(target, 0.5), np.full(n, largest)),
    ]
    top = floor
    while (top > 0).any():
        low = np.floor(top / 2)
        some = np.flatnonzero(top > 0)
        a, b = top[some], low[some]
        slope = (_cost(target[some], b) - _cost(target[some], a)) / (a - b)
        columns.append((some, -np.ones(len(some)), slope, a - b))
        top = low
    arc, sign, cost, upper = (np.concatenate(c) for c in zip(*columns))
    return arc, sign, cost, upper


def _add_cuts(program: SeparableProgram, cuts: list[Cut], expand: sp.csr_array, floor: Float, big: float, part: Int) -> None:
    """Add cuts as rows; a disjunction takes one binary column per option and big-M."""
    start: list[int] = []
    column: list[int] = []
    value: list[float] = []
    lower: list[float] = []
    for cut in cuts:
        many = len(cut.options) > 1
        if many:
            own = np.full(len(cut.options), part[cut.options[0][0][0][0]])
            first = program.add_columns(np.zeros(len(own)), np.ones(len(own)), own)
        for k, (expression, bound) in enumerate(cut.options):
            start.append(len(column))
            shift = 0.0
            for arc, coefficient in expression:
                a, b = expand.indptr[arc], expand.indptr[arc + 1]
                column += expand.indices[a:b].tolist()
                value += (coefficient * expand.data[a:b]).tolist()
                shift += coefficient * floor[arc]
            relaxed = float(bound)
            if many:
                slack = bound + big * sum(max(-c, 0) for _, c in expression)
                column.append(first + k)
                value.append(-slack)
                relaxed -= slack
            lower.append(relaxed - shift)
        if many:
            start.append(len(column))
            column += range(first, first + len(cut.options))
            value += [1.0] * len(cut.options)
            lower.append(1.0)
    n = len(lower)
    program.add_rows(np.array(lower), np.full(n, np.inf), np.array(start), np.array(column), np.array(value))
