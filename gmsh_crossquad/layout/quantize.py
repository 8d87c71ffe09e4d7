"""Integer quantization of a T-mesh: one mixed-integer linear program for the whole model.

    min sum_a w_a |n_a - t_a|,  n_a >= 0 integer,
    equal sums on opposite sides of every patch, every open CAD curve >= 1, closed curve >= 3, boundary loop >= 3,
    separation cuts (module `cuts`), found lazily.

t_a is the arc's length over the wanted block size, w_a = 1 / max(t_a, 1/2).  The cost is written with its kinks at integers,
n = floor(t) + u + e - d with 0 <= u <= 1, e >= 0, 0 <= d <= floor(t): it agrees with |n - t| at every integer.  Every column then
meets at most two patch rows with coefficients +-1, the matrix of a bidirected flow, whose linear relaxation has half-integral
vertices (Heistermann, Warnett, Bommes 2023): branch and bound has next to nothing to do.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from ..errors import LayoutError
from ..records import Float, Int, Model, TMesh
from .cuts import Cut, separation_cuts
from .quotient import quotient

__all__ = ["Quantization", "quantize"]

MAX_ROUNDS = 60


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


def _balance(tmesh: TMesh) -> sp.csr_array:
    """Rows of (sum of a side) - (sum of the opposite side) for every patch."""
    rows, columns, values = [], [], []
    k = 0
    for sides in tmesh.patches:
        for i in (0, 1):
            for j, sign in ((i, 1.0), (i + 2, -1.0)):
                for arc, _ in sides[j]:
                    rows.append(k)
                    columns.append(arc)
                    values.append(sign)
            k += 1
    return sp.csr_array((values, (rows, columns)), shape=(k, len(tmesh.length)))


def _at_least(tmesh: TMesh, model: Model) -> list[Cut]:
    """Minimum divisions of CAD curves and boundary loops, as cuts with one option."""
    out = []
    for curve, pieces in zip(model.curves, tmesh.pieces):
        out.append(Cut(((tuple((arc, 1) for arc in pieces), 3 if curve.closed else 1),)))
    for _, arcs in tmesh.loops:
        count: dict[int, int] = {}
        for arc in arcs:
            count[arc] = count.get(arc, 0) + 1
        out.append(Cut(((tuple(count.items()), 3),)))
    return out


def quantize(
    model: Model,
    tmesh: TMesh,
    target: Float,
    *,
    exact: dict[int, int] | None = None,
    at_most: dict[int, int] | None = None,
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
    progress : callable, optional
        Told a line per round.

    Raises
    ------
    LayoutError
        No divisions exist that meet all conditions.
    """
    from scipy.optimize import Bounds, LinearConstraint, milp

    n_arcs = len(tmesh.length)
    target = np.asarray(target, float)
    floor = np.floor(target)
    fraction = target - floor
    weight = 1.0 / np.maximum(target, 0.5)
    # columns u, e, d; n = floor + u + e - d
    cost = np.concatenate([weight * (1 - 2 * fraction), weight, weight])
    largest = 4.0 * max(float(target.max(initial=0.0)), 10.0) + 20.0 + len(model.curves)  # opposite a run of short curves
    upper = np.concatenate([np.ones(n_arcs), np.full(n_arcs, largest), floor])
    identity = sp.eye_array(n_arcs, format="csr")
    expand = sp.hstack([identity, identity, -identity], format="csr")
    balance = _balance(tmesh)
    fixed_rows: list[tuple[sp.csr_array, Float, Float]] = [(balance @ expand, -(balance @ floor), -(balance @ floor))]
    for bounds, equal in ((exact or {}, True), (at_most or {}, False)):
        if bounds:
            row = np.concatenate([np.full(len(tmesh.pieces[c]), i) for i, c in enumerate(bounds)])
            col = np.concatenate([np.array(tmesh.pieces[c]) for c in bounds])
            m = sp.csr_array((np.ones(len(row)), (row, col)), shape=(len(bounds), n_arcs))
            rhs = np.array(list(bounds.values()), float) - m @ floor
            fixed_rows.append((m @ expand, rhs if equal else np.full(len(rhs), -np.inf), rhs))

    cuts = _at_least(tmesh, model)
    known = set(cuts)
    n_base = len(cuts)
    for round_ in range(1, MAX_ROUNDS + 1):
        binaries = sum(len(c.options) for c in cuts if len(c.options) > 1)
        matrix, lower = _cut_rows(cuts, n_arcs, largest + float(floor.max(initial=0.0)), floor, expand, binaries)
        constraints = [LinearConstraint(matrix, lower, np.inf)]
        for fixed, least, most in fixed_rows:
            padded = sp.hstack([fixed, sp.csr_array((fixed.shape[0], binaries))], format="csr")
            constraints.append(LinearConstraint(padded, least, most))
        result = milp(
            np.concatenate([cost, np.zeros(binaries)]),
            constraints=constraints,
            integrality=np.ones(3 * n_arcs + binaries, np.int64),
            bounds=Bounds(np.zeros(3 * n_arcs + binaries), np.concatenate([upper, np.ones(binaries)])),
            options={"mip_rel_gap": 1e-2, "node_limit": 20_000, "time_limit": 60.0},
        )
        if result.x is None:
            raise LayoutError(
                "no integer divisions of the layout keep all corners and singularities apart"
                if result.status == 2
                else f"the quantization found no solution in its limits ({len(tmesh.patches)} patches)",
                remedy="another size, or fewer short curves, may help",
            )
        step = np.round(result.x[: 3 * n_arcs])
        divisions = (floor + step[:n_arcs] + step[n_arcs : 2 * n_arcs] - step[2 * n_arcs :]).astype(np.int64)
        new = [c for c in separation_cuts(tmesh, quotient(tmesh, divisions)) if c not in known]
        if progress is not None:
            progress(f"quantization round {round_}: cost {result.fun:.4g}, {len(new)} new cuts")
        if not new:
            value = float(np.sum(weight * np.abs(divisions - target)))
            return Quantization(divisions, round_, len(cuts) - n_base, value)
        cuts += new
        known.update(new)
    raise LayoutError(f"the quantization did not settle in {MAX_ROUNDS} rounds", remedy="another size may help")


def _cut_rows(
    cuts: list[Cut], n_arcs: int, largest: float, floor: Float, expand: sp.csr_array, binaries: int
) -> tuple[sp.csr_array, Float]:
    """Cuts as rows on (u, e, d, binaries); a disjunction takes one binary per option and big-M."""
    rows, columns, values, lower = [], [], [], []
    b_rows, b_columns, b_values = [], [], []
    r = b = 0
    for cut in cuts:
        many = len(cut.options) > 1
        first = b
        for expression, bound in cut.options:
            for arc, coefficient in expression:
                rows.append(r)
                columns.append(arc)
                values.append(float(coefficient))
            relaxed = float(bound)
            if many:
                big = bound + largest * sum(max(-c, 0) for _, c in expression)
                b_rows.append(r)
                b_columns.append(b)
                b_values.append(-big)
                relaxed -= big
                b += 1
            lower.append(relaxed)
            r += 1
        if many:
            for k in range(first, b):
                b_rows.append(r)
                b_columns.append(k)
                b_values.append(1.0)
            lower.append(1.0)
            r += 1
    on_arcs = sp.csr_array((values, (rows, columns)), shape=(r, n_arcs))
    on_binaries = sp.csr_array((b_values, (b_rows, b_columns)), shape=(r, binaries))
    return sp.hstack([on_arcs @ expand, on_binaries], format="csr"), np.array(lower) - on_arcs @ floor
