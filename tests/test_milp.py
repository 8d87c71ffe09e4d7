"""Small integer programs: against all possibilities, infeasible ones, silence."""

import itertools
import subprocess
import sys

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from gmsh_crossquad.layout.milp import solve

INF = np.inf


@settings(max_examples=60, deadline=None)
@given(
    matrix=st.lists(st.lists(st.integers(-1, 1), min_size=4, max_size=4), min_size=1, max_size=3),
    right=st.lists(st.integers(-3, 3), min_size=3, max_size=3),
    cost=st.lists(st.integers(1, 5), min_size=4, max_size=4),
    equal=st.booleans(),
)
def test_the_best_of_all_possibilities(matrix: list[list[int]], right: list[int], cost: list[int], equal: bool) -> None:
    a, c, b = np.array(matrix), np.array(cost), np.array(right[: len(matrix)])
    every = np.array(list(itertools.product(range(4), repeat=4)))
    values = every @ a.T
    whole = np.ones(4, bool)
    good = (values == b).all(axis=1) if equal else (values >= b).all(axis=1)
    found = solve(
        c.astype(float), sp.csr_array(a), b, b if equal else np.full(len(b), INF), np.full(4, 3.0), np.ones(4, bool), gap=0.0
    )
    if not good.any():
        assert found.x is None and found.infeasible
    else:
        assert found.x is not None and not found.infeasible
        x = found.x.round().astype(int)
        assert np.abs(found.x - x).max() < 1e-6
        assert tuple(x) in set(map(tuple, every[good].tolist()))
        assert c @ x == (every[good] @ c).min() == pytest.approx(found.cost)


def test_continuous_columns_may_be_fractions() -> None:
    """min x + y, 2 x + 3 y = 4: 0 and 4/3 where y may be a fraction, 2 and 0 where not."""
    row, four = sp.csr_array([[2.0, 3.0]]), np.array([4.0])
    most = np.full(2, INF)
    mixed = solve(np.ones(2), row, four, four, most, np.array([True, False]), gap=0.0)
    whole = solve(np.ones(2), row, four, four, most, np.array([True, True]), gap=0.0)
    np.testing.assert_allclose(mixed.x, [0.0, 4.0 / 3.0], atol=1e-9)
    np.testing.assert_allclose(whole.x, [2.0, 0.0], atol=1e-9)


def test_parity_makes_a_program_infeasible() -> None:
    """2 x - 2 y = 1 has solutions, but no integer ones."""
    one = np.array([1.0])
    found = solve(np.ones(2), sp.csr_array([[2.0, -2.0]]), one, one, np.full(2, 9.0), np.ones(2, bool))
    assert found.x is None and found.infeasible


def test_nothing_is_printed() -> None:
    code = """
import numpy as np, scipy.sparse as sp
from gmsh_crossquad.layout.milp import solve
assert solve(np.ones(1), sp.csr_array([[1.0]]), np.ones(1), np.ones(1), np.ones(1), np.ones(1, bool)).x[0] == 1
"""
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout == run.stderr == ""
