"""Indices against an independent library: libigl's singularities of a cross field that is constant on triangles."""

import numpy as np
import pytest

from gmsh_crossquad.field.align import align
from gmsh_crossquad.field.operators import FieldOperators
from gmsh_crossquad.field.singularities import snap_to_vertices
from gmsh_crossquad.field.smooth import edge_angle, smooth_field
from gmsh_crossquad.records import CrossField
from gmsh_crossquad.source.eigenmode import Eigenmode
from gmsh_crossquad.source.formula import Singularities
from gmsh_crossquad.source.samples import Samples

from .field_meshes import annulus, at, disc
from .source_frames import frames_of, inner_indices, random_square

igl = pytest.importorskip("igl")


def on_triangles(mesh, field):
    """Unit vectors (m, 3) of an arm at every centroid: the mean over the edges, without a wrap."""
    first = (field.theta + edge_angle(mesh))[mesh.triangle_edges[:, 0]]
    rest = np.cumsum(field.rotation, axis=1)
    angle = first + (rest[:, 0] + rest[:, 1]) / 3
    return np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)


def by_libigl(mesh, field):
    """(n,) indices modulo 4; 0 on the boundary."""
    points = np.column_stack([mesh.points, np.zeros(len(mesh.points))])
    x = on_triangles(mesh, field)
    y = np.cross([0.0, 0.0, 1.0], x)
    _, index = igl.find_cross_field_singularities(points, mesh.triangles.astype(np.int64), x, y, False)
    return np.where(mesh.boundary_vertex, 0, np.asarray(index).ravel() % 4)


def formula():
    mesh = disc(16, 48)
    places = [mesh.points[at(mesh, 0.4, 0.1)], mesh.points[at(mesh, -0.3, -0.4)]]
    return mesh, Singularities(places, [1, -1]).on(frames_of(mesh))


def aligned():
    mesh = disc(16, 48)
    places = [mesh.points[at(mesh, 0.4, 0.1)], mesh.points[at(mesh, -0.3, -0.4)], mesh.points[at(mesh, -0.5, 0.3)]]
    boundary = np.zeros(len(mesh.points), np.int64)
    boundary[[at(mesh, 1, 0), at(mesh, 0, 1), at(mesh, -1, 0)]] = 1
    field = Singularities(places, [1, -1, 1]).on(frames_of(mesh))
    return mesh, align(mesh, FieldOperators(mesh), field, boundary).field


def smooth(mesh):
    return mesh, smooth_field(mesh, FieldOperators(mesh))


def mode(number, mesh):
    return mesh, Eigenmode(number).on(frames_of(mesh))


def samples():
    source, mesh = disc(24, 70), disc(12, 40)
    z = source.points @ [1, 1j]
    angle = (np.angle(z - 0.42) - np.angle(z + 0.31 - 0.2j) + np.angle(z + 0.1 + 0.5j)) / 4
    values = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return mesh, Samples(source.points, source.triangles, values, "direction").on(frames_of(mesh))


CASES = {
    "formula": formula,
    "aligned": aligned,
    "smooth": lambda: smooth(disc(16, 40)),
    "smooth with corners": lambda: smooth(random_square(900, 3)),
    "mode": lambda: mode(4, disc(16, 48)),
    "mode with a hole": lambda: mode(3, annulus(0.4, 12, 60)),
    "samples": samples,
}


@pytest.mark.parametrize("name", CASES)
def test_indices_agree(name):
    mesh, field = CASES[name]()
    field = CrossField(field.theta, snap_to_vertices(mesh, field.rotation))
    _, index = inner_indices(mesh, field)
    assert np.array_equal(by_libigl(mesh, field), index % 4)
    assert np.any(index) or name == "smooth with corners"
