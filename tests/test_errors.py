"""Bad input: one test per kind, asserting class or exit status, a single line, and that nothing was written or changed."""

import math
import os

import gmsh
import numpy as np
import pytest

import gmsh_crossquad as cq
import gmsh_crossquad.api  # loaded once here, not in every child process
from gmsh_crossquad import cli

SQUARE = """
Point(1) = {0, 0, 0, 0.3}; Point(2) = {1, 0, 0, 0.3}; Point(3) = {1, 1, 0, 0.3}; Point(4) = {0, 1, 0, 0.3};
Line(1) = {1, 2}; Line(2) = {2, 3}; Line(3) = {3, 4}; Line(4) = {4, 1};
Curve Loop(1) = {1, 2, 3, 4}; Plane Surface(1) = {1};
"""
POINTS = "Point(1) = {0, 0, 0}; Point(2) = {1, 0, 0}; Point(3) = {0, 1, 0};"
BOWTIE = SQUARE.replace("Point(3) = {1, 1", "Point(3) = {0, 1").replace("Point(4) = {0, 1", "Point(4) = {1, 1")
FLAT = SQUARE.replace("{1, 1, 0", "{1, 0, 0").replace("{0, 1, 0", "{0.5, 0, 0")

BAD_MODELS = {
    "syntax error": ("a.geo", "Point(1) = {0, 0, 0;\n", 3, "syntax error"),
    "unknown command": ("a.geo", "Foo(3);\n", 3, "Unknown command"),
    "missing include": ("a.geo", 'Include "nowhere.geo";\n', 3, "nowhere.geo"),
    "no entities": ("a.geo", "// nothing\n", 3, "no surfaces"),
    "points only": ("a.geo", POINTS, 3, "no surfaces"),
    "curves only": ("a.geo", POINTS + "Line(1) = {1, 2}; Line(2) = {2, 3}; Line(3) = {3, 1};", 3, "no surfaces"),
    "no bytes": ("a.step", "", 3, "is empty"),
    "not a STEP file": ("a.step", "this is not a STEP file\n", 3, "cannot read"),
    "text as mesh": ("a.msh", "hello\n", 3, "cannot read"),
    "self-intersecting boundary": ("a.geo", BOWTIE, 3, ""),
    "face without area": ("a.geo", FLAT, 3, ""),
}


@pytest.fixture
def run(tmp_path, capfd, monkeypatch):
    """Runs the command in an empty folder; returns status and the lines of both streams."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments):
        status = cli.main([str(a) for a in arguments])
        out, err = capfd.readouterr()
        return status, out.splitlines(), err.splitlines()

    return run


def assert_one_line(outcome, status, text):
    assert outcome[0] == status, outcome
    assert outcome[1] == []
    assert len(outcome[2]) == 1, outcome[2]
    assert outcome[2][0].startswith("gmsh-crossquad: error: ")
    assert text in outcome[2][0]
    assert "internal error" not in outcome[2][0]


@pytest.mark.parametrize("kind", BAD_MODELS)
def test_bad_model(kind, run, tmp_path):
    name, text, status, message = BAD_MODELS[kind]
    (tmp_path / name).write_text(text)
    (tmp_path / "out.msh").write_text("what was here before")
    assert_one_line(run("mesh", name, "-o", "out.msh", "--size", 0.3), status, message)
    assert (tmp_path / "out.msh").read_text() == "what was here before"
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted([name, "out.msh"])


@pytest.mark.parametrize(
    "arguments, message",
    [
        ([], "required"),
        (["melt"], "invalid choice"),
        (["mesh", "a.geo"], "-o/--output"),
        (["mesh", "a.geo", "-o", "b.msh", "--size", "big"], "invalid float"),
        (["mesh", "a.geo", "-o", "b.msh", "--size", "0"], "size is 0"),
        (["mesh", "a.geo", "-o", "b.msh", "--size", "-1"], "size is -1"),
        (["mesh", "a.geo", "-o", "b.msh", "--size", "nan"], "size is nan"),
        (["mesh", "a.geo", "-o", "b.msh", "--size", "inf"], "size is inf"),
        (["mesh", "a.geo", "-o", "b.msh", "--block-size", "0"], "block_size is 0"),
        (["mesh", "a.geo", "-o", "b.msh", "--max-quads", "0"], "max_quads is 0"),
        (["mesh", "a.geo", "-o", "b.msh", "--max-quads", "1.5"], "invalid int"),
        (["mesh", "a.geo", "-o", "b.msh", "--size", "0.01", "--max-quads", "50"], "50"),
        (["mesh", "a.geo", "-o", "b.msh", "--quiet", "--verbose"], "not allowed with"),
        (["mesh", "none.geo", "-o", "b.msh"], "no such file"),
        (["mesh", ".", "-o", "b.msh"], "not a file"),
        (["mesh", "a.geo", "-o", "b.xyz"], "unknown mesh format"),
        (["mesh", "a.geo", "-o", "b.step"], "unknown mesh format"),
        (["mesh", "a.geo", "-o", "b"], "no extension"),
        (["mesh", "a.geo", "-o", "none/b.msh"], "does not exist"),
        (["mesh", "a.geo", "-o", "folder.msh"], "not a regular file"),
        (["mesh", "a.geo", "-o", "b.msh", "--picture", "b.bmp"], "unknown picture format"),
        (["mesh", "a.geo", "-o", "b.msh", "--vtu", "b.vtk"], "unknown ParaView format"),
        (["mesh", "a.geo", "-o", "b.vtu", "--vtu", "b.vtu"], "two outputs"),
        (["mesh", "old.msh", "-o", "old.msh"], "the model itself"),
        (["check", "none.msh"], "no such file"),
        (["check", "a.geo", "--model", "none.geo"], "no such file"),
    ],
)
def test_bad_usage(arguments, message, run, tmp_path):
    (tmp_path / "a.geo").write_text(SQUARE)
    (tmp_path / "old.msh").write_text("old")
    (tmp_path / "folder.msh").mkdir()
    assert_one_line(run(*arguments), 2, message)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.geo", "folder.msh", "old.msh"]
    assert (tmp_path / "old.msh").read_text() == "old"


def test_device_as_output(run, tmp_path):
    (tmp_path / "a.geo").write_text(SQUARE)
    (tmp_path / "b.msh").symlink_to(os.devnull)
    assert_one_line(run("mesh", "a.geo", "-o", "b.msh"), 2, "not a regular file")
    assert (tmp_path / "b.msh").is_symlink()


@pytest.mark.skipif(os.geteuid() == 0, reason="the superuser may write anywhere")
def test_folder_without_permission(run, tmp_path):
    (tmp_path / "a.geo").write_text(SQUARE)
    (tmp_path / "locked").mkdir(mode=0o555)
    assert_one_line(run("mesh", "a.geo", "-o", "locked/b.msh"), 2, "cannot write")


def test_check_of_a_file_without_mesh(run, tmp_path):
    (tmp_path / "a.geo").write_text(SQUARE)
    assert_one_line(run("check", "a.geo"), 1, "there is no mesh")


@pytest.fixture
def session():
    """A session with a meshed square; afterwards the mesh, the options, the models and the views must be as before."""
    gmsh.initialize(interruptible=False, readConfigFiles=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.model.add("other")
        gmsh.model.add("square")
        gmsh.model.occ.addRectangle(0, 0, 0, 1, 1)
        gmsh.model.occ.synchronize()
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.3)
        gmsh.model.mesh.generate(2)
        yield state()
    finally:
        gmsh.finalize()


def state():
    numbers = (
        "Mesh.Algorithm",
        "Mesh.MeshSizeMax",
        "Mesh.MeshSizeMin",
        "Mesh.RecombineAll",
        "General.Terminal",
        "General.AbortOnError",
    )
    tags, points, _ = gmsh.model.mesh.getNodes()
    kinds, elements, nodes = gmsh.model.mesh.getElements()
    return {
        "options": {n: gmsh.option.getNumber(n) for n in numbers},
        "models": (sorted(gmsh.model.list()), gmsh.model.getCurrent()),
        "views": list(gmsh.view.getTags()),
        "nodes": dict(zip(tags.tolist(), np.reshape(points, (-1, 3)).tolist(), strict=True)),
        "elements": {
            int(k): dict(zip(e.tolist(), n.reshape(len(e), -1).tolist(), strict=True)) for k, e, n in zip(kinds, elements, nodes)
        },
    }


@pytest.mark.parametrize(
    "options",
    [
        {"size": 0},
        {"size": -0.1},
        {"size": math.nan},
        {"size": math.inf},
        {"size": "small"},
        {"size": 0.01, "max_quads": 50},
        {"size": 0.1, "max_quads": 2.5},
        {"size": 0.1, "block_size": -1},
        {"size": 0.1, "background": 0},
        {"size": 0.1, "colour": 3},
    ],
)
def test_bad_option_leaves_the_session_alone(session, options):
    with pytest.raises(cq.InputError) as caught:
        cq.mesh(**options)
    assert "\n" not in str(caught.value)
    assert state() == session


def test_bad_geometry_leaves_the_session_alone(session):
    gmsh.model.setCurrent("other")
    corners = [gmsh.model.geo.addPoint(x, y, 0) for x, y in ((0, 0), (1, 0), (0, 1), (1, 1))]
    lines = [gmsh.model.geo.addLine(a, b) for a, b in zip(corners, [*corners[1:], corners[0]])]
    gmsh.model.geo.addPlaneSurface([gmsh.model.geo.addCurveLoop(lines)])  # a bow tie
    gmsh.model.geo.synchronize()
    gmsh.model.mesh.generate(1)
    before = state()
    with pytest.raises(cq.GeometryError) as caught:
        cq.mesh(size=0.3)
    assert caught.value.entity is not None
    assert state() == before


@pytest.mark.parametrize("failure", [cq.LayoutError("no layout"), RuntimeError("a fault"), KeyboardInterrupt()])
def test_failure_in_the_last_step_restores_the_mesh(session, failure, monkeypatch):
    from gmsh_crossquad import api

    def put(model, mesh):
        gmsh.model.mesh.clear()
        raise failure

    monkeypatch.setattr(api, "put_mesh", put)
    with pytest.raises(type(failure)):
        cq.mesh(size=0.3)
    assert state() == session


def test_mesh_without_session():
    assert not gmsh.isInitialized()
    with pytest.raises(cq.InputError, match="no Gmsh session"):
        cq.mesh(size=0.1)
    assert not gmsh.isInitialized()


def test_error_says_what_where_and_what_to_do():
    error = cq.GeometryError("too sharp", entity=(1, 7), location=(0.25, 1, 0), remedy="round it")
    assert str(error) == "too sharp, curve 7 at (0.25, 1, 0): round it"
    assert isinstance(error, cq.CrossQuadError) and error.exit_status == 3
