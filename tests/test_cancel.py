import numpy as np
import pytest

from gmsh_crossquad.field.align import Aligner
from gmsh_crossquad.field.cancel import _Energies, _paths, cancel_pairs
from gmsh_crossquad.field.operators import FieldOperators
from gmsh_crossquad.field.pipeline import aligned_field
from gmsh_crossquad.field.singularities import move_index, singular_vertices
from gmsh_crossquad.field.surface_mesh import SurfaceMesh
from gmsh_crossquad.records import CrossField

from . import models
from .field_meshes import annulus, at, disc, grid, prescribed, singular_angle, square_corners


def graph(mesh):
    import scipy.sparse as sp

    a, b = mesh.edges[~mesh.boundary_vertex[mesh.edges].any(axis=1)].T
    n = len(mesh.points)
    return sp.coo_matrix((np.hypot(*(mesh.points[a] - mesh.points[b]).T), (a, b)), (n, n)).tocsr()


def aligned(mesh, wanted, vertices, index):
    aligner = Aligner(mesh, FieldOperators(mesh), wanted)
    return aligner, aligner.rotate(prescribed(mesh, singular_angle(mesh, vertices, index))).field


def remaining(aligner, field):
    return singular_vertices(aligner.mesh, cancel_pairs(aligner, field).rotation)[1].tolist()


HOLES = ((4, 7, 4, 7), (12, 15, 6, 8), (6, 8, 12, 15))


@pytest.mark.parametrize("holes", [(), HOLES[:1], HOLES])
def test_the_quadratic_form_is_the_energy(holes):
    mesh = grid(20, 18, holes)
    vertices = [at(mesh, *p) for p in ((2, 9), (10, 10), (17, 4), (16, 15))]
    aligner, field = aligned(mesh, square_corners(mesh), vertices, [1, -1, 2, -2])
    paths = _paths(graph(mesh), np.array(vertices))
    energies = _Energies(aligner, field, paths, [])
    before = aligner.operators.energy(field.rotation)
    for amount in ([0, 0, 0, 0], [0, -1, 0, 0], [0, -1, 1, -1], [0, -1, 2, -2], [0, 3, -1, 2]):
        rotation = field.rotation.copy()
        for path, n in zip(paths, amount):
            move_index(mesh, rotation, path, n)
        after = aligner.operators.energy(aligner.rotate(CrossField(field.theta, rotation)).field.rotation)
        assert energies.best(np.array(amount))[0] == pytest.approx(after - before, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("places", [((4, 4), (5, 4)), ((3, 3), (20, 17)), ((3, 20), (12, 3))])
def test_a_square_needs_no_pair_at_any_distance(places):
    mesh = grid(24, 24)
    aligner, field = aligned(mesh, square_corners(mesh), [at(mesh, *p) for p in places], [1, -1])
    assert len(singular_vertices(mesh, field.rotation)[0]) == 2
    cleared = cancel_pairs(aligner, field)
    assert len(singular_vertices(mesh, cleared.rotation)[0]) == 0
    assert aligner.operators.energy(cleared.rotation) == pytest.approx(0.0, abs=1e-12)


def test_pairs_across_the_hole_of_a_ring():
    mesh = annulus(0.3, 12, 60)
    vertices = [at(mesh, 0.6, 0), at(mesh, -0.6, 0), at(mesh, 0, 0.7), at(mesh, 0, -0.5)]
    aligner, field = aligned(mesh, np.zeros(len(mesh.points), np.int64), vertices, [1, -1, 1, -1])
    cleared = cancel_pairs(aligner, field)
    assert len(singular_vertices(mesh, cleared.rotation)[0]) == 0
    # the field of polar coordinates, |grad theta| = 1 / r
    assert aligner.operators.energy(cleared.rotation) == pytest.approx(np.pi * np.log(1 / 0.3), rel=0.01)


@pytest.mark.parametrize("apart, kept", [(1, []), (16, [-1, 1])])
def test_a_pair_that_unwinds_a_strip_is_kept(apart, kept):
    # without the pair the field turns by 90 degrees from side to side over this length: 1/2 (pi/2)^2 apart / 4
    mesh = grid(32, 4)
    left, right = 16 - apart // 2, 16 - apart // 2 + apart
    wanted = square_corners(mesh)
    wanted[[at(mesh, left, 0), at(mesh, right, 0)]] = [1, -1]
    aligner, field = aligned(mesh, wanted, [at(mesh, left, 1), at(mesh, right, 1)], [-1, 1])
    assert sorted(remaining(aligner, field)) == kept


def test_the_pair_that_costs_least_goes():
    mesh = disc(16, 64)
    four = [at(mesh, *(0.6 * np.array([np.cos(a), np.sin(a)]))) for a in np.pi / 2 * np.arange(4)]
    centre, extra = at(mesh, 0.1, 0.1), at(mesh, 0.2, 0.1)
    aligner, field = aligned(mesh, np.zeros(len(mesh.points), np.int64), [*four, centre, extra], [1, 1, 1, 1, -1, 1])
    left, index = singular_vertices(mesh, cancel_pairs(aligner, field).rotation)
    assert sorted(left) == sorted(four)
    assert index.tolist() == [1] * 4


def test_singularities_of_one_sign_stay_as_they_are():
    mesh = disc(8, 32)
    four = [at(mesh, *(0.6 * np.array([np.cos(a), np.sin(a)]))) for a in np.pi / 2 * np.arange(4)]
    aligner, field = aligned(mesh, np.zeros(len(mesh.points), np.int64), four, [1] * 4)
    assert cancel_pairs(aligner, field) is field


def test_components_are_cancelled_separately():
    one, other = grid(8, 8), grid(8, 8)
    points = np.concatenate([one.points, other.points + [20.0, 0.0]])
    mesh = SurfaceMesh(points, np.concatenate([one.triangles, other.triangles + len(one.points)]))
    places = [(2, 2), (6, 6), (22, 5), (25, 3)]
    aligner, field = aligned(mesh, square_corners(mesh), [at(mesh, *p) for p in places], [1, -1, -1, 1])
    assert len(singular_vertices(mesh, field.rotation)[0]) == 4
    assert remaining(aligner, field) == []


@pytest.mark.parametrize("inner, off", [(0.15, 0.3), (0.2, 0.45), (0.3, 0.55)])
def test_eccentric_rings_have_no_singularities(inner, off):
    turn = 2 * np.pi * np.arange(24) / 24
    hole = [(off + inner * np.cos(a), -inner * np.sin(a)) for a in turn]
    rim = [(np.cos(a), np.sin(a)) for a in turn]
    mesh = models.background(models.polygon(rim, [hole]), 0.05)[0]
    wanted = np.zeros(len(mesh.points), np.int64)
    index = aligned_field(mesh, boundary_index=wanted).index
    assert not np.any(index[~SurfaceMesh(mesh.points, mesh.triangles).boundary_vertex])
