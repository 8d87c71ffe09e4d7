import numpy as np
import pytest

from gmsh_crossquad.errors import FieldError
from gmsh_crossquad.field.clearance import Clearance
from gmsh_crossquad.field.compatibility import Incompatible, add_singularities, change_boundary, misfits, quarter_text
from gmsh_crossquad.field.pipeline import aligned_field
from gmsh_crossquad.field.singularities import singular_vertices
from gmsh_crossquad.field.surface_mesh import SurfaceMesh

from . import models
from .field_meshes import annulus, at, disc, grid, prescribed, singular_angle, square_corners


def none(mesh):
    return np.zeros(len(mesh.points), np.int64)


@pytest.mark.parametrize(
    "quarters, text", [(0, "0"), (1, "+1/4"), (-1, "-1/4"), (2, "+1/2"), (-6, "-3/2"), (4, "+1"), (-8, "-2"), (5, "+5/4")]
)
def test_quarters_are_written_as_fractions(quarters, text):
    assert quarter_text(quarters) == text


def test_indices_that_fit_have_no_misfit():
    mesh = grid(9, 5, ((1, 2, 1, 2), (5, 7, 2, 4)))
    assert misfits(mesh, none(mesh), square_corners(mesh), mesh.boundary_vertex) == []
    assert misfits(annulus(), none(annulus()), none(annulus()), annulus().boundary_vertex) == []


def test_a_misfit_says_what_is_found_and_needed():
    mesh = disc()
    interior = none(mesh)
    interior[[0, 40]] = [1, 2]
    boundary = none(mesh)
    rim = np.flatnonzero(mesh.boundary_vertex)
    boundary[rim[3]] = -1
    (m,) = misfits(mesh, interior, boundary, np.isin(np.arange(len(mesh.points)), rim[3:5]))
    assert (m.found, m.needed, m.euler) == (2, 4, 1)
    assert m.interior == ((0, 1), (40, 2))
    assert m.boundary == ((int(rim[3]), -1),)
    # two blocks fewer: from three to one at the first; the second has two and cannot lose both
    assert m.corner == (int(rim[3]), 1)
    assert m.eases is (abs(1 * 90 - 180) <= abs(3 * 90 - 180))
    assert change_boundary(boundary, m)[rim[3]] == 1


def test_added_singularities_have_room():
    mesh = grid(12, 12)
    (m,) = misfits(mesh, none(mesh), none(mesh), np.zeros(len(mesh.points), bool))
    assert (m.found, m.needed, m.corner) == (0, 4, None)
    field = prescribed(mesh, np.zeros(len(mesh.edges)))
    rotation, added = add_singularities(mesh, Clearance(mesh, []), field.rotation, m)
    assert len(added) == 4
    vertices, index = singular_vertices(mesh, rotation)
    assert sorted(vertices) == sorted(added) and index.tolist() == [1, 1, 1, 1]
    assert added[0] == at(mesh, 6, 6)
    p = mesh.points[added]
    apart = np.linalg.norm(p[:, None] - p[None], axis=2) + 99 * np.eye(4)
    assert apart.min() > 3


@pytest.fixture(scope="module")
def round_plate():
    mesh = models.background(models.disc(arcs=4), 0.05)[0]
    surface = SurfaceMesh(mesh.points, mesh.triangles)
    return mesh, surface


def with_singularities(surface, places, index):
    return prescribed(surface, singular_angle(surface, [at(surface, *p) for p in places], index))


def test_a_field_that_does_not_fit_is_refused(round_plate):
    mesh, surface = round_plate
    field = with_singularities(surface, [(0.15, 0), (-0.15, 0), (0, 0.2)], [1, 1, 1])
    with pytest.raises(Incompatible, match=r"add up to \+3/4 instead of chi = 1: change them by \+1/4") as caught:
        aligned_field(mesh, field)
    assert isinstance(caught.value, FieldError)
    assert caught.value.misfit.corner is not None  # a disc's rim point can become a corner


def test_the_least_change_is_made_on_request(round_plate):
    mesh, surface = round_plate
    field = with_singularities(surface, [(0.15, 0), (-0.15, 0), (0, 0.2)], [1, 1, 1])
    aligned = aligned_field(mesh, field, fix=True, prescribed=np.zeros(len(mesh.points), bool))
    inside = ~surface.boundary_vertex
    assert sorted(aligned.index[inside & (aligned.index != 0)]) == [1, 1, 1, 1]
    assert len(aligned.added) == 1 and aligned.index[aligned.added[0]] == 1
    assert aligned.residual < 1e-12


def test_a_chosen_boundary_index_that_is_to_blame_is_put_back(round_plate):
    mesh, surface = round_plate
    field = with_singularities(surface, [(0.15, 0), (-0.15, 0), (0, 0.2), (0, -0.2)], [1, 1, 1, 1])
    wanted = none(surface)
    chosen = np.flatnonzero(surface.boundary_vertex & (mesh.vertex >= 0))[0]
    wanted[chosen] = -1
    with pytest.raises(Incompatible, match=r"\+3/4 instead of chi = 1"):
        aligned_field(mesh, field, wanted)
    aligned = aligned_field(mesh, field, wanted, fix=True, prescribed=np.arange(len(mesh.points)) == chosen)
    assert aligned.index[chosen] == 0
    assert aligned.added == ()


def test_a_given_field_is_kept_or_made_harmonic(round_plate):
    mesh, surface = round_plate
    x, y = surface.points[surface.edges].mean(axis=1).T
    angle = singular_angle(surface, [at(surface, *p) for p in [(0.2, 0), (-0.2, 0), (0, 0.2), (0, -0.2)]], [1, 1, 1, 1])
    field = prescribed(surface, angle + 0.1 * np.sin(5 * x) * np.sin(4 * y))
    kept, smooth = aligned_field(mesh, field), aligned_field(mesh, field, keep=False)
    assert np.array_equal(kept.index, smooth.index)
    assert np.abs(kept.phi).max() > 1e-3
    assert np.sum(kept.field.rotation**2) > np.sum(smooth.field.rotation**2)
    again = aligned_field(mesh, kept.field)
    assert np.abs(again.field.theta - kept.field.theta).max() < 1e-10
