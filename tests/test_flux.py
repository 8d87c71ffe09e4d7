import numpy as np
import pytest

from gmsh_crossquad.field.align import Aligner
from gmsh_crossquad.field.clearance import Clearance
from gmsh_crossquad.field.flux import flux_slope, vanish_flux
from gmsh_crossquad.field.operators import FieldOperators
from gmsh_crossquad.field.singularities import QUARTER, singular_vertices
from gmsh_crossquad.field.smooth import edge_angle
from gmsh_crossquad.records import CrossField

from .field_meshes import annulus, at, grid, middles, square_corners


def ready(mesh, wanted, vertices, index):
    aligner = Aligner(mesh, FieldOperators(mesh), wanted)
    z, a = middles(mesh), mesh.points[vertices] @ np.array([1, 1j])
    arms = z[mesh.triangle_edges][..., None] - a
    rotation = np.angle(np.roll(arms, -1, axis=1) / arms) @ (0.25 * np.array(index, float))
    theta = np.angle(z[:, None] - a) @ (0.25 * np.array(index, float)) - edge_angle(mesh)
    field = aligner.rotate(CrossField(theta, rotation)).field
    return aligner, field, Clearance(mesh, [aligner.loops[i].vertices for i in aligner.holes])


def flux(aligner, field):
    return aligner.flux(field.rotation)[aligner.holes]


def nowhere(mesh):
    return np.zeros(len(mesh.points), bool)


def plate():
    mesh = grid(30, 18, ((6, 9, 7, 10), (19, 23, 8, 11)))
    wanted = square_corners(mesh)
    for hole in mesh.loops[1:]:
        wanted[hole] = 0
    return mesh, wanted


def test_slope_is_the_derivative_by_finite_differences():
    mesh, wanted = plate()
    places = [(4, 4), (13, 4), (14, 14), (4, 13), (17, 5), (26, 4), (26, 14), (17, 15)]
    vertices, index = [at(mesh, *p) for p in places], [-1] * 7 + [-1]
    aligner, field, _ = ready(mesh, wanted, vertices, index)
    slope = flux_slope(aligner, np.array(vertices), np.array(index))
    assert slope.shape == (2, 8, 2)
    _, energy = aligner.harmonic()
    for k, step in ((0, (1, 0)), (2, (0, 1)), (4, (0, -1)), (5, (-1, 0)), (7, (0, 1))):
        change = []
        for sign in (1, -1):
            moved = list(vertices)
            moved[k] = at(mesh, *(np.array(places[k]) + sign * np.array(step)))
            value = flux(aligner, ready(mesh, wanted, moved, index)[1]) - flux(aligner, field)
            # another choice of the integers is no change of place
            change.append(value - QUARTER * energy @ np.rint(np.linalg.solve(energy, value) / QUARTER))
        assert slope[:, k] @ step == pytest.approx(0.5 * (change[0] - change[1]), abs=0.01, rel=0.08)


def test_flux_of_an_annulus_is_the_angle_between_its_singularities():
    # conjugate of alpha = log r / log(inner): F = - (pi/2) sum d_k phi_k / log(inner), modulo a whole turn
    inner = 0.4
    mesh = annulus(inner, 20, 120)
    for steps in (12, 30, 50):
        vertices = [10 * 120, 12 * 120 + steps]
        aligner, field, _ = ready(mesh, np.zeros(len(mesh.points), np.int64), vertices, [1, -1])
        expected = QUARTER * 2 * np.pi * steps / 120 / np.log(1 / inner)
        assert abs(flux(aligner, field)[0]) == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("index", [[1, -1], [-1, 1, 1, -1], [2, -2]])
def test_flux_of_an_annulus_vanishes(index):
    mesh = annulus(0.35, 14, 72)
    radius, angle = [0.6, 0.65, 0.75, 0.55], [0.0, 1.3, 2.9, 5.5]
    vertices = [at(mesh, r * np.cos(a), r * np.sin(a)) for r, a in zip(radius, angle)][: len(index)]
    aligner, field, clearance = ready(mesh, np.zeros(len(mesh.points), np.int64), vertices, index)
    assert abs(flux(aligner, field)[0]) > 1.0
    moved = vanish_flux(aligner, clearance, field, [], nowhere(mesh))
    assert np.abs(moved.flux).max() < 0.05
    assert np.allclose(moved.flux, flux(aligner, moved.field))
    assert sorted(moved.start) == sorted(vertices)
    before, after = (dict(zip(*(a.tolist() for a in singular_vertices(mesh, f.rotation)))) for f in (field, moved.field))
    assert [before[v] for v in moved.start.tolist()] == [after[v] for v in moved.end.tolist()]
    aligner.finish(aligner.rotate(moved.field), moved.field)


def test_singularities_that_pass_each_other_keep_apart():
    # on one circle, a quarter turn apart: they have to come to the same angle and can not be at the same place
    mesh = annulus(0.35, 16, 80)
    vertices = [at(mesh, 0.67, 0.0), at(mesh, 0.0, 0.67)]
    aligner, field, clearance = ready(mesh, np.zeros(len(mesh.points), np.int64), vertices, [1, -1])
    moved = vanish_flux(aligner, clearance, field, [], nowhere(mesh))
    assert np.abs(moved.flux).max() < 0.05
    p, q = mesh.points[moved.end]
    assert np.hypot(*(p - q)) > 0.1
    assert clearance.distance(mesh.points[moved.end])[0].min() > 0.08


def test_flux_of_two_holes_vanishes_or_is_reduced_to_a_part():
    mesh, wanted = plate()
    places = [(4, 4), (13, 4), (11, 15), (3, 9), (17, 5), (26, 4), (26, 14), (17, 15)]
    vertices = [at(mesh, *p) for p in places]
    aligner, field, clearance = ready(mesh, wanted, vertices, [-1] * 8)
    first = flux(aligner, field)
    assert np.abs(first).max() > 0.3
    none = vanish_flux(aligner, clearance, field, [], nowhere(mesh))
    half = vanish_flux(aligner, clearance, field, [], nowhere(mesh), 0.5)
    assert np.abs(none.flux).max() < 0.05
    assert np.allclose(half.flux, 0.5 * first, atol=0.05)

    def way(moved):
        return np.hypot(*(mesh.points[moved.end] - mesh.points[moved.start]).T).sum()

    assert way(half) < way(none)


def test_held_singularities_and_barred_vertices_stay():
    mesh = annulus(0.35, 14, 72)
    vertices = [at(mesh, 0.6, 0.0), at(mesh, 0.0, 0.7)]
    aligner, field, clearance = ready(mesh, np.zeros(len(mesh.points), np.int64), vertices, [1, -1])
    avoid = nowhere(mesh)
    free = vanish_flux(aligner, clearance, field, vertices[:1], avoid)
    assert vertices[0] in free.end.tolist()
    assert np.abs(free.flux).max() < 0.1
    avoid[free.end[free.end != vertices[0]]] = True
    other = vanish_flux(aligner, clearance, field, vertices[:1], avoid)
    assert not np.any(avoid[other.end])
    still = vanish_flux(aligner, clearance, field, vertices, nowhere(mesh))
    assert still.field is field
    assert np.array_equal(still.start, still.end)


def test_nothing_to_do_without_holes_or_singularities():
    mesh = annulus()
    aligner, field, clearance = ready(mesh, np.zeros(len(mesh.points), np.int64), [], [])
    assert vanish_flux(aligner, clearance, field, [], nowhere(mesh)).field is field
    square = grid(6, 6)
    aligner, field, clearance = ready(square, square_corners(square), [], [])
    assert vanish_flux(aligner, clearance, field, [], nowhere(square)).flux.shape == (0,)
