import numpy as np
import pytest

from gmsh_crossquad.field.operators import FieldOperators
from gmsh_crossquad.field.singularities import to_integer, triangle_index, vertex_index
from gmsh_crossquad.field.smooth import edge_angle, from_angles, smooth_field, wrap

from .field_meshes import annulus, disc, grid, middles, square_corners


def test_axis_parallel_boundary_gives_the_constant_field():
    mesh = grid(8, 6, ((0, 4, 3, 6), (5, 6, 2, 3)))
    field = smooth_field(mesh, FieldOperators(mesh))
    assert np.abs(wrap(field.theta + edge_angle(mesh))).max() < 1e-12
    assert np.array_equal(to_integer(vertex_index(mesh, field.rotation), "index"), square_corners(mesh))


def test_annulus_gives_the_radial_field():
    mesh = annulus(0.4, 8, 48)
    field = smooth_field(mesh, FieldOperators(mesh))
    assert np.abs(wrap(field.theta + edge_angle(mesh) - np.angle(middles(mesh)))).max() < 0.01
    assert not np.any(triangle_index(field.rotation))


def test_disc_gives_four_singularities():
    mesh = disc(16, 40)
    field = smooth_field(mesh, FieldOperators(mesh))
    assert np.all(field.theta[mesh.boundary_edge] == 0.0)
    triangles = triangle_index(field.rotation)
    vertices = to_integer(vertex_index(mesh, field.rotation), "index")
    assert not np.any(vertices[mesh.boundary_vertex])
    both = np.concatenate([triangles, vertices])
    assert both.sum() == 4
    assert np.all(both >= 0)


@pytest.mark.parametrize("turn", [0.3, 1.0])
def test_the_field_turns_with_the_mesh(turn):
    mesh = grid(7, 5, ((2, 3, 1, 4),))
    c, s = np.cos(turn), np.sin(turn)
    turned = type(mesh)(mesh.points @ np.array([[c, s], [-s, c]]), mesh.triangles)
    a = smooth_field(mesh, FieldOperators(mesh))
    b = smooth_field(turned, FieldOperators(turned))
    assert np.abs(wrap(a.theta - b.theta)).max() < 1e-10


def test_rotation_is_the_least_turn():
    mesh = disc(4, 12)
    theta = np.random.default_rng(0).uniform(-9, 9, len(mesh.edges))
    field = from_angles(mesh, theta)
    assert np.abs(field.rotation).max() <= np.pi / 4 + 1e-12
    angle = field.theta[mesh.triangle_edges] + mesh.edge_direction
    assert np.abs(wrap(np.roll(angle, -1, axis=1) - angle - field.rotation)).max() < 1e-12
