"""Integer programs of independent parts: the same as each part alone, and only what has changed is solved again."""

import gmsh
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import gmsh_crossquad as cq
from gmsh_crossquad.layout.integer_program import IntegerProgram
from gmsh_crossquad.layout.separable import SeparableProgram, parts_of_arcs


def random_part(random):
    """A small covering program: cost, upper, rows."""
    n, m = random.integers(2, 6), random.integers(1, 5)
    rows = []
    for _ in range(m):
        columns = np.sort(random.choice(n, random.integers(1, n + 1), replace=False))
        rows.append((columns, np.ones(len(columns)), float(random.integers(1, 2 * len(columns) + 1)) / 2))
    return random.uniform(1, 2, n), np.full(n, 4.0), rows


def add(program, rows, number):
    start = np.concatenate([[0], np.cumsum([len(c) for c, _, _ in rows])[:-1]])
    columns = np.concatenate([number[c] for c, _, _ in rows])
    lower = np.array([b for _, _, b in rows])
    program.add_rows(lower, np.full(len(rows), np.inf), start, columns, np.concatenate([v for _, v, _ in rows]))


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10_000), count=st.integers(1, 4))
def test_same_as_each_part_alone(seed, count):
    random = np.random.default_rng(seed)
    parts = [random_part(random) for _ in range(count)]
    part = random.permutation(np.repeat(np.arange(count), [len(p[0]) for p in parts]))
    number = [np.flatnonzero(part == k) for k in range(count)]
    cost, upper = np.empty(len(part)), np.empty(len(part))
    for own, p in zip(number, parts):
        cost[own], upper[own] = p[0], p[1]
    program = SeparableProgram(cost, upper, part)
    mixed = [(own[c], v, b) for own, (_, _, rows) in zip(number, parts) for c, v, b in rows]
    add(program, [mixed[i] for i in random.permutation(len(mixed))], np.arange(len(part)))
    found = program.solve()
    total = 0.0
    for own, (c, u, rows) in zip(number, parts):
        alone = IntegerProgram(c, u)
        add(alone, rows, np.arange(len(c)))
        solution = alone.solve()
        assert (solution is None) == (found is None) or found is None
        if found is not None:
            total += solution.cost
            for columns, _, bound in rows:
                assert found.values[own[columns]].sum() >= bound
    if found is not None:
        assert found.cost == pytest.approx(total) == pytest.approx(cost @ found.values)


def test_only_changed_parts_are_solved_again():
    program = SeparableProgram(np.ones(4), np.full(4, 9.0), np.array([0, 0, 1, 1]))
    add(program, [(np.array([0, 1]), np.ones(2), 3.0), (np.array([2, 3]), np.ones(2), 2.0)], np.arange(4))
    assert program.solve().programs == 2
    assert program.solve().programs == 0
    add(program, [(np.array([2]), np.ones(1), 2.5)], np.arange(4))
    again = program.solve()
    assert again.values[:2].sum() == 3 and again.values[2] == 3
    assert program.add_columns(np.ones(1), np.ones(1), np.array([1])) == program.n_columns - 1 == 4
    with pytest.raises(ValueError, match="two parts"):
        add(program, [(np.array([1, 2]), np.ones(2), 1.0)], np.arange(4))


def test_parts_are_improved_one_by_one():
    program = SeparableProgram(np.ones(4), np.full(4, 9.0), np.array([0, 0, 1, 1]))
    with pytest.raises(ValueError, match="not been solved"):
        program.improved(np.zeros(2))
    add(program, [(np.array([0, 1]), np.ones(2), 3.0), (np.array([2, 3]), np.ones(2), 2.5)], np.arange(4))
    found = program.solve()
    better = program.improved(np.zeros(2))
    assert better.cost <= found.cost and better.cost == better.values.sum() == 6


def test_infeasible_part():
    program = SeparableProgram(np.ones(2), np.ones(2), np.array([0, 1]))
    add(program, [(np.array([1]), np.ones(1), 2.0)], np.arange(2))
    assert program.solve() is None


def test_parts_of_an_assembly():
    """Two plates with a common side and one apart; a plate with a hole is one part."""
    gmsh.initialize(interruptible=False, readConfigFiles=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        occ = gmsh.model.occ
        left, right = (2, occ.addRectangle(0, 0, 0, 1, 1)), (2, occ.addRectangle(1, 0, 0, 1, 1))
        occ.fragment([left], [right])
        occ.cut([(2, occ.addRectangle(5, 0, 0, 1, 1))], [(2, occ.addDisk(5.5, 0.5, 0, 0.2, 0.2))])
        occ.synchronize()
        tmesh = cq.mesh(0.3).stages.tmesh
    finally:
        gmsh.finalize()
    part = parts_of_arcs(tmesh)
    x = tmesh.position[tmesh.arcs, 0]
    apart = x.mean(axis=1) > np.mean([x.min(), x.max()])
    assert set(part[apart]).isdisjoint(part[~apart])
    assert len(set(part[apart])) == len(set(part[~apart])) == 1
