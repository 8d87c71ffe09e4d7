"""The checks of validation/curved.py, on some of its surfaces and sizes."""

import importlib
import math
import sys
from pathlib import Path

import numpy as np
import pytest

FOLDER = Path(__file__).resolve().parent.parent / "validation"


@pytest.fixture(scope="module")
def curved():
    sys.path.insert(0, str(FOLDER))
    yield importlib.import_module("curved")
    sys.path.remove(str(FOLDER))


def test_ten_surfaces(curved):
    assert len(curved.SURFACES) >= 10
    assert {chi for _, chi in curved.SURFACES.values()} == {2, 1, 0, -1}


@pytest.mark.parametrize("name", ["sphere", "torus with a hole", "side of a cone", "helicoid"])
def test_poincare_hopf(curved, name):
    make, chi = curved.SURFACES[name]
    _, euler, index, total, whole = curved.poincare_hopf(make)
    assert euler == chi
    assert index == chi
    assert total < 1e-12
    assert whole < 1e-12


def test_angles_of_triangles(curved):
    corner = np.array([[[0.0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 2], [0, 2, 0], [2, 0, 0]]])
    right, equal = math.pi / 4, math.pi / 3
    assert curved.angles(corner) == pytest.approx(np.array([[right, 2 * right, right], [equal] * 3]))


def test_exact_field_of_a_cap(curved):
    (_, h, most, mean), (_, fine_h, fine_most, fine_mean) = (curved.exact_errors(f) for f in (1.6, 0.8))
    assert most < h * h
    assert fine_most < fine_h * fine_h
    assert 1.7 < math.log(mean / fine_mean) / math.log(h / fine_h) < 2.5


def test_octant(curved):
    quads, blocks, odd, least, _, off, faults = curved.octant(0.1)
    assert quads > 100
    assert blocks == 3
    assert odd == [3]
    assert curved.LEAST <= least <= math.sin(2 * math.pi / 3) + 1e-9
    assert off < 0.1
    assert not faults
