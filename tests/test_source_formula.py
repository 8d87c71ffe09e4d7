import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gmsh_crossquad.errors import FieldError
from gmsh_crossquad.field.align import align
from gmsh_crossquad.field.edge_frames import EdgeFrames
from gmsh_crossquad.field.operators import FieldOperators
from gmsh_crossquad.field.singularities import QUARTER, corner_rotation, snap_to_vertices, vertex_index
from gmsh_crossquad.field.smooth import edge_angle, wrap
from gmsh_crossquad.records import CrossField
from gmsh_crossquad.source.formula import Singularities

from .field_meshes import annulus, at, disc, middles, singular_angle
from .source_frames import drift, frames_of, inner_indices, random_square

TILTED = np.array([[0.6, 0.0, 0.8], [0.0, 1.0, 0.0]])


@pytest.mark.parametrize("d", [-9, -4, -1, 0, 1, 3, 5, 40])
def test_any_index_sits_at_its_vertex(d):
    mesh = disc(8, 24)
    v = at(mesh, 0.4, 0.3)
    field = Singularities([mesh.points[v]], [d]).on(frames_of(mesh))
    triangles, vertices = inner_indices(mesh, field)
    assert not np.any(triangles)
    assert {int(i): int(vertices[i]) for i in np.flatnonzero(vertices)} == ({v: d} if d else {})
    assert drift(mesh, field) < 1e-12


def test_angles_are_those_of_the_formula():
    mesh = disc(8, 24)
    vertices, d = [at(mesh, 0.4, 0.3), at(mesh, -0.5, 0.0)], [3, -2]
    field = Singularities(mesh.points[vertices], d).on(frames_of(mesh))
    assert np.abs(wrap(field.theta + edge_angle(mesh) - singular_angle(mesh, vertices, d))).max() < 1e-12


@settings(max_examples=40, deadline=None)
@given(
    st.lists(
        st.tuples(st.floats(0.001, 0.999), st.floats(0.001, 0.999), st.integers(-6, 6)),
        min_size=1,
        max_size=4,
        unique_by=lambda t: t[:2],
    ),
    st.integers(0, 3),
)
def test_no_index_inside_is_lost(points, seed):
    # also for points in triangles at the boundary, and near vertices and edges
    mesh = random_square(40, seed)
    field = Singularities([p[:2] for p in points], [p[2] for p in points]).on(frames_of(mesh))
    triangles, vertices = inner_indices(mesh, field)
    assert triangles.sum() + vertices.sum() == sum(p[2] for p in points)
    assert drift(mesh, field) < 1e-9


def test_a_point_in_a_triangle_at_the_boundary_stays_in_its_triangle():
    mesh = disc(6, 12)
    t = next(i for i, v in enumerate(mesh.triangles) if mesh.boundary_vertex[v].sum() == 2)
    p = mesh.points[mesh.triangles[t]]
    for w in ([0.8, 0.1, 0.1], [0.1, 0.8, 0.1], [0.1, 0.1, 0.8], [0.34, 0.33, 0.33], [0.6, 0.39, 0.01], [0.5, 0.5 - 1e-6, 1e-6]):
        triangles, vertices = inner_indices(mesh, Singularities([w @ p], [-3]).on(frames_of(mesh)))
        at_corner = not mesh.boundary_vertex[mesh.triangles[t, int(np.argmax(w))]] and max(w) > 0.5
        assert triangles[t] == (0 if at_corner else -3)
        assert np.abs(triangles).sum() + np.abs(vertices).sum() == 3


def test_a_point_at_an_edge_midpoint():
    mesh = disc(6, 12)
    for e in np.flatnonzero(~mesh.boundary_edge):
        field = Singularities([mesh.points[mesh.edges[e]].mean(axis=0)], [2]).on(frames_of(mesh))
        triangles, vertices = inner_indices(mesh, field)
        assert (triangles.sum() + vertices.sum(), np.count_nonzero(triangles) + np.count_nonzero(vertices)) == (2, 1)
        assert drift(mesh, field) < 1e-9


def test_equal_points_add_up():
    mesh = disc(6, 18)
    once = Singularities([mesh.points[3]], [3]).on(frames_of(mesh))
    source = Singularities([mesh.points[3], [0.1, 0.2], mesh.points[3]], [5, 0, -2])
    twice = source.on(frames_of(mesh))
    assert np.abs(once.rotation - twice.rotation).max() < 1e-12
    assert len(source.points()) == 2


def test_points_outside_act_on_the_degree_only():
    # formula (2) around a hole: one quarter turn of the cross for every quarter of index in the hole
    mesh = annulus()
    field = Singularities([(0.0, 0.1), (5.0, 5.0)], [3, 2]).on(frames_of(mesh))
    triangles, vertices = inner_indices(mesh, field)
    assert not np.any(triangles)
    assert not np.any(vertices)
    hole = mesh.loops[1]
    turned = np.sum((mesh.curvature - corner_rotation(mesh, field.rotation))[hole]) / QUARTER
    turning = np.sum(mesh.curvature[hole]) / QUARTER
    assert turned - turning == pytest.approx(3)


def test_order_two_against_the_exact_disc_solution():
    # theta = sum d/4 (arg(z - a) + arg(1 - conj(a) z))
    def error(n):
        mesh = disc(6 * n, 16 * n)
        vertices, d = [at(mesh, 0.5, 0.0), at(mesh, -0.5, 0.0)], [3, 1]
        field = align(
            mesh, FieldOperators(mesh), Singularities(mesh.points[vertices], d).on(frames_of(mesh)), 0 * mesh.some_half_edge
        )
        z, a = middles(mesh), mesh.points[vertices] @ [1, 1j]
        exact = sum(q / 4 * (np.angle(z - p) + np.angle(1 - np.conj(p) * z)) for p, q in zip(a, d))
        far = np.abs(z[:, None] - a).min(axis=1) > 0.15
        return np.abs(wrap(field.field.theta + edge_angle(mesh) - exact))[far].max()

    assert np.log2(error(3) / error(6)) > 1.7


def test_the_plane_of_the_face_does_not_matter():
    mesh = disc(6, 18)
    flat = Singularities([(0.3, 0.2), (0.0, 1.7)], [2, -1]).on(frames_of(mesh))
    frames = frames_of(mesh, TILTED, (5.0, -2.0, 3.0), 7.0)
    points = np.array([5.0, -2.0, 3.0]) + 7.0 * np.array([[0.3, 0.2], [0.0, 1.7]]) @ TILTED
    for p in (points, points[:, :2]):
        tilted = Singularities(p, [2, -1]).on(frames)
        assert np.abs(tilted.rotation - flat.rotation).max() < 1e-12
        assert np.ptp(wrap(tilted.theta - flat.theta - (tilted.theta - flat.theta)[0])) < 1e-12
    beside = Singularities(np.concatenate([points, points[:1] + [0, 0, 1]]), [2, -1, 3]).on(frames)
    assert np.abs(beside.rotation - flat.rotation).max() < 1e-12


def test_the_index_does_not_depend_on_the_orientation_of_the_face():
    mesh = disc(6, 18)
    turned = frames_of(mesh, np.array([[1.0, 0, 0], [0, -1.0, 0]]))
    v = at(mesh, 0.3, 0.4)
    field = Singularities([mesh.points[v] * [1, -1]], [3]).on(turned)
    assert inner_indices(mesh, field)[1][v] == 3


def test_snapped_and_aligned():
    mesh = random_square(300)
    field = Singularities([(0.31, 0.52), (0.73, 0.4), (0.6, 0.8)], [1, 2, -3]).on(frames_of(mesh))
    rotation = snap_to_vertices(mesh, field.rotation)
    index = np.rint(vertex_index(mesh, rotation))[~mesh.boundary_vertex]
    assert sorted(index[index != 0]) == [-3, 1, 2]
    corners = np.where(np.isclose(mesh.angle_sum, np.pi / 2) & mesh.boundary_vertex, 1, 0)
    align(mesh, FieldOperators(mesh), CrossField(field.theta, rotation), corners)


@pytest.mark.parametrize(
    "positions, quarters, words",
    [
        ([(0.0, 0.0)], [0.25], "index 0.25"),
        ([(0.0, 0.0)], [1, 2], "one index for each"),
        ([(0.0, np.nan)], [1], "no finite numbers"),
        ([(0.0, np.inf)], [1], "no finite numbers"),
        ([(0.0,)], [1], "two or three coordinates"),
        ([0.0, 1.0], [1, 1], "two or three coordinates"),
        ("ab", [1], "no numbers"),
        ([(0.0, 0.0)], [np.nan], "index nan"),
        ([(1.0, 0.0)], [1], "on the boundary, surface 1 at \\(1, 0, 0\\): give it as a boundary index"),
        ([(0.3 + 0.7 * np.cos(np.pi / 12), 0.7 * np.sin(np.pi / 12))], [1], "on the boundary, surface 1"),
    ],
)
def test_bad_singularities(positions, quarters, words):
    mesh = disc(6, 24)
    with pytest.raises(FieldError, match=words):
        Singularities(positions, quarters).on(frames_of(mesh))


def test_faces_it_cannot_work_on():
    mesh = disc(6, 18)
    upright = frames_of(mesh, np.array([[1.0, 0, 0], [0, 0, 1.0]]))
    with pytest.raises(FieldError, match="give three coordinates"):
        Singularities([(0.1, 0.0)], [1]).on(upright)
    assert Singularities([(0.1, 0.0, 0.2)], [1]).on(upright).theta.shape == (len(mesh.edges),)
    bent = frames_of(mesh)
    points = np.column_stack([mesh.points, 0.3 * mesh.points[:, 0] ** 2])
    with pytest.raises(FieldError, match="needs a planar face, surface 1"):
        Singularities([(0.1, 0.0)], [1]).on(EdgeFrames(1, mesh, points, bent.normal))
