"""Glue, quantization, quotient, verification, chords and blocks on the L-shape, where everything is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gmsh_crossquad.embed.place import coons, place
from gmsh_crossquad.errors import LayoutError
from gmsh_crossquad.layout.chords import arc_divisions, find_chords
from gmsh_crossquad.layout.cuts import separation_cuts
from gmsh_crossquad.layout.divisions import chord_divisions, cumulative_turning
from gmsh_crossquad.layout.quantize import quantize
from gmsh_crossquad.layout.quotient import curve_chain, quotient
from gmsh_crossquad.layout.verify import problems
from gmsh_crossquad.quad_edges import edges_of_quads
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
    d = chord_divisions(MODEL, TMESH, coarse, chords, np.full(10, size), UNIT / 3)
    assert (d.guide * d.fine == round(UNIT / size)).all() or (np.abs(UNIT / (d.guide * d.fine) / size - 1) < 0.3).all()
    assert (d.guide <= 3).all()


def test_prescribed_counts_are_exact():
    spacing = np.linspace(0, MODEL.curves[1].length, 8)
    curves = list(MODEL.curves)
    curves[1] = replace(curves[1], spacing=spacing)
    model = replace(MODEL, curves=tuple(curves))
    coarse = np.ones(10, np.int64)
    chords = find_chords(TMESH, quotient(TMESH, coarse))
    d = chord_divisions(model, TMESH, coarse, chords, np.full(10, UNIT / 3), UNIT / 3)
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
        chord_divisions(model, TMESH, coarse, chords, np.full(10, UNIT / 3), UNIT / 3)


def test_the_l_shape_has_three_blocks_and_straight_places():
    n = np.full(10, 2, np.int64)
    guide = place(MODEL, TMESH, quotient(TMESH, n))
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


def test_turning_of_a_circle():
    a = np.linspace(0, 2 * np.pi, 401)
    points = np.stack([np.cos(a), np.sin(a), 0 * a], axis=1)
    _, turning = cumulative_turning(points, a)
    assert turning[-1] == pytest.approx(2 * np.pi * 399 / 400)
