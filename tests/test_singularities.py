import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gmsh_crossquad.errors import LayoutError
from gmsh_crossquad.field.singularities import (
    QUARTER,
    check_poincare_hopf,
    move_index,
    shortest_path,
    singular_vertices,
    snap_to_vertices,
    to_integer,
    triangle_index,
    vertex_index,
    walk,
)
from gmsh_crossquad.field.surface_mesh import SurfaceMesh

from .field_meshes import annulus, at, disc, grid, middles, prescribed, singular_angle

MESHES = {
    "disc": (disc(8, 20), 1),
    "annulus": (annulus(0.4, 5, 24), 0),
    "square": (grid(4, 4), 1),
    "three holes": (grid(9, 5, ((1, 2, 1, 2), (4, 5, 2, 4), (7, 8, 1, 3))), -2),
}


@pytest.mark.parametrize("name", MESHES)
def test_poincare_hopf_holds_for_every_rotation(name):
    mesh, chi = MESHES[name]
    assert mesh.euler == chi
    rotation = np.random.default_rng(0).normal(size=(len(mesh.triangles), 3))
    total = rotation.sum() / QUARTER + vertex_index(mesh, rotation).sum()
    assert total == pytest.approx(4 * chi, abs=1e-10)


@pytest.mark.parametrize("index", [1, -1])
def test_index_of_a_prescribed_singularity(index):
    mesh = disc(10, 32)
    v = at(mesh, 0.5, 0.0)
    rotation = prescribed(mesh, singular_angle(mesh, [v], [index])).rotation
    assert not np.any(triangle_index(rotation))
    vertices, found = singular_vertices(mesh, rotation)
    assert vertices.tolist() == [v]
    assert found.tolist() == [index]


@pytest.mark.parametrize("index", [1, -1])
def test_snapping_keeps_the_index(index):
    mesh = disc(10, 32)
    z = mesh.points[mesh.triangles[100]].mean(axis=0) @ np.array([1, 1j])
    rotation = prescribed(mesh, index / 4 * np.angle(middles(mesh) - z)).rotation
    assert triangle_index(rotation)[100] == index
    snapped = snap_to_vertices(mesh, rotation)
    vertices, found = singular_vertices(mesh, snapped)
    assert not np.any(triangle_index(snapped))
    assert found.tolist() == [index]
    assert vertices[0] in mesh.triangles[100]
    rest = np.isin(mesh.triangles, mesh.triangles[100]).sum(axis=1) == 0
    assert np.array_equal(snapped[rest], rotation[rest])


def test_snapping_avoids_and_annihilates():
    mesh = disc(10, 32)
    t = 100
    z = mesh.points[mesh.triangles[t]].mean(axis=0) @ np.array([1, 1j])
    rotation = prescribed(mesh, np.angle(middles(mesh) - z) / 4).rotation
    avoid = np.zeros(len(mesh.points), bool)
    avoid[mesh.triangles[t, :2]] = True
    assert singular_vertices(mesh, snap_to_vertices(mesh, rotation, avoid))[0].tolist() == [mesh.triangles[t, 2]]
    opposite = prescribed(mesh, np.angle(middles(mesh) - z) / 4 + singular_angle(mesh, [mesh.triangles[t, 0]], [-1])).rotation
    assert triangle_index(opposite)[t] == 1
    assert len(singular_vertices(mesh, snap_to_vertices(mesh, opposite, avoid))[0]) == 0


def test_a_triangle_without_interior_vertex_cannot_hold_a_singularity():
    mesh = grid(1, 1)
    ears = type(mesh)(mesh.points[:3], np.array([[0, 2, 1]]))
    with pytest.raises(LayoutError, match="without interior vertex"):
        snap_to_vertices(ears, np.full((1, 3), QUARTER / 3))


@settings(max_examples=30, deadline=None)
@given(st.data())
def test_moves_transport_whole_quarter_turns(data):
    mesh = MESHES["three holes"][0]
    start, end = (data.draw(st.integers(0, len(mesh.points) - 1)) for _ in range(2))
    amount = data.draw(st.integers(-3, 3))
    target = np.zeros(len(mesh.points), bool)
    target[end] = True
    path = shortest_path(mesh, [start], target, np.ones(len(mesh.points), bool), 1000)
    rotation = np.zeros((len(mesh.triangles), 3))
    before = vertex_index(mesh, rotation)
    move_index(mesh, rotation, path, amount)
    expected = before.copy()
    expected[start] -= amount
    expected[end] += amount
    assert np.allclose(vertex_index(mesh, rotation), expected, atol=1e-12)
    assert not np.any(triangle_index(rotation))


def test_shortest_path_counts_edges():
    mesh = grid(6, 1)
    target = np.zeros(len(mesh.points), bool)
    target[at(mesh, 6, 0)] = True
    everywhere = np.ones(len(mesh.points), bool)
    assert len(shortest_path(mesh, [at(mesh, 0, 0)], target, everywhere, 100)) == 7
    assert shortest_path(mesh, [at(mesh, 0, 0)], target, everywhere, 5) == []


def test_walk_stops_at_the_nearest_allowed_vertex():
    mesh = grid(6, 6)
    path = walk(mesh, at(mesh, 1, 1), np.array([4.0, 4.1]), mesh.boundary_vertex)
    assert path[-1] == at(mesh, 4, 4)
    outside = walk(mesh, at(mesh, 3, 3), np.array([9.0, 3.0]), mesh.boundary_vertex)
    assert not mesh.boundary_vertex[outside].any()


def test_wrong_sum_is_refused():
    mesh = grid(3, 3)
    index = np.zeros(len(mesh.points), np.int64)
    with pytest.raises(LayoutError, match="add up to 0 quarter turns instead of 4"):
        check_poincare_hopf(mesh, index)
    index[:4] = 1
    check_poincare_hopf(mesh, index)


def test_an_error_says_where():
    mesh = grid(3, 3)
    values = np.zeros(len(mesh.points))
    values[5] = 0.25
    with pytest.raises(LayoutError, match=r"off by 0\.25") as caught:
        to_integer(values, "an index", mesh.points)
    assert caught.value.location == tuple(mesh.points[5])


def test_a_singularity_without_room_is_located():
    alone = SurfaceMesh(np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]), np.array([[0, 1, 2]]))
    rotation = np.array([[QUARTER, 0.0, 0.0]])
    with pytest.raises(LayoutError, match="without interior vertex") as caught:
        snap_to_vertices(alone, rotation)
    assert np.allclose(caught.value.location, alone.points.mean(axis=0))
