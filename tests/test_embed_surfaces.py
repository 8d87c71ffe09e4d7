"""Guide grids on curved faces: quality, smoothing, starts and placing on surfaces with known geometry."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gmsh_crossquad.embed.bent_patches import fill_bent
from gmsh_crossquad.embed.curve_table import CurveTable
from gmsh_crossquad.embed.grid_energy import GridEnergy, tangents_of
from gmsh_crossquad.embed.place import place
from gmsh_crossquad.embed.quality import guide_quality, scaled_jacobian
from gmsh_crossquad.embed.rest_lengths import rest_lengths
from gmsh_crossquad.embed.smooth import smooth
from gmsh_crossquad.embed.start import laplace_start
from gmsh_crossquad.layout.quotient import quotient
from gmsh_crossquad.records import Float, Guide, TMesh
from gmsh_crossquad.surfaces import Planes, quad_normals
from tests.analytic_surfaces import (
    Analytic,
    Cylinder,
    Graph,
    Grid,
    Shape,
    Sphere,
    Torus,
    bowl,
    closed_torus,
    cube_sphere,
    mapped,
    octant,
    shaken,
    torus_points,
    tube,
)
from tests.smoothing_grids import PLANE, Mapping, grid_quads, mapped_grid

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
    "bowl": bowl(5),
}
LEAST = {"octant": 0.86, "cube": 0.86, "saddle": 0.75}
"""Three right angles meet at 120 degrees in the regular corner: sin 120 = .866; the others have grids of right angles, but
for the saddle with corners of cos = 1/2."""


def edge_length(guide: Guide) -> float:
    p = guide.points[guide.quads]
    return float(np.linalg.norm(p - np.roll(p, -1, axis=1), axis=2).mean())


def check(out: Guide, grid: Grid) -> None:
    """What holds for every smoothed guide."""
    guide, model, surfaces = grid
    assert (out.points[guide.fixed] == guide.points[guide.fixed]).all()
    inner = np.flatnonzero((guide.curve < 0) & ~guide.fixed)
    face = np.zeros(len(guide.points), np.int64)
    face[guide.quads] = guide.quad_face[:, None]
    off = out.points[inner] - surfaces.feet(face[inner], out.points[inner])
    assert np.abs(off).max() < 1e-12
    sliding = np.flatnonzero((guide.curve >= 0) & ~guide.fixed)
    for row, curve in enumerate(model.curves):
        at = sliding[guide.curve[sliding] == row]
        assert out.points[at] == pytest.approx(curve.at(out.arclength[at]), abs=2e-3 * curve.length)


@pytest.mark.parametrize("name", GRIDS)
@pytest.mark.parametrize("amplitude", [0.0, 0.3, 0.7])
def test_shaken_grids_come_back(name: str, amplitude: float) -> None:
    """Displacements in edge lengths."""
    guide, model, surfaces = grid = GRIDS[name]
    start = shaken(grid, amplitude * edge_length(guide), 1)
    if amplitude:
        assert guide_quality(start, surfaces, model).min() < 0.0
    out, report = smooth(start, model, surfaces)
    check(out, grid)
    quality = guide_quality(out, surfaces, model)
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


@settings(max_examples=8, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_any_tangle_of_a_sphere_is_undone(seed: int) -> None:
    """Displacements of half an edge length in the mean: a fifth of the quads is turned over."""
    guide, model, surfaces = grid = GRIDS["cube"]
    out, report = smooth(shaken(grid, 0.5 * edge_length(guide), seed), model, surfaces)
    check(out, grid)
    assert report.min_scaled_jacobian > 0.86


@pytest.mark.parametrize("name", ["octant", "bend", "saddle", "bowl"])
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
    assert guide_quality(start, surfaces, model).min() > 0.5


def test_quality_sees_quads_turned_over_on_a_sphere() -> None:
    guide, model, surfaces = GRIDS["cube"]
    quality = guide_quality(guide, surfaces, model)
    assert quality.min() > 0.8
    assert guide_quality(replace(guide, quads=guide.quads[:, ::-1]), surfaces, model).max() < -0.8


def test_smoothing_on_a_sphere_is_deterministic() -> None:
    _, model, surfaces = grid = GRIDS["cube"]
    start = shaken(grid, 0.3, 5)
    one, two = smooth(start, model, surfaces)[0], smooth(start, model, surfaces)[0]
    assert (one.points == two.points).all()


def band(u: Float, v: Float) -> Float:
    """A zone of the sphere, closed in v."""
    a, b = 2 * np.pi * v, 2 * u - 1
    return np.column_stack([np.cos(a) * np.cos(b), -np.sin(a) * np.cos(b), np.sin(b)])


def coil(turns: float) -> Mapping:
    """A pipe whose cut winds around it."""

    def mapping(u: Float, v: Float) -> Float:
        a = 2 * np.pi * (turns * u - v)
        return np.column_stack([np.cos(a), np.sin(a), 4 * u])

    return mapping


PATCHES: dict[str, tuple[Mapping, Shape, float]] = {
    "torus": (lambda u, v: torus_points(TORUS, 2 * np.pi * u, 2 * np.pi * v), TORUS, 0.9),
    "return bend": (lambda u, v: torus_points(TORUS, np.pi * u, 2 * np.pi * v), TORUS, 0.9),
    "half of a bend": (lambda u, v: torus_points(TORUS, np.pi * u, np.pi * v), TORUS, 0.9),
    "pipe": (coil(0.0), Cylinder(), 0.99),
    "coil": (coil(1.0), Cylinder(), 0.4),
    "zone": (band, Sphere(), 0.8),
    "saddle": (lambda u, v: np.column_stack([u, v, 0.5 * (u * u - v * v)]), Graph(1.0), 0.85),
}


@pytest.mark.parametrize("name", PATCHES)
@pytest.mark.parametrize(("a", "b"), [(8, 5), (24, 9)])
@pytest.mark.parametrize("turned", [False, True])
def test_a_patch_is_filled_from_its_sides(name: str, a: int, b: int, turned: bool) -> None:
    """The grid is valid before any smoothing, also where one patch is a whole torus."""
    mapping, shape, least = PATCHES[name]
    u, v = np.meshgrid(np.linspace(0, 1, a + 1), np.linspace(0, 1, b + 1), indexing="ij")
    exact = mapping(u.ravel(), v.ravel())
    ids = np.arange(len(exact)).reshape(a + 1, b + 1)
    ids = ids.T if turned else ids
    points = exact.copy()
    points[ids[1:-1, 1:-1]] = np.nan
    surfaces = Analytic((shape,))
    out = fill_bent(points, [(ids, 0)], surfaces)
    side = np.setdiff1d(ids, ids[1:-1, 1:-1])
    assert (out[side] == exact[side]).all()
    face = np.zeros(len(out), np.int64)
    assert out == pytest.approx(surfaces.feet(face, out), abs=1e-12)
    quads = grid_quads(a, b)
    assert scaled_jacobian(out, quads, quad_normals(surfaces, out, quads, face[: len(quads)])).min() > least


def test_sides_are_carried_exactly_around_an_axis() -> None:
    """On a torus, from one circle around the tube and one around the axis."""
    mapping, shape, _ = PATCHES["torus"]
    u, v = np.meshgrid(np.linspace(0, 1, 9), np.linspace(0, 1, 5), indexing="ij")
    exact = mapping(u.ravel(), v.ravel())
    ids = np.arange(45).reshape(9, 5)
    points = exact.copy()
    points[ids[1:-1, 1:-1]] = np.nan
    assert fill_bent(points, [(ids, 0)], Analytic((shape,))) == pytest.approx(exact, abs=1e-12)


def test_placing_on_a_quarter_of_a_cylinder() -> None:
    """Two patches, one above the other; the arc between them is a chord far inside the cylinder."""

    def mapping(u: Float, v: Float) -> Float:
        return np.column_stack([np.cos(0.5 * np.pi * u), np.sin(0.5 * np.pi * u), v])

    _, model = mapped_grid(mapping, 2, 2)
    model = replace(model, faces=(replace(model.faces[0], origin=np.zeros(3), axes=np.eye(3)),))
    surfaces = Analytic((Cylinder(),))
    arcs = np.array([(0, 2), (2, 5), (5, 3), (1, 3), (0, 4), (4, 1), (4, 5)])
    position = np.concatenate([model.vertices, [[1, 0, 0.5], [0, 1, 0.5]]])
    quarter = model.curves[0].length
    tmesh = TMesh(
        position=position,
        cad_vertex=np.array([0, 1, 2, 3, -1, -1]),
        curve=np.array([-1, -1, -1, -1, 3, 1]),
        curve_arclength=np.array([0, 0, 0, 0, 0.5, 0.5]),
        critical=np.arange(6) < 4,
        quads_at={(0, k): 1 for k in range(4)},
        arcs=arcs,
        length=np.array([quarter, 0.5, 0.5, quarter, 0.5, 0.5, np.sqrt(2)]),
        polyline=tuple(position[[a, b]] for a, b in arcs),
        arc_curve=np.array([0, 1, 1, 2, 3, 3, -1]),
        arc_start=np.array([0, 0, 0.5, 0, 0, 0.5, 0]),
        pieces=((0,), (1, 2), (3,), (4, 5)),
        patches=((((0, 1),), ((1, 1),), ((6, -1),), ((4, -1),)), (((6, 1),), ((2, 1),), ((3, -1),), ((5, -1),))),
        patch_face=np.array([0, 0]),
        loops=((0, (0, 1, 2, 3, 4, 5)),),
        euler=np.array([1]),
    )
    guide = place(model, surfaces, tmesh, quotient(tmesh, np.array([6, 3, 3, 6, 3, 3, 6])))
    assert len(guide.quads) == 36
    inner = guide.points[guide.curve < 0]
    assert np.hypot(inner[:, 0], inner[:, 1]) == pytest.approx(1.0, abs=1e-12)
    assert guide_quality(guide, surfaces, model).min() > 0.95
    angle = np.arctan2(guide.points[:, 1], guide.points[:, 0])
    assert np.abs(angle[:, None] - np.linspace(0, 0.5 * np.pi, 7)).min(axis=1).max() < 0.07


def test_a_closed_face_without_curves_can_be_placed() -> None:
    """A torus that is one patch: one node, two arcs that are circles."""
    u = np.linspace(0, 2 * np.pi, 25)
    tube_circle, axis_circle = torus_points(TORUS, 0 * u, u), torus_points(TORUS, u, 0 * u)
    _, model, surfaces = closed_torus(4, 4, TORUS)
    none = np.array([-1])
    tmesh = TMesh(
        position=tube_circle[:1],
        cad_vertex=none,
        curve=none,
        curve_arclength=np.zeros(1),
        critical=np.array([False]),
        quads_at={},
        arcs=np.zeros((2, 2), np.int64),
        length=np.array([8 * np.pi, 2 * np.pi]),
        polyline=(axis_circle, tube_circle),
        arc_curve=np.array([-1, -1]),
        arc_start=np.zeros(2),
        pieces=(),
        patches=((((0, 1),), ((1, 1),), ((0, -1),), ((1, -1),)),),
        patch_face=np.array([0]),
        loops=(),
        euler=np.array([0]),
    )
    guide = place(model, surfaces, tmesh, quotient(tmesh, np.array([16, 8])))
    assert (len(guide.points), len(guide.quads)) == (128, 128)
    assert guide.points == pytest.approx(surfaces.feet(np.zeros(128, np.int64), guide.points), abs=1e-12)
    assert guide_quality(guide, surfaces, model).min() > 0.9
    assert smooth(guide, model, surfaces)[1].min_scaled_jacobian > 0.97
