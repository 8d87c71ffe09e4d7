import gmsh
import models
import numpy as np
import pytest

from gmsh_crossquad.cad.background import background_meshes, face_meshes
from gmsh_crossquad.cad.session import guest
from gmsh_crossquad.errors import MeshError
from gmsh_crossquad.field.surface_mesh import SurfaceMesh
from gmsh_crossquad.options import MeshOptions

MODELS = {
    "square": models.square,
    "l_shape": models.l_shape,
    "disc": models.disc,
    "disc of 3 arcs": lambda: models.disc(arcs=3),
    "annulus": models.annulus,
    "plate": models.plate_with_holes,
    "crack": models.square_with_crack,
    "edge crack": models.square_with_edge_crack,
    "cross": models.square_with_cross,
    "embedded circle": models.square_with_embedded_circle,
    "two squares": models.two_squares,
    "two materials": models.two_materials,
    "triple junction": models.triple_junction,
    "wedge": lambda: models.wedge(4.0),
    "needle": lambda: models.wedge(0.1),
    "thin gap": lambda: models.plate_with_holes([(0.5, 0.2002, 0.2)]),
}
CORNERS = {  # opening angles in degrees, per face
    "square": [[90] * 4],
    "l_shape": [[90] * 5 + [270]],
    "disc": [[180]],
    "annulus": [[180, 180]],
    "crack": [[90] * 4 + [360, 360]],
    "edge crack": [[90] * 6 + [360]],
    "cross": [[90] * 8 + [360] * 4],
    "embedded circle": [[90] * 4 + [180] * 2],
    "two squares": [[90] * 4] * 2,
    "triple junction": [[90, 90, 120]] * 3,
    "wedge": [[90, 90, np.degrees(4.0)]],
}
EULER = {"annulus": [0], "plate": [0], "crack": [0], "cross": [0], "two materials": [0, 1], "thin gap": [0]}


@pytest.fixture(scope="module")
def backgrounds():
    with guest():
        return {name: (model, background_meshes(model, MeshOptions())) for name, model in ((k, f()) for k, f in MODELS.items())}


@pytest.mark.parametrize("name", MODELS)
def test_invariants(backgrounds, name):
    model, meshes = backgrounds[name]
    assert [m.face for m in meshes] == list(range(len(model.faces)))
    for row, m in enumerate(meshes):
        mesh = SurfaceMesh(m.points, m.triangles)
        p = m.points[m.triangles]
        u, v = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]
        assert (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0] > 0).all()
        assert mesh.euler == EULER.get(name, [1] * len(meshes))[row]
        assert not (mesh.boundary_vertex[mesh.edges].all(axis=1) & ~mesh.boundary_edge).any()
        assert not mesh.boundary_vertex[mesh.triangles].all(axis=1).any()
        # every boundary half-edge once, and every boundary point starts one only
        half = mesh.half_edges[mesh.edge_half_edges[mesh.boundary_edge, 0]]
        assert sorted(map(tuple, half.tolist())) == sorted(map(tuple, m.boundary.tolist()))
        assert len(set(m.boundary[:, 0].tolist())) == len(m.boundary)
        # arc lengths place the points
        for k in range(2):
            for c in np.unique(m.boundary_curve):
                mine = m.boundary_curve == c
                there = model.faces[row].local(model.curves[c].at(m.boundary_arclength[mine, k]))
                np.testing.assert_allclose(m.points[m.boundary[mine, k]], there, atol=1e-12)
        known = m.vertex >= 0
        np.testing.assert_allclose(m.points[known], model.faces[row].local(model.vertices[m.vertex[known]]), atol=1e-12)
        assert (np.isfinite(m.opening_angle) == (known & mesh.boundary_vertex)).all()
        fan = np.bincount(m.triangles.ravel())
        corner = np.isfinite(m.opening_angle)
        assert (fan[corner] >= np.maximum(2, m.opening_angle[corner] / np.radians(45))).all()


@pytest.mark.parametrize("name", CORNERS)
def test_opening_angles(backgrounds, name):
    _, meshes = backgrounds[name]
    for m, expected in zip(meshes, CORNERS[name], strict=True):
        found = np.degrees(np.sort(m.opening_angle[np.isfinite(m.opening_angle)]))
        np.testing.assert_allclose(found, sorted(expected), atol=0.01)


@pytest.mark.parametrize("name", ["square", "disc", "plate", "two materials", "l_shape"])
def test_number_of_triangles_is_moderate(backgrounds, name):
    _, meshes = backgrounds[name]
    assert 1000 < sum(len(m.triangles) for m in meshes) < 8000


def test_shared_curve_has_the_same_nodes_on_both_sides(backgrounds):
    _, (outer, inner) = backgrounds["two materials"]
    nodes = [set(m.boundary_arclength[m.boundary_curve == 4].ravel().tolist()) for m in (outer, inner)]
    assert nodes[0] == nodes[1]
    assert len(nodes[0]) > 8


def doubled_crack():
    """A square with a crack from its right side to its centre that is drawn twice, with a vertex of each lip at its mouth."""
    v = [(0, 0), (2, 0), (2, 1), (2, 1), (2, 2), (0, 2), (1, 1)]
    ends = [(0, 1), (1, 2), (2, 6), (6, 3), (3, 4), (4, 5), (5, 0)]
    curves = [(a, b, models.line(v[a], v[b])) for a, b in ends]
    return models.build(v, curves, [([[(i, 1) for i in range(7)]], [], [])])


def test_crack_that_is_drawn_twice():
    model = doubled_crack()
    with guest():
        (m,) = background_meshes(model, MeshOptions())
    mesh = SurfaceMesh(m.points, m.triangles)
    assert mesh.euler == 1
    assert mesh.area.sum() * model.scale**2 == pytest.approx(4.0)
    corner = np.isfinite(m.opening_angle)
    angles = dict(zip(m.vertex[corner].tolist(), np.degrees(m.opening_angle[corner]).tolist()))
    assert angles == pytest.approx({0: 90, 1: 90, 2: 90, 3: 90, 4: 90, 5: 90, 6: 360})
    # every lip has its own side: the second vertex of the mouth is above the crack
    for vertex, curve, step in ((2, 2, 0), (3, 3, 1)):
        (point,) = np.flatnonzero(m.vertex == vertex)
        assert m.boundary_curve[m.boundary[:, step] == point] == [curve]


def test_embedded_point_is_a_port_inside():
    model = models.polygon([(0, 0), (1, 0), (1, 1), (0, 1)], embedded_points=[(0.3, 0.4)])
    with guest():
        (m,) = background_meshes(model, MeshOptions())
    (point,) = np.flatnonzero(m.port)
    assert m.vertex[point] == 4
    assert np.isnan(m.opening_angle[point])
    assert not SurfaceMesh(m.points, m.triangles).boundary_vertex[point]


def test_background_factor_makes_finer():
    model = models.disc()
    with guest():
        coarse, fine = (background_meshes(model, MeshOptions(background=f)) for f in (1.0, 0.5))
    assert 3.0 < len(fine[0].triangles) / len(coarse[0].triangles) < 5.0


def test_repeated_runs_are_identical():
    model = models.plate_with_holes()
    with guest():
        one, two = (background_meshes(model, MeshOptions())[0] for _ in range(2))
    np.testing.assert_array_equal(one.points, two.points)
    np.testing.assert_array_equal(one.triangles, two.triangles)


def test_session_stays_as_it_was():
    with guest():
        gmsh.model.add("mine")
        gmsh.model.occ.addRectangle(0, 0, 0, 4e3, 3e3)
        gmsh.model.occ.synchronize()
        gmsh.option.setNumber("Mesh.Algorithm", 8)
        calls = []
        gmsh.model.mesh.setSizeCallback(lambda dim, tag, x, y, z, lc: calls.append(tag) or 1e3)
        size, names = gmsh.option.getNumber("General.BoundingBoxSize"), gmsh.model.list()
        background_meshes(models.square(), MeshOptions())
        assert not calls
        assert gmsh.model.getCurrent() == "mine"
        assert gmsh.model.list() == names
        assert gmsh.option.getNumber("Mesh.Algorithm") == 8
        assert gmsh.option.getNumber("General.BoundingBoxSize") == pytest.approx(size, rel=1e-9)
        assert not len(gmsh.model.mesh.getNodes()[0])
        gmsh.model.mesh.generate(1)
        assert calls  # the user's callback still lives
        gmsh.option.setNumber("Mesh.Algorithm", 6)
        gmsh.model.remove()


def test_chord_that_cuts_a_neighbour_gets_more_nodes():
    # the four chords of a coarse circle would cut through the square around the disc
    disc = models.arc((0.5, 0.5), 0.49, 0.0, 2 * np.pi)
    ring = [(0, 0), (1, 0), (1, 1), (0, 1)]
    curves = [(i, (i + 1) % 4, models.line(ring[i], ring[(i + 1) % 4])) for i in range(4)] + [(4, 4, disc)]
    inner = [(0.6, 0.8), (0.8, 0.8), (0.8, 0.6)]
    curves += [(5 + i, 5 + (i + 1) % 3, models.line(inner[i], inner[(i + 1) % 3])) for i in range(3)]
    faces = [([[(4, 1)], [(5, 1), (6, 1), (7, 1)]], [], [])]
    model = models.build([*ring, (0.99, 0.5), *inner], curves, faces)
    spacing = [np.linspace(0.0, c.length, 4 + 1) for c in model.curves]
    with guest():
        (m,) = face_meshes(model, tuple(spacing), np.array([0.1]))
    assert (m.boundary_curve == 4).sum() > 4
    assert SurfaceMesh(m.points, m.triangles).euler == 0


def test_crossing_boundary_is_an_error():
    with guest(), pytest.raises(MeshError, match="surface 1"):
        models.background(models.polygon([(0, 0), (1, 1), (1, 0), (0, 1.5)]), 0.1)
