"""Guide grids on curved faces: quality, smoothing, starts and placing on surfaces with known geometry."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gmsh_crossquad.embed.curve_table import CurveTable
from gmsh_crossquad.embed.grid_energy import GridEnergy, tangents_of
from gmsh_crossquad.embed.quality import guide_quality
from gmsh_crossquad.embed.rest_lengths import rest_lengths
from gmsh_crossquad.embed.smooth import smooth
from gmsh_crossquad.embed.start import laplace_start
from gmsh_crossquad.records import Float, Guide
from gmsh_crossquad.surfaces import Planes
from tests.analytic_surfaces import (
    Cylinder,
    Graph,
    Grid,
    Torus,
    closed_torus,
    cube_sphere,
    mapped,
    octant,
    shaken,
    torus_points,
    tube,
)
from tests.smoothing_grids import PLANE

TORUS = Torus(3.0, 1.0)


def bend(angle: float, nu: int, nv: int) -> Grid:
    """A bent pipe."""
    return tube(lambda u, v: torus_points(TORUS, angle * u, 2 * np.pi * v), nu, nv, TORUS)


def pipe(nu: int, nv: int) -> Grid:
    """A straight pipe of radius 1 and length 4; u runs around."""

    def mapping(u: Float, v: Float) -> Float:
        return np.column_stack([np.cos(2 * np.pi * v), -np.sin(2 * np.pi * v), 4 * u])

    return tube(mapping, nu, nv, Cylinder())


def saddle(nu: int, nv: int, height: float = 1.0) -> Grid:
    def mapping(u: Float, v: Float) -> Float:
        x, y = 2 * u - 1, 2 * v - 1
        return np.column_stack([x, y, 0.5 * height * (x * x - y * y)])

    return mapped(mapping, nu, nv, Graph(height))


GRIDS = {
    "octant": octant(4),
    "cube": cube_sphere(4),
    "torus": closed_torus(20, 8, TORUS),
    "bend": bend(np.pi / 2, 8, 8),
    "return bend": bend(np.pi, 12, 8),
    "pipe": pipe(6, 8),
    "patch": mapped(lambda u, v: torus_points(TORUS, 0.2 + u, 3 * v - 1), 6, 8, TORUS),
    "saddle": saddle(6, 6),
}
LEAST = {"octant": 0.86, "cube": 0.86, "saddle": 0.75}
"""Three right angles meet at 120 degrees in the regular corner: sin 120 = .866; the others have grids of right angles, but
for the saddle with corners of cos = 1/2."""


def edge_length(guide: Guide) -> float:
    p = guide.points[guide.quads]
    return float(np.linalg.norm(p - np.roll(p, -1, axis=1), axis=2).mean())


def check(out: Guide, grid: Grid) -> None:
    """What holds for every smoothed guide on one curved face."""
    guide, model, surfaces = grid
    assert (out.points[guide.fixed] == guide.points[guide.fixed]).all()
    inner = np.flatnonzero((guide.curve < 0) & ~guide.fixed)
    off = out.points[inner] - surfaces.feet(np.zeros(len(inner), np.int64), out.points[inner])
    assert np.abs(off).max() < 1e-12
    sliding = np.flatnonzero((guide.curve >= 0) & ~guide.fixed)
    for row, curve in enumerate(model.curves):
        at = sliding[guide.curve[sliding] == row]
        assert out.points[at] == pytest.approx(curve.at(out.arclength[at]), abs=2e-3 * curve.length)


@pytest.mark.parametrize("name", GRIDS)
@pytest.mark.parametrize("amplitude", [0.0, 0.3, 1.0])
def test_shaken_grids_come_back(name: str, amplitude: float) -> None:
    """Displacements in edge lengths; from 1 on more than half of the quads are turned over."""
    guide, model, surfaces = grid = GRIDS[name]
    start = shaken(grid, amplitude * edge_length(guide), 1)
    if amplitude:
        assert guide_quality(start, surfaces).min() < 0.0
    out, report = smooth(start, model, surfaces)
    check(out, grid)
    quality = guide_quality(out, surfaces)
    assert report.min_scaled_jacobian == quality.min() > LEAST.get(name, 0.93)


@pytest.mark.parametrize("n", [4, 6])
def test_octant_of_a_sphere_from_a_bad_start(n: int) -> None:
    """All interior vertices in one point beside the middle."""
    guide, model, surfaces = grid = octant(n)
    points = guide.points.copy()
    inner = (guide.curve < 0) & ~guide.fixed
    points[inner] = surfaces.feet(np.zeros(int(inner.sum()), np.int64), points[inner] * 0.0 + [0.3, 0.5, 0.8])
    out, report = smooth(replace(guide, points=points), model, surfaces)
    check(out, grid)
    assert report.min_scaled_jacobian > 0.86


@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_any_tangle_of_a_sphere_within_two_edges_is_undone(seed: int) -> None:
    guide, model, surfaces = grid = cube_sphere(6)
    out, report = smooth(shaken(grid, 1.0 * edge_length(guide), seed), model, surfaces)
    check(out, grid)
    assert report.min_scaled_jacobian > 0.86


@pytest.mark.parametrize("name", ["octant", "bend", "saddle"])
@pytest.mark.parametrize(("eps", "power", "amplitude"), [(0.0, 4, 0.0), (0.3, 1, 0.5)])
def test_gradient_of_a_grid(name: str, eps: float, power: int, amplitude: float) -> None:
    guide, model, surfaces = grid = GRIDS[name]
    guide = shaken(grid, amplitude * edge_length(guide), 4)
    table = CurveTable(model.curves)
    rest = rest_lengths(guide, model, surfaces, table)
    energy = GridEnergy(guide, model, surfaces, table, rest)
    z = 0.01 * np.random.default_rng(1).normal(size=energy.size)
    value, gradient = energy.value(z, rest.sides, eps, power)
    assert np.isfinite(value)
    step = 1e-6
    numeric = np.empty(energy.size)
    for k in range(energy.size):
        move = np.zeros(energy.size)
        move[k] = step
        after, before = (energy.value(z + sign * move, rest.sides, eps, power)[0] for sign in (1, -1))
        numeric[k] = (after - before) / (2 * step)
    assert np.abs(numeric - gradient).max() < 1e-5 * np.abs(gradient).max()
    inverse = np.column_stack([energy.factor(z, rest.sides, eps, power)(column) for column in np.eye(energy.size)[:40]])
    assert np.abs(inverse[:40] - inverse[:40].T).max() < 1e-9 * np.abs(inverse).max()


def test_a_plane_called_curved_has_the_same_energy_and_hessian() -> None:
    """In a plane the tangent frames are turned, which no value can see; a Newton step is the same in space."""
    guide, model, flat = saddle(5, 4, height=0.0)
    guide = shaken((guide, model, flat), 0.02, 3)
    table = CurveTable(model.curves)
    plane = replace(model, faces=(replace(model.faces[0], origin=PLANE[0], axes=PLANE[1]),))
    moved = []
    values = []
    for its_model, surfaces in ((model, flat), (plane, Planes(plane))):
        rest = rest_lengths(guide, its_model, surfaces, table)
        energy = GridEnergy(guide, its_model, surfaces, table, rest)
        value, gradient = energy.value(np.zeros(energy.size), rest.sides, 0.0, 4)
        step = -energy.factor(np.zeros(energy.size), rest.sides, 0.0, 4)(gradient)
        values.append(value)
        moved.append(energy.positions(step)[0])
    assert values[0] == pytest.approx(values[1], rel=1e-12)
    assert np.abs(moved[1] - guide.points).max() > 1e-3
    assert moved[0] == pytest.approx(moved[1], abs=1e-9)


def test_tangents_are_right_handed_frames() -> None:
    normal = np.random.default_rng(0).normal(size=(50, 3))
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    normal[:3] = np.eye(3)
    frame = tangents_of(normal)
    assert np.cross(frame[:, 0], frame[:, 1]) == pytest.approx(normal, abs=1e-14)
    assert np.einsum("nac,nbc->nab", frame, frame) == pytest.approx(np.tile(np.eye(2), (50, 1, 1)), abs=1e-14)


@pytest.mark.parametrize("name", ["octant", "pipe", "saddle", "cube"])
def test_laplace_start_on_a_surface(name: str) -> None:
    """Vertices stay on the surface, and an even grid stays valid: nothing shrinks."""
    guide, model, surfaces = GRIDS[name]
    start = laplace_start(guide, model, surfaces, CurveTable(model.curves))
    inner = np.flatnonzero((guide.curve < 0) & ~guide.fixed)
    off = start.points[inner] - surfaces.feet(np.zeros(len(inner), np.int64), start.points[inner])
    assert np.abs(off).max() < 1e-12
    assert guide_quality(start, surfaces).min() > 0.5


def test_quality_sees_quads_turned_over_on_a_sphere() -> None:
    guide, _, surfaces = GRIDS["cube"]
    quality = guide_quality(guide, surfaces)
    assert quality.min() > 0.8
    assert guide_quality(replace(guide, quads=guide.quads[:, ::-1]), surfaces).max() < -0.8


def test_smoothing_on_a_sphere_is_deterministic() -> None:
    _, model, surfaces = grid = GRIDS["cube"]
    start = shaken(grid, 0.3, 5)
    one, two = smooth(start, model, surfaces)[0], smooth(start, model, surfaces)[0]
    assert (one.points == two.points).all()
