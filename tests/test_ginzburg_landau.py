import numpy as np
import pytest
from scipy.integrate import solve_bvp

from gmsh_crossquad.field.ginzburg_landau import minimise_energy
from gmsh_crossquad.field.operators import FieldOperators
from gmsh_crossquad.field.smooth import edge_angle, smooth_field, wrap

from .field_meshes import annulus, disc, grid, middles
from .source_frames import inner_indices


def start(mesh, field):
    angle = 4 * (field.theta + edge_angle(mesh))
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


def test_the_energy_falls_and_the_boundary_stays():
    mesh = disc(16, 40)
    operators = FieldOperators(mesh)
    before = start(mesh, smooth_field(mesh, operators))
    z, energies = minimise_energy(mesh, operators, before, 0.1)
    assert 10 < len(energies) < 300
    assert np.all(np.diff(energies) < 0)
    assert np.array_equal(z[operators.fixed], before[operators.fixed])
    # the energy of the result, by its definition
    mass = np.bincount(mesh.triangle_edges.ravel(), np.repeat(mesh.area / 3, 3))
    well = mass @ (np.sum(z**2, axis=1) - 1) ** 2 / (4 * 0.1**2)
    rise = operators.difference(z[:, 0]), operators.difference(z[:, 1])
    assert energies[-1] == pytest.approx(sum(operators.energy(r) for r in rise) + well, rel=1e-10)


def test_profile_on_an_annulus():
    # z = f(r) exp(4 i phi) with f'' + f'/r - 16 f/r^2 = f (f^2 - 1)/eps^2, f = 1 at both ends
    epsilon, inner = 0.15, 0.4
    r = np.linspace(inner, 1, 50)
    exact = solve_bvp(
        lambda r, y: np.stack([y[1], 16 * y[0] / r**2 - y[1] / r + y[0] * (y[0] ** 2 - 1) / epsilon**2]),
        lambda a, b: np.array([a[0] - 1, b[0] - 1]),
        r,
        np.stack([1 + 0 * r, 0 * r]),
        tol=1e-8,
    )

    def error(n):
        mesh = annulus(inner, 8 * n, 48 * n)
        operators = FieldOperators(mesh)
        phi = 4 * np.angle(middles(mesh))
        z, _ = minimise_energy(mesh, operators, np.stack([np.cos(phi), np.sin(phi)], axis=1), epsilon)
        assert np.abs(wrap(np.arctan2(z[:, 1], z[:, 0]) / 4 - phi / 4)).max() < 1e-3
        return np.abs(np.hypot(*z.T) - exact.sol(np.abs(middles(mesh)))[0])[operators.free].max()

    assert exact.sol([0.6])[0][0] < 0.9
    coarse, fine = error(2), error(4)
    assert fine < 0.01
    assert np.log2(coarse / fine) > 1.6


def test_a_large_core_gives_the_harmonic_field():
    mesh = annulus(0.3, 6, 30)
    operators = FieldOperators(mesh)
    before = start(mesh, smooth_field(mesh, operators))
    z, _ = minimise_energy(mesh, operators, before, 1e4)
    assert np.abs(z - operators.solve(before)).max() < 1e-6


@pytest.mark.parametrize("epsilon", [0.05, 0.1])
def test_smooth_field_with_a_core_size(epsilon):
    mesh = disc(14, 42)
    operators = FieldOperators(mesh)
    field = smooth_field(mesh, operators, epsilon)
    triangles, vertices = inner_indices(mesh, field)
    assert sorted(triangles[triangles != 0].tolist() + vertices[vertices != 0].tolist()) == [1, 1, 1, 1]
    assert np.all(field.theta[mesh.boundary_edge] == 0.0)


def test_a_field_without_energy_stays():
    mesh = grid(6, 5)
    operators = FieldOperators(mesh)
    z, energies = minimise_energy(mesh, operators, np.tile([1.0, 0.0], (len(mesh.edges), 1)), 0.5)
    assert len(energies) == 1
    assert np.abs(wrap(smooth_field(mesh, operators, 0.5).theta + edge_angle(mesh))).max() < 1e-12
    assert np.array_equal(z[:, 1], np.zeros(len(z)))
