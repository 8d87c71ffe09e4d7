from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gmsh_crossquad.embed.chain_energy import GAP_WEIGHT, GRADE_WEIGHT, TURN_WEIGHT, ChainEnergy
from gmsh_crossquad.embed.curve_table import CurveTable
from gmsh_crossquad.embed.energy import AREA_WEIGHT, corner_areas, corner_energy, corner_hessian
from gmsh_crossquad.embed.grid_energy import GridEnergy
from gmsh_crossquad.embed.quality import CHUNK, guide_quality, scaled_jacobian
from gmsh_crossquad.embed.rest_lengths import SAGITTA, rest_lengths
from gmsh_crossquad.embed.start import spread_chains
from gmsh_crossquad.records import Float
from gmsh_crossquad.surfaces import Planes
from tests.smoothing_grids import ell, fold, mapped_grid, rectangle, ring, sector, shaken

SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
UP = np.array([0.0, 0.0, 1.0])


def random_quads(count: int, spread: float, seed: int) -> tuple[Float, Float, Float]:
    random = np.random.default_rng(seed)
    corners = SQUARE[:, :, None] + random.normal(scale=spread, size=(4, 2, count))
    return corners[:, 0], corners[:, 1], random.uniform(0.5, 2.0, size=(4, count))


@pytest.mark.parametrize("power", [1, 4])
@pytest.mark.parametrize(("width", "height"), [(1.0, 1.0), (3.0, 0.01)])
def test_a_rectangle_with_its_own_rest_lengths_has_the_least_energy(width: float, height: float, power: int) -> None:
    x, y = (SQUARE * [width, height]).T[:, :, None]
    rest = np.array([[width], [height], [width], [height]])
    energy, gx, gy = corner_energy(x, y, rest, 0.0, power)
    assert energy == pytest.approx(4 * (1 + AREA_WEIGHT), rel=1e-12)
    assert np.abs(gx * width).max() < 1e-12
    assert np.abs(gy * height).max() < 1e-12
    assert corner_areas(x, y, rest) == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize(("eps", "power", "spread"), [(0.0, 4, 0.1), (0.0, 1, 0.1), (0.3, 1, 0.8), (0.1, 4, 0.4)])
def test_gradient_is_the_derivative_of_the_energy(eps: float, power: int, spread: float) -> None:
    x, y, rest = random_quads(6, spread, 3)
    energy, gx, gy = corner_energy(x, y, rest, eps, power)
    assert np.isfinite(energy)
    step = 1e-6
    for array, gradient in ((x, gx), (y, gy)):
        for at in np.ndindex(array.shape):
            kept = array[at]
            array[at] = kept + step
            after = corner_energy(x, y, rest, eps, power)[0]
            array[at] = kept - step
            before = corner_energy(x, y, rest, eps, power)[0]
            array[at] = kept
            assert (after - before) / (2 * step) == pytest.approx(gradient[at], rel=1e-5, abs=1e-7 * energy)


@pytest.mark.parametrize(("eps", "power"), [(0.0, 4), (0.0, 1)])
def test_hessian_is_exact_but_for_the_curvature_of_the_area(eps: float, power: int) -> None:
    """Along a motion that is linear in all corner areas, the dropped term is 0 and the Hessian is the true one."""
    x, y, rest = random_quads(5, 0.1, 1)
    hessian = corner_hessian(x, y, rest, eps, power)
    random = np.random.default_rng(2)
    move = random.normal(size=x.shape)
    step = 1e-4
    values = [corner_energy(x + t * move, y, rest, eps, power)[0] for t in (-step, 0.0, step)]
    second = (values[0] - 2 * values[1] + values[2]) / step**2
    assert np.einsum("aq,abq,bq->", move, hessian[:, 0, :, 0], move) == pytest.approx(second, rel=1e-4)


@pytest.mark.parametrize(("eps", "power", "spread"), [(0.0, 4, 0.1), (0.2, 1, 1.0), (1e-3, 1, 1.0)])
def test_hessian_is_positive_semidefinite_and_blind_to_translation(eps: float, power: int, spread: float) -> None:
    x, y, rest = random_quads(50, spread, 5)
    matrices = corner_hessian(x, y, rest, eps, power).reshape(8, 8, -1).transpose(2, 0, 1)
    scale = np.abs(matrices).max(axis=(1, 2))
    assert np.abs(matrices - matrices.swapaxes(1, 2)).max(axis=(1, 2)) == pytest.approx(0.0, abs=1e-12 * scale.max())
    assert (np.linalg.eigvalsh(matrices)[:, 0] > -1e-12 * scale).all()
    shift = np.tile([1.0, 0.5], 4)
    assert (np.abs(matrices @ shift).max(axis=1) < 1e-12 * scale).all()


def test_barrier_is_infinite_for_a_corner_turned_over() -> None:
    x, y = SQUARE.T[:, :, None].copy()
    x[2], y[2] = 0.3, 0.3
    rest = np.ones((4, 1))
    assert corner_areas(x, y, rest).min() < 0
    assert corner_energy(x, y, rest, 0.0, 4)[0] == np.inf
    assert np.isfinite(corner_energy(x, y, rest, 1e-3, 1)[0])


@settings(max_examples=30, deadline=None)
@given(angle=st.floats(0, 6.3), scale=st.floats(1e-3, 1e3), seed=st.integers(0, 100))
def test_energy_does_not_know_place_direction_and_unit(angle: float, scale: float, seed: int) -> None:
    x, y, rest = random_quads(4, 0.2, seed)
    c, s = np.cos(angle), np.sin(angle)
    energy = corner_energy(x, y, rest, 0.1, 4)[0]
    other = corner_energy(scale * (c * x - s * y) + 3.0, scale * (s * x + c * y), scale * rest, 0.1, 4)[0]
    assert other == pytest.approx(energy, rel=1e-6)


GRIDS = {
    "rectangle": mapped_grid(rectangle(2.0, 1.0), 4, 3),
    "sector": mapped_grid(sector(0.3, 1.0, 2.0), 3, 4),
    "ring": ring(2, 7, 0.4, 1.0),
    "ell": ell(2),
    "fold": fold(3, 1.1),
}


@pytest.mark.parametrize("name", GRIDS)
@pytest.mark.parametrize(("eps", "power", "amplitude"), [(0.0, 4, 0.01), (0.3, 1, 0.3)])
def test_gradient_of_a_grid(name: str, eps: float, power: int, amplitude: float) -> None:
    guide, model = GRIDS[name]
    guide = spread_chains(shaken(guide, model, amplitude, 4, slide=eps > 0), model, CurveTable(model.curves))
    rest = rest_lengths(guide, model, Planes(model), CurveTable(model.curves))
    grid = GridEnergy(guide, model, Planes(model), CurveTable(model.curves), rest)
    z = 0.01 * np.random.default_rng(1).normal(size=grid.size)
    energy, gradient = grid.value(z, rest.sides, eps, power)
    assert np.isfinite(energy)
    step = 1e-6
    numeric = np.empty(grid.size)
    for k in range(grid.size):
        move = np.zeros(grid.size)
        move[k] = step
        after, before = (grid.value(z + sign * move, rest.sides, eps, power)[0] for sign in (1, -1))
        numeric[k] = (after - before) / (2 * step)
    assert np.abs(numeric - gradient).max() < 1e-5 * np.abs(gradient).max()


def test_factor_solves_with_a_positive_definite_matrix() -> None:
    guide, model = GRIDS["fold"]
    rest = rest_lengths(guide, model, Planes(model), CurveTable(model.curves))
    grid = GridEnergy(guide, model, Planes(model), CurveTable(model.curves), rest)
    z = np.zeros(grid.size)
    solve = grid.factor(z, rest.sides, 0.0, 4)
    inverse = np.column_stack([solve(column) for column in np.eye(grid.size)])
    assert np.abs(inverse - inverse.T).max() < 1e-10 * np.abs(inverse).max()
    assert np.linalg.eigvalsh(inverse)[0] > 0


def test_zero_is_the_given_guide() -> None:
    guide, model = GRIDS["fold"]
    grid = GridEnergy(
        guide, model, Planes(model), CurveTable(model.curves), rest_lengths(guide, model, Planes(model), CurveTable(model.curves))
    )
    points, arclength = grid.positions(np.zeros(grid.size))
    assert points == pytest.approx(guide.points, abs=1e-14)
    assert (arclength == guide.arclength).all()


@pytest.mark.parametrize("angle", [0.1, 0.7, np.pi / 2, 2.0, 3.0])
@pytest.mark.parametrize("lift", [0.0, 1.0])
def test_scaled_jacobian_of_a_parallelogram_is_the_sine_of_its_angle(angle: float, lift: float) -> None:
    a, b = np.array([2.0, 0.0, 0.0]), 0.1 * np.array([np.cos(angle), np.sin(angle), 0.0])
    points = np.array([0 * a, a, a + b, b]) @ turn(lift).T
    normal = turn(lift) @ UP
    quads = np.array([[0, 1, 2, 3], [3, 2, 1, 0]])
    assert scaled_jacobian(points, quads, normal) == pytest.approx([np.sin(angle), -np.sin(angle)], abs=1e-12)


def turn(angle: float) -> Float:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


def test_scaled_jacobian_of_degenerate_and_folded_quads() -> None:
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.2, 0.2, 0], [0, 0, 0.0]])
    quads = np.array([[0, 1, 2, 3], [0, 5, 2, 3], [0, 1, 4, 3]])
    values = scaled_jacobian(points, quads, np.tile(UP, (3, 1)))
    assert values[0] == 1.0
    assert values[1] == 0.0
    assert values[2] < 0.0


def test_scaled_jacobian_in_chunks() -> None:
    random = np.random.default_rng(0)
    points = random.normal(size=(100, 3))
    quads = random.integers(0, 100, size=(CHUNK + 7, 4))
    normals = np.tile(UP, (len(quads), 1))
    whole = scaled_jacobian(points, quads, normals)
    assert (whole[CHUNK - 3 :] == scaled_jacobian(points, quads[CHUNK - 3 :], UP)).all()


def test_guide_quality_knows_the_planes_of_the_faces() -> None:
    guide, model = fold(3, 2.0)
    assert guide_quality(guide, Planes(model), model) == pytest.approx(1.0)


def test_chain_terms_by_hand() -> None:
    """One straight curve of length 1 with two sliding vertices."""
    guide, model = mapped_grid(rectangle(), 3, 1)
    table = CurveTable(model.curves)
    row = np.full(len(guide.points), -1)
    row[guide.chains[0][1:-1]] = [0, 1]
    row[guide.chains[2][1:-1]] = [2, 3]
    third = np.full(3, 1 / 3)
    chains = ChainEnergy(guide, model, (third, np.ones(1), third, np.ones(1)), table, row, 4)
    even = np.array([1 / 3, 2 / 3, 1 / 3, 2 / 3])
    energy, by_place, by_turn = chains.value(even, np.zeros(4))
    assert energy == pytest.approx(6 * GAP_WEIGHT)
    assert by_place == pytest.approx(0.0, abs=1e-12)
    assert by_turn == pytest.approx(0.0)
    moved = np.array([0.05, 0.5, 1 / 3, 2 / 3])
    gaps = np.array([0.05, 0.45, 0.5])
    expected = 3 * GAP_WEIGHT + 0.5 * GAP_WEIGHT * (3 * gaps + 1 / (3 * gaps)).sum()
    # 0.45 / 0.05 = 9 on the curve; in the corner 0.05 and the even third on the opposite curve are not neighbours.
    expected += GRADE_WEIGHT * np.log(9 / 2) ** 2
    assert chains.value(moved, np.zeros(4))[0] == pytest.approx(expected)
    for wrong in ([0.5, 0.5, 0.3, 0.6], [0.6, 0.5, 0.3, 0.6], [-0.1, 0.5, 0.3, 0.6]):
        assert chains.value(np.array(wrong), np.zeros(4))[0] == np.inf


def test_turning_costs_from_the_limit_of_its_edge() -> None:
    guide, model = mapped_grid(rectangle(), 3, 1)
    table = CurveTable(model.curves)
    row = np.full(len(guide.points), -1)
    row[guide.chains[0][1:-1]] = [0, 1]
    row[guide.chains[2][1:-1]] = [2, 3]
    third, none = np.full(3, 1 / 3), np.full(3, np.inf)
    turns = (np.array([0.1, np.inf, np.inf]), none[:1], none, none[:1])
    chains = ChainEnergy(guide, model, (third, np.ones(1), third, np.ones(1)), table, row, 4, turns)
    even = np.array([1 / 3, 2 / 3, 1 / 3, 2 / 3])
    base = chains.value(even, np.zeros(4))[0]
    turning = np.array([0.3, 0.6, 0.0, 0.0])  # .3 on the first two edges
    energy, _, by_turn = chains.value(even, turning)
    assert energy - base == pytest.approx(TURN_WEIGHT * (0.3 / 0.1 - 1) ** 2)
    assert by_turn[:2] == pytest.approx([2 * TURN_WEIGHT / 0.1 * 2, 0.0])


def test_rest_lengths_leave_no_bulge_beside_thin_cells() -> None:
    """One row of quads of height w between an arc of radius 1 and a concentric one: the bulge is l^2 / 8."""
    height = 0.01
    guide, model = mapped_grid(sector(1.0, 1.0 + height, 1.0), 1, 4)
    table = CurveTable(model.curves)
    for actual in (0.5, 1.0):
        rest = rest_lengths(guide, model, Planes(model), table, actual=actual)
        limits = np.concatenate([t for t in rest.turns if len(t) == 4])
        assert limits == pytest.approx(np.sqrt(8 * SAGITTA * height), rel=2e-2)
    assert all(np.isinf(t).all() for t in rest_lengths(guide, model, Planes(model), table).turns)
    wide, wide_model = mapped_grid(sector(1.0, 2.0, 1.0), 1, 4)
    assert all(
        np.isinf(t).all()
        for t in rest_lengths(wide, wide_model, Planes(wide_model), CurveTable(wide_model.curves), actual=1.0).turns
    )


def test_chain_hessian_is_the_second_derivative_where_nothing_is_dropped() -> None:
    """The ordering term; the turning term for a constant rate."""
    guide, model = mapped_grid(sector(0.5, 1.0, 2.0), 1, 3)
    grid = GridEnergy(
        guide, model, Planes(model), CurveTable(model.curves), rest_lengths(guide, model, Planes(model), CurveTable(model.curves))
    )
    chains = grid._chains
    s = np.array([0.3, 0.7, 0.6, 1.4])
    rate = np.array([2.0, 2.0, 1.0, 1.0])
    edges, pairs = chains.hessian(s, rate * s, np.ones(4), rate)
    full = np.zeros((5, 5))
    for rows, blocks in ((chains.edges, edges), (chains.pairs, pairs)):
        rows = np.minimum(rows, 4)
        for k in range(len(rows)):
            np.add.at(full, np.ix_(rows[k], rows[k]), blocks[:, :, k])
    step = 1e-5

    def gradient(at: Float) -> Float:
        _, by_place, by_turn = chains.value(at, rate * at)
        return by_place + by_turn * rate

    numeric = np.column_stack([(gradient(s + step * e) - gradient(s - step * e)) / (2 * step) for e in np.eye(4)])
    assert chains.value(s, 0 * s)[0] != chains.value(s, rate * s)[0]
    assert full[:4, :4] == pytest.approx(numeric, rel=1e-4, abs=1e-4 * np.abs(numeric).max())
