"""The two classes of SciPy that are loaded alone: they are SciPy's own, and cost what they should."""

import subprocess
import sys

import pytest


def _run(code: str) -> str:
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.strip()


@pytest.mark.parametrize("name", ["cKDTree", "Delaunay"])
def test_loaded_alone(name: str) -> None:
    code = f"import sys; from gmsh_crossquad.spatial import {name}; print({name}.__name__, 'scipy.spatial' in sys.modules)"
    assert _run(code) == f"{name} False"


@pytest.mark.parametrize("name", ["cKDTree", "Delaunay"])
@pytest.mark.parametrize("first", ["ours", "theirs"])
def test_the_same_class_as_that_of_scipy(name: str, first: str) -> None:
    ours, theirs = f"from gmsh_crossquad.spatial import {name} as a", f"from scipy.spatial import {name} as b"
    lines = [ours, theirs] if first == "ours" else [theirs, ours]
    assert _run("; ".join([*lines, "print(a is b)"])) == "True"


def test_search_and_triangulation() -> None:
    code = """
import numpy as np
from gmsh_crossquad.spatial import Delaunay, cKDTree
grid = np.stack(np.meshgrid(np.arange(3.0), np.arange(3.0)), axis=-1).reshape(-1, 2)
print(cKDTree(grid).query([1.1, 2.2])[1], len(Delaunay(grid).simplices))
"""
    assert _run(code) == "7 8"


def test_elsewhere_in_scipy() -> None:
    """A SciPy that keeps the classes in other modules is imported whole."""
    code = """
import sys
import gmsh_crossquad.spatial as spatial
spatial._HOME["cKDTree"] = "_moved"
print(spatial.cKDTree.__name__, "scipy.spatial" in sys.modules)
"""
    assert _run(code) == "cKDTree True"
