"""Chords that get more edges because of the curves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gmsh_crossquad.fill.curve_edges import BULGE, MOST_GRADED, chords_to_divide, graded
from gmsh_crossquad.fill.curve_fit import misfits
from gmsh_crossquad.fill.numbering import guide_chords
from gmsh_crossquad.fill.placed import _with_bundle
from gmsh_crossquad.surfaces import Planes
from tests.smoothing_grids import mapped_grid, rectangle, sector


@pytest.mark.parametrize(("height", "both"), [(0.2, False), (4.0, True)])
def test_only_a_bulging_edge_is_divided(height: float, both: bool) -> None:
    guide, model = mapped_grid(sector(1.0, 1.0 + height, 1.5), 1, 2)
    bulge = 0.75 * 0.75 / 8
    assert (bulge > BULGE * height) != both
    _, quad_edges, chord, n = guide_chords(guide.quads)
    found = chords_to_divide(model, Planes(model), guide, np.array([0]))
    along = chord[quad_edges[0][np.argmin(guide.curve[guide.quads[0]] < 0)]]
    assert along in range(n)
    assert len(found) == (2 if both else 1)
    if not both:
        points = guide.points
        edges = guide_chords(guide.quads)[0]
        mine = edges[chord == found[0]]
        radius = np.linalg.norm(points[mine], axis=2)
        assert radius[:, 0] == pytest.approx(radius[:, 1])  # edges along the arcs, not across


def test_even_edges_are_left_alone() -> None:
    guide, model = mapped_grid(rectangle(), 4, 4)
    n = guide_chords(guide.quads)[3]
    assert (graded(model, guide, np.full(n, 3)) == 3).all()


def test_a_long_edge_beside_a_crowd_is_halved() -> None:
    guide, model = mapped_grid(rectangle(2.0, 0.2), 2, 1)
    edges, _, chord, n = guide_chords(guide.quads)
    fine = np.full(n, 1)
    lengthwise = {int(c) for c, (a, b) in zip(chord, edges) if abs(guide.points[a, 0] - guide.points[b, 0]) > 0.1}
    left = min(lengthwise, key=lambda c: guide.points[edges[chord == c]][..., 0].mean())
    (right,) = lengthwise - {left}
    fine[right] = 40
    out = graded(model, guide, fine)
    assert out[right] == 40
    assert out[left] > 1
    cells = sum(int(out[c]) for c in lengthwise) * int(out[next(c for c in range(n) if c not in lengthwise)])
    assert cells <= MOST_GRADED * 41


def test_prescribed_edges_are_kept() -> None:
    guide, model = mapped_grid(rectangle(2.0, 0.2), 2, 1)
    edges, _, chord, n = guide_chords(guide.quads)
    fine = np.full(n, 1)
    fine[chord[np.argmax(guide.points[edges].mean(axis=1)[:, 0] * (np.ptp(guide.points[edges][..., 0], axis=1) > 0.1))]] = 40
    prescribed = replace(model, curves=tuple(replace(c, spacing=np.array([0.0, c.length])) for c in model.curves))
    assert (graded(prescribed, guide, fine) == fine).all()


def test_misfit_is_the_distance_in_lengths_of_the_nearest_edge() -> None:
    """Sixty edges of 1/30 on y = 0 and a long one on y = .3 over them: 9."""
    x = np.arange(60) / 30
    a = np.stack([x, 0 * x, 0 * x], axis=1)
    b = a + [1 / 30, 0.0, 0.0]
    found = misfits(np.vstack([a, [[0.5, 0.3, 0.0]]]), np.vstack([b, [[1.5, 0.3, 0.0]]]))
    assert found[:60] == pytest.approx(0.0)
    assert found[60] == pytest.approx(9.0)


def test_a_bundle_is_straightened_up_to_where_bulges_are_small() -> None:
    """Five cells in a row: edges 0 to 5 across it, bulging less and less, width 1; edge 0 is made straight."""
    n = 5
    quad_edges = np.array([[k, n + 1 + k, k + 1, 2 * n + 1 + k] for k in range(n)])
    bulge = np.zeros(3 * n + 1)
    bulge[: n + 1] = [1.0, 0.9, 0.5, 0.3, 0.1, 0.8]
    straight = np.zeros(3 * n + 1, bool)
    straight[0] = True
    out = _with_bundle(straight, quad_edges, bulge, np.ones(3 * n + 1))
    assert np.flatnonzero(out).tolist() == [0, 1, 2, 3]
