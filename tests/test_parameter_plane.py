"""Curved faces that Gmsh's mesher does not get done: triangles from the parameter plane, plain sizes, and flips to Delaunay."""

import gmsh
import numpy as np
import pytest

from gmsh_crossquad.cad import curved_mesh
from gmsh_crossquad.cad.background import background_meshes
from gmsh_crossquad.cad.parameter_plane import parameter_mesh
from gmsh_crossquad.cad.read import read_model
from gmsh_crossquad.cad.spacing import curve_spacing, face_sizes
from gmsh_crossquad.errors import MeshError
from gmsh_crossquad.field.delaunay import delaunay_flips
from gmsh_crossquad.field.surface_mesh import SurfaceMesh
from gmsh_crossquad.options import MeshOptions


@pytest.fixture
def session():
    gmsh.initialize(readConfigFiles=False)
    gmsh.option.setNumber("General.Terminal", 0)
    yield gmsh.model
    gmsh.finalize()


def area(mesh):
    p = mesh.points[mesh.triangles]
    return 0.5 * np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1).sum()


def quarter_cylinder(kernel, height=1.0, **layers):
    """A quarter of a cylinder of radius 1, extruded from its arc."""
    points = [kernel.addPoint(*p) for p in [(0, 0, 0), (1, 0, 0), (0, 1, 0)]]
    arc = kernel.addCircleArc(points[1], points[0], points[2])
    kernel.extrude([(1, arc)], 0, 0, height, **layers)
    kernel.synchronize()
    return read_model(MeshOptions())


@pytest.mark.parametrize("kernel", ["geo", "occ"])
@pytest.mark.parametrize("recombine", [False, True])
def test_sides_of_an_extrusion_with_layers(session, kernel, recombine):
    """Gmsh meshes them from the nodes of the layers only, which are not ours."""
    model = quarter_cylinder(getattr(session, kernel), numElements=[2, 1], heights=[0.6, 1], recombine=recombine)
    (mesh,) = background_meshes(model, MeshOptions())
    own = SurfaceMesh(mesh.points, mesh.triangles)
    assert len(own.points) - len(own.edges) + len(own.triangles) == 1
    known = np.isfinite(mesh.parameters[:, 0])  # all but those that split triangles at corners
    assert known.mean() > 0.9
    x, y, _ = (mesh.points[known] * model.scale + model.origin).T
    assert np.hypot(x, y) == pytest.approx(np.ones(len(x)), abs=1e-9)
    assert area(mesh) * model.scale**2 == pytest.approx(np.pi / 2, rel=1e-3)


def spacing_of(model):
    sizes = face_sizes(model, MeshOptions())
    return curve_spacing(model, MeshOptions(), sizes), float(sizes[0])


@pytest.mark.parametrize("height", [0.05, 1.0, 20.0])
def test_parameters_of_any_proportions_give_good_triangles(session, height):
    model = quarter_cylinder(session.occ, height)
    mesh = parameter_mesh(model, 0, *spacing_of(model))
    p = mesh.points[mesh.triangles]
    normal = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    quality = 2 * np.sqrt(3) * np.linalg.norm(normal, axis=1) / ((np.roll(p, -1, axis=1) - p) ** 2).sum(axis=(1, 2))
    assert quality.min() > 0.3
    assert np.quantile(quality, 0.1) > 0.7
    # oriented as the surface
    middle = p.mean(axis=1) * model.scale + model.origin
    uv = gmsh.model.getParametrization(2, model.faces[0].tag, middle.ravel())
    up = gmsh.model.getNormal(model.faces[0].tag, uv).reshape(-1, 3)
    assert (np.einsum("ij,ij->i", normal, up) > 0).all()


def test_a_face_with_a_seam_has_no_parameter_plane(session):
    session.occ.addCylinder(0, 0, 0, 0, 0, 1, 0.5)
    session.occ.synchronize()
    model = read_model(MeshOptions())
    row = next(r for r, face in enumerate(model.faces) if face.curved)
    with pytest.raises(MeshError):
        parameter_mesh(model, row, *spacing_of(model))


@pytest.mark.parametrize("shape", ["addSphere", "addTorus"])
def test_faces_that_fail_otherwise_are_meshed_with_plain_sizes(session, monkeypatch, shape):
    make = {"addSphere": (0, 0, 0, 1), "addTorus": (0, 0, 0, 1, 0.4)}
    exact = {"addSphere": 4 * np.pi, "addTorus": 4 * np.pi**2 * 0.4}
    generate, collected, plain = curved_mesh._generate, curved_mesh.collected, []

    def generated(*arguments):
        plain.append(arguments[-1])
        return generate(*arguments)

    def collect(*arguments):
        if not plain[-1]:
            raise MeshError("not this time")
        return collected(*arguments)

    monkeypatch.setattr(curved_mesh, "_generate", generated)
    monkeypatch.setattr(curved_mesh, "collected", collect)
    getattr(session.occ, shape)(*make[shape])
    session.occ.synchronize()
    model = read_model(MeshOptions())
    (mesh,) = background_meshes(model, MeshOptions())
    own = SurfaceMesh(mesh.points, mesh.triangles)
    assert not own.boundary_vertex.any()
    assert len(own.points) - len(own.edges) + len(own.triangles) == {"addSphere": 2, "addTorus": 0}[shape]
    assert area(mesh) * model.scale**2 == pytest.approx(exact[shape], rel=0.02)


def test_flips_make_a_stretched_mesh_delaunay():
    from scipy.spatial import Delaunay

    rng = np.random.default_rng(3)
    xy = rng.random((300, 2))
    stretched = Delaunay(xy * (1, 6)).simplices.astype(np.int64)
    points = np.column_stack([xy, np.zeros(300)])
    hull = Delaunay(xy).convex_hull
    inner = SurfaceMesh(points, stretched)
    keep = inner.edges[~inner.boundary_edge][:5]
    free = delaunay_flips(points, stretched, hull)
    key = lambda t: {frozenset(row) for row in t.tolist()}  # noqa: E731
    assert key(free) == key(Delaunay(xy).simplices)
    kept = delaunay_flips(points, stretched, keep)
    edges = {frozenset(e) for e in SurfaceMesh(points, kept).edges.tolist()}
    assert all(frozenset(e) in edges for e in keep.tolist())


def test_flips_do_not_change_a_delaunay_mesh_and_keep_orientation():
    from scipy.spatial import Delaunay

    xy = np.random.default_rng(5).random((200, 2))
    triangles = Delaunay(xy).simplices.astype(np.int64)
    points = np.column_stack([xy, np.zeros(200)])
    a, b, c = (xy[triangles[:, k]] for k in range(3))
    turned = ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]) < 0
    triangles[turned] = triangles[turned][:, ::-1]
    assert np.array_equal(delaunay_flips(points, triangles, np.zeros((0, 2), np.int64)), triangles)
