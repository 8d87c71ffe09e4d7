"""Glue, quantization, quotient, verification, chords and blocks on the L-shape, where everything is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gmsh_crossquad.embed.place import _carry, coons, place
from gmsh_crossquad.errors import LayoutError
from gmsh_crossquad.layout.chords import arc_divisions, find_chords
from gmsh_crossquad.layout.cuts import separation_cuts
from gmsh_crossquad.layout.divisions import chord_divisions, cumulative_turning
from gmsh_crossquad.layout.quantize import quantize
from gmsh_crossquad.layout.quotient import curve_chain, quotient
from gmsh_crossquad.layout.verify import problems
from gmsh_crossquad.quad_edges import edges_of_quads
from gmsh_crossquad.surfaces import Planes
from tests import tmeshes

MODEL, TMESH = tmeshes.l_shape()
UNIT = float(TMESH.length[0])


def test_glue_shares_nodes_with_the_cad_vertices():
    assert len(TMESH.position) == 8
    assert np.allclose(TMESH.position[:6], MODEL.vertices)
    assert [len(p) for p in TMESH.pieces] == [2, 1, 1, 1, 1, 2]
    assert TMESH.euler.tolist() == [1]
    assert {n: q for (_, n), q in TMESH.quads_at.items()} == {0: 1, 1: 1, 2: 1, 3: 3, 4: 1, 5: 1}


@pytest.mark.parametrize("block, expected", [(UNIT, 1), (UNIT / 2, 2), (UNIT / 5, 5)])
def test_quantization_finds_the_natural_divisions(block, expected):
    result = quantize(MODEL, TMESH, TMESH.length / block)
    assert result.divisions.tolist() == [expected] * 10
    assert result.cost == 0 and result.cuts == 0


def test_coarse_target_keeps_every_curve_alive():
    result = quantize(MODEL, TMESH, TMESH.length / (100 * UNIT))
    assert result.divisions.min() >= 0
    for pieces in TMESH.pieces:
        assert result.divisions[list(pieces)].sum() >= 1
    assert problems(MODEL, TMESH, quotient(TMESH, 3 * result.divisions)) == []


@settings(max_examples=25, deadline=None)
@given(st.tuples(*[st.integers(1, 4)] * 4))
def test_quotient_is_the_three_grids(counts):
    a, b, c, d = counts  # divisions of (0,0)-(1,0), (1,0)-(2,0), (0,0)-(0,1), (0,1)-(0,2)
    n = np.array([a, b, c, b, d, a, d, c, c, a])
    q = quotient(TMESH, n)
    assert len(q.quads) == a * c + b * c + a * d
    assert problems(MODEL, TMESH, q) == []
    edges, _ = edges_of_quads(q.quads)
    assert q.n_vertices - len(edges) + len(q.quads) == 1


def test_unequal_opposite_sides_are_refused():
    with pytest.raises(LayoutError, match="opposite sides"):
        quotient(TMESH, np.array([1, 1, 1, 1, 1, 1, 1, 1, 2, 1]))


def test_a_collapse_that_merges_corners_is_seen_and_cut():
    # the square at the lower left collapsed to nothing: the re-entrant corner falls on the outer sides
    n = np.array([0, 1, 0, 1, 1, 0, 1, 0, 0, 0])
    q = quotient(TMESH, n)
    assert problems(MODEL, TMESH, q)
    cuts = separation_cuts(TMESH, q)
    assert cuts

    def holds(cut):
        return any(sum(c * n[arc] for arc, c in expression) >= bound for expression, bound in cut.options)

    assert not any(holds(c) for c in cuts)


def test_verification_sees_a_wrong_valence():
    q = quotient(TMESH, np.ones(10, np.int64))
    wrong = replace(TMESH, quads_at={**TMESH.quads_at, (0, 3): 4})
    assert any("wrong number of quads" in p for p in problems(MODEL, wrong, q))


def test_verification_sees_a_missing_patch():
    broken = replace(TMESH, patches=TMESH.patches[:2], patch_face=TMESH.patch_face[:2])
    assert problems(MODEL, broken, quotient(broken, np.ones(10, np.int64)))


def test_chords_of_the_l_shape():
    q = quotient(TMESH, np.ones(10, np.int64))
    chords = find_chords(TMESH, q)
    # strips: left column (0-6, 9, 4-5), right column (6-1, 2-3), lower row (1-2, 8, 7-0), upper row (3-4, 5-7)
    label = [int(s[0]) for s in chords.arc_segments]
    assert chords.n == 4
    assert label[0] == label[9] == label[5]
    assert label[1] == label[3]
    assert label[2] == label[8] == label[7]
    assert label[4] == label[6]
    n = np.arange(1, 5)
    assert arc_divisions(chords, n).tolist() == [n[k] for k in label]


@pytest.mark.parametrize("size", [UNIT, UNIT / 3, UNIT / 10])
def test_chord_divisions_follow_the_size(size):
    coarse = np.ones(10, np.int64)
    chords = find_chords(TMESH, quotient(TMESH, coarse))
    d = chord_divisions(MODEL, TMESH, coarse, chords, np.full(10, size), np.full(10, UNIT / 3))
    assert (d.guide * d.fine == round(UNIT / size)).all() or (np.abs(UNIT / (d.guide * d.fine) / size - 1) < 0.3).all()
    assert (d.guide <= 3).all()


def test_prescribed_counts_are_exact():
    spacing = np.linspace(0, MODEL.curves[1].length, 8)
    curves = list(MODEL.curves)
    curves[1] = replace(curves[1], spacing=spacing)
    model = replace(MODEL, curves=tuple(curves))
    coarse = np.ones(10, np.int64)
    chords = find_chords(TMESH, quotient(TMESH, coarse))
    d = chord_divisions(model, TMESH, coarse, chords, np.full(10, UNIT / 3), np.full(10, UNIT / 3))
    assert arc_divisions(chords, d.guide * d.fine)[2] == 7


def test_contradicting_counts_are_named():
    curves = list(MODEL.curves)
    curves[1] = replace(curves[1], spacing=np.linspace(0, 1, 8))
    curves[2] = replace(curves[2], spacing=np.linspace(0, 1, 4))
    curves[3] = replace(curves[3], spacing=np.linspace(0, 1, 4))
    curves[5] = replace(curves[5], spacing=np.linspace(0, 1, 6))
    model = replace(MODEL, curves=tuple(curves))
    coarse = np.ones(10, np.int64)
    chords = find_chords(TMESH, quotient(TMESH, coarse))
    # left side (5) = lower row + upper row, but the lower row has 7 and the upper row 3
    with pytest.raises(LayoutError, match="contradict"):
        chord_divisions(model, TMESH, coarse, chords, np.full(10, UNIT / 3), np.full(10, UNIT / 3))


def test_the_l_shape_has_three_blocks_and_straight_places():
    n = np.full(10, 2, np.int64)
    guide = place(MODEL, Planes(MODEL), TMESH, quotient(TMESH, n))
    assert guide.quad_block.max() + 1 == 3
    assert np.bincount(guide.quad_block).tolist() == [4, 4, 4]
    edge = guide.points[np.roll(guide.quads, -1, axis=1)] - guide.points[guide.quads]
    assert np.allclose(np.linalg.norm(edge, axis=2), UNIT / 2)
    for c, chain in enumerate(guide.chains):
        assert guide.cad_vertex[chain[[0, -1]]].tolist() == [MODEL.curves[c].start, MODEL.curves[c].end]
        assert curve_chain(TMESH, quotient(TMESH, n), c) == chain.tolist()


def test_coons_reproduces_bilinear_maps():
    u, v = np.meshgrid(np.linspace(0, 1, 5), np.linspace(0, 1, 4), indexing="ij")
    exact = np.stack([u + 0.3 * v + 0.2 * u * v, v - 0.1 * u], axis=2)
    blank = exact.copy()
    blank[1:-1, 1:-1] = 0
    assert np.allclose(coons(blank), exact)


def test_a_strip_that_narrows_stays_inside():
    """Flat top, a parabola below it that leaves a gap of 1e-3; the left side is bent, which must not reach the gap."""
    x = np.linspace(-1, 1, 21)
    bottom = np.stack([x, -1e-3 - 0.2 * x**2], axis=1)
    top = np.stack([x, 0 * x], axis=1)
    v = np.linspace(0, 1, 6)
    left = bottom[0] + v[:, None] * (top[0] - bottom[0]) + np.stack([0 * v, 0.1 * np.sin(np.pi * v)], axis=1)
    grid = np.zeros((21, 6, 2))
    grid[:, 0], grid[:, -1], grid[0], grid[-1] = bottom, top, left, bottom[-1] + v[:, None] * (top[-1] - bottom[-1])
    inside = coons(grid)
    assert (np.diff(inside[8:13, :, 1], axis=1) > 0).all()
    assert np.allclose(coons(grid.swapaxes(0, 1)), inside.swapaxes(0, 1))


def test_vertices_follow_the_shift_of_the_ends_of_their_arcs():
    n = np.full(10, 4, np.int64)
    q = quotient(TMESH, n)
    element = np.zeros((len(q.vertex), 3))
    element[: len(TMESH.position)] = TMESH.position
    for arc in range(10):
        a, b = TMESH.position[TMESH.arcs[arc]]
        rows = q.offset[arc] + np.arange(3)
        element[rows] = a + np.arange(1, 4)[:, None] / 4 * (b - a)
    points = np.zeros((q.n_vertices, 3))
    joinable = np.flatnonzero(q.vertex[: q.n_joinable] >= 0)
    points[q.vertex[joinable]] = element[joinable]
    held = np.zeros(q.n_vertices, bool)
    held[q.vertex[: len(TMESH.position)]] = True
    shift = np.array([0.1, 0.2, 0.0])
    points[q.vertex[3]] += shift  # the re-entrant corner, where arcs 8 and 9 start
    moved = _carry(TMESH, q, element, points, held)
    for arc in (8, 9):
        inside = q.vertex[q.offset[arc] + np.arange(3)]
        expected = element[q.offset[arc] + np.arange(3)] + np.array([[0.75], [0.5], [0.25]]) * shift
        assert np.allclose(moved[inside], expected)


def test_turning_of_a_circle():
    a = np.linspace(0, 2 * np.pi, 401)
    points = np.stack([np.cos(a), np.sin(a), 0 * a], axis=1)
    _, turning = cumulative_turning(points, a)
    assert turning[-1] == pytest.approx(2 * np.pi * 399 / 400)
