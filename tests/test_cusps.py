"""Cusps: a line and a circle, two circles that touch inside, and cusps on a cylinder."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import replace

import gmsh
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import gmsh_crossquad
from gmsh_crossquad.cusps import SHARP, cusp_corners, find_cusps
from gmsh_crossquad.embed.curve_table import CurveTable
from gmsh_crossquad.embed.energy import corner_energy, corner_hessian
from gmsh_crossquad.embed.grid_energy import GridEnergy
from gmsh_crossquad.embed.kites import kites
from gmsh_crossquad.embed.quality import guide_quality, scaled_jacobian
from gmsh_crossquad.embed.rest_lengths import rest_lengths
from gmsh_crossquad.embed.smooth import smooth
from gmsh_crossquad.fill.coons import grid_quality
from gmsh_crossquad.fill.cusp_grid import cusp_grid
from gmsh_crossquad.quad_edges import edges_of_quads
from gmsh_crossquad.records import Float, Guide, Model
from gmsh_crossquad.surfaces import Planes

from . import models
from .guides import make_guide

UP = np.array([0.0, 0.0, 1.0])


def parabola(bend: float, x: Float) -> Float:
    return np.stack([x, 0.5 * bend * x * x])


def kite(low: float, high: float, n: int, m: int, length: float = 1.0) -> Float:
    """Grid (2, n + 1, m + 1) between two parabolas that touch in the origin."""
    bottom = parabola(low, np.linspace(0.0, length, n + 1))
    left = parabola(high, np.linspace(0.0, length, m + 1))
    slope = 0.5 * (low + high) * length
    width = 0.5 * (high - low) * length**2
    far = 0.5 * (bottom[:, -1] + left[:, -1]) + 0.3 * width * np.array([1.0, slope]) / np.hypot(1.0, slope)
    right, top = (near[:, -1:] + np.linspace(0, 1, k + 1) * (far - near[:, -1])[:, None] for near, k in ((bottom, m), (left, n)))
    return cusp_grid(bottom, right, top, left)


@given(
    low=st.floats(-0.4, 0.4),
    gap=st.floats(0.05, 0.4),
    n=st.integers(1, 9),
    m=st.integers(1, 9),
)
def test_grids_in_cusps_have_no_inverted_quad(low: float, gap: float, n: int, m: int) -> None:
    if low > 0 or low + gap < 0:
        m = n  # else a long edge on one curve cuts across the other one
    grid = kite(low, low + gap, n, m)
    assert grid.shape == (2, n + 1, m + 1)
    assert grid_quality(grid[:, None]) > 0
    assert np.array_equal(grid[:, 0, 0], [0, 0])


def test_grids_in_cusps_turn_with_their_sides() -> None:
    a, b = kite(0.1, 0.4, 4, 4), kite(-0.4, -0.1, 4, 4)
    # mirrored in the x axis, so that the sides change places
    assert a * [[[1.0]], [[-1.0]]] == pytest.approx(b.swapaxes(1, 2), abs=1e-12)


def test_sharp_corners_of_grids_count_only_where_turned_over() -> None:
    grid = kite(0.0, 0.1, 1, 1)[:, None]
    cusp = np.array([[True, False, False, False]])
    angle = np.arctan(0.05)
    assert grid_quality(grid)[0] == pytest.approx(np.sin(angle), rel=1e-2)
    assert grid_quality(grid, cusp)[0] > 0.5
    for k, turned in enumerate((grid, grid[:, :, ::-1].copy(), grid[:, :, ::-1, ::-1].copy(), grid[:, :, :, ::-1].copy())):
        mirrored = turned * ([[[[1.0]]], [[[-1.0]]]] if k % 2 else 1.0)
        assert grid_quality(mirrored, np.arange(4)[None] == k)[0] > 0.5
        assert grid_quality(mirrored, np.arange(4)[None] == (k + 1) % 4)[0] < 0.06
        assert grid_quality(mirrored * [[[[1.0]]], [[[-1.0]]]], np.arange(4)[None] == k)[0] < 0


def touching(bend: float = 1.0) -> tuple[Model, Guide]:
    """Between the x axis and a circle that touches it in the origin, from x = 0 to 0.8: a kite, and three cells on each side."""
    r = 1.0 / bend
    top = np.arcsin(0.8 / r)
    up = r - r * np.cos(top)
    circle = models.arc((0, r), r, -np.pi / 2, -np.pi / 2 + top)
    corners = [(0.0, 0.0), (0.8, 0.0), (0.8, float(up))]
    curves = [(0, 1, models.line(corners[0], corners[1])), (1, 2, models.line(corners[1], corners[2])), (2, 0, circle[::-1])]
    model = models.build(corners, curves, [([[(0, 1), (1, 1), (2, 1)]], [], [])])
    x = np.array([0.3, 0.5, 0.65, 0.8])
    y = r - np.sqrt(r * r - x * x)
    xy = [(0.0, 0.0), *zip(x, 0 * x), *zip(x + [0.03, 0.02, 0.01, 0], 0.5 * y), *zip(x, y)]
    low, mid, high = np.arange(1, 5), np.arange(5, 9), np.arange(9, 13)
    quads = [[0, low[0], mid[0], high[0]]]
    quads += [[low[i], low[i + 1], mid[i + 1], mid[i]] for i in range(3)]
    quads += [[mid[i], mid[i + 1], high[i + 1], high[i]] for i in range(3)]
    return model, make_guide(model, xy, quads, [[0, *low], [low[-1], mid[-1], high[-1]], [*high[::-1], 0]])


def test_cusps_are_found_by_the_directions_of_their_curves() -> None:
    model, guide = touching()
    found = find_cusps(guide, model)
    assert [x.tolist() for x in found] == [[0], [0], [[0, 2]], [[0, 1]]]
    assert cusp_corners(guide, model).sum() == 1
    for angle, cusps in ((0.9 * SHARP, 1), (1.1 * SHARP, 0)):
        wedge = models.wedge(angle)
        t = angle / 2
        xy = [(0, 0), (1, 0), (np.cos(t), np.sin(t)), (np.cos(angle), np.sin(angle))]
        quad = make_guide(wedge, xy, [[0, 1, 2, 3]], [[0, 1], [1, 2, 3], [3, 0]])
        assert cusp_corners(quad, wedge).sum() == cusps
    turned = replace(guide, quads=np.roll(guide.quads, -1, axis=1))
    assert np.argwhere(cusp_corners(turned, model)).tolist() == [[0, 3]]


def test_cusps_do_not_count_as_poor_quality() -> None:
    model, guide = touching()
    plain = scaled_jacobian(guide.points, guide.quads, UP)
    quality = guide_quality(guide, Planes(model), model)
    assert plain[0] == pytest.approx(np.sin(np.arctan2(0.0461, 0.3)), rel=0.02)
    assert quality[0] > 0.5
    assert np.array_equal(quality[1:], plain[1:])


def test_corners_left_out_have_no_energy() -> None:
    x, y = np.array([[0.0], [1.0], [1.3], [1.0]]), np.array([[0.0], [-0.1], [0.0], [0.1]])
    rest = np.array([[1.0], [0.3], [0.3], [1.0]])
    without = np.array([[True], [False], [False], [False]])
    step = 1e-6
    for eps, power in ((0.0, 4), (0.1, 1)):
        _, gx, gy = corner_energy(x, y, rest, eps, power, without)
        alone, others = (corner_energy(x, y, rest, eps, power, w)[0] for w in (~without, without))
        assert alone + others == pytest.approx(corner_energy(x, y, rest, eps, power)[0], rel=1e-12)
        for k in range(4):
            for c, gradient in ((x, gx), (y, gy)):
                moved = [c.copy(), c.copy()]
                moved[0][k] -= step
                moved[1][k] += step
                pair = [
                    corner_energy(m, y, rest, eps, power, without) if c is x else corner_energy(x, m, rest, eps, power, without)
                    for m in moved
                ]
                assert gradient[k, 0] == pytest.approx((pair[1][0] - pair[0][0]) / (2 * step), rel=1e-4, abs=1e-5)
        assert np.linalg.eigvalsh(corner_hessian(x, y, rest, eps, power, without).reshape(8, 8)).min() > -1e-9
    y[1] = 0.2  # turned over in the cusp and beside it
    assert corner_energy(x, y, rest, 0.0, 4)[0] == np.inf


@pytest.mark.parametrize("bend", [0.3, 1.0])
def test_smoothing_leaves_equal_sides_in_a_cusp(bend: float) -> None:
    model, guide = touching(bend)
    out, report = smooth(guide, model, Planes(model))
    a, far, b = np.linalg.norm(out.points[out.quads[0, 1:]] - out.points[0], axis=1)
    assert a == pytest.approx(b, rel=0.05)
    assert far == pytest.approx(a, rel=0.15)
    assert report.min_scaled_jacobian > 0.6


def test_edges_in_cusps_get_the_lengths_of_a_kite() -> None:
    model, guide = touching()
    table = CurveTable(model.curves)
    edges, quad_edges = edges_of_quads(guide.quads)
    key = {tuple(e): row for row, e in enumerate(edges.tolist())}
    chains = [np.array([key[min(e), max(e)] for e in itertools.pairwise(c.tolist())]) for c in guide.chains]
    own = np.full(len(edges), np.log(0.15 / model.scale))
    none = np.zeros(len(edges), bool)
    new, held = kites(own, none, find_cusps(guide, model), quad_edges, chains, model, table)
    along, short, other, back = np.exp(new[quad_edges[0]]) * model.scale
    assert along == pytest.approx(back) and short == pytest.approx(other)
    # the circle departs by 1 - cos(L) from the line, and its place by L - sin(L) along it
    assert short == pytest.approx(np.hypot(1 - np.cos(along), along - np.sin(along)) / np.sqrt(3), rel=1e-3)
    assert 0.3 * 0.15 <= short < 1.2 * 0.3 * 0.15
    assert np.flatnonzero(held).tolist() == sorted(quad_edges[0].tolist())
    assert np.array_equal(new[~held], own[~held])
    kept = none.copy()
    kept[quad_edges[0, 0]] = True
    assert kites(own, kept, find_cusps(guide, model), quad_edges, chains, model, table)[0][quad_edges[0, 0]] == own[0]
    rest = rest_lengths(guide, model, Planes(model), table)
    energy = GridEnergy(guide, model, Planes(model), table, rest)
    assert energy.areas(np.zeros(energy.size), rest.sides)[0, 0] == 1.0


def line_and_circle() -> None:
    geo = gmsh.model.geo
    p = [geo.addPoint(*x) for x in ((0, 0, 0), (0, 1, 0), (1, 1, 0), (1, 3, 0), (3, 3, 0), (3, 0, 0))]
    circle = geo.addCircleArc(p[0], p[1], p[2])
    lines = [geo.addLine(p[i], p[(i + 1) % 6]) for i in range(2, 6)]
    geo.addPlaneSurface([geo.addCurveLoop([-circle, *(-c for c in lines[::-1])])])
    geo.synchronize()


def circles(r: float = 1.0) -> None:
    """Half of the gap between circles of radius 2 and r that touch inside."""
    geo = gmsh.model.geo
    p = [geo.addPoint(*x, 0) for x in ((0, 0), (2, 0), (4, 0), (r, 0), (2, 2), (r, r), (2 * r, 0))]
    outer = [geo.addCircleArc(p[0], p[1], p[4]), geo.addCircleArc(p[4], p[1], p[2])]
    inner = [geo.addCircleArc(p[0], p[3], p[5]), geo.addCircleArc(p[5], p[3], p[6])]
    geo.addPlaneSurface([geo.addCurveLoop([*inner, geo.addLine(p[6], p[2]), -outer[1], -outer[0]])])
    geo.synchronize()


def near_circles() -> None:
    """The same with a gap that grows by a ninth of the bend."""
    circles(1.8)


def cylinder() -> None:
    """Half a cylinder between z = 0 and z = 1 - x, which touch on it."""
    occ = gmsh.model.occ
    p = [occ.addPoint(*x) for x in ((1, 0, 0), (-1, 0, 0), (-1, 0, 2))]
    face = occ.addPlaneSurface([occ.addCurveLoop([occ.addLine(p[i], p[(i + 1) % 3]) for i in range(3)])])
    wedge = [e for e in occ.extrude([(2, face)], 0, 1, 0) if e[0] == 3]
    occ.intersect(wedge, [(3, occ.addCylinder(0, 0, 0, 0, 0, 3, 1))])
    occ.synchronize()


@pytest.mark.parametrize("build", [line_and_circle, circles, near_circles, cylinder])
def test_models_with_cusps_are_meshed(build: Callable[[], None]) -> None:
    gmsh.initialize(interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    try:
        build()
        result = gmsh_crossquad.mesh(size=0.2)
        assert result.quad_quality.min() > 0
        assert result.quality.mean_scaled_jacobian > 0.85
    finally:
        gmsh.finalize()
