"""Hexahedra from plane models: volumes, orientation, conformity, topology, groups; solids filled by Gmsh on top of quads."""

import math

import gmsh
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import gmsh_crossquad as cq
from gmsh_crossquad import cli
from gmsh_crossquad.arguments import parse_extrusion
from gmsh_crossquad.errors import GeometryError, InputError

HEXAHEDRA = {1: 5, 2: 12, 3: 92}
INCOMPLETE = 17


pytestmark = pytest.mark.usefixtures("fresh_gmsh")


def plate():
    """A rectangle of 2 x 1 with a disc of another material in it and a hole."""
    occ = gmsh.model.occ
    disc, hole = occ.addDisk(0.6, 0.5, 0, 0.2, 0.2), occ.addDisk(1.5, 0.5, 0, 0.2, 0.2)
    body, _ = occ.cut([(2, occ.addRectangle(0, 0, 0, 2, 1))], [(2, hole)])
    occ.fragment(body, [(2, disc)])
    occ.synchronize()
    faces = sorted((gmsh.model.occ.getMass(2, t), t) for _, t in gmsh.model.getEntities(2))
    gmsh.model.addPhysicalGroup(2, [faces[0][1]], 5, "inclusion")
    gmsh.model.addPhysicalGroup(2, [faces[1][1]], 6, "body")
    left = [t for _, t in gmsh.model.getEntitiesInBoundingBox(-0.1, -0.1, -0.1, 0.1, 1.1, 0.1, 1)]
    gmsh.model.addPhysicalGroup(1, left, 8, "left")
    corner = [t for _, t in gmsh.model.getEntitiesInBoundingBox(-0.1, -0.1, -0.1, 0.1, 0.1, 0.1, 0)]
    gmsh.model.addPhysicalGroup(0, corner, 3, "corner")
    return 2 - 0.04 * math.pi


def volume(kind):
    points, weights = gmsh.model.mesh.getIntegrationPoints(kind, "Gauss6")
    determinants = gmsh.model.mesh.getJacobians(kind, points)[1]
    assert determinants.min() > 0
    return float(np.sum(determinants.reshape(-1, len(weights)) @ weights))


def groups():
    return {
        (d, gmsh.model.getPhysicalName(d, t)): (t, sorted(gmsh.model.getEntitiesForPhysicalGroup(d, t).tolist()))
        for d, t in gmsh.model.getPhysicalGroups()
    }


@pytest.mark.parametrize(("order", "incomplete"), [(1, False), (2, False), (2, True), (3, False)])
@pytest.mark.parametrize("along", [0.6, -0.6, (0.3, 0.1, -0.6)])
def test_volume_and_nodes(order, incomplete, along):
    area = plate()
    result = cq.mesh(0.25, order=order, incomplete=incomplete)
    made = result.extrude(along, 3)
    kind = INCOMPLETE if incomplete else HEXAHEDRA[order]
    tags, nodes = gmsh.model.mesh.getElementsByType(kind)
    assert len(tags) == made.hexahedra == 3 * len(result.mesh.quads)
    assert gmsh.model.mesh.getElementTypes(3).tolist() == [kind]
    all_tags = gmsh.model.mesh.getNodes()[0]
    assert set(nodes.tolist()) == set(all_tags.tolist()) == set(range(1, made.nodes + 1))
    assert not len(gmsh.model.mesh.getDuplicateNodes())
    assert volume(kind) == pytest.approx(0.6 * area, rel={1: 2e-2, 2: 1e-4, 3: 1e-4}[order])
    for measure in ("minSJ", "minSICN"):
        assert gmsh.model.mesh.getElementQualities(tags, measure).min() > 0


def hex_faces(nodes):
    """Sorted corners of the six faces of hexahedra."""
    sides = [(0, 1, 2, 3), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]
    return np.sort(nodes.reshape(-1, 8)[:, sides].reshape(-1, 4), axis=1)


def test_conforming_and_bounded_by_its_surfaces():
    """The faces of the hexahedra that only one has are the quads of surfaces on one volume; those of interfaces have two."""
    plate()
    cq.mesh(0.25).extrude(0.6, 2)
    faces, count = np.unique(hex_faces(gmsh.model.mesh.getElementsByType(5)[1]), axis=0, return_counts=True)
    assert count.max() == 2
    outer, interface = [], []
    for _, tag in gmsh.model.getEntities(2):
        volumes = gmsh.model.getAdjacencies(2, tag)[0]
        _, _, nodes = gmsh.model.mesh.getElements(2, tag)
        (outer if len(volumes) == 1 else interface).append(np.sort(nodes[0].reshape(-1, 4), axis=1))
    alone = {tuple(f) for f in faces[count == 1].tolist()}
    assert alone == {tuple(f) for f in np.concatenate(outer).tolist()}
    assert len(interface) == 1
    assert {tuple(f) for f in interface[0].tolist()} <= {tuple(f) for f in faces[count == 2].tolist()}


def test_groups_and_topology_after_writing(tmp_path):
    plate()
    before = groups()
    cq.mesh(0.25).extrude(0.6, 2)
    gmsh.option.setNumber("Mesh.SaveAll", 1)
    gmsh.write(str(tmp_path / "a.msh"))
    gmsh.clear()
    gmsh.open(str(tmp_path / "a.msh"))
    after = groups()
    assert set(after) == {
        (3, "inclusion"),
        (3, "body"),
        (2, "inclusion_bottom"),
        (2, "inclusion_top"),
        (2, "body_bottom"),
        (2, "body_top"),
        (2, "left"),
        (1, "corner"),
    }
    for (dim, name), (tag, _) in before.items():
        assert after[dim + 1, name][0] == tag
    assert after[2, "body_bottom"][1] == before[2, "body"][1]
    for (dim, name), z in (((2, "body_bottom"), 0.0), ((2, "body_top"), 0.6)):
        x = gmsh.model.mesh.getNodesForPhysicalGroup(dim, after[dim, name][0])[1].reshape(-1, 3)
        np.testing.assert_allclose(x[:, 2], z, atol=1e-15)
    x = gmsh.model.mesh.getNodesForPhysicalGroup(2, after[2, "left"][0])[1].reshape(-1, 3)
    assert np.abs(x[:, 0]).max() < 1e-12 and np.ptp(x[:, 2]) == pytest.approx(0.6)
    # a volume is bounded by its ends and the walls of its curves, and these close: Euler characteristic of the surface
    (body,) = after[3, "body"][1]
    boundary = gmsh.model.getBoundary([(3, body)], oriented=False)
    assert {after[2, f"body_{end}"][1][0] for end in ("bottom", "top")} <= {t for _, t in boundary}
    quads = np.concatenate([gmsh.model.mesh.getElements(2, t)[2][0].reshape(-1, 4) for _, t in boundary])
    half = np.sort(np.stack([quads.ravel(), np.roll(quads, -1, axis=1).ravel()], axis=1), axis=1)
    edges, uses = np.unique(half, axis=0, return_counts=True)
    assert set(uses.tolist()) == {2}
    assert len(np.unique(quads)) - len(edges) + len(quads) == 2 - 2 * 2  # a block with two holes through it


def test_walls_and_ends_are_oriented_outwards():
    """The divergence theorem over the oriented boundary of a volume."""
    plate()
    result = cq.mesh(0.25)
    result.extrude((0.2, 0.1, 0.6), 2)
    for _, tag in gmsh.model.getEntities(3):
        inside = volume_of(tag)
        flux = 0.0
        for _, signed in gmsh.model.getBoundary([(3, tag)], oriented=True):
            _, _, nodes = gmsh.model.mesh.getElements(2, abs(signed))
            x = np.array([gmsh.model.mesh.getNode(n)[0] for n in nodes[0]]).reshape(-1, 4, 3)
            area = 0.5 * np.cross(x[:, 2] - x[:, 0], x[:, 3] - x[:, 1])
            flux += np.sign(signed) * float(np.einsum("qc,qc->", area, x.mean(axis=1))) / 3
        assert abs(flux) == pytest.approx(inside, rel=1e-9)


def volume_of(tag):
    elements = gmsh.model.mesh.getElements(3, tag)[1][0]
    return float(gmsh.model.mesh.getElementQualities(elements, "volume").sum())


def test_faces_of_opposite_normals():
    points = [gmsh.model.geo.addPoint(x, y, 0) for x, y in ((0, 0), (1, 0), (2, 0), (2, 1), (1, 1), (0, 1))]
    line = gmsh.model.geo.addLine
    a, b, c, d = (line(points[i], points[j]) for i, j in ((0, 1), (1, 4), (4, 5), (5, 0)))
    e, f, g = (line(points[i], points[j]) for i, j in ((1, 2), (2, 3), (3, 4)))
    gmsh.model.geo.addPlaneSurface([gmsh.model.geo.addCurveLoop([a, b, c, d])])
    gmsh.model.geo.addPlaneSurface([gmsh.model.geo.addCurveLoop([b, -g, -f, -e])])
    gmsh.model.geo.synchronize()
    cq.mesh(0.25).extrude(1.0, 2)
    assert volume(5) == pytest.approx(2.0)


@settings(max_examples=15, deadline=None)
@given(
    normal=st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda n: np.linalg.norm(n) > 0.1),
    along=st.tuples(*[st.floats(-2, 2)] * 3),
    layers=st.integers(1, 4),
)
def test_any_plane_and_vector(normal, along, layers):
    """A unit square in any plane: the volume of the prism."""
    n = np.array(normal) / np.linalg.norm(normal)
    u = np.linalg.svd(n[None])[2][1]
    v = np.cross(n, u)
    gmsh.clear()
    p = [gmsh.model.geo.addPoint(*(a * u + b * v)) for a, b in ((0, 0), (1, 0), (1, 1), (0, 1))]
    lines = [gmsh.model.geo.addLine(i, j) for i, j in zip(p, [*p[1:], p[0]])]
    gmsh.model.geo.addPlaneSurface([gmsh.model.geo.addCurveLoop(lines)])
    gmsh.model.geo.synchronize()
    result = cq.mesh(0.5)
    height = abs(float(n @ along))
    if height < 1e-3:
        return
    result.extrude(along, layers)
    assert volume(5) == pytest.approx(height, rel=1e-9)


def test_refusals_leave_the_session_alone():
    plate()
    result = cq.mesh(0.25)
    name, models = gmsh.model.getCurrent(), gmsh.model.list()
    for along, layers, text in (
        ((1, 1, 0), 2, "along the faces"),
        (0.0, 2, "vector"),
        ((1, 2), 2, "vector"),
        (float("nan"), 2, "vector"),
        (1.0, 0, "layers"),
        (1.0, 1.5, "layers"),
    ):
        with pytest.raises(InputError, match=text):
            result.extrude(along, layers)
    with pytest.raises(InputError, match="hexahedra"):
        result.extrude(1.0, 10, most=100)
    gmsh.model.addPhysicalGroup(1, [gmsh.model.getEntities(1)[0][1]], name="body_top")
    with pytest.raises(GeometryError, match="body_top"):
        result.extrude(1.0, 2)
    assert (gmsh.model.getCurrent(), gmsh.model.list()) == (name, models)
    gmsh.model.add("other")
    with pytest.raises(InputError, match="not there"):
        result.extrude(1.0, 2)


def test_curved_and_crossing_faces_are_refused():
    gmsh.model.occ.addCylinder(0, 0, 0, 0, 0, 1, 0.5)
    gmsh.model.occ.synchronize()
    with pytest.raises(GeometryError, match="curved face"):
        cq.mesh(0.4).extrude(1.0, 2)
    gmsh.clear()
    gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1)
    gmsh.model.occ.synchronize()
    with pytest.raises(GeometryError, match="not parallel"):
        cq.mesh(0.5).extrude(1.0, 2)


@pytest.mark.parametrize("text", ["", "1", "1:", ":2", "1:0", "1:-2", "1,2:3", "1,2,3,4:2", "a:2", "0:2", "inf:3", "1:2.5"])
def test_bad_extrusions_by_text(text):
    with pytest.raises(InputError, match="LENGTH:LAYERS"):
        parse_extrusion(text)


def test_extrusions_by_text():
    assert parse_extrusion("0.5:4") == (0.5, 4)
    assert parse_extrusion("-1:1") == (-1.0, 1)
    assert parse_extrusion("1,-2,3e-1:12") == ([1.0, -2.0, 0.3], 12)


SQUARE = """
SetFactory("OpenCASCADE"); Rectangle(1) = {0, 0, 0, 1, 1}; Physical Curve("left", 6) = {4};
"""


def test_command_line(tmp_path, monkeypatch, capfd):
    gmsh.finalize()
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.geo").write_text(SQUARE)
    base = ["mesh", "a.geo", "--size", "0.25"]
    assert cli.main([*base, "-o", "a.msh", "--extrude", "0.5:2"]) == 0
    assert "16 quads" in (out := capfd.readouterr().out) and "; 32 hexahedra" in out
    assert cli.main([*base, "-o", "b.msh", "--extrude=-0.5:2", "--order", "2", "--quiet"]) == 0
    for file, kind in (("a.msh", 5), ("b.msh", 12)):
        gmsh.initialize(interruptible=False, readConfigFiles=False)
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.open(file)
        assert len(gmsh.model.mesh.getElementsByType(kind)[0]) == 32  # no physical volume: everything is saved
        assert volume(kind) == pytest.approx(0.5)
        gmsh.finalize()
    for arguments, text in (
        (["-o", "c.off", "--extrude", "1:1"], "unknown mesh format '.off'"),
        (["-o", "c.msh", "--extrude", "1"], "LENGTH:LAYERS"),
        (["-o", "c.nas", "--extrude", "1:1", "--order", "2"], "--incomplete"),
        (["-o", "c.msh", "--extrude", "1:9", "--max-quads", "100"], "144 hexahedra"),
    ):
        assert cli.main([*base, *arguments]) == 2
        assert text in capfd.readouterr().err
    assert not list(tmp_path.glob("c.*"))


@pytest.mark.parametrize(("order", "cell"), [(("1",), 12), (("2",), 29), (("2", "--incomplete"), 25)])
def test_vtu_has_its_nodes_in_the_order_of_vtk(tmp_path, order, cell):
    """Of hexahedra that are parallelepipeds the nodes are an affine image of VTK's own parametric coordinates."""
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader

    gmsh.finalize()
    (tmp_path / "a.geo").write_text(SQUARE)
    path = str(tmp_path / "a.vtu")
    arguments = ["mesh", str(tmp_path / "a.geo"), "-o", path, "--size", "0.5", "--quiet", "--extrude", "0.1,0.2,0.5:2"]
    assert cli.main([*arguments, "--order", *order]) == 0
    reader = vtkXMLUnstructuredGridReader()
    reader.SetFileName(path)
    reader.Update()
    grid = reader.GetOutput()
    x = vtk_to_numpy(grid.GetPoints().GetData())
    cells = [grid.GetCell(i) for i in range(grid.GetNumberOfCells()) if grid.GetCellType(i) == cell]
    assert len(cells) == 8
    for c in cells:
        local = np.reshape(c.GetParametricCoords()[: 3 * c.GetNumberOfPoints()], (-1, 3))
        nodes = x[[c.GetPointId(k) for k in range(c.GetNumberOfPoints())]]
        matrix = np.column_stack([local, np.ones(len(local))])
        fit, residual, rank, _ = np.linalg.lstsq(matrix, nodes, rcond=None)
        assert rank == 4 and residual.max() < 1e-20
        assert np.linalg.det(fit[:3]) > 0


def corners():
    """Places (q, 4, 3) of the corners of all quads; Gmsh numbers nodes anew when it goes on."""
    tags, x, _ = gmsh.model.mesh.getNodes()
    order = np.argsort(tags)
    nodes = gmsh.model.mesh.getElementsByType(3)[1]
    return x.reshape(-1, 3)[order[np.searchsorted(tags[order], nodes)]].reshape(-1, 4, 3)


@pytest.mark.parametrize("solid", ["box", "cylinder", "sphere"])
def test_gmsh_fills_a_solid(solid):
    """As the read me says: surfaces hidden, so that Gmsh keeps them; every quad carries one pyramid."""
    occ = gmsh.model.occ
    if solid == "box":
        occ.addBox(0, 0, 0, 1, 1, 1)
    elif solid == "cylinder":
        occ.addCylinder(0, 0, 0, 0, 0, 2, 0.7)
    else:
        occ.addSphere(0, 0, 0, 1)
    occ.synchronize()
    result = cq.mesh(0.3)
    before = corners()
    gmsh.model.setVisibility([entity for dim in (0, 1, 2) for entity in gmsh.model.getEntities(dim)], 0)
    gmsh.option.setNumber("Mesh.MeshOnlyVisible", 1)
    gmsh.model.mesh.generate(3)
    np.testing.assert_array_equal(corners(), before)
    pyramids, nodes = gmsh.model.mesh.getElementsByType(7)
    bases = {tuple(q) for q in np.sort(nodes.reshape(-1, 5)[:, :4], axis=1).tolist()}
    assert bases == {tuple(q) for q in np.sort(gmsh.model.mesh.getElementsByType(3)[1].reshape(-1, 4), axis=1).tolist()}
    assert len(pyramids) == len(result.mesh.quads)
    elements = np.concatenate([pyramids, gmsh.model.mesh.getElementsByType(4)[0]])
    assert gmsh.model.mesh.getElementQualities(elements, "minSICN").min() > 0
