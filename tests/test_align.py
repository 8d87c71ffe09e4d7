import numpy as np
import pytest

from gmsh_crossquad.errors import LayoutError
from gmsh_crossquad.field.align import Aligner, align
from gmsh_crossquad.field.operators import FieldOperators
from gmsh_crossquad.field.singularities import QUARTER, snap_to_vertices
from gmsh_crossquad.field.smooth import edge_angle, wrap
from gmsh_crossquad.records import CrossField

from .field_meshes import annulus, at, disc, grid, middles, prescribed, singular_angle, square_corners


def zeros(mesh):
    return np.zeros(len(mesh.points), np.int64)


def exact_disc(z, a, index):
    return sum(d / 4 * (np.angle(z - p) + np.angle(1 - np.conj(p) * z)) for p, d in zip(a, index))


def disc_error(n):
    mesh = disc(6 * n, 16 * n)
    places, index = [(0.5, 0.0), (0.0, 0.5), (-0.5, 0.0), (0.0, -2 / 3), (-1 / 3, 0.0), (1 / 3, 0.0)], [1, 1, 1, 1, 1, -1]
    vertices = [at(mesh, *p) for p in places]
    a = mesh.points[vertices] @ np.array([1, 1j])
    field = prescribed(mesh, singular_angle(mesh, vertices, index))
    aligned = align(mesh, FieldOperators(mesh), field, zeros(mesh))
    assert aligned.residual < 1e-12
    assert {int(v): int(aligned.index[v]) for v in np.flatnonzero(aligned.index)} == dict(zip(vertices, index))
    z = middles(mesh)
    far = np.abs(z[:, None] - a).min(axis=1) > 0.15
    return np.abs(wrap(aligned.field.theta + edge_angle(mesh) - exact_disc(z, a, index)))[far].max()


def test_converges_to_the_exact_disc_field_with_order_two():
    coarse, fine = disc_error(4), disc_error(8)
    assert fine < 0.01
    assert np.log2(coarse / fine) > 1.7


@pytest.mark.parametrize("sign", [1, -1])
def test_jump_at_boundary_singularities(sign):
    # one interior and three boundary singularities of a quarter on a disc: with the jump - (pi/2) q the rotation closes
    mesh = disc(10, 36)
    v = at(mesh, 0.2, 0.1)
    field = prescribed(mesh, singular_angle(mesh, [v], [1]))
    wanted = zeros(mesh)
    wanted[[at(mesh, np.cos(a), np.sin(a)) for a in (0.0, 2.0, 4.0)]] = sign
    if sign > 0:
        aligned = align(mesh, FieldOperators(mesh), field, wanted)
        assert np.array_equal(aligned.index[mesh.boundary_vertex], wanted[mesh.boundary_vertex])
        assert aligned.residual < 1e-12
    else:
        with pytest.raises(LayoutError, match="off by 6 quarter turns"):
            align(mesh, FieldOperators(mesh), field, wanted)


def test_degree_along_loops():
    # outer loop 1 - sum I, holes -1 - sum I with the domain on the left
    mesh = grid(9, 5, ((1, 2, 1, 2), (5, 7, 2, 4)))
    aligner = Aligner(mesh, FieldOperators(mesh), square_corners(mesh))
    degree = [aligner.turning[loop.vertices].sum() / QUARTER for loop in aligner.loops]
    assert np.allclose(degree, [4 - 4, -4 + 4, -4 + 4], atol=1e-12)
    smooth = Aligner(annulus(), FieldOperators(annulus()), zeros(annulus()))
    assert np.allclose([smooth.turning[loop.vertices].sum() / QUARTER for loop in smooth.loops], [4, -4], atol=1e-12)


@pytest.mark.parametrize("sign", [1, -1])
def test_period_of_the_rotation_that_repairs_the_degree(sign):
    # the constant field has degree 0 around the hole of an annulus, target -4: D = -4 and psi = - D/4 arg(z) repairs it
    mesh = annulus()
    aligner = Aligner(mesh, FieldOperators(mesh), zeros(mesh))
    psi = sign * np.angle(middles(mesh))
    field = prescribed(mesh, psi)
    unchanged = np.array_equal(aligner.close(field.rotation), field.rotation)
    assert unchanged == (sign > 0)


def test_defect_of_a_hole_is_repaired():
    mesh = annulus(0.4, 8, 40)
    aligned = align(mesh, FieldOperators(mesh), prescribed(mesh, np.zeros(len(mesh.edges))), zeros(mesh))
    assert aligned.residual < 1e-12
    assert not np.any(aligned.index)
    assert np.abs(wrap(aligned.field.theta + edge_angle(mesh) - np.angle(middles(mesh)))).max() < 0.01


def holed():
    mesh = grid(12, 8, ((2, 4, 2, 4), (7, 9, 4, 6)))
    vertices = [at(mesh, 5.5, 2.5), at(mesh, 10, 2)]
    return mesh, FieldOperators(mesh), prescribed(mesh, singular_angle(mesh, vertices, [1, -1])), vertices


def test_free_integers_minimise_the_energy():
    mesh, operators, field, _ = holed()
    aligner = Aligner(mesh, operators, square_corners(mesh))
    closed = aligner.close(field.rotation)
    x = aligner.solve(field.theta, closed, closed)
    basis, _ = aligner.harmonic()
    best, periods, _, _ = aligner.rotate(field)
    energies = {
        (i, j): operators.energy(closed + operators.difference(x + QUARTER * basis @ [i, j]))
        for i in range(-4, 5)
        for j in range(-4, 5)
    }
    assert operators.energy(best.rotation) == pytest.approx(min(energies.values()), rel=1e-12)
    assert energies[tuple(periods[1:].tolist())] == min(energies.values())
    assert periods[0] == 0


def test_result_does_not_depend_on_the_winding_of_the_input():
    mesh, operators, field, vertices = holed()
    wanted = square_corners(mesh)
    plain = align(mesh, operators, field, wanted)
    ramp = 3 * QUARTER * Aligner(mesh, operators, wanted).harmonic()[0][:, 1]
    wound = CrossField(field.theta + ramp, field.rotation + operators.difference(ramp))
    other = align(mesh, operators, wound, wanted)
    assert other.periods[2] == plain.periods[2] - 3
    assert np.abs(wrap(other.field.theta - plain.field.theta)).max() < 1e-9
    assert [plain.index[v] for v in vertices] == [1, -1]


def test_flux_is_balanced_and_is_the_derivative_of_the_energy():
    mesh, operators, field, _ = holed()
    wanted = square_corners(mesh)
    aligned = align(mesh, operators, field, wanted)
    assert aligned.flux.sum() == pytest.approx(0.0, abs=1e-9)
    basis, _ = Aligner(mesh, operators, wanted).harmonic()
    for column in range(2):
        step = 1e-4 * operators.difference(basis[:, column])
        up, down = operators.energy(aligned.field.rotation + step), operators.energy(aligned.field.rotation - step)
        assert aligned.flux[1 + column] == pytest.approx((up - down) / 2e-4, abs=1e-6)


def test_indices_that_contradict_poincare_hopf_are_refused():
    mesh = disc(6, 18)
    field = prescribed(mesh, singular_angle(mesh, [0], [3]))
    with pytest.raises(LayoutError, match="off by 1 quarter turns"):
        align(mesh, FieldOperators(mesh), field, zeros(mesh))


def test_singularities_in_triangles_are_snapped_first():
    mesh = disc(12, 24)
    z = sum(np.angle(middles(mesh) - p) / 4 for p in (0.31 + 0.02j, -0.32 + 0.1j, 0.02 + 0.41j, -0.03 - 0.37j))
    rotation = snap_to_vertices(mesh, prescribed(mesh, z).rotation)
    aligned = align(mesh, FieldOperators(mesh), CrossField(prescribed(mesh, z).theta, rotation), zeros(mesh))
    assert sorted(aligned.index[aligned.index != 0]) == [1, 1, 1, 1]


def rough(mesh, vertices, index):
    """A field with these singularities that is far from harmonic and not aligned."""
    x, y = mesh.points.T[:, mesh.edges].mean(axis=2)
    return prescribed(mesh, singular_angle(mesh, vertices, index) + 0.2 * np.sin(3 * x) * np.cos(2 * y) + 0.3)


def test_a_kept_field_is_turned_by_a_harmonic_angle():
    mesh, operators, _, vertices = holed()
    given = rough(mesh, vertices, [1, -1])
    aligned = align(mesh, operators, given, square_corners(mesh), given)
    assert aligned.residual < 1e-12
    assert [aligned.index[v] for v in vertices] == [1, -1]
    assert np.count_nonzero(aligned.index[~mesh.boundary_vertex]) == 2
    assert np.abs(wrap(aligned.field.theta - given.theta - aligned.phi - aligned.psi)).max() < 1e-12
    free = operators.free
    assert np.abs(operators.divergence(operators.difference(aligned.phi))[free]).max() < 1e-11
    smoothest = align(mesh, operators, given, square_corners(mesh))
    assert operators.energy(aligned.field.rotation) > operators.energy(smoothest.field.rotation)
    assert np.array_equal(aligned.index, smoothest.index)


def test_an_aligned_field_comes_out_as_it_went_in():
    mesh, operators, _, vertices = holed()
    first = align(mesh, operators, rough(mesh, vertices, [1, -1]), square_corners(mesh), rough(mesh, vertices, [1, -1]))
    again = align(mesh, operators, first.field, square_corners(mesh), first.field)
    assert np.abs(again.phi + again.psi).max() < 1e-12
    assert np.abs(again.field.rotation - first.field.rotation).max() < 1e-12
    assert not again.periods.any()


@pytest.mark.parametrize("quarters", [-3, 2, 4])
def test_period_of_psi_is_the_defect(quarters):
    # + (pi/2) D with D = target - degree; the printed sign gives the opposite
    mesh = annulus()
    given = prescribed(mesh, (1 - quarters / 4) * np.angle(middles(mesh)))
    aligner = Aligner(mesh, FieldOperators(mesh), zeros(mesh))
    rotated = aligner.rotate(given, given.rotation)
    aligned = aligner.finish(rotated, given)
    (hole,) = aligner.holes
    turn = aligner.operators.difference(aligned.psi) + rotated.closed - given.rotation
    through = np.bincount(mesh.triangles.ravel(), np.roll(turn, 1, axis=1).ravel(), len(mesh.points))
    # the hole is clockwise: the target is -4, the degree -4 + quarters, D = - quarters
    assert through[aligner.loops[hole].vertices].sum() == pytest.approx(-quarters * QUARTER, abs=1e-11)
    assert np.abs(aligned.psi[mesh.boundary_edge]).max() == 0.0
