import numpy as np
import pytest

from gmsh_crossquad.field.align import Aligner
from gmsh_crossquad.field.boundary import correct_boundary
from gmsh_crossquad.field.clearance import Clearance
from gmsh_crossquad.field.forces import forces, gradient
from gmsh_crossquad.field.operators import FieldOperators
from gmsh_crossquad.field.relax import attraction, leave_corners, relax_singularities
from gmsh_crossquad.field.singularities import (
    singular_vertices,
    snap_to_vertices,
    to_integer,
    triangle_index,
    vertex_index,
)
from gmsh_crossquad.field.smooth import smooth_field
from gmsh_crossquad.field.surface_mesh import SurfaceMesh

from .field_meshes import annulus, at, disc, grid, middles, prescribed, singular_angle, square_corners
from .models import background, wedge


def disc_energy(a, index):
    """Energy of quarter-turn singularities in the aligned unit disc, without the constant of the cores."""
    total = 0.0
    for i in range(len(a)):
        for j in range(len(a)):
            part = np.log(abs(1 - a[i] * np.conj(a[j])))
            if i != j:
                part += np.log(abs(a[i] - a[j]))
            total -= np.pi / 16 * index[i] * index[j] * part
    return total


def test_force_is_the_derivative_of_the_exact_energy():
    mesh = disc(48, 128)
    a, index = np.array([0.3 + 0.1j, -0.4 + 0.05j]), [1, -1]
    theta = sum(d / 4 * (np.angle(middles(mesh) - p) + np.angle(1 - np.conj(p) * middles(mesh))) for p, d in zip(a, index))
    rotation = prescribed(mesh, theta).rotation
    found = forces(mesh, rotation, np.stack([a.real, a.imag], axis=1), np.array([0.3, 0.3]))
    for k in range(2):
        for c, unit in enumerate((1, 1j)):
            step = 1e-5 * unit * np.eye(2)[k]
            slope = (disc_energy(a + step, index) - disc_energy(a - step, index)) / 2e-5
            assert found[k, c] == pytest.approx(-slope, abs=0.01)


def test_gradient_of_a_linear_angle():
    mesh = disc(5, 12)
    middle = mesh.points[mesh.edges].mean(axis=1)
    rotation = FieldOperators(mesh).difference(0.2 * middle[:, 0] - 0.1 * middle[:, 1])
    assert np.allclose(gradient(mesh, rotation), [0.2, -0.1], atol=1e-12)


def test_clearance_of_an_annulus():
    mesh = annulus(0.4, 12, 96)
    clearance = Clearance(mesh, [mesh.loops[1]])
    distance, away = clearance.distance(np.array([[0.5, 0.0], [0.0, 0.8]]))
    assert np.allclose(distance, [0.1, 0.2], atol=2e-3)
    assert np.allclose(away, [[1.0, 0.0], [0.0, -1.0]], atol=0.02)
    # 0.4 of the half width, which is less than 0.6 of the hole's radius
    assert np.allclose(clearance.wanted(np.array([[0.5, 0.0], [0.0, 0.8]])), 0.12, atol=2e-3)


def test_clearance_of_a_small_hole_is_its_own_size():
    mesh = grid(30, 30, ((14, 16, 14, 16),))
    clearance = Clearance(mesh, [mesh.loops[1]])
    assert clearance.wanted(np.array([[16.5, 15.0]]))[0] == pytest.approx(0.6 * 8 / (2 * np.pi))


def test_free_length_of_a_square_corner():
    mesh = grid(20, 20)
    direction = np.array([1.0, 1.0]) / np.sqrt(2)
    free = Clearance(mesh, []).free_length(np.zeros(2), direction, np.sin(np.pi / 4), 1.0)
    # distance to the far sides falls below 0.8 t / sqrt(2) where t (1 + 0.8) = 20 sqrt(2)
    assert free == pytest.approx(20 * np.sqrt(2) / 1.8, rel=0.3)


@pytest.mark.parametrize("degrees", [45, 135, 225, 315])
def test_half_way_corners_are_indifferent(degrees):
    quads = round(degrees / 90 + 0.5)
    assert attraction(np.radians(degrees), quads, 1) == pytest.approx(0.0, abs=1e-12)
    assert attraction(np.radians(degrees - 1), quads, 1) > 0 > attraction(np.radians(degrees + 1), quads, 1)


def test_boundary_correction_moves_what_is_missing_inside():
    mesh = disc(10, 32)
    field = smooth_field(mesh, FieldOperators(mesh))
    wanted = np.zeros(len(mesh.points), np.int64)
    wanted[[at(mesh, 1, 0), at(mesh, -1, 0)]] = [1, -1]
    rotation = correct_boundary(mesh, field.rotation, wanted)
    found = vertex_index(mesh, rotation)
    assert np.allclose(found[mesh.boundary_vertex], wanted[mesh.boundary_vertex], atol=1e-9)
    assert np.allclose(found[~mesh.boundary_vertex], vertex_index(mesh, field.rotation)[~mesh.boundary_vertex], atol=1e-12)
    moved = triangle_index(rotation) - triangle_index(field.rotation)
    assert sorted(moved[moved != 0]) == [-1, 1]
    for t in np.flatnonzero(moved):
        assert wanted[mesh.triangles[t]].sum() == -moved[t]


def test_boundary_correction_prefers_annihilation():
    mesh = grid(8, 8)
    operators = FieldOperators(mesh)
    field = smooth_field(mesh, operators)
    corner = at(mesh, 0, 0)
    t = int(mesh.star(corner)[0] // 3)
    k = int(np.flatnonzero(mesh.triangles[t] == corner)[0])
    rotation = field.rotation.copy()
    rotation[t, (k + 2) % 3] += np.pi / 2
    wanted = to_integer(vertex_index(mesh, field.rotation), "index")
    assert not np.array_equal(np.rint(vertex_index(mesh, rotation)), wanted)
    assert np.allclose(correct_boundary(mesh, rotation, wanted), field.rotation, atol=1e-12)


def test_singularities_leave_a_hole():
    mesh = grid(24, 24, ((10, 14, 10, 14),))
    operators = FieldOperators(mesh)
    wanted = square_corners(mesh)
    hole = mesh.loops[1]
    wanted[hole] = 0
    vertices = [at(mesh, x, y) for x, y in ((9, 9), (15, 9), (15, 15), (9, 15))]
    aligner = Aligner(mesh, operators, wanted)
    field = aligner.rotate(prescribed(mesh, singular_angle(mesh, vertices, [-1] * 4))).field
    clearance = Clearance(mesh, [hole])
    nowhere = np.zeros(len(mesh.points), bool)
    far = singular_vertices(mesh, relax_singularities(aligner, clearance, field, [], nowhere).rotation)
    assert far[1].tolist() == [-1] * 4
    places = mesh.points[far[0]]
    assert np.all(clearance.distance(places)[0] > 0.6 * clearance.wanted(places))
    held = relax_singularities(aligner, clearance, field, vertices, nowhere)
    assert sorted(singular_vertices(mesh, held.rotation)[0]) == sorted(vertices)


@pytest.mark.parametrize("degrees", [15, 30])
def test_singularity_of_a_sharp_corner_goes_to_the_bisector(degrees):
    face = background(wedge(np.radians(degrees)), 0.03)[0]
    mesh = SurfaceMesh(face.points, face.triangles)
    operators = FieldOperators(mesh)
    tip = int(np.nanargmin(face.opening_angle))
    wanted = np.zeros(len(mesh.points), np.int64)
    wanted[np.isfinite(face.opening_angle)] = 1
    field = smooth_field(mesh, operators)
    rotation = snap_to_vertices(mesh, correct_boundary(mesh, field.rotation, wanted))
    assert singular_vertices(mesh, rotation)[1].tolist() == [1]
    nowhere = np.zeros(len(mesh.points), bool)
    moved, held = leave_corners(mesh, Clearance(mesh, []), rotation, wanted, np.array([tip]), nowhere)
    vertices, index = singular_vertices(mesh, moved)
    assert index.tolist() == [1]
    assert held == vertices.tolist()
    v = mesh.points[vertices[0]] - mesh.points[tip]
    # unit radius over the scale of the model
    radius = np.hypot(*(mesh.points - mesh.points[tip]).T).max()
    assert 0.3 * radius < np.hypot(*v) < 0.8 * radius
    centre = mesh.points.mean(axis=0) - mesh.points[tip]
    assert abs(v[0] * centre[1] - v[1] * centre[0]) / np.hypot(*v) / np.hypot(*centre) < np.sin(np.radians(degrees) / 4)


def test_room_is_shared_between_neighbours():
    clearance = Clearance(grid(20, 20), [])
    room = clearance.room(np.array([[10.0, 10.0], [13.0, 10.0], [2.0, 10.0]]))
    assert np.allclose(room, [1.5, 1.5, 2.0], atol=0.01)
    assert clearance.room(np.array([[10.0, 10.0]]))[0] == pytest.approx(10.0, abs=0.01)
