from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gmsh_crossquad.errors import FieldError
from gmsh_crossquad.field.operators import FieldOperators
from gmsh_crossquad.field.pipeline import aligned_field
from gmsh_crossquad.field.smooth import wrap
from gmsh_crossquad.field.surface_mesh import SurfaceMesh

from . import models
from .field_meshes import at, prescribed, singular_angle

CASES = {
    "disc": (models.disc(), [1, 1, 1, 1]),
    "square": (models.square(), []),
    "L": (models.l_shape(), []),
    "annulus": (models.annulus(), []),
    "triangle": (models.regular(3), [1]),
    "pentagon": (models.regular(5), [-1]),
    "crack": (models.square_with_crack(), []),
    "edge crack": (models.square_with_edge_crack(), []),
    "cross": (models.square_with_cross(), []),
    "sharp wedge": (models.wedge(np.radians(20)), [1]),
}


def surface(mesh):
    return SurfaceMesh(mesh.points, mesh.triangles)


def interior(mesh, aligned):
    index = aligned.index[~surface(mesh).boundary_vertex]
    return sorted(index[index != 0].tolist())


@pytest.mark.parametrize("name", CASES)
def test_singularities_of_the_default_field(name):
    model, expected = CASES[name]
    mesh = models.background(model, 0.05)[0]
    aligned = aligned_field(mesh)
    assert interior(mesh, aligned) == expected
    assert aligned.residual < 1e-10
    assert np.abs(aligned.field.theta[surface(mesh).boundary_edge]).max() < 1e-10


def test_components_are_separate_problems():
    mesh = models.background(models.square_with_embedded_circle(), 0.03)[0]
    s = surface(mesh)
    assert len(s.component_euler) == 2
    aligned = aligned_field(mesh)
    total = np.bincount(s.components, aligned.index, 2)
    assert np.array_equal(total, 4 * s.component_euler)
    inside = np.flatnonzero(s.component_euler == 1)[0]
    index = aligned.index[s.components == inside]
    assert sorted(index[index != 0]) == [1, 1, 1, 1]


def test_ports_stay_regular():
    mesh = models.background(models.disc(), 0.05)[0]
    inside = np.flatnonzero(~surface(mesh).boundary_vertex)
    singular = inside[aligned_field(mesh).index[inside] != 0]
    port = mesh.port.copy()
    port[singular] = True
    other = aligned_field(replace(mesh, port=port))
    assert not np.any(other.index[singular])
    assert interior(mesh, other) == [1, 1, 1, 1]


def test_a_given_field_keeps_its_singularities():
    mesh = models.background(models.l_shape(), 0.05)[0]
    s = surface(mesh)
    centre = mesh.points[np.isfinite(mesh.opening_angle)].mean(axis=0)
    vertices = [at(s, *(centre + d)) for d in ((-0.1, -0.05), (0.02, -0.15))]
    field = prescribed(s, singular_angle(s, vertices, [1, -1]))
    aligned = aligned_field(mesh, field)
    assert {v: int(aligned.index[v]) for v in np.flatnonzero(aligned.index * ~s.boundary_vertex)} == dict(zip(vertices, [1, -1]))
    assert aligned.residual < 1e-10


def test_a_given_field_with_a_wrong_sum_is_refused():
    mesh = models.background(models.l_shape(), 0.05)[0]
    s = surface(mesh)
    v = int(np.flatnonzero(~s.boundary_vertex)[5])
    with pytest.raises(FieldError, match=r"add up to \+5/4 instead of chi = 1"):
        aligned_field(mesh, prescribed(s, singular_angle(s, [v], [1])))


def test_boundary_indices_can_be_given():
    mesh = models.background(models.disc(), 0.05)[0]
    s = surface(mesh)
    wanted = np.zeros(len(mesh.points), np.int64)
    wanted[s.loops[0][[0, len(s.loops[0]) // 2]]] = 1
    aligned = aligned_field(mesh, boundary_index=wanted)
    assert np.array_equal(aligned.index[s.boundary_vertex], wanted[s.boundary_vertex])
    assert interior(mesh, aligned) == [1, 1]


PLATE = models.background(
    models.polygon([(0, 0), (2.1, 0.1), (2, 1.2), (0.9, 1.6), (-0.1, 1)], [[(0.7, 0.5), (0.8, 0.9), (1.2, 0.85), (1.1, 0.4)]]),
    0.06,
)[0]
REFERENCE = aligned_field(PLATE)


@settings(max_examples=12, deadline=None)
@given(st.floats(-3.2, 3.2), st.floats(-100, 100), st.floats(-100, 100), st.sampled_from([1e-3, 0.3, 1.0, 7.0, 1e3]))
def test_rigid_motions_and_scaling_do_not_matter(turn, x, y, scale):
    c, s = np.cos(turn), np.sin(turn)
    points = scale * (PLATE.points @ np.array([[c, s], [-s, c]]) + np.array([x, y]))
    moved = aligned_field(replace(PLATE, points=points))
    assert np.array_equal(moved.index, REFERENCE.index)
    assert np.abs(wrap(moved.field.theta - REFERENCE.field.theta)).max() < 1e-7
    assert np.allclose(moved.flux, REFERENCE.flux, atol=1e-7)


@settings(max_examples=8, deadline=None)
@given(st.randoms(use_true_random=False))
def test_numbering_does_not_matter(random):
    new = list(range(len(PLATE.points)))
    random.shuffle(new)
    order = list(range(len(PLATE.triangles)))
    random.shuffle(order)
    new_of, back = np.array(new), np.argsort(new)
    turned = [np.roll(new_of[t], random.randrange(3)) for t in PLATE.triangles[order]]
    mesh = replace(
        PLATE,
        points=PLATE.points[back],
        triangles=np.array(turned),
        boundary=new_of[PLATE.boundary],
        vertex=PLATE.vertex[back],
        opening_angle=PLATE.opening_angle[back],
        port=PLATE.port[back],
    )
    found = aligned_field(mesh)
    assert np.array_equal(found.index, REFERENCE.index[back])
    energy = [FieldOperators(surface(m)).energy(a.field.rotation) for m, a in ((PLATE, REFERENCE), (mesh, found))]
    assert energy[0] == pytest.approx(energy[1], rel=1e-9)
