from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gmsh_crossquad.embed.curve_table import CurveTable
from gmsh_crossquad.embed.quality import guide_quality
from gmsh_crossquad.embed.rest_lengths import LEAST_RATIO, _limit, rest_lengths
from gmsh_crossquad.embed.start import LEAST_GAP, chain_arclengths, laplace_start, spread_chains
from gmsh_crossquad.errors import MeshError
from gmsh_crossquad.quad_edges import edges_of_quads
from gmsh_crossquad.records import Float, Guide, Int, Model
from gmsh_crossquad.surfaces import Planes
from tests.smoothing_grids import curve_of, ell, fold, mapped_grid, rectangle, ring, sector, segment, shaken


def arc(radius: float, angle: float):  # type: ignore[no-untyped-def]
    return lambda t: radius * np.column_stack([np.cos(angle * t), np.sin(angle * t), 0.0 * t])


def test_curve_table_on_an_arc_converges() -> None:
    """At one share of the polyline length the place is that of the same share of the arc, the samples being even."""
    errors = []
    for samples in (9, 17, 33):
        curve = curve_of(arc(2.0, 2.0), 0, 1, 1, samples)
        share = np.linspace(0.0, 1.0, 101)
        value, derivative = CurveTable([curve]).at(np.zeros(101, dtype=np.int64), share * curve.length)
        errors.append(np.abs(np.linalg.norm(value[:, :3], axis=1) - 2.0).max())
        assert value[:, 3] == pytest.approx(2.0 * share, abs=1e-3 + 1.0 / samples**2)
        assert np.linalg.norm(derivative[:, :3], axis=1) == pytest.approx(1.0, abs=4.0 / samples**2)
    assert errors[0] < 1e-3
    assert errors[0] / errors[1] > 6.0
    assert errors[1] / errors[2] > 6.0


def test_curve_table_is_exact_on_lines_and_its_derivative_is_continuous() -> None:
    curves = [curve_of(segment((0, 0, 0), (3, 4, 0)), 0, 1, 1, 2), curve_of(arc(1.0, 1.5), 1, 2, 2, 12)]
    table = CurveTable(curves)
    s = np.array([0.0, 1.25, 5.0])
    value, derivative = table.at(np.zeros(3, dtype=np.int64), s)
    assert value[:, :3] == pytest.approx(np.outer(s / 5.0, [3, 4, 0]), abs=1e-14)
    assert derivative == pytest.approx(np.tile([0.6, 0.8, 0.0, 0.0], (3, 1)), abs=1e-14)
    row = np.ones(10, dtype=np.int64)
    nodes = curves[1].arclength[1:-1]
    left, right = table.at(row, nodes - 1e-9), table.at(row, nodes + 1e-9)
    assert left[1] == pytest.approx(right[1], abs=1e-6)
    step = 1e-6
    centre = 0.5 * (nodes + curves[1].arclength[2:])
    difference = (table.at(row, centre + step)[0] - table.at(row, centre - step)[0]) / (2 * step)
    assert difference == pytest.approx(table.at(row, centre)[1], abs=1e-7)


def test_curve_table_keeps_kinks_and_counts_their_turning() -> None:
    def path(t: Float) -> Float:
        return np.column_stack([np.minimum(t, 0.5), np.maximum(t - 0.5, 0.0), 0.0 * t])

    curve = curve_of(path, 0, 1, 1, 9)
    value, _ = CurveTable([curve]).at(np.zeros(50, dtype=np.int64), np.linspace(0, curve.length, 50))
    off = np.minimum(np.abs(value[:, 1]), np.abs(value[:, 0] - 0.5))
    assert off.max() < 1e-14
    assert value[-1, 3] == pytest.approx(np.pi / 2)
    assert (np.diff(value[:, 3]) > -1e-12).all()


def test_curve_table_takes_the_given_end_directions() -> None:
    curve = replace(curve_of(arc(1.0, 1.0), 0, 1, 1, 5), tangents=np.array([[0.0, 1.0, 0.0], [np.sin(1.0), -np.cos(1.0), 0.0]]))
    _, derivative = CurveTable([curve]).at(np.zeros(2, dtype=np.int64), np.array([0.0, curve.length]))
    assert derivative[:, :3] == pytest.approx(np.array([[0.0, 1.0, 0.0], [-np.sin(1.0), np.cos(1.0), 0.0]]), abs=1e-14)


def gaps(guide: Guide, model: Model, row: int) -> Float:
    return np.diff(chain_arclengths(guide, model, row))


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 1000))
def test_spread_chains_gives_strict_order(seed: int) -> None:
    guide, model = mapped_grid(sector(0.3, 1.0, 2.0), 3, 6)
    guide = shaken(guide, model, 0.0, seed)
    spread = spread_chains(guide, model, CurveTable(model.curves))
    for row, curve in enumerate(model.curves):
        mean = curve.length / (len(guide.chains[row]) - 1)
        assert gaps(spread, model, row).min() > 0.999 * LEAST_GAP * mean
    assert (spread.points[guide.fixed] == guide.points[guide.fixed]).all()


def test_spread_chains_leaves_good_chains_alone_and_opens_ties() -> None:
    guide, model = mapped_grid(rectangle(), 4, 4)
    kept = spread_chains(guide, model, CurveTable(model.curves))
    assert (kept.arclength == guide.arclength).all()
    arclength = guide.arclength.copy()
    chain = guide.chains[0]
    arclength[chain[2]] = arclength[chain[1]]
    opened = spread_chains(replace(guide, arclength=arclength), model, CurveTable(model.curves))
    assert gaps(opened, model, 0).min() == pytest.approx(LEAST_GAP * 0.25)
    assert (opened.arclength[guide.chains[1]] == guide.arclength[guide.chains[1]]).all()


def test_spread_chains_refuses_prescribed_nodes_in_the_wrong_order() -> None:
    guide, model = mapped_grid(rectangle(), 4, 4)
    fixed, arclength = guide.fixed.copy(), guide.arclength.copy()
    first, second = guide.chains[2][1:3]
    fixed[[first, second]] = True
    arclength[[first, second]] = arclength[[second, first]]
    with pytest.raises(MeshError, match="curve 3"):
        spread_chains(replace(guide, fixed=fixed, arclength=arclength), model, CurveTable(model.curves))


def test_grid_edges() -> None:
    edges, rows = edges_of_quads(np.array([[0, 1, 2, 3], [1, 4, 5, 2]]))
    assert edges.tolist() == [[0, 1], [0, 3], [1, 2], [1, 4], [2, 3], [2, 5], [4, 5]]
    assert rows.tolist() == [[0, 2, 4, 1], [3, 6, 5, 2]]


@pytest.mark.parametrize("make", [lambda: mapped_grid(rectangle(3.0, 1.0), 5, 4), lambda: fold(4, 1.0)])
def test_laplace_start_restores_an_even_grid(make) -> None:  # type: ignore[no-untyped-def]
    """An affine grid solves the uniform Laplace equation."""
    guide, model = make()
    again = laplace_start(shaken(guide, model, 5.0, 2), model, Planes(model), CurveTable(model.curves))
    assert again.points == pytest.approx(guide.points, abs=1e-12)


@pytest.mark.parametrize("make", [lambda: ring(3, 12, 0.5, 1.0), lambda: mapped_grid(sector(0.5, 1.0, 1.5), 4, 8)])
def test_laplace_start_forgets_the_start(make) -> None:  # type: ignore[no-untyped-def]
    guide, model = make()
    one, two = (laplace_start(shaken(guide, model, 1.0, seed), model, Planes(model), CurveTable(model.curves)) for seed in (1, 2))
    assert one.points == pytest.approx(two.points, abs=1e-12)
    assert guide_quality(one, Planes(model), model).min() > 0.5


def edge_lengths(guide: Guide, sides: Float) -> tuple[Int, Float]:
    edges, rows = edges_of_quads(guide.quads)
    length = np.empty(len(edges))
    length[rows.T] = sides
    assert (length[rows.T] == sides).all(), "an edge has two rest lengths"
    return edges, length


def test_rest_lengths_of_an_even_grid_are_its_edges() -> None:
    guide, model = mapped_grid(rectangle(3.0, 1.0), 6, 5)
    rest = rest_lengths(guide, model, Planes(model), CurveTable(model.curves))
    assert rest.sides == pytest.approx(np.tile([[0.5], [0.2], [0.5], [0.2]], (1, 30)), rel=1e-12)
    assert rest.even == pytest.approx(np.sqrt(0.1), rel=1e-12)
    assert all(c == pytest.approx(gaps(guide, model, row), rel=1e-12) for row, c in enumerate(rest.chains))


@pytest.mark.parametrize("make", [lambda: ell(4), lambda: fold(4, 0.7), lambda: ring(3, 9, 0.3, 1.0)])
@pytest.mark.parametrize("seed", [1, 2])
def test_rest_lengths_fill_curves_and_faces(make, seed: int) -> None:  # type: ignore[no-untyped-def]
    guide, model = make()
    random = np.random.default_rng(seed)
    guide = replace(guide, quad_size=guide.quad_size * np.exp(random.normal(size=guide.quad_size.shape)))
    rest = rest_lengths(guide, model, Planes(model), CurveTable(model.curves))
    for curve, chain in zip(model.curves, rest.chains):
        assert chain.sum() == pytest.approx(curve.length, rel=1e-12)
    areas = 0.25 * (rest.sides[0] + rest.sides[2]) * (rest.sides[1] + rest.sides[3])
    p = guide.points[guide.quads]
    exact = 0.5 * np.linalg.norm(np.cross(p[:, 2] - p[:, 0], p[:, 3] - p[:, 1]), axis=1)
    for face in range(len(model.faces)):
        of_face = guide.quad_face == face
        assert areas[of_face].sum() == pytest.approx(exact[of_face].sum(), rel=1e-12)


def test_a_thin_strip_in_the_layout_is_widened() -> None:
    guide, model = mapped_grid(rectangle(), 10, 10)
    size = guide.quad_size.copy()
    size[40:50, 0] /= 100.0
    rest = rest_lengths(replace(guide, quad_size=size), model, Planes(model), CurveTable(model.curves))
    edges, length = edge_lengths(guide, rest.sides)
    across = np.abs(guide.points[edges[:, 0], 1] - guide.points[edges[:, 1], 1]) < 1e-9
    inside = across & (guide.points[edges[:, 0], 1] > 0.05) & (guide.points[edges[:, 0], 1] < 0.95)
    columns = np.rint(guide.points[edges[inside], 0].min(axis=1) * 10).astype(int)
    by_column = np.array([length[inside][columns == c].mean() for c in range(10)])
    ratio = np.exp(np.abs(np.diff(np.log(by_column))))
    assert ratio.max() < 1.2 * LEAST_RATIO


def test_a_short_curve_keeps_its_length_and_the_others_theirs() -> None:
    """A curve of one edge a hundred times shorter than its neighbours."""

    def mapping(u: Float, v: Float) -> Float:
        return np.column_stack([u, v * (0.001 + 0.999 * u), 0.0 * u])

    guide, model = mapped_grid(mapping, 8, 1)
    rest = rest_lengths(guide, model, Planes(model), CurveTable(model.curves))
    assert rest.chains[3] == pytest.approx([0.001], rel=1e-9)
    assert rest.chains[1] == pytest.approx([1.0], rel=1e-9)
    for row in (0, 2):
        ratio = np.exp(np.abs(np.diff(np.log(rest.chains[row]))))
        assert ratio.max() < LEAST_RATIO + 1e-9


def test_a_chain_must_run_along_edges() -> None:
    guide, model = mapped_grid(rectangle(), 4, 4)
    chain = guide.chains[1][[0, 2, 1, 3, 4]]
    broken = replace(guide, chains=(guide.chains[0], chain, *guide.chains[2:]))
    with pytest.raises(MeshError, match="curve 2"):
        rest_lengths(broken, model, Planes(model), CurveTable(model.curves))


def test_limit_brings_neighbours_within_the_ratio() -> None:
    """One jump of a factor 1000 in a row of edges; the first edge is held, and does not count."""
    u = np.log(np.array([1e-6] + [1.0] * 6 + [1e-3] * 6))
    pairs = np.column_stack([np.arange(12), np.arange(1, 13)])
    held = np.zeros(13, dtype=bool)
    held[0] = True
    out = _limit(u, pairs, held)
    assert out[:2].tolist() == u[:2].tolist()
    assert np.abs(np.diff(out[1:])).max() < 0.4 * np.log(1000.0)
    quarter = np.array([0.0, np.log(4.0)])
    two = _limit(quarter, np.array([[0, 1]]), np.zeros(2, dtype=bool))
    assert two == pytest.approx(np.log([np.sqrt(2), 2 * np.sqrt(2)]))


def test_edges_are_shorter_where_a_curve_turns() -> None:
    def nose(u: Float, v: Float) -> Float:
        angle = np.pi * (v - 0.5)
        return np.column_stack([(1 + u) * np.cos(angle), (0.2 + u) * np.sin(angle), 0.0 * u])

    guide, model = mapped_grid(nose, 3, 3)
    guide = replace(guide, quad_size=np.full_like(guide.quad_size, 0.5))
    first, tip, last = rest_lengths(guide, model, Planes(model), CurveTable(model.curves)).chains[3]
    assert tip < 0.8 * first
    assert last == pytest.approx(first)
