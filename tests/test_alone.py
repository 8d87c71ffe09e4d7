import numpy as np
import pytest

from gmsh_crossquad.errors import LayoutError
from gmsh_crossquad.field.align import align
from gmsh_crossquad.field.operators import FieldOperators
from gmsh_crossquad.field.repair import alternatives
from gmsh_crossquad.field.surface_mesh import SurfaceMesh
from gmsh_crossquad.layout import alone
from gmsh_crossquad.layout.alone import divisible, has_divisions
from gmsh_crossquad.layout.face_tmesh import trace_face

from . import models
from .field_meshes import prescribed, singular_angle

NONE = np.zeros(0, np.int64)


def ring(degrees):
    """An annulus with a singularity of +1/4 and one of -1/4 at different radii, so many degrees apart."""
    model = models.annulus()
    mesh = models.background(model, 0.035)[0]
    surface = SurfaceMesh(mesh.points, mesh.triangles)
    unit = 1 / model.scale
    angle = np.radians(degrees)
    places = unit * np.array([[0.6, 0.0], [0.8 * np.cos(angle), 0.8 * np.sin(angle)]])
    inside = np.flatnonzero(~surface.boundary_vertex)
    vertices = [int(inside[np.argmin(np.hypot(*(mesh.points[inside] - p).T))]) for p in places]
    field = prescribed(surface, singular_angle(surface, vertices, [1, -1]))
    aligned = align(surface, FieldOperators(surface), field, np.zeros(len(mesh.points), np.int64))
    return model, mesh, vertices, aligned


def singular(mesh, aligned):
    on = np.zeros(len(mesh.points), bool)
    on[mesh.boundary] = True
    rows = np.flatnonzero(~on & (aligned.index != 0))
    return dict(zip(rows.tolist(), aligned.index[rows].tolist()))


@pytest.mark.parametrize("degrees", [0, 180])
def test_singularities_of_a_ring_must_face_each_other(degrees):
    # a flat annulus with closed geodesics as boundary and cone points of 270 and 450 degrees has them on one ray
    model, mesh, _, aligned = ring(degrees)
    assert has_divisions(model, mesh, trace_face(mesh, aligned)) == (degrees == 0)


def test_a_layout_that_has_divisions_is_kept():
    model, mesh, _, aligned = ring(0)
    tmesh = trace_face(mesh, aligned)
    assert divisible(model, mesh, aligned, tmesh, NONE) == (aligned, tmesh)


def test_a_pair_gives_a_ring_divisions():
    model, mesh, vertices, aligned = ring(180)
    found, tmesh = divisible(model, mesh, aligned, trace_face(mesh, aligned), NONE)
    assert has_divisions(model, mesh, tmesh)
    index = singular(mesh, found)
    assert [index[v] for v in vertices] == [1, -1]
    assert sorted(index[v] for v in found.added) == [-1, 1]
    assert set(index) == {*vertices, *found.added}
    assert not found.moved
    # what turned the given field: theta = given + phi + psi up to quarter turns
    rest = found.field.theta - found.given.theta - found.phi - found.psi
    assert np.abs(np.sin(2 * rest)).max() < 1e-9


def test_alternatives_add_pairs_and_then_move():
    _, mesh, vertices, aligned = ring(150)
    found = list(alternatives(mesh, aligned, NONE))
    assert [(len(a.added), len(a.moved)) for a in found] == [(2, 0), (4, 0), (6, 0), (0, 2), (0, 2), (0, 2)]
    assert [start for start, _ in found[-1].moved] == sorted(vertices)
    assert abs(found[-1].flux[1]) < 0.05 * abs(aligned.flux[1])
    assert found[-3].flux[1] == pytest.approx(0.5 * aligned.flux[1], abs=0.05)
    assert [len(a.moved) for a in alternatives(mesh, aligned, NONE, move=False)] == [0, 0, 0]
    assert len(list(alternatives(mesh, aligned, np.array(vertices)))) == 3


def test_nothing_to_try_without_holes():
    model = models.square()
    mesh = models.background(model, 0.1)[0]
    surface = SurfaceMesh(mesh.points, mesh.triangles)
    wanted = np.where(np.isfinite(mesh.opening_angle), 1, 0)
    field = prescribed(surface, np.zeros(len(surface.edges)))
    assert not list(alternatives(mesh, align(surface, FieldOperators(surface), field, wanted), NONE))


def test_no_way_out_is_an_error(monkeypatch):
    model, mesh, _, aligned = ring(180)
    monkeypatch.setattr(alone, "alternatives", lambda *args, **options: iter(()))
    with pytest.raises(LayoutError, match=r"no layout of the cross field .* \(flux .*surface 1 at .*change the singularities"):
        divisible(model, mesh, aligned, trace_face(mesh, aligned), NONE)
