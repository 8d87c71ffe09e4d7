"""The formulas of the paper whose printed sign or factor is wrong: each test fails with the printed one.

The numbers in front are those of "Quadrilateral mesh of non-simply connected domain and non-planar surfaces from a given
cross-field"; the table in validation/paper/README.md tells what is printed and what is right.
"""

import numpy as np
import pytest
import scipy.sparse as sp

from gmsh_crossquad.field.align import Aligner, align
from gmsh_crossquad.field.corners import default_index
from gmsh_crossquad.field.ginzburg_landau import minimise_energy
from gmsh_crossquad.field.operators import FieldOperators, factor
from gmsh_crossquad.field.singularities import QUARTER, corner_rotation, vertex_index
from gmsh_crossquad.field.smooth import edge_angle, wrap
from gmsh_crossquad.records import CrossField

from .field_meshes import annulus, at, disc, grid, middles, prescribed, singular_angle, square_corners


def zeros(mesh):
    return np.zeros(len(mesh.points), np.int64)


def test_formula_1_has_a_square():
    # 1/(4 eps^2) int (|u|^2 - 1)^2: unit length is best; without the square u = 0 is
    mesh, epsilon = disc(10, 32), 0.1
    operators = FieldOperators(mesh)
    z = np.zeros((len(mesh.edges), 2))
    z[:, 0] = 0.5
    assert minimise_energy(mesh, operators, z, epsilon)[1][0] == pytest.approx(0.75**2 * mesh.area.sum() / (4 * epsilon**2))
    z[operators.fixed, 0] = 1.0
    best, energies = minimise_energy(mesh, operators, z, epsilon)
    assert np.abs(best - [1.0, 0.0]).max() < 1e-5
    assert energies[-1] < 1e-9
    mass = np.bincount(mesh.triangle_edges.ravel(), np.repeat(mesh.area / 3, 3), len(mesh.edges))[operators.free]
    printed = factor((operators.inner + sp.diags(mass / (2 * epsilon**2))).tocsc())
    inside = printed.solve(operators.load(z[:, 0]))
    middle = np.argmin(np.abs(middles(mesh)[operators.free]))
    assert inside[middle] < 0.02


def test_table_1_a_right_angle_has_index_one_quarter():
    # the constant field is aligned with a square; its index at the corners is measured
    mesh = grid(4, 4)
    constant = prescribed(mesh, np.zeros(len(mesh.edges)))
    corner = mesh.boundary_vertex & np.isclose(mesh.angle_sum, np.pi / 2)
    measured = vertex_index(mesh, constant.rotation)
    assert np.allclose(measured[corner], 1.0, atol=1e-12)
    assert np.allclose(measured[~corner], 0.0, atol=1e-12)
    assert default_index(np.pi * np.array([0.5, 1.0, 1.5, 2.0])).tolist() == [1, 0, -1, -2]


def test_formulas_14_and_15_jump_along_the_boundary():
    # domain on the left, the cross turns by + (pi - b - 2 pi I) at a node; with - phi misses 1.5 - 6/n turns on an n-gon
    n = 36
    mesh = disc(10, n)
    field = prescribed(mesh, singular_angle(mesh, [at(mesh, 0.2, 0.1)], [1]))
    nodes = [at(mesh, np.cos(a), np.sin(a)) for a in (0.0, 2.0, 4.0)]
    wanted = zeros(mesh)
    wanted[nodes] = 1
    aligned = align(mesh, FieldOperators(mesh), field, wanted)
    jump = np.pi - mesh.angle_sum[nodes] - 2 * np.pi * 0.25
    assert np.allclose(corner_rotation(mesh, aligned.field.rotation)[nodes], jump, atol=1e-11)
    (loop,) = mesh.loops
    steps = (mesh.curvature - QUARTER * wanted - corner_rotation(mesh, field.rotation))[loop]
    assert steps.sum() == pytest.approx(0.0, abs=1e-10)
    assert abs(steps.sum() - 2 * jump.sum()) / (2 * np.pi) == pytest.approx(1.5 - 6 / n)


@pytest.mark.parametrize(
    "mesh, angle, index, degrees",
    [
        (grid(4, 4), lambda z: 0 * z.real, 1, [1 - 4 / 4]),
        (disc(8, 24), lambda z: sum(np.angle(z - a) / 4 for a in (0.5, 0.5j, -0.5, -0.5j)), 0, [1]),
        (annulus(), np.angle, 0, [1, -1]),
        (grid(6, 6, ((2, 4, 2, 4),)), lambda z: 0 * z.real, 1, [1 - 4 / 4, -1 - -4 / 4]),
    ],
    ids=["square", "disc", "annulus", "square with a square hole"],
)
def test_formula_17_degrees(mesh, angle, index, degrees):
    # outer loop 1 - sum I, hole -1 - sum I with the domain on the left: these fields need nothing moved
    wanted = square_corners(mesh) if index else zeros(mesh)
    aligner = Aligner(mesh, FieldOperators(mesh), wanted)
    found = [aligner.turning[p.vertices].sum() / (2 * np.pi) for p in aligner.loops]
    assert np.allclose(found, degrees, atol=1e-12)
    z = middles(mesh)
    for loop, degree in zip(aligner.loops, degrees):
        ring = np.exp(4j * angle(z[loop.edges]))
        assert np.angle(np.roll(ring, -1) / ring).sum() / (8 * np.pi) == pytest.approx(degree, abs=1e-9)
    if index or len(degrees) > 1:
        field = prescribed(mesh, angle(z))
        assert np.array_equal(aligner.close(field.rotation), field.rotation)


@pytest.mark.parametrize("quarters", [-4, -1, 3])
def test_formula_20_psi_in_the_plane(quarters):
    # u has degree off by D around the hole; psi = - D/4 arg(z - c) repairs it, + D/4 arg(z - c) makes the defect 2 D
    mesh = annulus()
    given = (1 - quarters / 4) * np.angle(middles(mesh))
    aligner = Aligner(mesh, FieldOperators(mesh), zeros(mesh))
    (hole,) = (aligner.loops[i].vertices for i in aligner.holes)

    def defect(angle):
        through = corner_rotation(mesh, prescribed(mesh, angle).rotation)
        return np.sum((aligner.turning - through)[hole]) / QUARTER

    found = defect(given)
    assert found == pytest.approx(-quarters)
    psi = -found / 4 * np.angle(middles(mesh))
    assert defect(given + psi) == pytest.approx(0.0, abs=1e-9)
    assert defect(given - psi) == pytest.approx(2 * found)
    aligned = align(mesh, FieldOperators(mesh), prescribed(mesh, given), zeros(mesh))
    assert not np.any(aligned.index)
    off = np.abs(wrap(aligned.field.theta + edge_angle(mesh) - given - psi))
    assert off.max() < 0.02


def test_formulas_14_and_19_have_a_free_integer_per_hole():
    # on the annulus between 0.4 and 1 a period m costs 1/2 (pi/2)^2 m^2 2 pi / ln(1 / 0.4); m = 0 is best
    mesh = annulus(0.4, 24, 120)
    operators = FieldOperators(mesh)
    aligner = Aligner(mesh, operators, zeros(mesh))
    radial = prescribed(mesh, np.angle(middles(mesh)))
    basis = aligner.harmonic()[0][:, 0]
    least = operators.energy(aligner.rotate(radial).field.rotation)
    for m in (-2, 1, 3):
        x = QUARTER * m * basis
        wound = CrossField(radial.theta + x, radial.rotation + operators.difference(x))
        assert np.abs(wrap(wound.theta[mesh.boundary_edge])).max() < 1e-9
        more = operators.energy(wound.rotation) - operators.energy(radial.rotation)
        assert more == pytest.approx(0.5 * QUARTER**2 * m**2 * 2 * np.pi / np.log(2.5), rel=2e-3)
        found = aligner.rotate(wound)
        assert found.periods.tolist() == [0, -m]
        assert operators.energy(found.field.rotation) == pytest.approx(least)
