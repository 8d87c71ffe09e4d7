"""Integer programs against answers known by hand and against SciPy's solver."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import Bounds, LinearConstraint, milp

from gmsh_crossquad.layout.integer_program import GAP, IntegerProgram


def dense(program: IntegerProgram, matrix, lower, upper) -> None:
    matrix = np.asarray(matrix, float)
    rows, columns = np.nonzero(matrix)
    start = np.searchsorted(rows, np.arange(len(matrix)))
    program.add_rows(np.asarray(lower, float), np.asarray(upper, float), start, columns, matrix[rows, columns])


def test_a_whole_relaxation_needs_one_program():
    program = IntegerProgram(np.array([1.0, 2.0]), np.array([10.0, 10.0]))
    dense(program, [[1, 1]], [3], [np.inf])
    solution = program.solve()
    assert solution is not None
    assert solution.values.tolist() == [3, 0]
    assert solution.cost == solution.bound == 3.0
    assert solution.programs == 1


def test_an_odd_cycle_is_rounded():
    # x + y, y + z, z + x >= 1: the relaxation is (1/2, 1/2, 1/2), an integer solution costs 2
    program = IntegerProgram(np.ones(3), np.full(3, 5.0))
    dense(program, [[1, 1, 0], [0, 1, 1], [1, 0, 1]], [1, 1, 1], [np.inf] * 3)
    solution = program.solve()
    assert solution is not None
    assert solution.bound == pytest.approx(1.5)
    assert solution.cost == pytest.approx(2.0)
    assert sorted(solution.values.tolist()) == [0, 1, 1]


def test_no_solution_is_none():
    program = IntegerProgram(np.ones(1), np.full(1, 9.0))
    dense(program, [[2]], [3], [3])
    assert program.solve() is None


def test_rows_can_be_added_after_a_solve():
    program = IntegerProgram(np.array([1.0, 3.0]), np.array([4.0, 4.0]))
    dense(program, [[1, 1]], [2], [np.inf])
    first = program.solve()
    dense(program, [[-1, 1]], [0], [np.inf])
    second = program.solve()
    assert first is not None and second is not None
    assert first.values.tolist() == [2, 0]
    assert second.values.tolist() == [1, 1]


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10_000))
def test_solutions_are_feasible_and_no_better_than_the_optimum(seed):
    rng = np.random.default_rng(seed)
    n, m = 6, 4
    matrix = rng.integers(-1, 2, (m, n))
    inside = rng.integers(0, 4, n)
    right = matrix @ inside
    cost = rng.integers(1, 9, n).astype(float)
    program = IntegerProgram(cost, np.full(n, 8.0))
    dense(program, matrix[np.any(matrix != 0, axis=1)], right[np.any(matrix != 0, axis=1)], right[np.any(matrix != 0, axis=1)])
    solution = program.solve()
    exact = milp(cost, constraints=LinearConstraint(matrix, right, right), integrality=np.ones(n), bounds=Bounds(0, 8))
    assert solution is not None and exact.x is not None
    assert (matrix @ solution.values == right).all()
    assert solution.bound - 1e-9 <= exact.fun <= solution.cost + 1e-6


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10_000))
def test_improved_solutions_are_within_the_gap_of_the_optimum(seed):
    rng = np.random.default_rng(seed)
    n, m = 12, 5
    matrix = rng.integers(-1, 3, (m, n))
    matrix = matrix[np.any(matrix != 0, axis=1)]
    right = matrix @ rng.integers(0, 4, n)
    cost = rng.integers(1, 9, n).astype(float)
    program = IntegerProgram(cost, np.full(n, 8.0))
    dense(program, matrix, right, right)
    dive = program.solve()
    exact = milp(cost, constraints=LinearConstraint(matrix, right, right), integrality=np.ones(n), bounds=Bounds(0, 8))
    assert dive is not None and exact.x is not None
    better = program.improved(dive)
    assert (matrix @ better.values == right).all() and better.cost == pytest.approx(cost @ better.values)
    assert exact.fun - 1e-6 <= better.cost <= dive.cost
    assert better.cost <= (1 + GAP) * exact.fun + 1e-6


def test_improving_keeps_a_solution_at_its_bound():
    program = IntegerProgram(np.array([1.0, 2.0]), np.array([10.0, 10.0]))
    dense(program, [[1, 1]], [3], [np.inf])
    solution = program.solve()
    assert program.improved(solution) is solution


def test_columns_that_are_not_integral_may_be_fractions():
    # x - s <= 0.5 with 3 <= 2 x: x = 2 and s = 1.5 at the least, and branching on s would never end
    program = IntegerProgram(np.array([1.0]), np.array([10.0]))
    assert program.add_columns(np.array([1.0]), np.array([np.inf]), integral=False) == 1
    dense(program, [[1, -1], [2, 0]], [-np.inf, 3], [0.5, np.inf])
    solution = program.solve()
    assert solution is not None
    assert solution.values[0] == 2
    assert solution.cost == pytest.approx(3.5)


def test_the_solver_says_nothing():
    code = (
        "import numpy as np\nfrom gmsh_crossquad.layout.integer_program import IntegerProgram\n"
        "p = IntegerProgram(np.ones(2), np.ones(2))\np.solve()\n"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout == "" and run.stderr == ""
