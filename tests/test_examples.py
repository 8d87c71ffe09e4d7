"""Every example model becomes a quad mesh without faults, judged from its file against its model."""

import re
from pathlib import Path

import pytest

import gmsh_crossquad.api
import gmsh_crossquad.check  # noqa: F401  loaded once here, not in every child process
from gmsh_crossquad import cli

GEO = Path(__file__).resolve().parent.parent / "geo"
SIZES = {
    "airfoil": 0.12,
    "annulus": 0.15,
    "blade": 0.12,
    "bracket": 0.12,
    "circle": 0.15,
    "crack": 0.1,
    "disc": 0.15,
    "flange": 0.09,
    "four_materials": 0.1,
    "half_torus": 0.2,
    "heat_sink": 0.06,
    "inclusion": 0.12,
    "l_shape": 0.1,
    "naca0012": 0.15,
    "notched_bar": 0.1,
    "pipe_elbow": 0.2,
    "plate_hole": 0.12,
    "plate_two_holes": 0.09,
    "quarter_sphere": 0.2,
    "saddle": 0.2,
    "size_field": None,
    "stator_sector": 0.05,
    "transfinite_counts": None,
    "triple_junction": 0.08,
}


def test_every_example_is_here():
    assert sorted(SIZES) == sorted(p.stem for p in GEO.glob("*.geo"))


@pytest.mark.parametrize("name", SIZES)
def test_example(name, tmp_path, capfd):
    model, mesh = str(GEO / f"{name}.geo"), str(tmp_path / "a.msh")
    size = [] if SIZES[name] is None else ["--size", str(SIZES[name])]
    assert cli.main(["mesh", model, "-o", mesh, "--vtu", str(tmp_path / "a.vtu"), *size]) == 0, capfd.readouterr().err
    capfd.readouterr()
    status = cli.main(["check", mesh, "--model", model])
    out = capfd.readouterr().out
    assert status == 0, out
    least = re.search(r"scaled Jacobian, min +(-?\d\.\d+)", out)
    assert least is not None and float(least[1]) > 0.1


def test_transfinite_counts_are_kept(tmp_path):
    import gmsh

    mesh = str(tmp_path / "a.msh")
    assert cli.main(["mesh", str(GEO / "transfinite_counts.geo"), "-o", mesh, "--quiet"]) == 0
    gmsh.initialize(interruptible=False, readConfigFiles=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.open(mesh)
        for curve, nodes in ((1, 25), (4, 13)):
            assert len(gmsh.model.mesh.getElements(1, curve)[1][0]) == nodes - 1
    finally:
        gmsh.finalize()
