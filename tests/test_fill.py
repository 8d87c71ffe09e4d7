"""Fill of guide grids: chords, spacing on curves, tangents, Coons grids, and whole meshes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gmsh_crossquad.embed.quality import scaled_jacobian
from gmsh_crossquad.errors import InputError, MeshError
from gmsh_crossquad.fill import placed
from gmsh_crossquad.fill.coons import coons, grid_quads, grid_quality
from gmsh_crossquad.fill.curves import curve_parameters, monotone_cubic
from gmsh_crossquad.fill.filler import Filler
from gmsh_crossquad.fill.numbering import guide_chords, guide_topology
from gmsh_crossquad.fill.pipeline import fill, poor_cells
from gmsh_crossquad.fill.tangents import continuation, cubic, end_tangents
from gmsh_crossquad.records import Float, Guide, Int, Model, QuadMesh
from gmsh_crossquad.surfaces import Planes

from . import models
from .guides import grid, hole_in_plate, make_guide, ring, straight

UP = np.array([0.0, 0.0, 1.0])


def n_chords(guide: Guide) -> int:
    return guide_chords(guide.quads)[3]


def uniform(guide: Guide, k: int) -> Int:
    return np.full(n_chords(guide), k)


def area(mesh: QuadMesh) -> float:
    p = mesh.points[mesh.quads]
    return 0.5 * float(np.cross(p[:, 2] - p[:, 0], p[:, 3] - p[:, 1])[:, 2].sum())


def edge_uses(quads: Int) -> dict[tuple[int, int], int]:
    out: dict[tuple[int, int], int] = {}
    for quad in quads.tolist():
        for a, b in zip(quad, quad[1:] + quad[:1]):
            key = (min(a, b), max(a, b))
            out[key] = out.get(key, 0) + 1
    return out


def check_record(model: Model, mesh: QuadMesh, faces_of_curve: list[int]) -> None:
    """What must hold of every QuadMesh: every node once, every curve edge in its faces, every other edge in two quads."""
    groups = [mesh.vertex_node[mesh.vertex_node >= 0], *(c[1:-1] for c in mesh.curve_nodes), *mesh.face_nodes]
    assert np.array_equal(np.sort(np.concatenate(groups)), np.arange(len(mesh.points)))
    assert np.array_equal(np.unique(mesh.quads), np.arange(len(mesh.points)))
    uses = edge_uses(mesh.quads)
    for nodes, parameters, want in zip(mesh.curve_nodes, mesh.curve_parameters, faces_of_curve):
        assert len(nodes) == len(parameters)
        for a, b in zip(nodes[:-1].tolist(), nodes[1:].tolist()):
            assert uses.pop((min(a, b), max(a, b))) == want
    assert set(uses.values()) <= {2}
    for row, nodes in enumerate(mesh.face_nodes):
        assert np.all(np.isin(np.flatnonzero(np.isin(mesh.quads, nodes).any(axis=1)), np.flatnonzero(mesh.quad_face == row)))
    assert np.all(np.diff(mesh.quad_face) >= 0)


# chords


@pytest.mark.parametrize(("nx", "ny"), [(1, 1), (3, 2), (5, 4)])
def test_chords_of_a_grid(nx: int, ny: int) -> None:
    edges, quad_edges, chord, count = guide_chords(grid(nx, ny)[1].quads)
    assert count == nx + ny
    assert len(edges) == nx * (ny + 1) + ny * (nx + 1)
    assert sorted(np.bincount(chord)) == sorted([ny + 1] * nx + [nx + 1] * ny)
    assert np.array_equal(chord[quad_edges[:, :2]], chord[quad_edges[:, 2:]])


def test_chords_of_a_ring() -> None:
    # one closed chord around per layer, one across per sector
    assert n_chords(ring(8, 3)[1]) == 8 + 3


@given(st.integers(0, 10**6))
@settings(max_examples=20, deadline=None)
def test_chords_do_not_depend_on_numbers(seed: int) -> None:
    rng = np.random.default_rng(seed)
    quads = grid(3, 4)[1].quads
    new = rng.permutation(20)
    turned = np.array([np.roll(q, rng.integers(4)) for q in new[quads]])[rng.permutation(12)]
    edges, quad_edges, chord, count = guide_chords(turned)
    assert count == 7
    assert np.all(edges[:, 0] < edges[:, 1])
    ends = np.sort(np.stack([turned, np.roll(turned, -1, axis=1)], axis=2), axis=2)
    assert np.array_equal(edges[quad_edges], ends)
    assert np.all(np.diff(np.unique(chord, return_index=True)[1]) > 0)


# curves


@given(st.lists(st.floats(0.01, 10), min_size=1, max_size=8), st.integers(0, 10**6))
@settings(max_examples=40, deadline=None)
def test_monotone_cubic_is_pchip(steps: list[float], seed: int) -> None:
    from scipy.interpolate import PchipInterpolator

    rng = np.random.default_rng(seed)
    x = np.concatenate([[0.0], np.cumsum(steps)])
    y = np.cumsum(rng.uniform(-1, 3, len(x)))
    at = np.concatenate([rng.uniform(0, x[-1], 50), x])
    want = PchipInterpolator(x, y)(at) if len(x) > 1 else y
    np.testing.assert_allclose(monotone_cubic(x, y, at), want, rtol=1e-9, atol=1e-9)
    np.testing.assert_array_equal(monotone_cubic(x, y, x), y)


@given(st.lists(st.floats(0.05, 5), min_size=2, max_size=8), st.integers(0, 7))
@settings(max_examples=40, deadline=None)
def test_periodic_cubic_has_no_seam(steps: list[float], shift: int) -> None:
    shift %= len(steps)
    x = np.arange(len(steps) + 1.0)
    y = np.concatenate([[0.0], np.cumsum(steps)])
    at = np.linspace(0, len(steps), 101)
    moved = np.concatenate([y[shift:-1], y[: shift + 1] + y[-1]])
    a = monotone_cubic(x, moved - moved[0], at, periodic=True)
    place = at + shift
    turn = np.floor(place / len(steps))
    b = monotone_cubic(x, y, place - turn * len(steps), periodic=True) + turn * y[-1] - y[shift]
    np.testing.assert_allclose(a, b, atol=1e-9)
    assert np.all(np.diff(a) > 0)


def test_parameters_keep_guide_vertices_and_order() -> None:
    curve = models.square(2.0).curves[0]
    length = curve.length
    t = curve_parameters(curve, length * np.array([0.0, 0.1, 0.9, 1.0]), np.array([3, 1, 4]))
    np.testing.assert_allclose(t[[0, 3, 4, 8]], [0, 0.1, 0.9, 1], atol=1e-12)
    assert np.all(np.diff(t) > 0)


def test_even_steps_between_guide_vertices() -> None:
    curve = models.square(2.0).curves[0]
    s = curve.length * np.array([0.0, 0.1, 0.9, 1.0])
    t = curve_parameters(curve, s, np.array([2, 4, 2]), np.array([1.0, 1.0, 0.0]))
    smooth = curve_parameters(curve, s, np.array([2, 4, 2]))
    np.testing.assert_allclose(t[:7], [0, 0.05, 0.1, 0.3, 0.5, 0.7, 0.9], atol=1e-12)
    np.testing.assert_allclose(t[6:], smooth[6:], atol=1e-12)
    assert smooth[3] - smooth[2] < 0.2  # grows from the smaller step before


def test_transfinite_spacing_is_kept() -> None:
    curve = models.square().curves[0]
    curve = replace(curve, spacing=curve.length * np.array([0, 0.1, 0.3, 0.6, 1.0]))
    t = curve_parameters(curve, curve.length * np.array([0, 0.3, 1]), np.array([2, 2]))
    np.testing.assert_allclose(t, [0, 0.1, 0.3, 0.6, 1], atol=1e-12)
    with pytest.raises(MeshError, match="prescribes 5, curve 1"):
        curve_parameters(curve, curve.length * np.array([0, 0.3, 1]), np.array([2, 3]))


def test_guide_vertices_out_of_order_are_refused() -> None:
    curve = models.square().curves[2]
    with pytest.raises(MeshError, match="not in order, curve 3"):
        curve_parameters(curve, curve.length * np.array([0, 0.6, 0.5, 1]), np.array([2, 2, 2]))


# tangents


def lines(guide: Guide) -> tuple[Int, Int]:
    edges, quad_edges, _, _ = guide_chords(guide.quads)
    topology = guide_topology(guide, edges, quad_edges)
    return edges, continuation(guide.quads, topology)


def test_lines_run_straight_on_inside_and_end_at_curves() -> None:
    _, guide = grid(4, 3)
    edges, following = lines(guide)
    for e, (a, b) in enumerate(edges.tolist()):
        for end, v in ((0, a), (1, b)):
            g = following[e, end]
            if guide.curve[v] >= 0 or guide.cad_vertex[v] >= 0:
                assert g == -1
            else:
                assert v in edges[g]
                d = guide.points[b] - guide.points[a]
                w = guide.points[edges[g, 1]] - guide.points[edges[g, 0]]
                assert abs(np.cross(d, w)[2]) < 1e-12 and g != e


def test_lines_end_at_irregular_vertices() -> None:
    # three quads around a point inside a hexagon
    a = np.pi * np.arange(6) / 3
    model = models.regular(6)
    xy = np.concatenate([np.stack([np.cos(a), np.sin(a)], 1), [[0, 0]]])
    guide = make_guide(model, xy, [(6, 0, 1, 2), (6, 2, 3, 4), (6, 4, 5, 0)], [(i, (i + 1) % 6) for i in range(6)])
    assert np.all(lines(guide)[1] == -1)


def test_one_speed_per_fine_step_on_both_sides() -> None:
    x = np.array([0, 0.3, 1.0])
    model, guide = grid(2, 2)
    xy = np.array([(u, v) for u in x for v in (0, 0.4, 1)])
    guide = make_guide(model, xy, guide.quads, [[0, 3, 6], [6, 7, 8], [8, 5, 2], [2, 1, 0]])
    edges, following = lines(guide)
    k = np.arange(len(edges)) % 3 + 1
    t = end_tangents(guide.points, edges, k, following)
    a, b = (edges.tolist().index(e) for e in ([1, 4], [4, 7]))
    l1, l2 = 0.3 / model.scale / k[a], 0.7 / model.scale / k[b]
    np.testing.assert_allclose(t[a, 1] / k[a], [2 * l1 * l2 / (l1 + l2), 0, 0], atol=1e-12)
    np.testing.assert_allclose(t[b, 0] / k[b], t[a, 1] / k[a], atol=1e-12)


def test_three_points_of_a_parabola_give_its_direction() -> None:
    f = lambda u: np.stack([u, u * u, 0 * u], axis=1)  # noqa: E731
    # through -1, 0, 2 on the axis: the non-uniform difference is exact for a parabola over the same parameter
    points = f(np.array([-1.0, 0.0, 2.0]))
    edges, following = np.array([[0, 1], [1, 2]]), np.array([[-1, 1], [0, -1]])
    t = end_tangents(points, edges, np.array([1, 1]), following)
    l1, l2 = np.sqrt(2), np.sqrt(20)
    want = l2 / (l1 + l2) * np.array([1, -1, 0]) / l1 + l1 / (l1 + l2) * np.array([2, 4, 0]) / l2
    for direction in (t[0, 1], t[1, 0]):
        np.testing.assert_allclose(direction / np.linalg.norm(direction), want / np.linalg.norm(want), atol=1e-12)
    # the second derivative of the cubic vanishes where the line ends
    chord = points[1] - points[0]
    np.testing.assert_allclose(6 * chord - 4 * t[0, 0] - 2 * t[0, 1], 0, atol=1e-12)


@pytest.mark.parametrize("k", [2, 3, 8])
def test_cubic_reproduces_cubics(k: int) -> None:
    c = np.random.default_rng(1).normal(size=(4, 3))
    u = np.arange(1, k) / k
    f = lambda u: sum(np.power.outer(u, i)[..., None] * c[i] for i in range(4))  # noqa: E731
    tangents = np.stack([c[1], c[1] + 2 * c[2] + 3 * c[3]])[None]
    got = cubic(f(np.array(0.0))[None], f(np.array(1.0))[None], tangents, k)
    np.testing.assert_allclose(got[0], f(u), atol=1e-12)


# Coons grids


def polar_sides(ku: int, kv: int) -> tuple[Float, Float, Float, Float]:
    """One cell of an annulus (2, 1, k + 1): bottom on radius 1, top on radius 2, u along the angle (clockwise)."""
    a = np.linspace(np.pi / 2, 0, ku + 1)
    r = np.linspace(1, 2, kv + 1)
    e = np.stack([np.cos(a), np.sin(a)])[:, None]
    x0, x1 = e[:, :, :1], e[:, :, -1:]
    return e, x1 * r, 2 * e, x0 * r


@pytest.mark.parametrize(("ku", "kv"), [(1, 1), (4, 3), (7, 2)])
def test_coons_of_a_sector_is_polar(ku: int, kv: int) -> None:
    bottom, right, top, left = polar_sides(ku, kv)
    got = coons(bottom, right, top, left)
    r = np.linspace(1, 2, kv + 1)
    np.testing.assert_allclose(got, bottom[..., None] * r, atol=1e-14)


@given(st.integers(1, 6), st.integers(1, 6), st.integers(0, 10**6))
@settings(max_examples=30, deadline=None)
def test_coons_reproduces_graded_parallelograms(ku: int, kv: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    s = np.concatenate([[0], np.cumsum(rng.uniform(0.1, 1, ku))])
    t = np.concatenate([[0], np.cumsum(rng.uniform(0.1, 1, kv))])
    m = rng.normal(size=(2, 2))
    f = lambda s, t: np.einsum("ab,b...->a...", m, np.stack(np.broadcast_arrays(s, t)))[:, None]  # noqa: E731
    got = coons(f(s, 0 * s), f(0 * t + s[-1], t), f(s, 0 * s + t[-1]), f(0 * t, t))
    np.testing.assert_allclose(got, f(s[:, None], t[None]), atol=1e-12)


def test_grid_quality_is_the_least_scaled_jacobian() -> None:
    rng = np.random.default_rng(3)
    x, y = np.meshgrid(np.arange(5.0), np.arange(4.0), indexing="ij")
    g = np.stack([x, y])[:, None] + rng.uniform(-0.45, 0.45, (2, 6, 5, 4))
    nodes = np.arange(6 * 20).reshape(6, 5, 4)
    points = np.concatenate([g.reshape(2, -1).T, np.zeros((120, 1))], axis=1)
    want = [scaled_jacobian(points, q, UP).min() for q in grid_quads(nodes)]
    np.testing.assert_allclose(grid_quality(g), want, atol=1e-12)


# meshes


@pytest.mark.parametrize(("k", "m"), [(1, 1), (2, 3), (5, 1)])
def test_rectangle_becomes_a_regular_grid(k: int, m: int) -> None:
    model, guide = grid(3, 2, 3.0, 2.0)
    edges, _, chord, count = guide_chords(guide.quads)
    along_x = np.abs(np.diff(guide.points[edges], axis=1)[:, 0, 0]) > 1e-6
    divisions = np.full(count, m)
    divisions[chord[along_x]] = k
    mesh = fill(model, Planes(model), guide, divisions, straight(model))
    assert len(mesh.quads) == 6 * k * m
    check_record(model, mesh, [1] * 4)
    x, y = mesh.points[:, 0] * k, mesh.points[:, 1] * m
    np.testing.assert_allclose(x, np.round(x), atol=1e-12)
    np.testing.assert_allclose(y, np.round(y), atol=1e-12)
    assert np.all(mesh.points[:, 2] == 0)
    np.testing.assert_allclose(scaled_jacobian(mesh.points, mesh.quads, UP), 1, atol=1e-12)
    assert area(mesh) == pytest.approx(6, abs=1e-12)


@pytest.mark.parametrize("k", [1, 2, 7])
def test_annulus_is_polar(k: int) -> None:
    model, guide, evaluate = ring(8, 1)
    mesh = fill(model, Planes(model), guide, uniform(guide, k), evaluate)
    check_record(model, mesh, [1, 1])
    r = np.hypot(mesh.points[:, 0], mesh.points[:, 1])
    a = np.arctan2(mesh.points[:, 1], mesh.points[:, 0]) / (np.pi / 4 / k)
    np.testing.assert_allclose((r - 0.5) * 2 * k, np.round((r - 0.5) * 2 * k), atol=1e-6)
    np.testing.assert_allclose(a, np.round(a), atol=1e-6)
    for row, radius in ((0, 1.0), (1, 0.5)):
        np.testing.assert_allclose(r[mesh.curve_nodes[row]], radius, atol=4e-16)
        assert mesh.curve_nodes[row][0] == mesh.curve_nodes[row][-1] == mesh.vertex_node[row]
    # 8 k chords of both circles bound the polygonal ring
    assert area(mesh) == pytest.approx(0.5 * 8 * k * np.sin(2 * np.pi / (8 * k)) * 0.75, abs=1e-9)


@pytest.mark.parametrize("k", [1, 3])
def test_faces_share_the_nodes_of_their_curve(k: int) -> None:
    model = models.two_squares()
    xy = [(0, 0), (1, 0), (2, 0), (2, 1), (1, 1), (0, 1)]
    guide = make_guide(model, xy, [(1, 2, 3, 4), (0, 1, 4, 5)], [(0, 1), (1, 2), (2, 3), (3, 4), (4, 5), (5, 0), (1, 4)], [1, 0])
    mesh = fill(model, Planes(model), guide, uniform(guide, k), straight(model))
    check_record(model, mesh, [1, 1, 1, 1, 1, 1, 2])
    assert np.array_equal(mesh.quad_face, np.repeat([0, 1], k * k))
    assert np.array_equal(mesh.quad_block, np.repeat([1, 0], k * k))
    shared = mesh.points[mesh.curve_nodes[6]]
    np.testing.assert_allclose(shared[:, :2], np.stack([np.ones(k + 1), np.arange(k + 1) / k], 1), atol=1e-14)


def test_crack_and_embedded_point_carry_nodes() -> None:
    model = models.square_with_crack((0.3, 0.5), (0.7, 0.5))
    x, y = [0, 0.3, 0.7, 1], [0, 0.5, 1]
    g = np.arange(12).reshape(4, 3)
    quads = np.stack([g[:-1, :-1], g[1:, :-1], g[1:, 1:], g[:-1, 1:]], axis=2).reshape(-1, 4)
    chains = [g[:, 0], g[-1], g[::-1, -1], g[0, ::-1], [4, 7]]
    guide = make_guide(model, [(a, b) for a in x for b in y], quads, chains)
    mesh = fill(model, Planes(model), guide, uniform(guide, 4), straight(model))
    check_record(model, mesh, [1, 1, 1, 1, 2])
    np.testing.assert_allclose(mesh.points[mesh.curve_nodes[4], 0], [0.3, 0.4, 0.5, 0.6, 0.7], atol=1e-14)
    assert area(mesh) == pytest.approx(1, abs=1e-12)


def test_embedded_point_is_a_vertex_node() -> None:
    model = models.polygon([(0, 0), (1, 0), (1, 1), (0, 1)], embedded_points=[(0.4, 0.6)])
    g = np.arange(9).reshape(3, 3)
    quads = np.stack([g[:-1, :-1], g[1:, :-1], g[1:, 1:], g[:-1, 1:]], axis=2).reshape(-1, 4)
    xy = [(a, b) for a in (0, 0.4, 1) for b in (0, 0.6, 1)]
    guide = make_guide(model, xy, quads, [g[:, 0], g[-1], g[::-1, -1], g[0, ::-1]])
    cad = guide.cad_vertex.copy()
    cad[4] = 4
    mesh = fill(model, Planes(model), replace(guide, cad_vertex=cad), uniform(guide, 3), straight(model))
    check_record(model, mesh, [1] * 4)
    np.testing.assert_allclose(mesh.points[mesh.vertex_node[4]], [0.4, 0.6, 0], atol=1e-15)


@given(st.integers(0, 10**6))
@settings(max_examples=15, deadline=None)
def test_any_divisions_give_a_conforming_mesh(seed: int) -> None:
    rng = np.random.default_rng(seed)
    model, guide, evaluate = hole_in_plate(2)
    divisions = rng.integers(1, 6, n_chords(guide))
    mesh = fill(model, Planes(model), guide, divisions, evaluate)
    check_record(model, mesh, [1] * 5)
    _, quad_edges, chord, _ = guide_chords(guide.quads)
    assert len(mesh.quads) == divisions[chord[quad_edges[:, 0]]] @ divisions[chord[quad_edges[:, 1]]]
    # a plate with one hole: Euler characteristic 0
    assert len(mesh.points) - len(edge_uses(mesh.quads)) + len(mesh.quads) == 0
    assert scaled_jacobian(mesh.points, mesh.quads, UP).min() > 0


def moved(model: Model, guide: Guide, turn: Float, factor: float, shift: Float) -> tuple[Model, Guide]:
    """The model and guide after x -> factor turn x + shift (user's units)."""
    curves = tuple(replace(c, points=c.points @ turn.T) for c in model.curves)
    faces = tuple(replace(f, origin=turn @ f.origin, axes=f.axes @ turn.T) for f in model.faces)
    return (
        replace(
            model,
            origin=factor * (turn @ model.origin) + shift,
            scale=model.scale * factor,
            vertices=model.vertices @ turn.T,
            curves=curves,
            faces=faces,
        ),
        replace(guide, points=guide.points @ turn.T),
    )


@given(st.integers(0, 10**6), st.sampled_from([1e-9, 1e-3, 1.0, 1e6]))
@settings(max_examples=15, deadline=None)
def test_mesh_moves_with_the_model(seed: int, factor: float) -> None:
    rng = np.random.default_rng(seed)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    shift = factor * rng.uniform(-5, 5, 3)
    model, guide, evaluate = hole_in_plate(2)
    a = fill(model, Planes(model), guide, uniform(guide, 4), evaluate)
    model2, guide2 = moved(model, guide, turn, factor, shift)
    b = fill(model2, Planes(model2), guide2, uniform(guide, 4), lambda row, t: factor * evaluate(row, t) @ turn.T + shift)
    np.testing.assert_allclose((b.points - shift) / factor @ turn, a.points, atol=1e-11)
    assert np.array_equal(a.quads, b.quads)


@pytest.mark.parametrize("height", [0.0, 0.3, -7.1])
def test_nodes_of_a_horizontal_face_have_one_height(height: float) -> None:
    model, guide, evaluate = hole_in_plate(2)
    model, guide = moved(model, guide, np.eye(3), 1.0, np.array([0, 0, height]))
    mesh = fill(model, Planes(model), guide, uniform(guide, 5), lambda row, t: evaluate(row, t) + [0, 0, height])
    assert np.all(mesh.points[:, 2] == height)


@given(st.integers(0, 10**6))
@settings(max_examples=10, deadline=None)
def test_renumbering_the_guide_moves_no_node(seed: int) -> None:
    rng = np.random.default_rng(seed)
    model, guide, evaluate = hole_in_plate(2)
    new = rng.permutation(len(guide.points))
    old = np.argsort(new)
    quads = np.array([np.roll(q, rng.integers(4)) for q in new[guide.quads]])[rng.permutation(len(guide.quads))]
    other = replace(
        guide,
        points=guide.points[old],
        curve=guide.curve[old],
        arclength=guide.arclength[old],
        fixed=guide.fixed[old],
        cad_vertex=guide.cad_vertex[old],
        quads=quads,
        chains=tuple(new[c] for c in guide.chains),
    )
    a, b = (fill(model, Planes(model), g, uniform(g, 4), evaluate) for g in (guide, other))
    order = lambda p: p[np.lexsort(np.round(p, 9).T)]  # noqa: E731
    np.testing.assert_allclose(order(a.points), order(b.points), atol=1e-12)


def test_two_runs_are_equal_to_the_bit() -> None:
    model, guide, evaluate = hole_in_plate(3)
    a, b = (fill(model, Planes(model), guide, uniform(guide, 6), evaluate) for _ in range(2))
    assert a.points.tobytes() == b.points.tobytes() and a.quads.tobytes() == b.quads.tobytes()


def test_sizes_do_not_jump_between_cells() -> None:
    # sizes of guide cells double: the fine ones may not jump by more than the cubic needs
    xs = np.array([0, 1, 3, 7, 15.0])
    model, guide = grid(4, 2, 15.0, 2.0)
    g = np.arange(15).reshape(5, 3)
    guide = make_guide(model, [(a, b) for a in xs for b in (0, 1, 2)], guide.quads, [g[:, 0], g[-1], g[::-1, -1], g[0, ::-1]])
    mesh = fill(model, Planes(model), guide, uniform(guide, 32), straight(model))
    steps = np.diff(np.unique(np.round(mesh.points[np.abs(mesh.points[:, 1] - 1) < 1e-9, 0], 9)))
    assert len(steps) == 128
    ratio = steps[1:] / steps[:-1]
    assert ratio.max() < 1.1 and ratio.min() > 1 / 1.1


# never fold


def step() -> tuple[Model, Guide]:
    """A line with a short steep step between long flat edges, close to the bottom: a smooth curve dips through it."""
    model, guide = grid(3, 2, 6.1, 1.0)
    g = np.arange(12).reshape(4, 3)
    xy = [(x, y) for x, line in zip((0, 3, 3.1, 6.1), (0.05, 0.05, 0.45, 0.45)) for y in (0, line, 1)]
    return model, make_guide(model, xy, guide.quads, [g[:, 0], g[-1], g[::-1, -1], g[0, ::-1]])


def test_cells_beside_bulging_edges_do_not_fold(monkeypatch: pytest.MonkeyPatch) -> None:
    model, guide = step()
    own = scaled_jacobian(guide.points, guide.quads, UP)
    assert own.min() > 0
    mesh = fill(model, Planes(model), guide, uniform(guide, 8), straight(model))
    quality = scaled_jacobian(mesh.points, mesh.quads, UP)
    assert quality.min() > 0
    monkeypatch.setattr(placed, "SHARES", ())
    with pytest.raises(MeshError, match="fold"):
        fill(model, Planes(model), guide, uniform(guide, 8), straight(model))


def test_sides_of_a_thin_cell_do_not_shear_it(monkeypatch: pytest.MonkeyPatch) -> None:
    # the bottom breaks at x = .02 and is even beyond; the line close above it runs on there and grows
    corners = [(0, 0), (0.02, 0), (1, 0), (1, 1), (0, 1)]
    model = models.polygon(corners)
    xy = [*corners, (0.02, 1), (0, 0.003), (0.02, 0.003), (1, 0.003)]
    quads = [(0, 1, 7, 6), (1, 2, 8, 7), (6, 7, 5, 4), (7, 8, 3, 5)]
    guide = make_guide(model, xy, quads, [(0, 1), (1, 2), (2, 8, 3), (3, 5, 4), (4, 6, 0)])
    mesh = fill(model, Planes(model), guide, uniform(guide, 16), straight(model))
    assert scaled_jacobian(mesh.points, mesh.quads, UP).min() > 0.5
    monkeypatch.setattr(placed, "SHARES", ())
    mesh = fill(model, Planes(model), guide, uniform(guide, 16), straight(model))
    assert scaled_jacobian(mesh.points, mesh.quads, UP).min() < 0.3


def bulge(height: float, top: float = 1.0, lines: Sequence[float] = (0.3,)) -> tuple[Model, Guide, Callable[[int, Float], Float]]:
    """A rectangle with an arc of the given height as its bottom, and guide lines above its ends."""
    radius = (0.25 + height**2) / (2 * height)
    a = np.arcsin(0.5 / radius)
    centre = (0.5, height - radius)
    start, end = np.pi / 2 + a, np.pi / 2 - a
    corners = [(0, 0), (1, 0), (1, top), (0, top)]
    sides = [(i, (i + 1) % 4, models.line(corners[i], corners[(i + 1) % 4])) for i in (1, 2, 3)]
    curves = [(0, 1, models.arc(centre, radius, start, end)), *sides]
    model = models.build(corners, curves, [([[(i, 1) for i in range(4)]], [], [])])
    n = len(lines)
    right, left = [1, *range(4, 4 + n), 2], [0, *range(4 + n, 4 + 2 * n), 3]
    xy = [*corners, *((1, y) for y in lines), *((0, y) for y in lines)]
    quads = list(zip(left, right, right[1:], left[1:]))
    guide = make_guide(model, xy, quads, [(0, 1), right, (2, 3), left[::-1]])
    return model, guide, straight(model)


@pytest.mark.parametrize("height", [0.28, 0.35, 0.45])
def test_sides_bend_with_a_curve_that_bulges_by_more_than_the_cell_beside_it(height: float) -> None:
    """The line at y = .3 rises by .7 of what the arc does, for it has .7 of the way to the straight top before it."""
    model, guide, evaluate = bulge(height)
    mesh = fill(model, Planes(model), guide, uniform(guide, 8), evaluate)
    assert scaled_jacobian(mesh.points, mesh.quads, UP).min() > 0.15
    middle = mesh.points[np.abs(mesh.points[:, 0] - 0.5) < 1e-9]
    assert len(middle) == 17
    between = np.sort(middle[:, 1])[8]
    assert between == pytest.approx(0.3 + 0.7 * height, abs=1e-9)


def test_cells_of_a_bundle_share_the_gap() -> None:
    """An arc that leaves a gap of 1 % below a straight line, with ten cells across it: no cell takes more than its part."""
    model, guide, evaluate = bulge(0.3, 0.303, 0.0303 * np.arange(1, 10))
    mesh = fill(model, Planes(model), guide, uniform(guide, 2), evaluate)
    assert scaled_jacobian(mesh.points, mesh.quads, UP).min() > 0
    middle = np.sort(mesh.points[np.abs(mesh.points[:, 0] - 0.5) < 1e-9, 1])
    np.testing.assert_allclose(np.diff(middle), 0.003 / 20, rtol=1e-6)


def test_cells_that_straightening_would_fold_keep_their_edges(monkeypatch: pytest.MonkeyPatch) -> None:
    """Cubics follow thin rings of eight cells, straight edges would cross the inner circle."""
    model, guide, evaluate = ring(8, 20)
    straight_lines = lambda skeleton, topology, *_: (0.0, *np.zeros((2, len(topology.edges)), bool))  # noqa: E731
    monkeypatch.setattr(placed, "bundle_offsets", straight_lines)
    monkeypatch.setattr(placed.Placed, "wanted", lambda self, own: np.ones(len(own)))
    mesh = fill(model, Planes(model), guide, uniform(guide, 4), evaluate)
    assert scaled_jacobian(mesh.points, mesh.quads, UP).min() > 0
    monkeypatch.setattr(placed.Placed, "_restored", lambda self, worst, *_: worst)
    with pytest.raises(MeshError, match="fold"):
        fill(model, Planes(model), guide, uniform(guide, 4), evaluate)


def test_a_cell_that_a_curve_fills_is_refused_with_its_place() -> None:
    model, guide, evaluate = bulge(0.45, 0.4)  # the arc crosses the top
    with pytest.raises(MeshError, match=r"fold when they are filled, surface 1 at \(0\.5, 0\.(15|35), 0\)"):
        fill(model, Planes(model), guide, uniform(guide, 8), evaluate)
    poor, folded = poor_cells(model, Planes(model), guide, uniform(guide, 8), evaluate)
    assert len(folded)
    assert np.isin(folded, poor).all()


def test_a_good_guide_has_no_poor_cells() -> None:
    model, guide, evaluate = bulge(0.05)
    assert [len(rows) for rows in poor_cells(model, Planes(model), guide, uniform(guide, 8), evaluate)] == [0, 0]


def test_inverted_guide_quads_are_noted() -> None:
    model, guide = grid(3, 3)
    p = guide.points.copy()
    p[5] = p[10] + 0.1
    mesh = fill(model, Planes(model), replace(guide, points=p), uniform(guide, 2), straight(model))
    assert len(mesh.notes) == 1 and "inverted guide quads" in mesh.notes[0]


# refusals


def test_wrong_number_of_divisions() -> None:
    model, guide = grid(2, 2)
    with pytest.raises(MeshError, match="3 divisions for 4"):
        fill(model, Planes(model), guide, np.array([1, 1, 1]), straight(model))


def test_division_zero() -> None:
    model, guide = grid(2, 2)
    with pytest.raises(MeshError, match="no division"):
        fill(model, Planes(model), guide, np.array([1, 0, 1, 1]), straight(model))


def test_chain_that_is_not_in_the_guide() -> None:
    model, guide = grid(2, 2)
    chains = (guide.chains[0][[0, 2]], *guide.chains[1:])
    with pytest.raises(MeshError, match="gap on curve row 0"):
        fill(model, Planes(model), replace(guide, chains=chains), np.ones(4, int), straight(model))


def test_open_inner_edge() -> None:
    model, guide = grid(2, 2)
    keep = [0, 1, 2]
    parts = {name: getattr(guide, name)[keep] for name in ("quads", "quad_face", "quad_block", "quad_size")}
    with pytest.raises(MeshError, match=r"gap|not conforming"):
        fill(model, Planes(model), replace(guide, **parts), np.ones(n_chords(replace(guide, **parts)), int), straight(model))


def test_unknown_filler() -> None:
    model, guide = grid(1, 1)
    with pytest.raises(InputError, match="unknown filler"):
        fill(model, Planes(model), guide, np.ones(2, int), straight(model), filler="other")


# Gmsh's mesher


@pytest.mark.parametrize("n", [1, 2])
def test_gmsh_follows_the_same_rule(n: int) -> None:
    gmsh = pytest.importorskip("gmsh")
    model, guide, evaluate = hole_in_plate(n)
    divisions = np.arange(n_chords(guide)) % 4 + 1
    a = fill(model, Planes(model), guide, divisions, evaluate)
    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        before = gmsh.model.list(), gmsh.option.getNumber("Mesh.MeshOnlyVisible")
        b = fill(model, Planes(model), guide, divisions, evaluate, filler="gmsh")
        assert (gmsh.model.list(), gmsh.option.getNumber("Mesh.MeshOnlyVisible")) == before
    finally:
        gmsh.finalize()
    np.testing.assert_allclose(a.points, b.points, atol=1e-9)
    assert np.array_equal(a.quads, b.quads)


def test_cells_that_fold_at_one_division_get_two(monkeypatch: pytest.MonkeyPatch) -> None:
    model, guide = grid(2, 2, 2.0, 2.0)
    _, quad_edges, chord, n = guide_chords(guide.quads)
    filler = Filler(model, Planes(model), straight(model))
    ones = np.ones(n, np.int64)
    np.testing.assert_array_equal(filler.unfolded(guide, ones), ones)
    own = np.unique(chord[quad_edges[3]])

    def placed_(guide: Guide, divisions: np.ndarray, needed: list[int]) -> SimpleNamespace:
        worst = np.ones(4)
        worst[3] = 1.0 if (divisions[needed] > 1).all() else -1.0
        return SimpleNamespace(worst=worst, own=np.ones(4))

    for needed in ([own[0]], list(range(n))):  # the chords of the cell are enough, or all are needed
        monkeypatch.setattr(filler, "_placed", partial(placed_, needed=needed))
        expected = ones.copy()
        expected[own if len(needed) == 1 else needed] = 2
        np.testing.assert_array_equal(filler.unfolded(guide, ones), expected)
