from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import gmsh_crossquad.embed.smooth as smooth_module
from gmsh_crossquad.embed.minimise import minimise
from gmsh_crossquad.embed.quality import guide_quality
from gmsh_crossquad.embed.smooth import smooth
from gmsh_crossquad.embed.start import chain_arclengths
from gmsh_crossquad.records import Float, Guide, Model
from gmsh_crossquad.surfaces import Planes
from tests.smoothing_grids import build, ell, fold, grid_quads, mapped_grid, moved, rectangle, ring, sector, segment, shaken

GRIDS = {
    "square": mapped_grid(rectangle(), 8, 8),
    "rectangle": mapped_grid(rectangle(5.0, 1.0), 10, 6),
    "strip": mapped_grid(rectangle(1.0, 0.01), 20, 3),
    "one row": mapped_grid(rectangle(1.0, 0.02), 12, 1),
    "sector": mapped_grid(sector(0.3, 1.0, 2.5), 6, 14),
    "ring": ring(4, 16, 0.3, 1.0),
    "ell": ell(5),
    "fold": fold(6, 1.2),
}


def check(guide: Guide, model: Model, given_: Guide) -> None:
    """What holds for every smoothed guide."""
    assert (guide.points[given_.fixed] == given_.points[given_.fixed]).all()
    for row, curve in enumerate(model.curves):
        assert np.diff(chain_arclengths(guide, model, row)).min() > 0
        inner = guide.chains[row][1:-1]
        assert guide.points[inner] == pytest.approx(curve.at(guide.arclength[inner]), abs=2e-3 * curve.length)
    for face, record in enumerate(model.faces):
        vertices = np.unique(guide.quads[guide.quad_face == face])
        off = (guide.points[vertices] - record.origin) @ np.cross(*record.axes)
        assert off == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("name", GRIDS)
@pytest.mark.parametrize("amplitude", [0.0, 0.05, 0.5])
def test_shaken_grids_come_back(name: str, amplitude: float) -> None:
    """Every one of these blocks has a grid of (nearly) right angles, and the optimum must be near it."""
    guide, model = GRIDS[name]
    start = shaken(guide, model, amplitude, 7, slide=amplitude > 0.1)
    out, report = smooth(start, model, Planes(model))
    check(out, model, start)
    quality = guide_quality(out, Planes(model), model)
    assert report.min_scaled_jacobian == quality.min()
    assert len(report.inverted) == 0
    assert quality.min() > 0.95


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_any_tangle_of_a_convex_face_is_undone(seed: int) -> None:
    guide, model = GRIDS["square"]
    out, report = smooth(shaken(guide, model, 1.0, seed), model, Planes(model))
    assert report.min_scaled_jacobian > 0.9
    assert out.points == pytest.approx(guide.points, abs=0.1)


def test_all_interior_vertices_in_one_point() -> None:
    guide, model = GRIDS["sector"]
    points = guide.points.copy()
    points[(guide.curve < 0) & ~guide.fixed] = [0.1, 0.2, 0.0]
    out, report = smooth(replace(guide, points=points), model, Planes(model))
    check(out, model, guide)
    assert report.min_scaled_jacobian > 0.95


def test_a_twisted_interior_is_undone() -> None:
    """The inner square turned by half a turn: the grid has edges through each other everywhere."""
    guide, model = GRIDS["square"]
    points = guide.points.copy()
    inner = (guide.curve < 0) & ~guide.fixed
    points[inner] = [1.0, 1.0, 0.0] - points[inner]
    _, report = smooth(replace(guide, points=points), model, Planes(model))
    assert report.min_scaled_jacobian > 0.95
    assert report.rounds > 0


def test_an_even_rectangle_stays() -> None:
    guide, model = GRIDS["rectangle"]
    out, report = smooth(guide, model, Planes(model))
    assert out.points == pytest.approx(guide.points, abs=1e-12)
    assert report.min_scaled_jacobian == pytest.approx(1.0, abs=1e-12)
    assert (report.rounds, report.start) == (0, "placed")


@pytest.mark.parametrize("name", ["ring", "ell", "fold"])
@pytest.mark.parametrize("scale", [1e-4, 1.0, 1e3])
def test_smoothing_does_not_know_place_direction_and_unit(name: str, scale: float) -> None:
    guide, model = GRIDS[name]
    start = shaken(guide, model, 0.1, 3)
    axis = np.array([1.0, 2.0, -0.5]) / np.linalg.norm([1.0, 2.0, -0.5])
    matrix = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    rotation = np.eye(3) + np.sin(0.8) * matrix + (1 - np.cos(0.8)) * matrix @ matrix
    shift = scale * np.array([3.0, -1.0, 2.0])
    one, _ = smooth(start, model, Planes(model))
    other_start, other_model = moved(start, model, rotation, shift, scale)
    two, report = smooth(other_start, other_model, Planes(other_model))
    check(two, other_model, other_start)
    assert len(report.inverted) == 0
    assert two.points / scale == pytest.approx((scale * one.points @ rotation.T + shift) / scale, abs=0.02)


def test_smoothing_is_deterministic() -> None:
    guide, model = GRIDS["sector"]
    start = shaken(guide, model, 0.3, 5)
    one, two = smooth(start, model, Planes(model))[0], smooth(start, model, Planes(model))[0]
    assert (one.points == two.points).all()


def test_a_tiny_feature_is_untangled_too() -> None:
    """A sector with an inner radius of 1e-4: quads there are ten thousand times smaller than outside."""

    def mapping(u: Float, v: Float) -> Float:
        r = 1e-4 ** (1 - u)
        return np.column_stack([r * np.cos(1.5 * v), r * np.sin(1.5 * v), 0.0 * u])

    guide, model = mapped_grid(mapping, 24, 6)
    random = np.random.default_rng(2)
    points = guide.points.copy()
    inner = np.flatnonzero((guide.curve < 0) & ~guide.fixed)
    size = np.linalg.norm(points[inner], axis=1)[:, None] * [0.4, 0.4, 0.0]
    points[inner] += size * random.normal(size=(len(inner), 3))
    start = replace(guide, points=points)
    assert guide_quality(start, Planes(model), model)[: 6 * 6].min() < 0
    out, report = smooth(start, model, Planes(model))
    check(out, model, guide)
    assert report.min_scaled_jacobian > 0.9


def test_edges_do_not_cut_off_the_tip_of_a_curve() -> None:
    """An ellipse-like nose whose tip turns by almost 180 degrees within a tenth of its length."""

    def mapping(u: Float, v: Float) -> Float:
        angle = np.pi * (v - 0.5)
        r = 1.0 + u
        return np.column_stack([r * np.cos(angle), (0.1 + u) * np.sin(angle), 0.0 * u])

    guide, model = mapped_grid(mapping, 5, 16)
    out, report = smooth(guide, model, Planes(model))
    check(out, model, guide)
    assert report.min_scaled_jacobian > 0.3
    s = chain_arclengths(out, model, 3)
    curve = model.curves[3]
    direction = np.diff(curve.points, axis=0)
    angle = np.unwrap(np.arctan2(direction[:, 1], direction[:, 0]))
    centre = 0.5 * (curve.arclength[1:] + curve.arclength[:-1])
    turned = np.abs(np.diff(np.interp(s, centre, angle)))
    assert turned.max() < np.radians(60)
    assert (s[1:] - s[:-1]).max() / curve.length < 0.5


def test_edges_along_a_curve_are_graded() -> None:
    """A single short curve in a corner of a square, and a layout that gives its strip to the whole width."""

    def mapping(u: Float, v: Float) -> Float:
        return np.column_stack([u, v * (0.02 + 0.98 * u), 0.0 * u])

    guide, model = mapped_grid(mapping, 6, 1)
    arclength = guide.arclength.copy()
    chain = guide.chains[0]
    arclength[chain[1:-1]] = [0.01, 0.02, 0.03, 0.04, 0.05]
    out, report = smooth(replace(guide, arclength=arclength), model, Planes(model))
    check(out, model, guide)
    for row in (0, 2):
        gap = np.diff(chain_arclengths(out, model, row))
        assert np.exp(np.abs(np.diff(np.log(gap)))).max() < 3.0
    assert len(report.inverted) == 0


def test_prescribed_places_on_a_curve_stay() -> None:
    guide, model = GRIDS["sector"]
    fixed = guide.fixed.copy()
    fixed[guide.chains[1]] = True
    start = shaken(replace(guide, fixed=fixed), model, 0.3, 1)
    out, report = smooth(start, model, Planes(model))
    assert (out.arclength[guide.chains[1]] == start.arclength[guide.chains[1]]).all()
    check(out, model, start)
    assert report.min_scaled_jacobian > 0.9


def test_the_report_names_quads_that_cannot_be_untangled() -> None:
    """A quad whose four corners are fixed, one of them inside the triangle of the others."""
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0.25, 0.25, 0], [0, 1, 0]])
    chains = [([k, (k + 1) % 4], segment(points[k], points[(k + 1) % 4])) for k in range(4)]
    guide, model = build(points, grid_quads(1, 1)[:, [0, 1, 2, 3]] * 0 + [[0, 1, 2, 3]], chains)
    out, report = smooth(guide, model, Planes(model))
    assert report.inverted.tolist() == [0]
    assert report.min_scaled_jacobian < 0
    assert (out.points == guide.points).all()


def test_minimise_finds_the_minimum_of_a_quadratic_in_one_step() -> None:
    matrix = np.array([[3.0, 1.0], [1.0, 2.0]])
    goal = np.array([1.0, -2.0])

    def value(z: Float) -> tuple[float, Float]:
        return 1.0 + 0.5 * float((z - goal) @ matrix @ (z - goal)), matrix @ (z - goal)

    result = minimise(value, lambda z: lambda b: np.linalg.solve(matrix, b), np.zeros(2), factorisations=3)
    assert result.z == pytest.approx(goal)
    assert result.steps == 1


def test_minimise_with_a_wrong_matrix_and_a_barrier() -> None:
    """x - log x has its minimum at 1 and a barrier at 0; the Rosenbrock valley needs the corrections of L-BFGS."""

    def barrier(z: Float) -> tuple[float, Float]:
        return (float(z[0] - np.log(z[0])), 1.0 - 1.0 / z) if z[0] > 0 else (np.inf, z)

    identity = lambda z: lambda b: 100.0 * b  # noqa: E731
    assert minimise(barrier, identity, np.array([1e-3]), factorisations=20, tolerance=1e-12).z == pytest.approx([1.0], abs=1e-4)

    def valley(z: Float) -> tuple[float, Float]:
        x, y = z
        return (1 - x) ** 2 + 100 * (y - x * x) ** 2 + 1, np.array([-2 * (1 - x) - 400 * x * (y - x * x), 200 * (y - x * x)])

    result = minimise(valley, lambda z: lambda b: b / 200.0, np.array([-1.2, 1.0]), factorisations=20, steps=20, tolerance=1e-12)
    assert result.z == pytest.approx([1.0, 1.0], abs=1e-3)


def test_long_edges_shrink_towards_a_crowd_on_the_next_curve() -> None:
    """Forty edges on the left side of a square, three on the bottom: the outer ones of these grade down to the crowd."""
    guide, model = mapped_grid(rectangle(), 3, 40)
    out, report = smooth(guide, model, Planes(model))
    check(out, model, guide)
    gap = np.diff(chain_arclengths(out, model, 0))
    assert gap[0] < 0.31
    assert gap[1] > 0.35
    assert report.min_scaled_jacobian > 0.5


def test_the_laplace_start_takes_over(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without untangling rounds a tangled start is lost, and the uniform Laplace grid of a square is valid at once."""
    guide, model = GRIDS["square"]
    monkeypatch.setattr(smooth_module, "ROUNDS", 0)
    out, report = smooth(shaken(guide, model, 1.0, 1), model, Planes(model))
    assert (report.start, report.rounds) == ("laplace", 0)
    assert report.min_scaled_jacobian > 0.99
    assert out.points == pytest.approx(guide.points, abs=0.01)


def test_sharpening_lifts_the_worst_corner(monkeypatch: pytest.MonkeyPatch) -> None:
    """A block under a wave, with nodes only where the energy puts them."""

    def mapping(u: Float, v: Float) -> Float:
        return np.column_stack([u, v * (1 + 0.6 * np.cos(2 * np.pi * u)), 0.0 * u])

    guide, model = mapped_grid(mapping, 12, 8)
    sharp = smooth(guide, model, Planes(model))[1].min_scaled_jacobian
    monkeypatch.setattr(smooth_module, "WANTED", 0.0)
    assert sharp > 1.2 * smooth(guide, model, Planes(model))[1].min_scaled_jacobian
