"""Points that must be vertices of the background mesh."""

import models
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gmsh_crossquad.cad.background import background_meshes, face_meshes
from gmsh_crossquad.cad.inside import curve_distance, inside
from gmsh_crossquad.cad.seeds import face_seeds
from gmsh_crossquad.cad.session import guest
from gmsh_crossquad.errors import FieldError
from gmsh_crossquad.field.surface_mesh import SurfaceMesh
from gmsh_crossquad.options import MeshOptions

SQUARE = [(0, 0), (1, 0), (1, 1), (0, 1)]
# a frame whose plane is x + 2 y + 2 z = 0
TILTED = np.array([[2.0, -2.0, 1.0], [2.0, 1.0, -2.0]]) / 3.0


def flat(*points):
    return np.array([(x, y, np.nan) for x, y in points])


def meshes(model, *points, options=None):
    with guest():
        seeds = face_seeds(model, flat(*points))
        return seeds, background_meshes(model, options or MeshOptions(), seeds)


def neighbours(mesh, vertex):
    return set(mesh.triangles[(mesh.triangles == vertex).any(axis=1)].ravel().tolist()) - {vertex}


def assert_roomy(mesh):
    """Every special inner vertex has a ring of its own of at least 4 regular inner vertices."""
    surface = SurfaceMesh(mesh.points, mesh.triangles)
    special = np.flatnonzero((mesh.seed >= 0) | ((mesh.vertex >= 0) & ~surface.boundary_vertex)).tolist()
    assert not surface.boundary_vertex[special].any()
    for v in special:
        ring = neighbours(mesh, v)
        assert len(ring) >= 4
        assert not surface.boundary_vertex[list(ring)].any()
        assert not ring & set(special)


# ---- where points are


@given(st.lists(st.tuples(st.floats(-0.5, 2.5), st.floats(-0.5, 2.5)), min_size=1, max_size=20))
@settings(max_examples=50, deadline=None)
def test_inside_and_distance_of_a_frame(points):
    """A square [0, 2]^2 with the hole [.5, 1]^2."""
    model = models.polygon([(0, 0), (2, 0), (2, 2), (0, 2)], holes=[[(0.5, 0.5), (0.5, 1), (1, 1), (1, 0.5)]])
    p = np.array(points)
    local = (np.column_stack([p, np.zeros(len(p))]) - model.origin) / model.scale
    distance, _ = curve_distance(model, 0, local[:, :2])

    def to_square(low, high):  # signed, positive outside
        d = np.abs(p - 0.5 * (low + high)) - 0.5 * (high - low)
        return np.linalg.norm(np.maximum(d, 0), axis=1) + np.minimum(d.max(axis=1), 0)

    outer, hole = to_square(0.0, 2.0), to_square(0.5, 1.0)
    np.testing.assert_allclose(distance * model.scale, np.minimum(np.abs(outer), np.abs(hole)), atol=1e-12)
    clear = distance > 1e-9
    np.testing.assert_array_equal(inside(model, 0, local[:, :2])[clear], ((outer < 0) & (hole > 0))[clear])


def test_nearest_curve():
    model = models.square()
    assert curve_distance(model, 0, model.faces[0].local(model.curves[2].points[1:2] * 0.9))[1].tolist() == [2]


def test_seeds_of_every_face():
    model = models.two_materials()
    points = flat((0.1, 0.1), (0.5, 0.5), (5, 5), (0.9, 0.1))
    outer, disc = face_seeds(model, points)
    np.testing.assert_allclose(
        model.faces[0].world(outer) * model.scale + model.origin, [(0.1, 0.1, 0), (0.9, 0.1, 0)], atol=1e-12
    )
    np.testing.assert_allclose(model.faces[1].world(disc) * model.scale + model.origin, [(0.5, 0.5, 0)], atol=1e-12)


def test_point_in_a_hole_is_no_seed():
    assert face_seeds(models.annulus(), flat((0, 0), (0.1, 0)))[0].shape == (0, 2)


def test_heights():
    model = models.build(SQUARE, [(i, (i + 1) % 4, models.line(SQUARE[i], SQUARE[(i + 1) % 4])) for i in range(4)],
                         [([[(i, 1) for i in range(4)]], [], [])], axes=TILTED)  # fmt: skip
    where = np.array([0.3, 0.6]) @ TILTED
    expected = (where - model.origin) / model.scale @ TILTED.T
    for point in (where, [where[0], where[1], np.nan]):
        np.testing.assert_allclose(face_seeds(model, np.array([point]))[0], [expected], atol=1e-12)
    normal = np.array([1, 2, 2]) / 3
    assert len(face_seeds(model, (where + 1e-7 * normal)[None])[0]) == 1
    assert len(face_seeds(model, (where + 1e-4 * normal)[None])[0]) == 0


def test_upright_face_needs_three_coordinates():
    upright = np.array([[1.0, 0, 0], [0, 0, 1.0]])
    model = models.build(SQUARE, [(i, (i + 1) % 4, models.line(SQUARE[i], SQUARE[(i + 1) % 4])) for i in range(4)],
                         [([[(i, 1) for i in range(4)]], [], [])], axes=upright)  # fmt: skip
    with pytest.raises(FieldError, match="upright face, surface 1: give three coordinates"):
        face_seeds(model, flat((0.5, 0.5)))
    assert len(face_seeds(model, np.array([(0.5, 0.0, 0.5)]))[0]) == 1


@pytest.mark.parametrize("y", [0.0, 1e-8, -1e-8])
def test_seed_on_the_boundary(y):
    with pytest.raises(FieldError, match=r"singularity on the boundary, surface 1 at \(0.5, .*boundary index"):
        face_seeds(models.square(), flat((0.5, y)))


def test_seed_on_an_embedded_curve():
    model = models.square_with_crack()
    with pytest.raises(FieldError, match="on the boundary"):
        face_seeds(model, flat((0.5, 0.5)))
    with pytest.raises(FieldError, match="on the boundary"), guest():
        background_meshes(model, MeshOptions(), (model.faces[0].local(model.vertices[[4]]),))


def test_embedded_point_is_no_seed():
    model = models.polygon(SQUARE, embedded_points=[(0.3, 0.4)])
    (seeds,) = face_seeds(model, flat((0.3, 0.4), (0.6, 0.4)))
    assert len(seeds) == 1


# ---- the mesh


@pytest.mark.parametrize(
    ("model", "points"),
    [
        (models.disc(), [(-0.4, 0), (0.4, 0), (0.0, 0.999), (0.001, 0.3), (0.0, 0.3)]),
        (models.square(), [(0.5, 1e-4), (0.1, 0.1), (0.1, 0.1001)]),
        (models.annulus(), [(0.41, 0), (0, 0.7), (0.99, 0.0)]),
        (models.square_with_crack(), [(0.5, 0.502), (0.71, 0.5)]),
        (models.l_shape(), [(1.001, 0.999), (0.5, 0.5), (0.999, 0.999)]),
    ],
    ids=["disc", "square", "annulus", "crack", "l_shape"],
)
def test_seeds_are_vertices_with_room(model, points):
    (seeds,), (mesh,) = meshes(model, *points)
    rows = np.flatnonzero(mesh.seed >= 0)
    assert sorted(mesh.seed[rows].tolist()) == list(range(len(points)))
    assert (mesh.points[rows] == seeds[mesh.seed[rows]]).all()
    assert (mesh.vertex[rows] == -1).all()
    assert_roomy(mesh)
    assert len(mesh.triangles) < 8000


@given(st.lists(st.tuples(st.floats(0.02, 0.95), st.floats(0, 6.28)), min_size=2, max_size=4, unique=True), st.floats(1e-3, 0.1))
@settings(max_examples=8, deadline=None)
def test_random_seeds_have_room(polar, apart):
    points = [(r * np.cos(a), r * np.sin(a)) for r, a in polar]
    points.append((points[0][0], points[0][1] + apart * (1 if points[0][1] < 0 else -1)))
    if min(np.hypot(p[0] - q[0], p[1] - q[1]) for i, p in enumerate(points) for q in points[:i]) < 1e-5:
        return
    _, (mesh,) = meshes(models.disc(), *points)
    assert (mesh.seed >= 0).sum() == len(points)
    assert_roomy(mesh)


def test_embedded_points_have_room():
    model = models.polygon(SQUARE, embedded_points=[(0.5, 0.01), (0.5, 0.012), (0.3, 0.4)])
    (mesh,) = meshes(model)[1]
    assert (mesh.vertex >= 4).sum() == 3
    assert_roomy(mesh)


def test_seeds_of_two_faces_and_their_common_curve():
    model = models.two_materials()
    seeds, (outer, inner) = meshes(model, (0.5, 0.751), (0.1, 0.1), (0.5, 0.5), (0.5, 0.52))
    assert [len(s) for s in seeds] == [2, 2]
    assert [sorted(m.seed[m.seed >= 0].tolist()) for m in (outer, inner)] == [[0, 1], [0, 1]]
    nodes = [set(m.boundary_arclength[m.boundary_curve == 4].ravel().tolist()) for m in (outer, inner)]
    assert nodes[0] == nodes[1]
    assert_roomy(outer)
    assert_roomy(inner)


def test_without_seeds_nothing_is_marked():
    for m in meshes(models.two_squares())[1]:
        assert m.seed.shape == (len(m.points),)
        assert (m.seed == -1).all()


def test_far_seed_changes_only_its_surroundings():
    """The sizes of the triangles away from a seed in the middle stay as they are."""
    model = models.square()
    (plain,), (seeded,) = meshes(model)[1], meshes(model, (0.5, 0.5))[1]
    assert abs(len(seeded.triangles) - len(plain.triangles)) < 0.02 * len(plain.triangles)


def test_uniform_background_takes_seeds_too():
    model = models.square()
    seeds = face_seeds(model, flat((0.52, 0.47)))
    spacing = tuple(np.linspace(0.0, c.length, 12) for c in model.curves)
    with guest():
        (mesh,) = face_meshes(model, spacing, np.array([0.05]), seeds)
    (row,) = np.flatnonzero(mesh.seed == 0)
    assert (mesh.points[row] == seeds[0][0]).all()
