"""Fields of curved faces as the user sees them: arms in tangent planes, files, places in errors, views."""

import numpy as np
import pytest

from gmsh_crossquad.errors import GeometryError, LayoutError, MeshError
from gmsh_crossquad.face_field import face_field, singularities_of
from gmsh_crossquad.field.edge_frames import EdgeFrames
from gmsh_crossquad.field.pipeline import aligned_field
from gmsh_crossquad.field.surface_mesh import SurfaceMesh
from gmsh_crossquad.field_arrays import field_from_arrays, quadratic
from gmsh_crossquad.field_result import FieldResult
from gmsh_crossquad.field_stage import edge_frames, field_of_face, located, wishes
from gmsh_crossquad.options import MeshOptions
from gmsh_crossquad.source.files import read_field
from gmsh_crossquad.source.known import Known
from gmsh_crossquad.view.mpl_draw import _in_front
from gmsh_crossquad.view.scene import build_field_scene
from tests import models
from tests import surface_meshes as sm
from tests.surface_models import model_of


def octant_field():
    model, mesh = model_of(sm.octant(8))
    return model, mesh, face_field(model, mesh, aligned_field(mesh))


def test_arms_are_tangent_and_follow_the_boundary():
    _, _, f = octant_field()
    for arms in (f.directions, f.given):
        np.testing.assert_allclose(np.linalg.norm(arms, axis=1), 1.0, atol=1e-12)
        np.testing.assert_allclose(np.einsum("ec,ec->e", arms, f.normals), 0.0, atol=1e-12)
    # of the unit sphere, up to the bend of a triangle
    assert np.einsum("ec,ec->e", f.normals, f.places).min() > 0.98
    edge = f.points[f.edges[:, 1]] - f.points[f.edges[:, 0]]
    edge /= np.linalg.norm(edge, axis=1)[:, None]
    along = np.abs(np.einsum("ec,ec->e", f.directions, edge))[f.surface.boundary_edge]
    assert np.abs(along * np.sqrt(1 - np.minimum(along, 1) ** 2)).max() < 1e-6
    (spot,) = singularities_of(f)
    assert np.linalg.norm(spot.point - np.full(3, 3**-0.5)) < 0.25  # edges are up to .2 long


def test_triangle_arms_are_in_the_triangles():
    _, _, f = octant_field()
    np.testing.assert_allclose(np.einsum("tc,tc->t", f.triangle_arms, f.triangle_normals), 0.0, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(f.triangle_arms, axis=1), 1.0, atol=1e-12)
    # away from the singular point the arm of a triangle is near one of those of its edges
    far = np.linalg.norm(f.points[f.triangles].mean(axis=1) - 3**-0.5, axis=1) > 0.4
    own = np.einsum("tkc,tc->tk", f.directions[f.surface.triangle_edges], f.triangle_arms)[far]
    assert np.maximum(np.abs(own), np.sqrt(np.maximum(1 - own**2, 0))).min() > np.cos(0.15)


@pytest.mark.parametrize("suffix", ["arrays", ".vtu"])
def test_out_and_in_again(tmp_path, suffix):
    model, mesh, f = octant_field()
    if suffix == "arrays":
        (g,) = field_from_arrays(*quadratic((f,)))
    else:
        FieldResult((f,)).write(tmp_path / "a.vtu")
        (g,) = read_field(tmp_path / "a.vtu").faces
    np.testing.assert_array_equal(g.triangles, f.triangles)
    np.testing.assert_array_equal(g.index, f.index)
    np.testing.assert_array_equal(g.rotation, f.rotation)
    np.testing.assert_allclose(np.sin(2 * (g.theta - f.theta)), 0.0, atol=1e-9)
    np.testing.assert_allclose(g.normal, f.normal, atol=1e-12)
    again = Known((g,)).on(edge_frames(model, mesh))
    np.testing.assert_array_equal(again.rotation, f.rotation)


def test_known_field_on_another_background():
    """Sampled at places that are not on the triangles, and aligned, it has the same singularity."""
    f = octant_field()[2]
    model, mesh = model_of(sm.octant(13))
    aligned, _ = field_of_face(model, mesh, wishes(model, MeshOptions(field=Known((f,)))))
    inside = np.flatnonzero(aligned.index * ~SurfaceMesh(mesh.points, mesh.triangles).boundary_vertex)
    assert aligned.index[inside].tolist() == [1]


@pytest.mark.parametrize("kind", [LayoutError, GeometryError, MeshError])
def test_places_of_errors_are_the_users(kind):
    model, mesh = model_of(sm.octant(4))
    v = 5
    error = located(model, 0, kind("bad", location=mesh.points[v]))
    assert type(error) is kind
    assert error.entity == (2, 1)
    np.testing.assert_allclose(error.location, model.origin + model.scale * mesh.points[v], atol=1e-12)


def test_places_on_plane_faces():
    model = models.square()
    local = model.faces[0].local(model.vertices[2:3])[0]
    expected = model.origin + model.scale * model.vertices[2]
    np.testing.assert_allclose(located(model, 0, LayoutError("bad", location=local)).location, expected, atol=1e-12)
    np.testing.assert_allclose(located(model, 0, LayoutError("bad", location=expected)).location, expected, atol=1e-12)


def test_moebius_band_is_refused_with_its_place():
    model, mesh = model_of(sm.cylinder())
    flipped = mesh.triangles.copy()
    flipped[3] = flipped[3, ::-1]
    with pytest.raises(GeometryError) as caught:
        field_of_face(model, type(mesh)(**{**vars(mesh), "triangles": flipped}), wishes(model, MeshOptions()))
    assert caught.value.entity == (2, 1)
    assert np.linalg.norm(np.array(caught.value.location)[:2]) > 0.5  # on the cylinder, not in the scaled box


def test_frames_of_a_sphere():
    mesh = sm.sphere(6)
    frames = edge_frames(*model_of(mesh))
    assert isinstance(frames, EdgeFrames)
    assert np.einsum("ec,ec->e", frames.normal, frames.places).min() > 0.97


def test_the_outside_is_looked_at():
    f = octant_field()[2]
    scene = build_field_scene((f,))
    panel = scene.panels[1]
    area = np.cross(
        panel.points[panel.cells[:, 1]] - panel.points[panel.cells[:, 0]],
        panel.points[panel.cells[:, 2]] - panel.points[panel.cells[:, 0]],
    )
    assert (area[:, 2] > 0).mean() > 0.95
    assert len(np.unique(panel.colours, axis=0)) > 10  # lit
    arms = panel.lines[0].segments
    middle = arms.mean(axis=1)
    # crosses are on the surface, a little in front of it
    off = np.abs(np.linalg.norm(middle, axis=1) - 1.0)
    assert len(arms) > 200 and off.max() < 0.05


def test_markers_behind_the_surface_are_hidden():
    f = face_field(*(lambda model, mesh: (model, mesh, aligned_field(mesh)))(*model_of(sm.sphere(6))))
    panel = build_field_scene((f,)).panels[1]
    spots = np.concatenate([m.points for m in panel.markers])
    seen = _in_front(panel, spots, 0.1)
    assert len(spots) == 8
    assert seen[spots[:, 2] > 0.2].all() and not seen[spots[:, 2] < -0.2].any()
