import os
import re
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path

import gmsh
import meshio
import pytest

import gmsh_crossquad as cq
import gmsh_crossquad.api  # loaded once here, not in every child process
from gmsh_crossquad import child, cli, formats, progress
from gmsh_crossquad.arguments import parse_extrusion

ROOT = Path(__file__).resolve().parent.parent
SQUARE = """
Point(1) = {0, 0, 0, 0.25}; Point(2) = {1, 0, 0, 0.25}; Point(3) = {1, 1, 0, 0.25}; Point(4) = {0, 1, 0, 0.25};
Line(1) = {1, 2}; Line(2) = {2, 3}; Line(3) = {3, 4}; Line(4) = {4, 1};
Curve Loop(1) = {1, 2, 3, 4}; Plane Surface(1) = {1};
"""
GROUPS = 'Physical Surface("body", 5) = {1}; Physical Curve("bottom", 6) = {1};\n'


@pytest.fixture
def square(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.geo").write_text(SQUARE + GROUPS)
    return tmp_path


def names(folder):
    return sorted(p.name for p in folder.iterdir())


def test_mesh_then_check(square, capfd):
    assert cli.main(["mesh", "a.geo", "-o", "a.msh", "--size", "0.25"]) == 0
    out, err = capfd.readouterr()
    assert err == ""
    assert re.search(
        r"^a\.msh: \d+ quads in \d+ blocks?, scaled Jacobian min 1\.000 mean 1\.000, 0 irregular vertices$", out, re.M
    )
    assert re.search(r"^  total +\d+\.\d{3} s$", out, re.M)
    assert names(square) == ["a.geo", "a.msh"]
    assert cli.main(["check", "a.msh", "--model", "a.geo"]) == 0
    out, err = capfd.readouterr()
    assert err == "" and out.splitlines()[-1] == "ok" and "body" in out


def test_check_of_triangles_fails(square, capfd):
    subprocess.run([sys.executable, "-c", TRIANGLES], check=True)
    assert cli.main(["check", "t.msh"]) == 1
    assert re.search(r"^fails: no quads; \d+ triangles$", capfd.readouterr().out, re.M)


TRIANGLES = """
import gmsh
gmsh.initialize(interruptible=False, readConfigFiles=False)
gmsh.option.setNumber("General.Terminal", 0)
gmsh.open("a.geo")
gmsh.model.mesh.generate(2)
gmsh.write("t.msh")
"""


def test_quiet_prints_nothing(square, capfd):
    assert cli.main(["mesh", "a.geo", "-o", "a.msh", "--quiet"]) == 0
    assert cli.main(["check", "a.msh", "--quiet"]) == 0
    assert capfd.readouterr() == ("", "")


def test_verbose_names_the_stages(square, capfd):
    assert cli.main(["mesh", "a.geo", "-o", "a.msh", "--verbose"]) == 0
    err = capfd.readouterr().err
    assert "gmsh-crossquad: open\n" in err and "gmsh-crossquad: fill\n" in err


def test_extra_outputs_and_permissions(square):
    Path("a.msh").write_text("old")
    os.chmod("a.msh", 0o640)
    Path("link.vtu").symlink_to("real.vtu")
    assert cli.main(["mesh", "a.geo", "-o", "a.msh", "--picture", "a.png", "--vtu", "link.vtu"]) == 0
    assert names(square) == ["a.geo", "a.msh", "a.png", "link.vtu", "real.vtu"]
    assert Path("a.msh").stat().st_mode & 0o777 == 0o640
    assert Path("link.vtu").is_symlink()


@pytest.mark.parametrize("suffix", [".msh", ".msh2", ".vtu", ".vtk", ".inp", ".unv", ".su2", ".med", ".bdf", ".MSH"])
def test_formats(square, suffix):
    assert cli.main(["mesh", "a.geo", "-o", "a" + suffix, "--size", "0.25", "--quiet"]) == 0
    assert names(square) == sorted(["a.geo", "a" + suffix])
    size = Path("a" + suffix).stat().st_size
    assert size > 500


def test_default_msh_is_ascii_41_unless_the_model_says_otherwise(square):
    assert cli.main(["mesh", "a.geo", "-o", "a.msh", "--quiet"]) == 0
    assert Path("a.msh").read_text().split()[1:3] == ["4.1", "0"]
    with open("a.geo", "a") as file:
        file.write("Mesh.MshFileVersion = 2.2; Mesh.Binary = 1;\n")
    assert cli.main(["mesh", "a.geo", "-o", "a.msh", "--quiet"]) == 0
    assert Path("a.msh").read_bytes().split()[1:3] == [b"2.2", b"1"]


def test_vtu_carries_physical_numbers(square):
    assert cli.main(["mesh", "a.geo", "-o", "a.vtu", "--quiet"]) == 0
    mesh = meshio.read("a.vtu")
    data = {c.type: d for c, d in zip(mesh.cells, mesh.cell_data["physical"], strict=True)}
    assert set(data["quad"].tolist()) == {5}
    assert set(data["line"].tolist()) == {6}


def test_model_with_groups_of_curves_only_is_saved_with_its_quads(square):
    Path("b.geo").write_text(SQUARE + 'Physical Curve("bottom", 6) = {1};\n')
    assert cli.main(["mesh", "b.geo", "-o", "b.msh2", "--quiet"]) == 0
    gmsh.initialize(interruptible=False, readConfigFiles=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.open("b.msh2")
        assert len(gmsh.model.mesh.getElementsByType(3)[0]) > 0
    finally:
        gmsh.finalize()


def test_crash_of_native_code_is_one_line(square, capfd, monkeypatch):
    def crash(job, emit):
        emit("fill")
        Path(job["output"]).write_text("half a mesh")
        os.kill(os.getpid(), signal.SIGSEGV)

    Path("a.msh").write_text("old")
    monkeypatch.setattr(cli, "mesh_task", crash)
    assert cli.main(["mesh", "a.geo", "-o", "a.msh"]) == 1
    out, err = capfd.readouterr()
    assert out == ""
    assert err.startswith("gmsh-crossquad: error: Gmsh crashed with signal SIGSEGV in the stage 'fill'") and err.count("\n") == 1
    assert names(square) == ["a.geo", "a.msh"] and Path("a.msh").read_text() == "old"


def test_exit_of_native_code_is_one_line(square, capfd, monkeypatch):
    monkeypatch.setattr(cli, "mesh_task", lambda job, emit: os._exit(7))
    assert cli.main(["mesh", "a.geo", "-o", "a.msh"]) == 1
    assert "ended the process with status 7" in capfd.readouterr().err


def test_unexpected_exception_is_one_line(square, capfd, monkeypatch):
    def fail(job, emit):
        raise ZeroDivisionError("one\ntwo")

    monkeypatch.setattr(cli, "mesh_task", fail)
    assert cli.main(["mesh", "a.geo", "-o", "a.msh"]) == 1
    err = capfd.readouterr().err
    assert err.startswith("gmsh-crossquad: error: internal error: ZeroDivisionError: one two") and err.count("\n") == 1
    assert cli.main(["mesh", "a.geo", "-o", "a.msh", "--verbose"]) == 1
    assert "Traceback" in capfd.readouterr().err


SLEEPER = """
import sys, time
from pathlib import Path
from gmsh_crossquad import cli
def sleep(job, emit):
    Path(job["output"]).write_text("half")
    Path("started").touch()
    time.sleep(60)
cli.mesh_task = sleep
sys.exit(cli.main(["mesh", "a.geo", "-o", "a.msh"]))
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_interruption_leaves_nothing(square, number):
    process = subprocess.Popen([sys.executable, "-c", SLEEPER], stderr=subprocess.PIPE, text=True)
    for _ in range(400):
        if Path("started").exists():
            break
        time.sleep(0.02)
    process.send_signal(number)
    _, err = process.communicate(timeout=10)
    assert process.returncode == 130
    assert err == "gmsh-crossquad: error: interrupted\n"
    assert names(square) == ["a.geo", "started"]


def test_runs_without_fork(square, monkeypatch, capfd):
    monkeypatch.delattr(os, "fork")
    assert cli.main(["mesh", "a.geo", "-o", "a.msh", "--quiet"]) == 0
    assert names(square) == ["a.geo", "a.msh"]
    Path("a.geo").write_text("Foo;")
    assert cli.main(["mesh", "a.geo", "-o", "a.msh"]) == 3
    assert capfd.readouterr().err.count("\n") == 1


def test_events_may_arrive_in_pieces():
    reader, writer = os.pipe()
    for piece in (b'{"sta', b'ge": "a"}\n{"stage": "b"}\n{"resu', b'lt": 3}\n'):
        os.write(writer, piece)
    os.close(writer)
    with os.fdopen(reader, "rb", buffering=0) as file:
        events = list(child._events(file, progress.Display(quiet=True)))
    assert events == [{"stage": "a"}, {"stage": "b"}, {"result": 3}]


def test_full_disk_is_noticed(tmp_path):
    from gmsh_crossquad.cad.files import _check_written

    half = tmp_path / "a.msh"
    half.write_text("$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n" + "0 0 0\n" * 30)
    with pytest.raises(cq.MeshError, match="not written in full"):
        _check_written(half)
    half.write_text("")
    with pytest.raises(cq.MeshError, match="not written in full"):
        _check_written(half)


@pytest.mark.parametrize(
    "arguments", [["--version"], ["--help"], ["mesh", "--help"], ["check", "--help"], ["mesh", "none.geo", "-o", "a.msh"]]
)
def test_nothing_heavy_is_imported_before_the_work(arguments, tmp_path):
    code = f"""
import sys
from gmsh_crossquad.cli import main
main({arguments!r})
print(sorted({{'numpy', 'scipy', 'gmsh', 'vtk', 'meshio', 'rich', 'matplotlib'}} & set(sys.modules)))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=tmp_path)
    assert done.stdout.splitlines()[-1] == "[]"


def test_pipeline_does_without_the_optional_libraries():
    code = """
import sys
import gmsh_crossquad
gmsh_crossquad.mesh
print(sorted({'vtk', 'vtkmodules', 'meshio', 'rich', 'matplotlib'} & set(sys.modules)))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert done.stdout == "[]\n"


def test_version_agrees_with_the_metadata(capfd):
    assert cli.main(["--version"]) == 0
    assert capfd.readouterr().out == f"gmsh-crossquad {cq.__version__}\n"
    assert f'version = "{cq.__version__}"' in (ROOT / "pyproject.toml").read_text()


def test_public_names_can_be_loaded():
    for name in cq.__all__:
        assert getattr(cq, name) is not None
    with pytest.raises(AttributeError):
        cq.nothing  # noqa: B018


def test_bar_appears_only_for_slow_stages_on_a_terminal():
    class Terminal:
        def __init__(self, tty):
            self.tty, self.text = tty, ""

        def isatty(self):
            return self.tty

        def write(self, text):
            self.text += text
            return len(text)

        def flush(self):
            pass

    for tty, patience, shown in ((True, 0.0, True), (True, 60.0, False), (False, 0.0, False)):
        stream = Terminal(tty)
        display = progress.Display(stream, patience=patience)
        display.start("trace")
        time.sleep(0.001)
        display.tick()
        display.close()
        assert bool(stream.text) == shown


def test_timing_table_adds_up():
    lines = progress.timing_table({"read": 0.25, "quantize": 1.5}).splitlines()
    assert lines[-1].split() == ["total", "1.750", "s"]


def readme_commands():
    text = (ROOT / "README.md").read_text()
    return [line for block in re.findall(r"```sh\n(.*?)```", text, re.S) for line in block.splitlines()]


def test_readme_names_the_commands_that_the_checks_run():
    install, test, check, *fields = readme_commands()
    fields = fields[:3]
    script = [line.strip() for line in (ROOT / ".ci" / "run").read_text().splitlines()]
    assert install.split(" && ")[-1] in script
    assert test.split(" && ")[-1] in script
    assert test.split(" && ")[-2].replace("pip install", "pip install --quiet") in script
    assert check in script
    assert len(fields) == 3 and all(line in script for line in fields)
    assert install.split(" && ")[-1].startswith("gmsh-crossquad mesh ")


def test_readme_commands_are_understood():
    for line in readme_commands():
        program, *arguments = shlex.split(line.split(" && ")[-1])
        if program == "gmsh-crossquad":
            given = cli._parser().parse_args(arguments)
            model = given.model or given.mesh
            assert not model.startswith("geo/") or (ROOT / model).is_file(), line
            if getattr(given, "extrude", None):
                parse_extrusion(given.extrude)


def test_readme_solid_is_filled(tmp_path):
    code = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), re.S)
    subprocess.run([sys.executable, "-c", code[1]], check=True, cwd=tmp_path, capture_output=True)
    kinds = meshio.read(tmp_path / "solid.msh").cells_dict
    assert len(kinds["pyramid"]) == len(kinds["quad"]) and len(kinds["tetra"]) > 0 and "triangle" not in kinds


def test_readme_python_runs(tmp_path):
    code = re.search(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), re.S)
    assert code is not None
    (tmp_path / "geo").symlink_to(ROOT / "geo")
    subprocess.run([sys.executable, "-c", code[1]], check=True, cwd=tmp_path, capture_output=True)
    assert names(tmp_path) == ["field.vtu", "geo", "plate.msh", "plate.png", "plate.vtu"]


def test_readme_parameters_of_a_model(square):
    block = re.search(r"```c\n(.*?)```", (ROOT / "README.md").read_text(), re.S)
    assert block is not None
    (square / "own.geo").write_text(block[1].replace("eigenmode:4", "smooth") + SQUARE + GROUPS)
    assert cli.main(["mesh", "own.geo", "-o", "a.msh", "--quiet"]) == 0
    quads = meshio.read(square / "a.msh").cells_dict["quad"]
    assert len(quads) == 400  # 20 x 20 of size 0.05, where the points ask for 0.25


def test_readme_lists_every_option():
    text = (ROOT / "README.md").read_text()
    for action in cli._parser()._subparsers._group_actions[0].choices["mesh"]._actions:
        for option in action.option_strings:
            if option.startswith("--") and option not in ("--help", "--output"):
                assert f"`{option}" in text, option


def test_every_format_is_written_by_its_name(tmp_path):
    for suffix in formats.MESH_FORMATS:
        place = formats.check_output(tmp_path / f"x{suffix}")
        assert formats.temporary_beside(place).suffix == suffix
    assert names(tmp_path) == []
