"""Properties of the whole pipeline on random domains, boundary indices and singularities."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from validation.domains import FAMILIES, draw
from validation.random_draws import outcome

pytestmark = pytest.mark.usefixtures("gmsh_session")


@given(st.integers(0, 100_000))
@settings(max_examples=10, deadline=None, derandomize=True)
def test_draws_are_what_they_should_be(seed):
    case, again = draw(seed), draw(seed)
    assert case.geo == again.geo
    assert case.family == FAMILIES[seed % 10]
    assert np.array_equal(case.positions, again.positions)
    assert set(case.quarters) <= {-2, -1, 1, 2}
    border = np.concatenate([piece.points for loop in case.loops for piece in loop])
    extent = max(np.ptp(border.real), np.ptp(border.imag))
    z = case.positions @ np.array([1, 1j])
    for k in range(len(z)):
        assert np.abs(np.append(border, np.delete(z, k)) - z[k]).min() > 0.09 * extent


@pytest.mark.parametrize("family", range(10))
def test_random_draws_are_aligned_as_asked_and_meshed(family):
    errors = []

    @given(st.integers(0, 1_000))
    @settings(max_examples=20, deadline=None, derandomize=True)
    def draws(number):
        found = outcome(10 * number + family)
        assert found.aligned
        if found.error:
            assert "\n" not in found.error
            errors.append(found)
        else:
            assert found.quality > 0

    draws()
    assert len(errors) <= 1  # 20 draws of each of 10 families: at least 97 % of all, measured 100 %


@pytest.mark.parametrize("seed", [45, 104])
def test_rings_whose_field_has_no_layout_are_meshed(seed):
    found = outcome(seed)
    assert found.aligned
    assert found.quality > 0.1
    assert any("was added" in note for note in found.notes)
