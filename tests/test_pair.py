import numpy as np
import pytest

from gmsh_crossquad.field.pair import add_pair
from gmsh_crossquad.field.singularities import singular_vertices

from .field_meshes import annulus, at, grid, square_corners
from .test_flux import flux, nowhere, ready


def test_a_pair_makes_the_flux_vanish_and_leaves_the_others():
    mesh = annulus(0.35, 16, 80)
    vertices = [at(mesh, 0.6, 0.0), at(mesh, 0.0, 0.7)]
    aligner, field, clearance = ready(mesh, np.zeros(len(mesh.points), np.int64), vertices, [1, -1])
    assert abs(flux(aligner, field)[0]) > 1.0
    pair = add_pair(aligner, clearance, field, vertices, nowhere(mesh))
    assert np.abs(pair.flux).max() < 0.05
    places, index = singular_vertices(mesh, pair.field.rotation)
    found = dict(zip(places.tolist(), index.tolist()))
    assert [found.pop(v) for v in vertices] == [1, -1]
    assert sorted(found.values()) == [-1, 1]
    p, q = mesh.points[list(found)]
    assert np.hypot(*(p - q)) > 0.1
    aligner.finish(aligner.rotate(pair.field), pair.field)


def test_a_pair_where_the_field_has_no_singularity():
    # +1/4 and -1/4 on the outer circle, a third of a turn apart
    mesh = annulus(0.35, 16, 84)
    wanted = np.zeros(len(mesh.points), np.int64)
    wanted[at(mesh, 1.0, 0.0)], wanted[at(mesh, -0.5, np.sqrt(0.75))] = 1, -1
    aligner, field, clearance = ready(mesh, wanted, [], [])
    assert abs(flux(aligner, field)[0]) > 1.0
    pair = add_pair(aligner, clearance, field, [], nowhere(mesh))
    assert np.abs(pair.flux).max() < 0.05


@pytest.mark.parametrize("full", [True, False])
def test_no_pair_without_room_or_holes(full):
    mesh = annulus() if full else grid(8, 8)
    wanted = np.zeros(len(mesh.points), np.int64) if full else square_corners(mesh)
    aligner, field, clearance = ready(mesh, wanted, [], [])
    avoid = nowhere(mesh)
    avoid[:] = full
    assert add_pair(aligner, clearance, field, [], avoid) is None
