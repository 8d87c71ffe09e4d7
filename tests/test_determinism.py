"""Two runs of the command give the same file, bit by bit."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

GEO = Path(__file__).parent.parent / "geo"


@pytest.mark.parametrize("name, size", [("plate_two_holes", "0.08"), ("stator_sector", "0.05"), ("airfoil", "0.2")])
def test_two_runs_are_identical(tmp_path: Path, name: str, size: str) -> None:
    files = []
    for run in ("one", "two"):
        files.append(tmp_path / f"{run}.msh")
        command = [sys.executable, "-m", "gmsh_crossquad", "mesh", str(GEO / f"{name}.geo"), "-o", str(files[-1])]
        subprocess.run([*command, "--size", size, "--quiet"], check=True)
    assert files[0].read_bytes() == files[1].read_bytes()
    assert files[0].stat().st_size > 1000
