"""Every source of fields on a model of two faces: for all of it or by face, from Python, the command line and a .geo file."""

import sys

import gmsh
import meshio
import numpy as np
import pytest

import gmsh_crossquad as cq
from gmsh_crossquad import cli

# two rectangles with a common side, surfaces 1 and 2, and a view of vectors on the whole
GEO = """
SetFactory("OpenCASCADE");
Rectangle(1) = {0, 0, 0, 1.3, 1};
Rectangle(2) = {1.3, 0, 0, 1.2, 1};
BooleanFragments{ Surface{1, 2}; Delete; }{}
Physical Surface("left", 1) = {1};
Physical Surface("right", 2) = {2};
Mesh.MeshSizeMax = 0.2;
View "wind" {
  VT(-1,-1,0, 4,-1,0, 4,3,0){1,0.2,0, 1,0.2,0, 1,0.2,0};
  VT(-1,-1,0, 4,3,0, -1,3,0){1,0.2,0, 1,0.2,0, 1,0.2,0};
};
"""
PAIRS = "singularities:(0.4,0.5):1,(0.8,0.4):-1,(1.7,0.6):1,(2.1,0.5):-1"
SOURCES = {
    "smooth": [0, 0],
    "smooth:0.1": [0, 0],
    PAIRS: [2, 2],
    "eigenmode:1:neumann": [0, 0],
    "eigenmode:1:neumann:isolines": [0, 0],
    "wind.vtu:v": [0, 0],
    "wind.vtu:principal": [0, 0],
    "wind.msh:wind": [0, 0],
    "view:wind": [0, 0],
    "wind_field:along": [0, 0],
    "1=" + PAIRS: [2, 0],
    "2=wind_field:along;eigenmode:1:neumann": [0, 0],
    "1=wind.vtu:v;2=" + PAIRS: [0, 2],
}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.delitem(sys.modules, "wind_field", raising=False)
    (tmp_path / "two.geo").write_text(GEO)
    (tmp_path / "wind_field.py").write_text("import numpy\ndef along(p):\n    return numpy.full(len(p), 0.2)\n")
    points = np.array([[-1, -1, 0], [4, -1, 0], [4, 3, 0], [-1, 3, 0]], float)
    stress = np.tile([2.0, 1.0, 0.0, 0.1, 0.0, 0.0], (4, 1))
    data = {"v": np.tile([1.0, 0.2, 0.0], (4, 1)), "stress": stress}
    meshio.Mesh(points, [("triangle", [[0, 1, 2], [0, 2, 3]])], point_data=data).write("wind.vtu")
    gmsh.initialize(readConfigFiles=False)
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.open("two.geo")
    gmsh.view.write(gmsh.view.getTags()[-1], "wind.msh")
    yield tmp_path
    if gmsh.isInitialized():
        gmsh.finalize()


def singular(result):
    return [sum(s.face == face for s in result.singularities) for face in (1, 2)]


@pytest.mark.parametrize("source", SOURCES)
def test_python(folder, source):
    result = cq.mesh(field=source)
    assert singular(result) == SOURCES[source]
    assert result.quality.conforming and result.quality.inverted == 0
    for f in result.field:
        assert f.residual < 1e-10


def test_objects_by_face(folder):
    result = cq.mesh(field={1: PAIRS, 2: lambda p: np.full(len(p), 0.1)})
    assert singular(result) == [2, 0]
    again = cq.mesh(field={1: result.field[0], None: "smooth"})
    assert singular(again) == [2, 0]
    assert np.abs(again.field[0].theta - result.field[0].theta).max() < 1e-12


@pytest.mark.parametrize("source", SOURCES)
def test_command_line(folder, source, capfd):
    gmsh.finalize()
    assert cli.main(["mesh", "two.geo", "-o", "a.msh", "--field", source]) == 0
    out = capfd.readouterr().out
    assert f"{sum(SOURCES[source])} irregular vertices" in out


@pytest.mark.parametrize("source", SOURCES)
def test_geo_file(folder, source, capfd):
    gmsh.finalize()
    parts = dict(p.split("=") if p[1] == "=" else ("", p) for p in source.split(";"))
    names = [f'DefineConstant[f{k} = {{"{text}", Name "CrossQuad/Field {k}"}}];\n' for k, text in parts.items()]
    (folder / "own.geo").write_text("".join(names).replace(' "}', '"}').replace('Field "', 'Field"') + GEO)
    assert cli.main(["mesh", "own.geo", "-o", "a.msh"]) == 0, capfd.readouterr().err
    assert f"{sum(SOURCES[source])} irregular vertices" in capfd.readouterr().out


def test_a_face_that_does_not_fit_is_named(folder):
    with pytest.raises(cq.FieldError, match=r"add up to \+5/4 where chi = 1 is needed .*, surface 2: add one interior -1/4"):
        cq.mesh(field="singularities:(1.7,0.6):1")
