"""The nearest of many points: ties, scales, and the two ways of searching."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gmsh_crossquad.field.nearest import nearest


@settings(max_examples=60, deadline=None)
@given(n=st.integers(1, 200), k=st.integers(0, 40), grid=st.integers(1, 12), seed=st.integers(0, 2**32 - 1))
def test_no_point_is_nearer(n: int, k: int, grid: int, seed: int) -> None:
    """On an integer grid there are ties, duplicates and exact hits."""
    rng = np.random.default_rng(seed)
    points, queries = rng.integers(0, grid, (n, 2)).astype(float), rng.integers(0, grid, (k, 2)).astype(float)
    least = np.sqrt(((queries[:, None] - points) ** 2).sum(axis=2).min(axis=1))
    distance, row = nearest(points, queries)
    np.testing.assert_array_equal(distance, least)
    np.testing.assert_array_equal(np.hypot(*(points[row] - queries).T), least)


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e6])
@pytest.mark.parametrize("far", [0.0, 1e3])
def test_circle(scale: float, far: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """The nearest of the points of a circle has the nearest angle; both ways of searching find it."""
    angle = np.linspace(0, 2 * np.pi, 700, endpoint=False)
    circle = scale * (far + np.stack([np.cos(angle), np.sin(angle)], axis=1))
    rng = np.random.default_rng(1)
    wanted, radius = rng.integers(0, 700, 3000), rng.uniform(0.1, 2.0, 3000)
    turn = angle[wanted] + rng.uniform(-0.49, 0.49, 3000) * 2 * np.pi / 700
    queries = scale * (far + radius[:, None] * np.stack([np.cos(turn), np.sin(turn)], axis=1))
    for pairs in (10**9, 0):
        monkeypatch.setattr("gmsh_crossquad.field.nearest.PAIRS", pairs)
        distance, row = nearest(circle, queries)
        np.testing.assert_array_equal(row, wanted)
        np.testing.assert_allclose(distance, np.hypot(*(queries - circle[wanted]).T), rtol=1e-14)
