"""Singular points on curved CAD faces: which face has them, and that they are vertices of its background mesh."""

import gmsh
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gmsh_crossquad.cad.curved_background import curved_meshes
from gmsh_crossquad.cad.curved_seeds import _quality, with_vertices
from gmsh_crossquad.cad.read import read_model
from gmsh_crossquad.cad.seeds import face_seeds, inner_points
from gmsh_crossquad.cad.spacing import curve_spacing, face_sizes
from gmsh_crossquad.errors import FieldError, InputError
from gmsh_crossquad.field.surface_mesh import SurfaceMesh
from gmsh_crossquad.field_stage import field_of_face, wishes
from gmsh_crossquad.options import MeshOptions
from gmsh_crossquad.source.formula import Singularities
from tests import surface_meshes as sm

CUBE = np.array([[a, b, c] for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)]) / 3**0.5
TURN = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]


@pytest.fixture
def session():
    gmsh.initialize(readConfigFiles=False)
    gmsh.option.setNumber("General.Terminal", 0)
    yield gmsh.model.occ
    gmsh.finalize()


def only_faces(kind="Sphere"):
    """The faces of one kind are those to mesh."""
    gmsh.model.occ.synchronize()
    gmsh.model.removeEntities(gmsh.model.getEntities(3))
    tags = [t for _, t in gmsh.model.getEntities(2) if gmsh.model.getType(2, t) == kind]
    gmsh.model.addPhysicalGroup(2, tags, name="part")
    return read_model(MeshOptions())


def background(model, seeds=None):
    sizes = face_sizes(model, MeshOptions())
    inner = inner_points(model, sizes, seeds)
    rows = [row for row, face in enumerate(model.faces) if face.curved]
    return curved_meshes(model, rows, curve_spacing(model, MeshOptions(), sizes, inner), sizes, inner)


def world(model, row, local):
    return model.origin + model.scale * model.faces[row].world(local)


def fields(model, positions, quarters, **options):
    """Background meshes and aligned fields with given singularities."""
    wanted = wishes(model, MeshOptions(field=Singularities(positions, quarters), **options))
    return [(mesh, *field_of_face(model, mesh, wanted)) for mesh in background(model, wanted.seeds)]


def inside(mesh, aligned):
    """Places and indices of the interior singularities."""
    rows = np.flatnonzero(aligned.index * ~SurfaceMesh(mesh.points, mesh.triangles).boundary_vertex)
    return rows, aligned.index[rows]


# ---- the mesh


@given(st.integers(0, 10**6), st.sampled_from(["sphere", "torus", "bump"]))
@settings(max_examples=25, deadline=None)
def test_random_points_become_vertices(seed, name):
    mesh = {"sphere": sm.sphere, "torus": sm.torus, "bump": sm.bump}[name]()
    rng = np.random.default_rng(seed)
    inner = np.flatnonzero(~mesh.boundary_vertex[mesh.triangles].any(axis=1))
    weight = rng.dirichlet(np.ones(3), 6)
    wanted = np.einsum("kc,kcd->kd", weight, mesh.points[mesh.triangles[rng.choice(inner, 6, replace=False)]])
    segments = mesh.edges[mesh.boundary_edge]
    points, triangles, rows = with_vertices(mesh.points, mesh.triangles, mesh.boundary_vertex, segments, wanted)
    np.testing.assert_array_equal(points[rows], wanted)
    assert len(set(rows.tolist())) == len(wanted)
    new = SurfaceMesh(points, triangles)
    assert new.euler == mesh.euler
    assert sorted(map(tuple, new.edges[new.boundary_edge].tolist())) == sorted(map(tuple, segments.tolist()))
    # on the same side as the triangle of the old mesh that is nearest
    from scipy.spatial import cKDTree

    near = cKDTree(mesh.points[mesh.triangles].mean(axis=1)).query(points[triangles].mean(axis=1))[1]
    assert np.einsum("tc,tc->t", new.triangle_normal, mesh.triangle_normal[near]).min() > 0.5
    assert _quality(points[triangles])[1].min() > 0.05


def test_a_point_near_fixed_vertices_is_put_in():
    """All vertices are fixed: the triangle, or the two triangles at a side, are cut."""
    mesh = sm.sphere(4)
    fixed = np.ones(len(mesh.points), bool)
    corner = mesh.points[mesh.triangles[7]]
    for weight, before in (([0.3, 0.4, 0.3], 1), ([0.0, 0.5, 0.5], 2)):
        place = np.array(weight) @ corner
        points, triangles, rows = with_vertices(mesh.points, mesh.triangles, fixed, np.zeros((0, 2), int), place[None])
        assert rows.tolist() == [len(mesh.points)]
        assert SurfaceMesh(points, triangles).euler == 2
        assert len(triangles) == len(mesh.triangles) + 2
        assert (triangles == rows[0]).sum() >= before + 2


# ---- CAD


def test_points_go_to_their_feet(session):
    session.addSphere(0, 0, 0, 1)
    model = only_faces()
    points = np.array([[0.6, 0, 0.8], [0, 0, 1.01], [0, -1.005, 0]])
    (seeds,) = face_seeds(model, points, strict=True)
    np.testing.assert_allclose(world(model, 0, seeds), points / np.linalg.norm(points, axis=1)[:, None], atol=1e-9)
    (mesh,) = background(model, (seeds,))
    rows = np.flatnonzero(mesh.seed >= 0)
    np.testing.assert_array_equal(mesh.points[rows], seeds[mesh.seed[rows]])
    assert sorted(mesh.seed[rows].tolist()) == [0, 1, 2]


def test_close_points_have_room(session):
    session.addTorus(0, 0, 0, 1, 0.4)
    model = only_faces("Torus")
    points = np.array([[1.4, 0, 0], [1.4, 0.02, 0], [-1, 0, 0.4]])
    (seeds,) = face_seeds(model, points, strict=True)
    (mesh,) = background(model, (seeds,))
    surface = SurfaceMesh(mesh.points, mesh.triangles)
    special = np.flatnonzero(mesh.seed >= 0).tolist()
    assert len(special) == 3
    for v in special:
        ring = surface.neighbours(v)
        assert len(ring) >= 4
        assert not set(ring) & set(special)
    assert len(mesh.triangles) < 20_000


def test_far_points_are_refused(session):
    session.addSphere(0, 0, 0, 1)
    model = only_faces()
    with pytest.raises(
        FieldError, match=r"on no face, the nearest is 2\.\d+ % of its size away at \(1\.1, 0, 0\): put it on a surface"
    ):
        face_seeds(model, np.array([[1.1, 0, 0]]), strict=True)
    with pytest.raises(FieldError, match="and near none at"):
        face_seeds(model, np.array([[7.0, 0, 0]]), strict=True)
    with pytest.raises(FieldError, match="two coordinates on a curved face"):
        face_seeds(model, np.array([[0.1, 0, np.nan]]), strict=True)
    assert len(face_seeds(model, np.array([[7.0, 0, 0]]))[0]) == 0


def test_every_point_has_one_face(session):
    """A cylinder with caps: points of a plane face are none of the curved one, and the other way round."""
    session.addCylinder(0, 0, 0, 0, 0, 2, 0.7)
    session.synchronize()
    model = read_model(MeshOptions())
    points = np.array([[0.7, 0, 1.0], [0.1, 0.2, 2.0], [0, 0.705, 0.3], [0.1, 0, 0]])
    seeds = face_seeds(model, points, strict=True)
    kinds = [gmsh.model.getType(2, f.tag) for f in model.faces]
    count = {kind: sum(len(s) for s, k in zip(seeds, kinds) if k == kind) for kind in set(kinds)}
    assert count == {"Cylinder": 2, "Plane": 2}
    row = kinds.index("Cylinder")
    np.testing.assert_allclose(np.linalg.norm(world(model, row, seeds[row])[:, :2], axis=1), 0.7, atol=1e-9)


def test_points_beside_a_trimmed_face(session):
    """Half a sphere: the foot of a point on the other half is on the surface, but not in the face."""
    session.addSphere(0, 0, 0, 1, angle1=0)
    model = only_faces()
    assert len(face_seeds(model, np.array([[0.6, 0, 0.8]]), strict=True)[0]) == 1
    with pytest.raises(FieldError, match="on no face"):
        face_seeds(model, np.array([[0.6, 0, -0.8]]), strict=True)
    with pytest.raises(FieldError, match="on the boundary"):
        face_seeds(model, np.array([[0.6, 0.8, 0.0]]), strict=True)


# ---- the field


def test_sphere_with_eight_points(session):
    """The corners of a cube: exactly those; by symmetry the crosses follow the edges of the cube."""
    session.addSphere(0, 0, 0, 1)
    model = only_faces()
    ((mesh, aligned, _),) = fields(model, CUBE @ TURN.T, [1] * 8)
    rows, index = inside(mesh, aligned)
    assert index.tolist() == [1] * 8
    found = world(model, 0, mesh.points[rows])
    assert np.linalg.norm(found[:, None] - (CUBE @ TURN.T)[None], axis=2).min(axis=0).max() < 1e-9
    surface = SurfaceMesh(mesh.points, mesh.triangles)
    middle = world(model, 0, mesh.points[surface.edges].mean(axis=1)) @ TURN
    edge = np.flatnonzero((np.abs(middle[:, 0]) < 0.05) & (np.abs(np.abs(middle[:, 1:]) - 0.7).max(axis=1) < 0.05))
    along = (mesh.points[surface.edges[edge, 1]] - mesh.points[surface.edges[edge, 0]]) @ TURN
    normal = surface.edge_normal[edge] @ TURN
    line = np.array([1.0, 0, 0]) - normal * normal[:, :1]
    angle = np.arctan2(np.einsum("kc,kc->k", np.cross(along, line), normal), np.einsum("kc,kc->k", along, line))
    assert len(edge) >= 4
    assert np.abs(np.sin(2 * (angle - aligned.field.theta[edge]))).max() < 0.1


def test_octant_with_a_point_off_centre(session):
    session.addSphere(0, 0, 0, 1, angle1=0, angle3=np.pi / 2)
    model = only_faces()
    place = np.array([0.8, 0.5, 0.35])
    ((mesh, aligned, _),) = fields(model, place[None], [1])
    rows, index = inside(mesh, aligned)
    assert index.tolist() == [1]
    np.testing.assert_allclose(world(model, 0, mesh.points[rows[0]]), place / np.linalg.norm(place), atol=1e-9)
    assert aligned.residual < 1e-10
    assert aligned.index.sum() == 4


def test_indices_that_do_not_add_up(session):
    session.addSphere(0, 0, 0, 1)
    model = only_faces()
    with pytest.raises(FieldError, match=r"closed surface add up to \+1 where chi = 2 is needed, surface 1: .*\(4 sing"):
        fields(model, CUBE[:4], [1] * 4)


def test_index_in_the_name_of_an_embedded_point(session):
    geo = gmsh.model.geo
    centre = geo.addPoint(0, 0, 0)
    p = [geo.addPoint(*q) for q in np.eye(3).tolist()]
    loop = geo.addCurveLoop([geo.addCircleArc(p[i], centre, p[(i + 1) % 3]) for i in range(3)])
    face = geo.addSurfaceFilling([loop], -1, centre)
    place = np.array([0.8, 0.5, 0.35]) / np.linalg.norm([0.8, 0.5, 0.35])
    inner = geo.addPoint(*place.tolist())
    stray = geo.addPoint(*(place[::-1]).tolist())
    geo.synchronize()
    gmsh.model.mesh.embed(0, [inner], 2, face)
    gmsh.model.addPhysicalGroup(0, [inner], name="index=1/4")
    model = read_model(MeshOptions())
    wanted = wishes(model, MeshOptions())
    (mesh,) = background(model, wanted.seeds)
    aligned, _ = field_of_face(model, mesh, wanted)
    rows, index = inside(mesh, aligned)
    assert index.tolist() == [1]
    assert model.vertex_tags[mesh.vertex[rows[0]]] == inner
    with pytest.raises(InputError, match=r"not embedded in surface 1, .*Point\{6\} In Surface\{1\}"):
        wishes(model, MeshOptions(boundary_index={stray: "1/4"}))
