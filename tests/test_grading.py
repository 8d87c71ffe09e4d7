"""Sizes along arcs, and the measure of long edges beside crowds of short ones."""

from __future__ import annotations

import numpy as np
import pytest

from gmsh_crossquad.cad.sizes import SizeMap
from gmsh_crossquad.fill.curve_fit import curve_fit
from gmsh_crossquad.layout.arc_sizes import arc_sizes
from gmsh_crossquad.records import QuadMesh
from tests import tmeshes


def strip(places: list[float]) -> QuadMesh:
    """A mesh of one straight curve with nodes at `places`."""
    n = len(places)
    points = np.stack([np.array(places), np.zeros(n), np.zeros(n)], axis=1)
    none = np.zeros((0, 4), np.int64)
    row = np.arange(n)
    empty = np.zeros(0, np.int64)
    return QuadMesh(points, none, empty, empty, row[[0, -1]], (row,), (np.array(places),), (empty,))


def test_even_edges_fit():
    assert curve_fit(strip(np.linspace(0, 1, 20).tolist())) == 0.0


def test_a_long_edge_beside_few_short_ones_fits():
    assert curve_fit(strip([0.0, 1.0, 1.01, 1.02])) < 0.3


@pytest.mark.parametrize("short", [1e-2, 1e-3])
def test_a_long_edge_beside_a_crowd_does_not_fit(short):
    crowd = [1.0 + short * k for k in range(20)]
    # at .88 of the long edge the crowd is .12 away, all of its edges are `short` long
    assert curve_fit(strip([0.0, *crowd])) > 0.1 / short


def test_a_graded_crowd_fits():
    steps = np.concatenate([np.full(20, 1e-3), 1e-3 * 2.0 ** np.arange(1, 11)])
    assert curve_fit(strip([0.0, *np.cumsum(steps).tolist()])) < 0.3


def test_a_constant_size_stays_where_no_curve_is_short():
    model, tmesh = tmeshes.l_shape()
    size = 0.5 * float(tmesh.length.min())
    graded, wanted = arc_sizes(model, tmesh, SizeMap(model, (), size))
    assert np.allclose(graded, size) and np.allclose(wanted, size)


def test_sizes_shrink_near_short_curves():
    model, tmesh = tmeshes.l_shape()
    size = 10 * float(tmesh.length.max())
    graded, wanted = arc_sizes(model, tmesh, SizeMap(model, (), size))
    longest = max(c.length for c in model.curves)
    assert np.allclose(wanted, size)
    # every arc is within one side of a curve: 3 L + distance
    assert (graded <= 3 * longest + longest).all()
