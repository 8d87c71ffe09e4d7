import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gmsh_crossquad.errors import FieldError
from gmsh_crossquad.field.edge_frames import EdgeFrames
from gmsh_crossquad.field.smooth import edge_angle, wrap
from gmsh_crossquad.field.surface_mesh import SurfaceMesh
from gmsh_crossquad.source.cells import linear_triangles
from gmsh_crossquad.source.formula import Singularities
from gmsh_crossquad.source.locate import Locator
from gmsh_crossquad.source.samples import Samples

from .field_meshes import annulus, at, disc, grid, middles
from .source_frames import delaunay, frames_of, inner_indices, random_square

TILTED = np.array([[0.6, 0.0, 0.8], [0.0, 1.0, 0.0]])
UPRIGHT = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])


def unit(angle):
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def error(mesh, field, angle):
    """Greatest difference between a field and the global angles (e,)."""
    return np.abs(wrap(field.theta + edge_angle(mesh) - angle)).max()


def linear(p):
    return 0.3 + 0.4 * p[..., 0] - 0.7 * p[..., 1]


def square(n):
    mesh = grid(n, n)
    return SurfaceMesh(mesh.points / n, mesh.triangles)


# --- the same field in all its forms


def forms(angle):
    d, e = unit(angle), unit(angle + np.pi / 2)
    tensor = 2.0 * d[:, :, None] * d[:, None, :] - 1.0 * e[:, :, None] * e[:, None, :]
    xx, yy, xy = tensor[:, 0, 0], tensor[:, 1, 1], tensor[:, 0, 1]
    full = np.zeros((len(d), 3, 3))
    full[:, :2, :2] = tensor
    turned = unit(angle + np.pi / 2 * (np.arange(len(angle)) % 4))
    return {
        "direction 2": ("direction", d),
        "direction 3": ("direction", 5.0 * np.column_stack([d, 0 * xx])),
        "any arm": ("direction", turned),
        "with a normal part": ("direction", np.column_stack([d, 0.5 + xx**2])),
        "directions": ("directions", np.stack([d, -e], axis=1)),
        "directions flat": ("directions", np.column_stack([d, 0 * xx, e, 0 * xx])),
        "directions that are not orthogonal": (
            "directions",
            np.stack([unit(angle + 0.1), unit(angle + np.pi / 2 - 0.1)], axis=1),
        ),
        "angle": ("angle", angle + np.pi / 2 * (np.arange(len(angle)) % 3)),
        "angle column": ("angle", angle[:, None]),
        "tensor 3": ("tensor", np.column_stack([xx, yy, xy])),
        "tensor 6": ("tensor", np.column_stack([xx, yy, 0 * xx, xy, 0 * xx, 0 * xx])),
        "tensor 9": ("tensor", full.reshape(-1, 9)),
        "tensor 2 x 2": ("tensor", tensor),
        "tensor 3 x 3": ("tensor", full + 7.0 * np.eye(3)),
    }


@pytest.mark.parametrize("form", forms(np.zeros(1)))
def test_every_form_gives_the_field(form):
    target, source = random_square(60, 1), square(12)
    kind, values = forms(linear(source.points))[form]
    field = Samples(source.points, source.triangles, values, kind).on(frames_of(target))
    assert error(target, field, linear(target.points[target.edges].mean(axis=1))) < 2e-3


@pytest.mark.parametrize("form", ["direction 2", "any arm", "directions", "angle", "tensor 9"])
def test_cells_are_averaged(form):
    target, source = random_square(60, 1), square(24)
    kind, values = forms(linear(source.points[source.triangles].mean(axis=1)))[form]
    field = Samples(source.points, source.triangles, values, kind, "cells").on(frames_of(target))
    inside = ~target.boundary_edge
    exact = linear(target.points[target.edges].mean(axis=1))
    assert np.abs(wrap(field.theta + edge_angle(target) - exact))[inside].max() < 0.02


@pytest.mark.parametrize("form", ["direction 3", "angle"])
def test_interpolation_has_order_two(form):
    target = random_square(200, 2)

    def worst(n):
        source = square(n)
        angle = np.sin(2 * source.points[:, 0]) * np.cos(3 * source.points[:, 1])
        kind, values = forms(angle)[form]
        field = Samples(source.points, source.triangles, values, kind).on(frames_of(target))
        p = target.points[target.edges].mean(axis=1)
        return error(target, field, np.sin(2 * p[:, 0]) * np.cos(3 * p[:, 1]))

    assert np.log2(worst(10) / worst(40)) / 2 > 1.7


def test_values_at_edge_midpoints_come_back():
    # second-order triangles whose middle nodes are the target's edge midpoints; the corners have no direction
    mesh = disc(8, 24)
    field = Singularities([mesh.points[at(mesh, 0.4, 0.1)]], [1]).on(frames_of(mesh))
    n = len(mesh.points)
    points = np.concatenate([mesh.points, mesh.points[mesh.edges].mean(axis=1)])
    cells = np.concatenate([mesh.triangles, n + mesh.triangle_edges], axis=1)
    directions = np.concatenate([np.zeros((n, 2)), unit(field.theta + edge_angle(mesh))])
    back = Samples(points, cells, directions, "direction").on(frames_of(mesh))
    assert np.abs(wrap(back.theta - field.theta)).max() < 1e-10
    assert np.abs(back.rotation - field.rotation).max() < 1e-10


def test_singularities_of_a_sampled_field():
    source, target = disc(30, 90), disc(11, 40)
    a, d = np.array([0.31 + 0.22j, -0.4 + 0.1j]), [1, -1]
    z = source.points @ [1, 1j]
    angle = sum(q / 4 * np.angle(z - p) for p, q in zip(a, d))
    field = Samples(source.points, source.triangles, unit(angle), "direction").on(frames_of(target))
    triangles, vertices = inner_indices(target, field)
    place = np.concatenate([target.points[target.triangles].mean(axis=1), target.points]) @ [1, 1j]
    index = np.concatenate([triangles, vertices])
    for p, q in zip(a, d):
        here = np.abs(place - p) < 0.15
        assert index[here].sum() == q
        index[here] = 0
    assert not np.any(index)


@settings(max_examples=15, deadline=None)
@given(st.floats(0, 6.3), st.integers(0, 5))
def test_the_field_turns_with_the_model(turn, seed):
    source, target = random_square(80, seed), random_square(30, seed + 1)
    direction = np.column_stack([unit(linear(source.points)), np.zeros(len(source.points))])
    spin = np.array([[np.cos(turn), np.sin(turn), 0], [-np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
    plain = Samples(source.points, source.triangles, direction, "direction").on(frames_of(target))
    axes = np.eye(2, 3) @ spin
    turned = Samples(source.points @ axes, source.triangles, direction @ spin, "direction").on(frames_of(target, axes))
    assert np.abs(wrap(turned.theta - plain.theta)).max() < 1e-9


@pytest.mark.parametrize("axes", [TILTED, UPRIGHT, np.array([[0, 0, 1.0], [1.0, 0, 0]]), TILTED * [[1], [-1]]])
def test_other_planes(axes):
    source, target = square(12), random_square(60)
    frames = frames_of(target, axes, (1.0, 2.0, 3.0), 4.0)
    points = np.array([1.0, 2, 3]) + 4.0 * source.points @ axes
    angle = linear(source.points)
    exact = linear(target.points[target.edges].mean(axis=1))
    field = Samples(points, source.triangles, unit(angle) @ axes, "direction").on(frames)
    assert error(target, field, exact) < 2e-3
    d = unit(angle) @ axes
    tensor = d[:, :, None] * d[:, None, :]
    assert error(target, Samples(points, source.triangles, tensor, "tensor").on(frames), exact) < 2e-3


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_angles_count_from_the_x_axis_about_the_upward_normal(side):
    # the direction of an angle does not depend on the orientation of the face
    target = disc(4, 12)
    frames = frames_of(target, np.array([[1.0, 0, 0], [0, side, 0]]))
    points = target.points * [1, side]
    by_angle = Samples(points, target.triangles, np.full(len(points), 0.3), "angle").on(frames)
    by_arm = Samples(points, target.triangles, np.tile(unit(0.3), (len(points), 1)), "direction").on(frames)
    assert np.abs(wrap(by_angle.theta - by_arm.theta)).max() < 1e-12


def test_curved_faces():
    # the field along meridians of a spherical cap, sampled on another mesh of the cap
    def cap(mesh):
        r = 1.2 * np.hypot(*mesh.points.T)
        a = np.arctan2(*mesh.points.T[::-1])
        return np.stack([np.sin(r) * np.cos(a), np.sin(r) * np.sin(a), np.cos(r)], axis=1)

    source, target = annulus(0.3, 16, 90), annulus(0.35, 7, 36)
    points = cap(target)
    middle = points[target.edges].mean(axis=1)
    normal = middle / np.linalg.norm(middle, axis=1)[:, None]
    frames = EdgeFrames(1, SurfaceMesh(points, target.triangles), points, normal)
    p = cap(source)
    east = np.stack([-p[:, 1], p[:, 0], 0 * p[:, 0]], axis=1)
    values = np.cross(east, p)
    field = Samples(p, source.triangles, values, "direction").on(frames)
    exact = frames.angles(np.stack([-middle[:, 1], middle[:, 0], 0 * middle[:, 0]], axis=1))
    assert np.abs(wrap(field.theta - exact)).max() < 0.01
    on_cells = np.cross(east, p)[source.triangles].mean(axis=1)
    field = Samples(p, source.triangles, on_cells, "direction", "cells").on(frames)
    assert np.abs(wrap(field.theta - exact)).max() < 0.03
    with pytest.raises(FieldError, match="a field of angles needs a planar face"):
        Samples(p, source.triangles, np.zeros(len(p)), "angle").on(frames)


# --- cells


@pytest.mark.parametrize("nodes, count", [(3, 1), (4, 2), (6, 4), (8, 6), (9, 8)])
def test_cells_are_cut_into_triangles(nodes, count):
    corners = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])[: 3 if nodes in (3, 6) else 4]
    middles_ = 0.5 * (corners + np.roll(corners, -1, axis=0))
    points = {3: corners, 4: corners, 6: np.vstack([corners, middles_]), 8: np.vstack([corners, middles_])}.get(nodes)
    points = np.vstack([corners, middles_, [[0.5, 0.5]]]) if points is None else points
    triangles, cell = linear_triangles([np.arange(nodes)[None], np.arange(nodes)[None]])
    assert (len(triangles), np.bincount(cell).tolist()) == (2 * count, [count, count])
    assert sorted(set(triangles.ravel().tolist())) == list(range(nodes))
    p = points[triangles[:count]]
    a, b = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]
    area = 0.5 * (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
    assert area.min() > 0
    assert area.sum() == pytest.approx(0.5 if len(corners) == 3 else 1.0)


def test_quads_and_triangles_together():
    points = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1], [2, 0]])
    cells = [np.array([[0, 1, 2, 3]]), np.array([[1, 4, 2]])]
    field = Samples(points, cells, np.tile(unit(0.2), (2, 1)), "direction", "cells")
    target = delaunay(np.array([[0.1, 0.1], [1.4, 0.2], [1.1, 0.5], [0.5, 0.9]]))
    assert error(target, field.on(frames_of(target)), 0.2) < 1e-12


# --- locating


def test_locator_on_a_graded_mesh():
    # sizes from 1e-4 to 1: the containing triangle is seldom the one with the nearest centroid
    rng = np.random.default_rng(3)
    r = 10 ** rng.uniform(-4, 0, 3000)
    a = rng.uniform(0, 2 * np.pi, len(r))
    points = np.concatenate([np.stack([r * np.cos(a), r * np.sin(a)], axis=1), [[-2.0, -2], [2, -2], [2, 2], [-2, 2]]])
    mesh = delaunay(points)
    r = 10 ** rng.uniform(-4, 0.25, 2000)
    a = rng.uniform(0, 2 * np.pi, len(r))
    places = np.stack([r * np.cos(a), r * np.sin(a), 0 * r], axis=1)
    corners = np.concatenate([mesh.points, np.zeros((len(mesh.points), 1))], axis=1)[mesh.triangles]
    found = Locator(corners).find(places, np.tile([0.0, 0, 1], (len(r), 1)))
    assert np.all(found.triangle >= 0)
    assert np.abs(np.sum(found.weight[:, :, None] * corners[found.triangle], axis=1) - places).max() < 1e-12
    assert found.weight.min() > -1e-8


def test_nearest_point_of_places_outside():
    mesh = disc(6, 24)
    corners = np.concatenate([mesh.points, np.zeros((len(mesh.points), 1))], axis=1)[mesh.triangles]
    a = np.linspace(0, 6, 50)
    up = np.tile([0.0, 0, 1], (len(a), 1))
    places = np.stack([1.05 * np.cos(a), 1.05 * np.sin(a), 0 * a], axis=1)
    found = Locator(corners).find(places, up)
    foot = np.sum(found.weight[:, :, None] * corners[found.triangle], axis=1)
    dense = np.linspace(mesh.points[mesh.loops[0]], np.roll(mesh.points[mesh.loops[0]], -1, axis=0), 400).reshape(-1, 2)
    nearest = np.linalg.norm(places[:, None, :2] - dense, axis=2).min(axis=1)
    assert np.abs(np.linalg.norm(places - foot, axis=1) - nearest).max() < 1e-4
    assert np.all(Locator(corners).find(places * 1.3, up).triangle == -1)
    assert np.all(Locator(corners).find(0.5 * places, np.tile([1.0, 0, 0], (len(a), 1))).triangle == -1)


def test_a_round_boundary_with_another_polygon():
    source, target = disc(8, 24), disc(12, 37)
    field = Samples(source.points, source.triangles, np.tile(unit(0.3), (len(source.points), 1)), "direction").on(
        frames_of(target)
    )
    assert error(target, field, 0.3) < 1e-12


# --- repairs


def test_a_single_point_without_direction_is_filled():
    mesh = disc(8, 24)
    values = np.tile(unit(0.3), (len(mesh.points), 1))
    values[at(mesh, 0.5, 0.1)] = 0.0
    assert error(mesh, Samples(mesh.points, mesh.triangles, values, "direction").on(frames_of(mesh)), 0.3) < 1e-12


def test_a_field_that_is_zero_on_the_boundary_is_used():
    # like a flow that sticks to the wall
    mesh = grid(8, 8)
    values = unit(0.02 * mesh.points[:, 0]) * np.where(mesh.boundary_vertex, 0.0, 1.0)[:, None]
    field = Samples(mesh.points, mesh.triangles, values, "direction").on(frames_of(mesh))
    assert error(mesh, field, 0.02 * middles(mesh).real) < 0.02


# --- refusals


def bad(change=None, kind="direction", where="points", points=None, cells=None, values=None):
    mesh = grid(8, 8)
    p = mesh.points if points is None else points
    c = mesh.triangles if cells is None else cells
    v = np.tile(unit(0.3), (len(mesh.points if where == "points" else mesh.triangles), 1)) if values is None else values
    if change is not None:
        change(v, mesh.points)
    return lambda: Samples(p, c, v, kind, where).on(frames_of(mesh))


def put(value, condition):
    def change(v, p):
        v[condition(p)] = value

    return change


REFUSALS = {
    "NaN": (bad(put(np.nan, lambda p: p[:, 0] == 3)), r"9 of 145 values .* first at \(3, 0, 0\)"),
    "infinite": (bad(put(np.inf, lambda p: (p == [2, 5]).all(axis=1))), r"1 of 145 values .* at \(2, 5, 0\)"),
    "NaN in a cell": (
        bad(where="cells", values=np.where(np.arange(256)[:, None] == 7, np.nan, np.ones((256, 2)))),
        r"1 of 256 values .* first at",
    ),
    "zero everywhere": (bad(put(0.0, lambda p: p[:, 0] >= 0)), "zero everywhere"),
    "zero on a curve": (bad(put(0.0, lambda p: p[:, 0] == 4)), r"along a curve or in a region, surface 1 at \(4, \d, 0\)"),
    "zero in a region": (bad(put(0.0, lambda p: p[:, 0] >= 4)), r"along a curve or in a region, surface 1 at \(4"),
    "normal": (bad(values=np.tile([0.0, 0, 2], (145, 1))), "no direction on the face, surface 1: it is normal"),
    "normal on a curve": (
        bad(put([0, 0, 1], lambda p: p[:, 1] == 2), values=np.tile([1.0, 0, 0], (145, 1))),
        "along a curve or in a region",
    ),
    "isotropic": (bad(kind="tensor", values=np.tile(np.eye(3), (145, 1, 1))), "no direction on the face"),
    "isotropic on a curve": (
        bad(put(np.eye(2), lambda p: p[:, 0] == 4), kind="tensor", values=np.tile(np.diag([2.0, 1.0]), (145, 1, 1))),
        "along a curve or in a region",
    ),
    "opposed arms": (
        bad(kind="directions", values=np.tile(np.stack([unit(0.0), unit(np.pi / 4)]), (145, 1, 1))),
        "no direction on the face",
    ),
    "noise": (bad(values=unit(np.random.default_rng(0).uniform(0, 7, 145))), "more than 36 degrees within .* % of its cells"),
    "too few values": (bad(values=np.ones((144, 2))), r"shape \(144, 2\) for 145 places"),
    "four columns": (bad(values=np.ones((145, 4))), r"shape \(145, 4\): an array \(n, 2\) or \(n, 3\) is needed"),
    "flat": (bad(values=np.ones(145)), r"shape \(145,\)"),
    "five columns of a tensor": (bad(kind="tensor", values=np.ones((145, 5))), r"shape \(145, 5\)"),
    "skew tensor": (bad(kind="tensor", values=np.tile([[1.0, 2], [0, 1]], (145, 1, 1))), "not symmetric"),
    "a word": (bad(values="north"), "no real numbers"),
    "complex": (bad(values=np.ones((145, 2)) * 1j), "no real numbers"),
    "one number": (bad(values=3.0), r"shape \(\) for 145 places"),
    "unknown kind": (bad(kind="vector"), "kind 'vector': the kinds are direction, "),
    "unknown place": (bad(where="edges"), "'edges': they must be on points or cells"),
    "no cells": (bad(cells=np.zeros((0, 3), int)), "no triangles or quadrangles: scattered points"),
    "no cells at all": (bad(cells=[]), "no triangles or quadrangles"),
    "cells of five nodes": (bad(cells=np.arange(145).reshape(-1, 5)), r"cells of shape \(29, 5\)"),
    "cells beyond the points": (bad(cells=np.array([[0, 1, 145]])), "points that it does not have"),
    "cells of real numbers": (bad(cells=np.array([[0, 1, 2.5]])), "points that it does not have"),
    "flat cells": (bad(cells=np.array([[0, 1, 1]])), "no area"),
    "no points": (bad(points=np.zeros((0, 2))), r"shape \(0, 2\)"),
    "NaN in a point": (bad(points=np.full((145, 2), np.nan)), "not finite"),
    "points of one coordinate": (bad(points=np.ones((145, 1))), r"shape \(145, 1\)"),
    "elsewhere": (bad(points=grid(8, 8).points + 100), "covers only 0.0 % of the background points, surface 1 at"),
    "above": (bad(points=np.column_stack([grid(8, 8).points, np.full(145, 5.0)])), "covers only 0.0 %"),
    "half": (bad(points=grid(8, 8).points * [0.5, 1]), r"covers only \d\d\.\d % of the background points"),
}


@pytest.mark.parametrize("name", REFUSALS)
def test_bad_values_are_refused(name):
    call, words = REFUSALS[name]
    with pytest.raises(FieldError, match=words) as caught:
        call()
    assert "\n" not in str(caught.value)


def test_a_field_that_jumps_along_a_curve():
    mesh = grid(20, 20)
    jump = unit(np.where(mesh.points[:, 0] > 10, np.pi / 4 - 0.001 * np.sin(9 * mesh.points[:, 1]), 0.0))
    with pytest.raises(FieldError, match="jumps by 45 degrees along a curve, surface 1 at"):
        Samples(mesh.points, mesh.triangles, jump, "direction").on(frames_of(mesh))


def test_a_background_too_coarse_for_the_field():
    source, target = square(100), square(6)
    values = unit(4 * np.sin(9 * source.points[:, 0]) * np.sin(9 * source.points[:, 1]))
    with pytest.raises(FieldError, match=r"within \d+ % of the background triangles"):
        Samples(source.points, source.triangles, values, "direction").on(frames_of(target))
