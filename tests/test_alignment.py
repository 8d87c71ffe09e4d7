"""Rows that keep the sides of strips in step, on a hand-made strip."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gmsh_crossquad.layout.alignment import LEAST, MOST, PRICE, STRIP, UNLIKE, alignment
from gmsh_crossquad.records import TMesh
from tests.tmeshes import l_shape


def strip(bottom: list[float], top: list[float], width: float) -> TMesh:
    """One patch: arcs of the bottom from left to right, the right side, arcs of the top from right to left, the left side."""
    n, m = len(bottom), len(top)
    lengths = np.array([*bottom, width, *top[::-1], width])
    arc = np.arange(len(lengths)).tolist()
    sides = (
        tuple((a, 1) for a in arc[:n]),
        ((n, 1),),
        tuple((a, 1) for a in arc[n + 1 : n + 1 + m]),
        ((arc[-1], 1),),
    )
    _, base = l_shape()
    return replace(base, length=lengths, patches=(sides,))


def divisions(bottom: list[int], top: list[int]) -> np.ndarray:
    return np.array([*bottom, 1, *top[::-1], 1])


def test_sides_in_step_have_no_shift():
    tmesh = strip([1.0, 2.0, 3.0], [2.0, 4.0], 0.1)
    rows, free, price = alignment(tmesh, np.ones(7))
    assert rows.shape == (3, 7)
    assert rows @ divisions([2, 4, 6], [4, 8]) == pytest.approx(0.0)
    assert free == pytest.approx(LEAST)
    assert price == pytest.approx(PRICE / free)


def test_the_shift_is_that_of_the_opposite_place():
    tmesh = strip([3.0, 3.0], [2.0, 4.0], 0.1)
    rows, _, _ = alignment(tmesh, np.ones(6))
    # the bottom's middle lies a quarter into the second arc of the top, the top's node two thirds into the first of the bottom
    shift = rows @ divisions([6, 2], [4, 4])
    assert shift == pytest.approx([6 - (4 + 0.25 * 4), 4 - 6 * 2 / 3])


def test_the_free_shift_is_one_width():
    tmesh = strip([3.0, 3.0], [2.0, 4.0], 0.5)
    _, free, _ = alignment(tmesh, np.full(6, 12.0))
    assert free == pytest.approx(0.5 / (6.0 / 24.0))


@pytest.mark.parametrize("width", [6.0 / STRIP * 1.01, 6.0 / STRIP + 1.0, 6.0])
def test_wide_patches_are_left_alone(width):
    rows, free, _ = alignment(strip([3.0, 3.0], [2.0, 4.0], width), np.ones(6))
    assert rows.shape == (0, 6)
    assert len(free) == 0


def test_sides_of_unlike_length_and_bare_sides_are_left_alone():
    assert len(alignment(strip([UNLIKE * 3.1, UNLIKE * 3.1], [2.0, 4.0], 0.1), np.ones(6))[1]) == 0
    assert len(alignment(strip([UNLIKE * 2.9, UNLIKE * 2.9], [2.0, 4.0], 0.1), np.ones(6))[1]) == 2
    assert len(alignment(strip([6.0], [6.0], 0.1), np.ones(4))[1]) == 0


def test_crowds_of_nodes_are_thinned():
    n = 5 * MOST
    tmesh = strip([1.0] * n, [float(n)], 0.1)
    rows, free, _ = alignment(tmesh, np.ones(n + 3))
    assert len(free) == MOST
    assert rows @ np.array([1] * n + [1, n, 1]) == pytest.approx(0.0, abs=1e-9)


def test_less_may_be_free_in_narrow_strips_only():
    narrow, wide = strip([3.0, 3.0], [2.0, 4.0], 0.1), strip([3.0, 3.0], [2.0, 4.0], 0.5)
    assert alignment(narrow, np.ones(6), 0.6)[1] == pytest.approx(0.6)
    assert alignment(narrow, np.ones(6), 0.6)[2] == pytest.approx(PRICE / 0.6)
    assert alignment(wide, np.full(6, 12.0), 0.6)[1] == pytest.approx(alignment(wide, np.full(6, 12.0))[1])
