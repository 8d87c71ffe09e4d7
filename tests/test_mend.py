"""Elements of order 2 and 3 that are turned over are mended by nodes that slide on the CAD."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import gmsh
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import gmsh_crossquad.fill.high_order as raising
from gmsh_crossquad.fill.elements import Elements
from gmsh_crossquad.fill.high_order import GRID, HighOrder, high_order
from gmsh_crossquad.fill.jacobians import least_jacobian, quad_normals
from gmsh_crossquad.fill.moves import Moves
from gmsh_crossquad.fill.pipeline import fill
from gmsh_crossquad.fill.shape_energy import ShapeEnergy
from gmsh_crossquad.quad_edges import edges_of_quads
from gmsh_crossquad.records import Bool, Float, Int, Model, QuadMesh
from gmsh_crossquad.surfaces import Planes, Surfaces

from .guides import make_guide
from .guides import ring as annulus
from .models import disc
from .test_fill_surfaces import uniform

GLOBE = 2.5
Case = tuple[Model, Surfaces, QuadMesh, Callable[[int, Float], Float]]


@dataclass(frozen=True)
class Globe:
    """The sphere of radius `GLOBE` about the origin, in the coordinates of a model."""

    model: Model

    @property
    def curved(self) -> Bool:
        return np.array([True])

    def feet(self, face: Int, points: Float) -> Float:
        return (GLOBE * self.normals(face, points) - self.model.origin) / self.model.scale

    def normals(self, face: Int, points: Float) -> Float:
        x = points * self.model.scale + self.model.origin
        return x / np.linalg.norm(x, axis=1, keepdims=True)


def lift(x: Float) -> Float:
    """Points of the plane on the upper half of the sphere."""
    return np.column_stack([x[:, :2], np.sqrt(GLOBE**2 - np.sum(x[:, :2] ** 2, axis=1))])


def on_globe(case: Case) -> Case:
    model, _, mesh, evaluate = case
    return model, Globe(model), replace(mesh, points=lift(mesh.points)), lambda row, t: lift(evaluate(row, t))


def thin_ring() -> Case:
    """A circle of radius .8 in six edges, and around it a hexagon with corners at .88, the sides of which cut the circle: their
    middles are at .88 cos 30 degrees = .762."""
    model, guide, evaluate = annulus(6, 2, 0.8, 1.2)
    mesh = fill(model, Planes(model), guide, uniform(guide, 1), evaluate)
    points = mesh.points.copy()
    middle = np.isclose(np.hypot(*points[:, :2].T), 1.0)
    points[middle] *= 0.88
    return model, Planes(model), replace(mesh, points=points), evaluate


def round_corners() -> Case:
    """A disc in nine quads, of which four have a corner inside the circle and two sides on it."""
    model = disc()
    a = np.pi / 6 * np.arange(12)
    around = np.stack([np.cos(a), np.sin(a)], axis=1)
    g = np.zeros((4, 4), np.int64)
    g[:3, 0], g[3, :3], g[3:0:-1, 3], g[0, 3:0:-1] = np.arange(12).reshape(4, 3)
    g[1, 1], g[2, 1], g[2, 2], g[1, 2] = 12, 13, 14, 15
    quads = np.stack([g[:-1, :-1], g[1:, :-1], g[1:, 1:], g[:-1, 1:]], axis=2).reshape(-1, 4)
    guide = make_guide(model, np.concatenate([around, 0.5 * around[::3]]), quads, [[*range(12), 0]])

    def evaluate(row: int, t: Float) -> Float:
        return np.stack([np.cos(2 * np.pi * t), np.sin(2 * np.pi * t), 0 * t], axis=1)

    return model, Planes(model), fill(model, Planes(model), guide, uniform(guide, 1), evaluate), evaluate


def least_over_middle(mesh: QuadMesh, new: HighOrder, order: int) -> Float:
    """Least Bernstein coefficient of every element over the Jacobian in the middle of the straight one."""
    x = np.concatenate([mesh.points, new.points])
    grid = np.array(GRID[order])
    grids = np.empty((len(new.quads), order + 1, order + 1, 3))
    grids[:, grid[:, 0], grid[:, 1]] = x[new.quads]
    corner = mesh.points[mesh.quads]
    middle = 0.5 * np.linalg.norm(np.cross(corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1]), axis=1)
    return least_jacobian(grids, quad_normals(corner), np.full(len(grids), -np.inf)) / middle


def unmended(case: Case, order: int, monkeypatch: pytest.MonkeyPatch) -> HighOrder:
    with monkeypatch.context() as patch:
        patch.setattr(raising, "mend", lambda work: (0, np.zeros(len(work.edges), bool)))
        return high_order(case[0], case[1], case[2], order, case[3])


@pytest.mark.parametrize("incomplete", [False, True])
@pytest.mark.parametrize("order", [2, 3])
@pytest.mark.parametrize("globe", [False, True])
def test_a_thin_cell_beside_a_bulge(globe: bool, order: int, incomplete: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    case = on_globe(thin_ring()) if globe else thin_ring()
    model, surface, mesh, evaluate = case
    assert np.sum(least_over_middle(mesh, unmended(case, order, monkeypatch), order) < 0) >= 6
    new = high_order(model, surface, mesh, order, evaluate, incomplete=incomplete)
    assert new.notes == ()
    assert (least_over_middle(mesh, new, order) > 0).all()
    kept = new.quads[:, : 4 * order] if incomplete else new.quads
    nodes = np.unique(kept[kept >= len(mesh.points)]) - len(mesh.points)
    off = np.linalg.norm(new.points[nodes], axis=1) - GLOBE if globe else new.points[nodes, 2]
    assert np.abs(off).max() < 1e-12
    for row, (at, t) in enumerate(zip(new.curve_nodes, new.curve_parameters, strict=True)):
        np.testing.assert_array_equal(new.points[at - len(mesh.points)], evaluate(row, t))


@pytest.mark.parametrize("order", [2, 3])
@pytest.mark.parametrize("globe", [False, True])
def test_a_corner_inside_a_smooth_curve(globe: bool, order: int, monkeypatch: pytest.MonkeyPatch) -> None:
    case = on_globe(round_corners()) if globe else round_corners()
    model, surface, mesh, evaluate = case
    before = unmended(case, order, monkeypatch)
    poor = least_over_middle(mesh, before, order) < (0.01 if order == 2 else 0)  # parabolas leave a little angle
    assert poor.sum() == 4
    new = high_order(model, surface, mesh, order, evaluate)
    assert new.notes == ()
    least = least_over_middle(mesh, new, order)
    assert least.min() > 0.05
    (at,), (t,) = new.curve_nodes, new.curve_parameters
    np.testing.assert_array_equal(new.points[at - len(mesh.points)], evaluate(0, t))
    whole = np.sort(np.concatenate([mesh.curve_parameters[0], t]))
    np.testing.assert_array_equal(t, whole[np.arange(len(whole)) % order != 0])  # in order, all inside their edges
    # not farther than needed: between its nodes the circle is followed within a part of the chord's distance from it
    u = np.linspace(0, 1, 21)
    to = np.vander(u, order + 1, increasing=True) @ np.linalg.inv(np.vander(np.arange(order + 1) / order, increasing=True))
    x = np.concatenate([mesh.points, new.points])[new.lines[0][:, [0, *range(2, order + 1), 1]]]
    radius = np.hypot(*np.einsum("si,kic->cks", to, x)[:2])
    assert np.abs(radius - 1).max() < {2: 0.2, 3: 0.1}[order] * (1 - np.cos(np.pi / 12))


def test_what_is_good_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    model, guide, evaluate = annulus(8, 2)
    mesh = fill(model, Planes(model), guide, uniform(guide, 1), evaluate)
    case = model, Planes(model), mesh, evaluate
    for order in (2, 3):
        np.testing.assert_array_equal(unmended(case, order, monkeypatch).points, high_order(*case[:3], order, evaluate).points)


def some_elements(order: int, seed: int, size: float) -> tuple[Float, Float]:
    """Corners (3, 4, 3) of quads near a square in different planes, and nodes (3, (p + 1)^2, 3) of elements near them."""
    random = np.random.default_rng(seed)
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 0.6, 0], [0, 0.6, 0]]) + random.uniform(-0.1, 0.1, (3, 4, 3)) * [1, 1, 0]
    corners = np.stack([corners[k] @ np.linalg.qr(random.normal(size=(3, 3)))[0] for k in range(3)])
    u = np.arange(order + 1)[:, None, None] / order
    v = np.swapaxes(u, 0, 1)
    a, b, c, d = (corners[:, None, None, k] for k in range(4))
    x = (1 - u) * (1 - v) * a + u * (1 - v) * b + u * v * c + (1 - u) * v * d
    return corners, x.reshape(3, -1, 3) + size * random.uniform(-1, 1, (3, (order + 1) ** 2, 3))


@pytest.mark.parametrize("order", [2, 3])
@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 10_000), size=st.floats(0, 0.2), eps=st.floats(1e-3, 1.0))
def test_gradient_of_the_energy(order: int, seed: int, size: float, eps: float) -> None:
    corners, x = some_elements(order, seed, size)
    energy = ShapeEnergy.of_straight(corners, order)
    way = np.random.default_rng(seed + 1).normal(size=x.shape)
    way /= np.linalg.norm(way)
    h = 1e-6 * eps
    slope = (energy.value(x + h * way, eps)[0] - energy.value(x - h * way, eps)[0]) / (2 * h)
    gradient = energy.value(x, eps)[1]
    assert np.sum(gradient * way) == pytest.approx(slope, rel=1e-4, abs=1e-5 * np.linalg.norm(gradient))


@pytest.mark.parametrize("order", [2, 3])
def test_energy_of_a_rectangle_is_the_least(order: int) -> None:
    u, v = np.meshgrid(np.arange(order + 1) / order, np.arange(order + 1) / order, indexing="ij")
    x = np.stack([3 * u, 0.1 * v, 0 * u], axis=2).reshape(1, -1, 3)
    energy = ShapeEnergy.of_straight(np.array([[[0, 0, 0], [3, 0, 0], [3, 0.1, 0], [0, 0.1, 0]]], float), order)
    value, gradient = energy.value(x, 1e-6)
    assert value == pytest.approx(2, abs=1e-9)
    assert np.abs(gradient).max() < 1e-8
    assert energy.least(x) == pytest.approx(1)


@pytest.mark.parametrize("order", [2, 3])
def test_least_coefficient_is_what_gmsh_calls_min_sj(order: int) -> None:
    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.model.add("elements")
        gmsh.model.addDiscreteEntity(2, 1)
        corners, x = some_elements(order, 7, 0.05)
        x -= np.einsum("mkc,mc->mk", x - x[:, :1], quad_normals(corners))[..., None] * quad_normals(corners)[:, None]  # in plane
        grid = np.array(GRID[order])
        x = x.reshape(3, order + 1, order + 1, 3)
        x[:, grid[:4, 0], grid[:4, 1]] = corners
        gmsh.model.mesh.addNodes(2, 1, np.arange(1, 1 + x[..., 0].size), x[:, grid[:, 0], grid[:, 1]].ravel())
        gmsh.model.mesh.addElementsByType(1, {2: 10, 3: 36}[order], [1, 2, 3], np.arange(1, 1 + x[..., 0].size))
        expected = gmsh.model.mesh.getElementQualities([1, 2, 3], "minSJ")
    finally:
        gmsh.finalize()
    assert ShapeEnergy.of_straight(corners, order).least(x.reshape(3, -1, 3)) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("inner", [False, True])
@pytest.mark.parametrize("order", [2, 3])
def test_moves(order: int, inner: bool) -> None:
    """`displacements` are what `apply` does to first order along a sphere and its curves; `gradient` is its transpose."""
    model, surface, mesh, evaluate = on_globe(thin_ring())
    edges, quad_edges = edges_of_quads(mesh.quads)
    work = Elements.start(model, surface, mesh, order, edges, quad_edges, evaluate, inner=inner)
    for row, chain in enumerate(mesh.curve_nodes):
        e, forward = raising._chain(edges, chain, len(mesh.points))
        t = mesh.curve_parameters[row]
        work.put_on_curve(row, e, forward, t, t[:-1, None] + np.arange(1, order) / order * np.diff(t)[:, None])
    work.put_on_faces()
    some = quad_edges[2]
    quads = work.users(some)
    assert 1 < len(quads) < len(mesh.quads) and (work.curve[some] >= 0).sum() == 1
    random = np.random.default_rng(1)
    moves = Moves.of(work, np.unique(some), quads)
    y, g = random.uniform(-1, 1, moves.size), random.normal(size=work.nodes(quads).shape)
    assert np.sum(moves.displacements(y) * g) == pytest.approx(y @ moves.gradient(g))
    before = work.nodes(quads)
    errors = []
    for step in (1e-2, 1e-3):
        trial = work.copy()
        Moves.of(trial, np.unique(some), quads).apply(step * y)
        error = (trial.nodes(quads) - before - moves.displacements(step * y)).reshape(-1, 3)
        normal = surface.normals(np.zeros(len(error), np.int64), before.reshape(-1, 3))
        along = error - np.einsum("nc,nc->n", error, normal)[:, None] * normal
        errors.append(np.abs(along if inner else error).max())  # Coons' rule leaves the sphere
    assert errors[1] < 2e-2 * errors[0] and 0 < errors[0] < 1e-2
    np.testing.assert_array_equal(before, work.nodes(quads))
