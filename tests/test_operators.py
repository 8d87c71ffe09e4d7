import numpy as np
import pytest

from gmsh_crossquad.field.operators import FieldOperators

from .field_meshes import annulus, disc, grid


@pytest.mark.parametrize("mesh", [disc(), annulus(), grid(5, 4, ((2, 3, 1, 2),))], ids=["disc", "annulus", "hole"])
def test_linear_functions_are_exact(mesh):
    operators = FieldOperators(mesh)
    middle = mesh.points[mesh.edges].mean(axis=1)
    f = 0.3 + 2.0 * middle[:, 0] - middle[:, 1]
    assert np.allclose(operators.solve(f), f, atol=1e-12)
    assert operators.energy(operators.difference(f)) == pytest.approx(0.5 * 5.0 * mesh.area.sum(), rel=1e-12)


def test_columns_are_solved_separately():
    mesh = disc()
    operators = FieldOperators(mesh)
    values = np.random.default_rng(1).normal(size=(len(mesh.edges), 2))
    both = operators.solve(values)
    assert np.allclose(both, np.stack([operators.solve(values[:, c]) for c in range(2)], axis=1), atol=1e-12)


def test_solution_with_correction_is_a_minimum():
    mesh = annulus()
    operators = FieldOperators(mesh)
    rng = np.random.default_rng(2)
    values, r = rng.normal(size=len(mesh.edges)), rng.normal(size=(len(mesh.triangles), 3))
    x = operators.solve(values, r)
    assert np.array_equal(x[mesh.boundary_edge], values[mesh.boundary_edge])
    assert np.allclose(operators.divergence(operators.difference(x) + r)[operators.free], 0.0, atol=1e-10)
    best = operators.energy(operators.difference(x) + r)
    for _ in range(5):
        y = x + 1e-3 * np.where(mesh.boundary_edge, 0.0, rng.normal(size=len(x)))
        assert operators.energy(operators.difference(y) + r) > best


def test_divergence_is_the_adjoint_of_difference():
    mesh = disc(5, 12)
    operators = FieldOperators(mesh)
    rng = np.random.default_rng(3)
    x, r = rng.normal(size=len(mesh.edges)), rng.normal(size=(len(mesh.triangles), 3))
    assert np.sum(operators.weight * r * operators.difference(x)) == pytest.approx(x @ operators.divergence(r), rel=1e-12)
    assert np.allclose(operators.divergence(operators.difference(x)), operators.stiffness @ x, atol=1e-11)


def test_capacity_of_an_annulus():
    mesh = annulus(0.4, 24, 96)
    operators = FieldOperators(mesh)
    inner = mesh.boundary_edge & (np.hypot(*mesh.points[mesh.edges].mean(axis=1).T) < 0.7)
    x = operators.solve(inner.astype(float))
    assert 2 * operators.energy(operators.difference(x)) == pytest.approx(2 * np.pi / np.log(1 / 0.4), rel=3e-3)
