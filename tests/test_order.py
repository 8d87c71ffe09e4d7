"""The order of the elements: by option or by the model, in the session and in files of every format."""

import math

import gmsh
import numpy as np
import pytest

import gmsh_crossquad as cq
from gmsh_crossquad import cli
from gmsh_crossquad.errors import InputError
from gmsh_crossquad.formats import MESH_FORMATS, check_order

QUADS = {1: 3, 2: 10, 3: 36}
ELLIPSE = """
SetFactory("OpenCASCADE"); Disk(1) = {0, 0, 0, 1, 0.7};
Physical Surface("body", 5) = {1}; Physical Curve("rim", 6) = {1};
"""
AREA = 0.7 * math.pi


@pytest.fixture
def ellipse(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.geo").write_text(ELLIPSE)
    return tmp_path


@pytest.fixture
def session():
    gmsh.initialize(interruptible=False, readConfigFiles=False)
    gmsh.option.setNumber("General.Terminal", 0)
    yield
    gmsh.finalize()


def kinds(path):
    """Element types of the quads of a file, and their area by quadrature."""
    gmsh.initialize(interruptible=False, readConfigFiles=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.open(str(path))
        types = gmsh.model.mesh.getElementTypes(2).tolist()
        area = 0.0
        for kind in types:
            points, weights = gmsh.model.mesh.getIntegrationPoints(kind, "Gauss6")
            _, determinants, _ = gmsh.model.mesh.getJacobians(kind, points)
            area += float(np.sum(determinants.reshape(-1, len(weights)) @ weights))
        return types, area
    finally:
        gmsh.finalize()


@pytest.mark.parametrize("order", [1, 2, 3])
def test_order_by_option(ellipse, order, capfd):
    assert cli.main(["mesh", "a.geo", "-o", "a.msh", "--size", "0.3", "--order", str(order)]) == 0
    assert (f"quads of order {order} in" if order > 1 else " quads in") in capfd.readouterr().out
    types, area = kinds("a.msh")
    assert types == [QUADS[order]]
    assert area == pytest.approx(AREA, rel={1: 3e-2, 2: 2e-4, 3: 2e-5}[order])
    assert cli.main(["check", "a.msh", "--model", "a.geo"]) == 0


@pytest.mark.parametrize("arguments", [("2",), ("2", "--incomplete"), ("3",)])
def test_check_finds_curved_elements_that_are_turned_over(ellipse, session, arguments, capfd):
    """A node of an edge is moved behind the opposite side; the corners, all that the scaled Jacobian sees, are as before."""
    assert cli.main(["mesh", "a.geo", "-o", "a.msh", "--size", "0.3", "--quiet", "--order", *arguments]) == 0
    assert cli.main(["check", "a.msh"]) == 0
    gmsh.open("a.msh")
    kinds, _, nodes = gmsh.model.mesh.getElements(2)
    count = gmsh.model.mesh.getElementProperties(kinds[0])[3]
    row = nodes[0].reshape(-1, count)[5]
    ends, middle = (np.array([gmsh.model.mesh.getNode(n)[0] for n in row[k]]) for k in (slice(4), slice(4, 5)))
    gmsh.model.mesh.setNode(row[4], middle[0] + 1.5 * (ends[2] + ends[3] - ends[0] - ends[1]) / 2, [])
    gmsh.write("a.msh")
    capfd.readouterr()
    assert cli.main(["check", "a.msh"]) == 1
    out = capfd.readouterr().out
    assert "inverted cells         0" in out and "elements of order 2 or 3 are turned over" in out


def test_order_by_the_model_and_option_before_it(ellipse):
    (ellipse / "a.geo").write_text(ELLIPSE + "Mesh.ElementOrder = 2; Mesh.SecondOrderIncomplete = 1;\n")
    assert cli.main(["mesh", "a.geo", "-o", "a.msh", "--size", "0.3", "--quiet"]) == 0
    assert kinds("a.msh")[0] == [16]
    assert cli.main(["mesh", "a.geo", "-o", "a.msh", "--size", "0.3", "--quiet", "--no-incomplete"]) == 0
    assert kinds("a.msh")[0] == [10]
    assert cli.main(["mesh", "a.geo", "-o", "a.msh", "--size", "0.3", "--quiet", "--order", "1"]) == 0
    assert kinds("a.msh")[0] == [3]


def test_order_that_cannot_be_made(ellipse, capfd):
    assert cli.main(["mesh", "a.geo", "-o", "a.msh", "--order", "4"]) == 2
    assert "order is 4: use order 1, 2 or 3" in capfd.readouterr().err
    (ellipse / "a.geo").write_text(ELLIPSE + "Mesh.ElementOrder = 5;\n")
    assert cli.main(["mesh", "a.geo", "-o", "a.msh"]) == 2
    assert "Mesh.ElementOrder is 5: use order 1, 2 or 3" in capfd.readouterr().err
    assert not (ellipse / "a.msh").exists()


@pytest.mark.parametrize("suffix", [".bdf", ".cgns", ".med", ".nas", ".vtk", ".msh2"])
def test_formats_with_nine_nodes(ellipse, suffix):
    assert cli.main(["mesh", "a.geo", "-o", "a" + suffix, "--size", "0.3", "--order", "2", "--quiet"]) == 0
    types, area = kinds("a" + suffix)
    assert types == [10]
    assert area == pytest.approx(AREA, rel=2e-4)


def test_format_with_eight_nodes_only(ellipse, capfd):
    arguments = ["mesh", "a.geo", "-o", "a.unv", "--size", "0.3", "--order", "2", "--quiet"]
    assert cli.main(arguments) == 2
    assert "use --incomplete" in capfd.readouterr().err
    assert cli.main([*arguments, "--incomplete"]) == 0
    types, area = kinds("a.unv")
    assert types == [16]
    assert area == pytest.approx(AREA, rel=2e-4)


@pytest.mark.parametrize("order", [2, 3])
def test_every_format_is_refused_or_keeps_its_nodes(session, tmp_path, order):
    """Whatever format is not refused keeps all nodes: those that Gmsh reads are read again."""
    gmsh.model.occ.addRectangle(0, 0, 0, 1, 1)
    gmsh.model.occ.synchronize()
    cq.mesh(0.5, order=order)
    nodes = len(gmsh.model.mesh.getNodes()[0])
    kept = []
    for suffix in MESH_FORMATS:
        try:
            check_order("a" + suffix, order, False)
        except InputError:
            continue
        if suffix not in (".vtu", ".dat", ".inp", ".m"):  # which Gmsh does not read
            gmsh.write(str(tmp_path / ("a" + suffix)))
            kept.append(suffix)
    assert {".msh", ".cgns"} <= set(kept)
    for suffix in kept:
        gmsh.clear()
        gmsh.merge(str(tmp_path / ("a" + suffix)))
        assert len(gmsh.model.mesh.getNodes()[0]) == nodes, suffix
        assert gmsh.model.mesh.getElementTypes(2).tolist() == [QUADS[order]], suffix


@pytest.mark.parametrize(("arguments", "cell"), [(("2",), 28), (("2", "--incomplete"), 23), (("3",), 70)])
def test_vtu_has_curved_cells(ellipse, arguments, cell):
    """VTK's own tessellation of the cells has the ellipse's area, and no triangle turned over."""
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkFiltersCore import vtkTriangleFilter
    from vtkmodules.vtkFiltersGeometry import vtkDataSetSurfaceFilter
    from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader

    assert cli.main(["mesh", "a.geo", "-o", "a.vtu", "--size", "0.3", "--quiet", "--order", *arguments]) == 0
    reader = vtkXMLUnstructuredGridReader()
    reader.SetFileName("a.vtu")
    reader.Update()
    grid = reader.GetOutput()
    types = np.array([grid.GetCellType(i) for i in range(grid.GetNumberOfCells())])
    assert cell in types
    physical = vtk_to_numpy(grid.GetCellData().GetArray("physical"))
    assert set(physical[types == cell]) == {5} and set(physical[types != cell]) == {6}
    surface = vtkDataSetSurfaceFilter()
    surface.SetNonlinearSubdivisionLevel(4)
    surface.SetInputData(grid)
    triangles = vtkTriangleFilter()
    triangles.SetInputConnection(surface.GetOutputPort())
    triangles.PassLinesOff()
    triangles.Update()
    out = triangles.GetOutput()
    p = vtk_to_numpy(out.GetPoints().GetData()).astype(float)
    t = p[vtk_to_numpy(out.GetPolys().GetConnectivityArray()).reshape(-1, 3)]
    area = np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0])[:, 2] / 2
    assert area.min() > 0
    assert area.sum() == pytest.approx(AREA, rel=3e-4)


def test_session_keeps_nodes_on_a_curved_face(session):
    gmsh.model.occ.addSphere(0, 0, 0, 2)
    gmsh.model.occ.synchronize()
    gmsh.option.setNumber("Mesh.ElementOrder", 2)
    result = cq.mesh(0.8)
    assert (result.order, result.incomplete) == (2, False)
    assert gmsh.model.mesh.getElementTypes(2).tolist() == [10]
    x = gmsh.model.mesh.getNodes(2)[1].reshape(-1, 3)
    assert np.abs(np.linalg.norm(x, axis=1) - 2).max() < 1e-9
    tags = gmsh.model.mesh.getElementsByType(10)[0]
    for measure in ("minSICN", "minSJ"):
        assert gmsh.model.mesh.getElementQualities(tags, measure).min() > 0


def test_incomplete_quads_leave_no_gap_in_the_numbers(session):
    gmsh.model.occ.addSphere(0, 0, 0, 2)
    gmsh.model.occ.synchronize()
    cq.mesh(0.8, order=2, incomplete=True)
    tags = np.sort(gmsh.model.mesh.getNodes()[0])
    np.testing.assert_array_equal(tags, np.arange(1, len(tags) + 1))
    assert set(gmsh.model.mesh.getElementsByType(16)[1]) == set(tags.tolist())


@pytest.mark.parametrize("value", [0, 4, 1.5, "two", True])
def test_bad_order(session, value):
    with pytest.raises(InputError, match="order is"):
        cq.mesh(order=value)
