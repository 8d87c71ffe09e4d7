import numpy as np
import pytest

from gmsh_crossquad.errors import LayoutError
from gmsh_crossquad.field.clearance import Clearance
from gmsh_crossquad.field.edge_frames import EdgeFrames
from gmsh_crossquad.field.pipeline import aligned_field
from gmsh_crossquad.field.singularities import singular_vertices, triangle_index
from gmsh_crossquad.field.strong import split_strong
from gmsh_crossquad.field.surface_mesh import SurfaceMesh
from gmsh_crossquad.source.formula import Singularities

from . import models
from .field_meshes import at, disc, grid


def formula(mesh, vertices, index):
    """The exact field: strong singularities turn by more than 45 degrees from edge to edge."""
    points = np.c_[mesh.points, np.zeros(len(mesh.points))]
    frames = EdgeFrames(1, mesh, points, np.tile([0.0, 0.0, 1.0], (len(mesh.edges), 1)))
    return Singularities(mesh.points[vertices], index).on(frames)


@pytest.mark.parametrize("quarters", [2, 3])
def test_strong_indices_are_shared_around_their_place(quarters):
    mesh = disc(20, 60)
    centre, other = at(mesh, 0.1, 0.0), at(mesh, -0.7, 0.0)
    field = formula(mesh, [centre, other], [quarters, -2])
    rotation, moved = split_strong(mesh, Clearance(mesh, []), field.rotation, np.zeros(len(mesh.points), bool))
    vertices, index = singular_vertices(mesh, rotation)
    assert sorted(index) == [-2] + [1] * quarters
    assert vertices[index == -2] == other
    assert not triangle_index(rotation).any()
    assert moved == tuple((centre, v) for _, v in moved) and len({v for _, v in moved}) == quarters
    places = mesh.points[[v for _, v in moved]]
    distance = np.linalg.norm(places - mesh.points[centre], axis=1)
    room = 0.35 * min(0.4, 0.9)
    assert np.all(np.abs(distance - room) < 0.06)
    assert np.linalg.norm(places.mean(axis=0) - mesh.points[centre]) < 0.05


def test_others_stay_where_they_are():
    mesh = disc()
    field = formula(mesh, [0, at(mesh, 0.5, 0.3)], [1, -3])
    rotation, moved = split_strong(mesh, Clearance(mesh, []), field.rotation, np.zeros(len(mesh.points), bool))
    assert moved == () and rotation is field.rotation


def test_a_mesh_without_room_is_refused():
    mesh = grid(2, 2)
    v = at(mesh, 1, 1)
    field = formula(mesh, [v], [2])
    avoid = np.ones(len(mesh.points), bool)
    with pytest.raises(LayoutError, match="no room to split a singularity of index 2/4 at"):
        split_strong(mesh, Clearance(mesh, []), field.rotation, avoid)


def test_the_aligned_field_tells_what_was_split():
    mesh = models.background(models.disc(), 0.03)[0]
    surface = SurfaceMesh(mesh.points, mesh.triangles)
    centre = at(surface, 0.02, 0.0)
    aligned = aligned_field(mesh, formula(surface, [centre], [4]))
    assert [a for a, _ in aligned.split] == [centre] * 4
    assert sorted(aligned.index[aligned.index != 0]) == [1, 1, 1, 1]
    assert aligned.index[centre] == 0
