"""Cross fields with prescribed singularities on curved surfaces."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gmsh_crossquad.errors import FieldError
from gmsh_crossquad.field.compatibility import Incompatible
from gmsh_crossquad.field.operators import FieldOperators
from gmsh_crossquad.field.pipeline import aligned_field
from gmsh_crossquad.field.singularities import QUARTER, move_index, triangle_index, vertex_index
from gmsh_crossquad.field.smooth import wrap
from gmsh_crossquad.field.surface_mesh import SurfaceMesh
from gmsh_crossquad.source.prescribed import handle_cocycles, prescribed_field
from tests import surface_meshes as sm
from tests.source_frames import drift

SURFACES = {
    "octant": sm.octant(10),
    "sphere": sm.sphere(6),
    "sphere with three holes": sm.holed_sphere([(0.6 + 0.2j, 0.3), (-0.6 - 0.1j, 0.25)], 0.18),
    "cylinder": sm.cylinder(),
    "torus": sm.torus(cells=(24, 12)),
    "double torus": sm.double_torus((20, 10)),
    "saddle": sm.saddle(10),
}


def indices(mesh: SurfaceMesh, places, quarters):
    out = np.zeros(len(mesh.points), np.int64)
    for p, q in zip(places, quarters):
        out[sm.nearest(mesh, p)] += q
    return out


@given(st.sampled_from(sorted(SURFACES)), st.integers(0, 10**6), st.integers(1, 6))
@settings(max_examples=25, deadline=None)
def test_any_indices_come_out(name, seed, count):
    """On a closed surface the last one makes the sum right; of any size and sign."""
    mesh = SURFACES[name]
    rng = np.random.default_rng(seed)
    index = np.zeros(len(mesh.points), np.int64)
    inner = rng.choice(np.flatnonzero(~mesh.boundary_vertex), count + 1, replace=False)
    index[inner[:-1]] = rng.integers(-3, 4, count)
    if mesh.component_closed[0]:
        index[inner[-1]] = 4 * mesh.euler - index.sum()
    field = prescribed_field(mesh, index, 1)
    assert drift(mesh, field) < 1e-9
    assert not np.any(triangle_index(field.rotation))
    inside = ~mesh.boundary_vertex
    np.testing.assert_allclose(vertex_index(mesh, field.rotation)[inside], index[inside], atol=1e-9)
    # least energy: no edge is pulled, not even on the boundary
    operators = FieldOperators(mesh)
    assert np.abs(operators.divergence(field.rotation)).max() < 1e-8 * (1 + np.abs(field.rotation).max())


@pytest.mark.parametrize("name", ["torus", "double torus"])
def test_no_turn_around_a_handle_lowers_the_energy(name):
    mesh = SURFACES[name]
    index = np.zeros(len(mesh.points), np.int64)
    index[::40] = 1
    index[5] = 4 * mesh.euler - index.sum() + index[5]
    operators = FieldOperators(mesh)
    field = prescribed_field(mesh, index, 1)
    loops = handle_cocycles(mesh)
    assert len(loops) == 2 - mesh.euler
    for cocycle in loops:
        for sign in (1, -1):
            other = field.rotation + sign * cocycle
            other = other + operators.difference(operators.solve(np.zeros(len(mesh.edges)), other))
            assert operators.energy(other) > operators.energy(field.rotation)


def test_flat_torus_field_is_parallel():
    """Without singularities on a torus of revolution the crosses follow the circles, or make a constant angle with them."""
    mesh = sm.torus(cells=(24, 12))
    field = prescribed_field(mesh, np.zeros(len(mesh.points), np.int64), 1)
    middle = mesh.points[mesh.edges].mean(axis=1)
    around = np.stack([-middle[:, 1], middle[:, 0], np.zeros(len(middle))], axis=1)
    x = (mesh.points[mesh.edges[:, 1]] - mesh.points[mesh.edges[:, 0]]) / mesh.edge_length[:, None]
    y = np.cross(mesh.edge_normal, x)
    angle = np.arctan2(np.einsum("ec,ec->e", around, y), np.einsum("ec,ec->e", around, x)) - field.theta
    power = np.exp(4j * angle)
    assert np.abs(power - power.mean()).max() < 0.1  # the triangles are coarse


def test_aligned_it_is_the_harmonic_field():
    """Rotated as little as possible it becomes the field of least energy with these indices: keeping it changes nothing."""
    face = sm.face_mesh(SURFACES["octant"], {sm.nearest(SURFACES["octant"], p): QUARTER for p in np.eye(3)})
    mesh = SURFACES["octant"]
    field = prescribed_field(mesh, indices(mesh, [(0.8, 0.5, 0.35)], [1]), 1)
    kept, harmonic = (aligned_field(face, field, keep=keep) for keep in (True, False))
    np.testing.assert_array_equal(kept.index, harmonic.index)
    assert np.abs(wrap(kept.field.theta - harmonic.field.theta)).max() < 1e-9
    assert kept.index.sum() == 4


def test_half_sphere_against_the_exact_field():
    """One index of +1 at the pole of a hemisphere: the crosses follow meridians and parallels."""
    mesh = sm.hemisphere(12)
    pole = sm.nearest(mesh, (0, 0, 1))
    field = prescribed_field(mesh, indices(mesh, [(0, 0, 1)], [4]), 1)
    aligned = aligned_field(sm.face_mesh(mesh), field, split=False)
    assert aligned.index[pole] == 4
    middle = mesh.points[mesh.edges].mean(axis=1)
    around = np.stack([-middle[:, 1], middle[:, 0], np.zeros(len(middle))], axis=1)
    x = (mesh.points[mesh.edges[:, 1]] - mesh.points[mesh.edges[:, 0]]) / mesh.edge_length[:, None]
    y = np.cross(mesh.edge_normal, x)
    angle = np.arctan2(np.einsum("ec,ec->e", around, y), np.einsum("ec,ec->e", around, x))
    far = middle[:, 2] < 0.9
    assert np.abs(wrap(angle - aligned.field.theta))[far].max() < 0.02


def test_sums_on_closed_and_open_surfaces():
    sphere = SURFACES["sphere"]
    with pytest.raises(
        FieldError, match=r"closed surface add up to \+1/4 where chi = 2 .*\+7/4 in all \(7 singularities of \+1/4"
    ):
        prescribed_field(sphere, indices(sphere, [(0, 0, 1)], [1]), 1)
    mesh = SURFACES["saddle"]
    field = prescribed_field(mesh, indices(mesh, [(0, 0, 0)], [1]), 1)
    with pytest.raises(Incompatible):
        aligned_field(sm.face_mesh(mesh, {}), field)


def test_move_along_a_handle_changes_no_index():
    mesh = SURFACES["torus"]
    for cocycle in handle_cocycles(mesh):
        np.testing.assert_allclose(cocycle.sum(axis=1), 0.0, atol=1e-12)
        np.testing.assert_allclose(vertex_index(mesh, cocycle), mesh.curvature / QUARTER, atol=1e-9)
    path = [int(mesh.triangles[0, 0]), int(mesh.triangles[0, 1])]
    open_path = np.zeros(mesh.triangles.shape)
    move_index(mesh, open_path, path, 1)
    assert np.abs(vertex_index(mesh, open_path) - mesh.curvature / QUARTER).max() > 0.9
