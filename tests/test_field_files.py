"""The aligned field out and in again: Python objects, VTU and Gmsh files, the `field` command."""

import re
from pathlib import Path

import gmsh
import meshio
import numpy as np
import pytest

import gmsh_crossquad as cq
from gmsh_crossquad import cli
from gmsh_crossquad.errors import FieldError, InputError

GEO = Path(__file__).resolve().parent.parent / "geo"
PNG = b"\x89PNG\r\n\x1a\n"


@pytest.fixture
def session():
    gmsh.initialize(readConfigFiles=False)
    gmsh.option.setNumber("General.Terminal", 0)
    yield
    gmsh.finalize()


@pytest.fixture
def given(session):
    """A field with a singular point that is set, one that is strong, and a hole."""
    gmsh.open(str(GEO / "naca0012.geo"))
    return cq.cross_field(field="singularities:(-0.4,0.1):1,(0.4,0.6):-2,(1.5,-0.2):3")


def crosses_differ(a, b):
    """Greatest angle between the crosses of two face fields, radians."""
    y = np.cross(a.normal, a.directions)
    angle = np.arctan2(np.sum(b.directions * y, axis=1), np.sum(b.directions * a.directions, axis=1))
    return np.abs(angle - np.pi / 2 * np.rint(angle / (np.pi / 2))).max()


def test_parts_add_up(given):
    (f,) = given.faces
    assert len(f.flux) == len(f.periods) == 2
    assert f.residual < 1e-12
    x = np.stack([np.sum(f.given * a, axis=1) for a in (np.array([1.0, 0, 0]), np.array([0, 1.0, 0]))])
    angle = np.arctan2(x[1], x[0]) + f.phi + f.psi
    v = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    dot, cross = np.sum(v * f.directions, axis=1), np.cross(v, f.directions)[:, 2]
    off = np.arctan2(cross, dot)
    assert np.abs(off - np.pi / 2 * np.rint(off / (np.pi / 2))).max() < 1e-9


def test_a_result_is_a_field(given):
    again = cq.cross_field(field=given)
    (a,), (b,) = given.faces, again.faces
    assert crosses_differ(a, b) < 1e-10
    assert np.array_equal(a.index, b.index)
    assert np.abs(b.phi + b.psi).max() < 1e-10
    assert np.abs(a.rotation - b.rotation).max() < 1e-10
    third = cq.cross_field(field=given.faces)
    assert np.array_equal(third.faces[0].theta, b.theta)


@pytest.mark.parametrize("name", ["field.vtu", "field.msh"])
def test_files_come_back_as_they_were(given, tmp_path, name):
    path = tmp_path / name
    given.write(path)
    again = cq.cross_field(field=str(path))
    (a,), (b,) = given.faces, again.faces
    assert crosses_differ(a, b) < 1e-10
    assert np.array_equal(a.index, b.index)
    assert len(b.seeds) == 3
    assert [p.name for p in tmp_path.iterdir()] == [name]


def test_on_another_background_the_field_is_sampled(session):
    gmsh.open(str(GEO / "naca0012.geo"))
    plain = cq.cross_field(field="singularities:(-0.4,0.1):1,(0.4,0.6):-1,(1.5,-0.2):1,(1.5,0.5):1")
    finer = cq.cross_field(field=plain, background=0.8)
    assert len(finer.faces[0].points) > 1.2 * len(plain.faces[0].points)
    assert [s.index for s in finer.singularities] == [s.index for s in plain.singularities]
    for a, b in zip(plain.singularities, finer.singularities, strict=True):
        assert np.linalg.norm(a.point - b.point) < 0.1


def test_a_mesh_of_a_result_has_its_singularities(given):
    result = cq.mesh(size=0.15, field=given)
    assert sorted(s.index for s in given.singularities) == [-2, 1, 3]
    assert sorted(s.index for s in result.singularities) == [-2, 1, 1, 1, 1]  # three blocks at least around a point
    assert any("was split into 3 of +1/4" in note for note in result.notes)
    assert result.quality.conforming and result.quality.inverted == 0


def test_the_field_of_a_mesh_is_written_and_shown(given, tmp_path):
    result = cq.mesh(size=0.2)
    result.write_field(tmp_path / "f.vtu")
    (again,) = cq.cross_field(field=str(tmp_path / "f.vtu")).faces
    assert crosses_differ(result.field[0], again) < 1e-10
    views = given.show()
    assert set(views) == {"v", "v across", "u", "singularities"}
    assert set(views.values()) <= set(gmsh.view.getTags().tolist())
    shown = cq.cross_field(field=f"view:{views['v']}")
    assert sum(s.index for s in shown.singularities) == sum(s.index for s in given.singularities)


def test_vtu_arrays(given, tmp_path):
    given.write(tmp_path / "f.vtu")
    mesh = meshio.read(tmp_path / "f.vtu")
    assert mesh.cells[0].type == "triangle6"
    assert set(mesh.point_data) == {"v", "u", "phi", "psi", "index", "seed"}
    assert set(mesh.cell_data) == {"face", "rotation", "normal"}
    np.testing.assert_allclose(np.linalg.norm(mesh.point_data["v"], axis=1), 1.0, atol=1e-12)
    assert mesh.point_data["index"].sum() == 0  # chi of a plate with a hole


def test_a_plain_array_of_a_file(session, tmp_path):
    # crosses turned by 10 degrees everywhere: aligned on the square they follow its sides
    gmsh.open(str(GEO / "l_shape.geo"))
    x, y = np.meshgrid(np.linspace(-3, 3, 13), np.linspace(-3, 3, 13))
    points = np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1)
    n = np.arange(169).reshape(13, 13)
    quads = np.stack([n[:-1, :-1], n[:-1, 1:], n[1:, 1:], n[1:, :-1]], axis=-1).reshape(-1, 4)
    a = np.radians(10)
    arms = np.tile([np.cos(a), np.sin(a), 0.0], (169, 1))
    tensor = np.tile([2 + np.cos(2 * a), 2 - np.cos(2 * a), 0.0, np.sin(2 * a), 0.0, 0.0], (169, 1))
    data = {"arm": arms, "stress": tensor, "angle": np.full(169, a)}
    meshio.Mesh(points, [("quad", quads)], point_data=data).write(tmp_path / "s.vtu")
    for array in ("arm", "stress", "principal", "angle"):
        (f,) = cq.cross_field(field=f"{tmp_path / 's.vtu'}:{array}").faces
        assert np.abs(f.phi).max() == pytest.approx(a, abs=1e-9)
        assert np.abs(np.cos(np.arctan2(f.directions[:, 1], f.directions[:, 0]) * 4) - 1).max() < 1e-9
    with pytest.raises(InputError, match="has 2 arrays of vectors or tensors: name one of its arrays: 'arm', 'stress', 'angle'"):
        cq.cross_field(field=str(tmp_path / "s.vtu"))
    with pytest.raises(InputError, match="has no array 'sigma'"):
        cq.cross_field(field=f"{tmp_path / 's.vtu'}:sigma")
    del data["stress"]
    meshio.Mesh(points, [("quad", quads)], point_data=data).write(tmp_path / "t.vtu")
    with pytest.raises(InputError, match="has no arrays of tensors"):
        cq.cross_field(field=f"{tmp_path / 't.vtu'}:principal")
    (f,) = cq.cross_field(field=str(tmp_path / "t.vtu")).faces  # the only vectors
    assert np.abs(f.phi).max() == pytest.approx(a, abs=1e-9)


@pytest.mark.parametrize(
    "text, error, message",
    [
        ("none.vtu", InputError, "no such file 'none.vtu'"),
        ("none.msh:v", InputError, "no such file 'none.msh'"),
        ("bad.vtu", FieldError, "'bad.vtu' cannot be read"),
        ("lines.vtu", FieldError, "has no triangles or quadrangles"),
        ("view:99", cq.CrossQuadError, "99"),
        ("no_such_module:f", InputError, "no_such_module"),
    ],
)
def test_what_cannot_be_read(session, tmp_path, monkeypatch, text, error, message):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bad.vtu").write_text("hello")
    meshio.Mesh([[0, 0, 0], [1, 0, 0]], [("line", [[0, 1]])]).write("lines.vtu")
    gmsh.open(str(GEO / "l_shape.geo"))
    with pytest.raises(error, match=message) as caught:
        cq.cross_field(field=text)
    assert "\n" not in str(caught.value)


def test_the_field_command(tmp_path, capfd):
    model = str(GEO / "disc.geo")
    field, picture = tmp_path / "f.vtu", tmp_path / "f.png"
    argument = "singularities:(-0.4,0):1,(0.4,0):1"
    assert cli.main(["field", model, "-o", str(field), "--field", argument, "--picture", str(picture)]) == 0
    out, err = capfd.readouterr()
    assert err == ""
    assert re.search(r"^surface 1: \d+ triangles, singularities 2 of positive and 0 of negative index, misaligned by", out, re.M)
    assert picture.read_bytes()[:8] == PNG
    mesh = tmp_path / "m.msh"
    assert cli.main(["mesh", model, "-o", str(mesh), "--size", "0.15", "--field", str(field)]) == 0
    assert re.search(r"2 irregular vertices$", capfd.readouterr().out.strip())
    assert cli.main(["field", model, "-o", str(tmp_path / "f.obj")]) == 2
    assert "unknown field format '.obj': use one of .msh .vtu" in capfd.readouterr().err


def test_indices_on_the_command_line(tmp_path, capfd):
    model, mesh = str(GEO / "disc.geo"), str(tmp_path / "m.msh")
    run = ["mesh", model, "-o", mesh, "--size", "0.15", "--quiet"]
    assert cli.main([*run, "--index", "1=0", "--index", "2@1=0"]) == 0
    assert cli.main([*run, "--field", "singularities:(0,0):1"]) == 2
    err = capfd.readouterr().err
    assert re.fullmatch(r"gmsh-crossquad: error: the indices add up to \+3/4 where chi = 1 is needed .*\n", err)
    assert cli.main([*run, "--field", "singularities:(0,0):1", "--fix-indices"]) == 0
    for bad, message in (("1", "write POINT=1/4"), ("x=1/4", "write POINT=1/4"), ("1=1/3", "quarter"), ("77=1/4", "77")):
        assert cli.main([*run, "--index", bad]) == 2
        assert message in capfd.readouterr().err
