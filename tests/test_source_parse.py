import subprocess
import sys
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from gmsh_crossquad.errors import FieldError, InputError
from gmsh_crossquad.source.eigenmode import Eigenmode
from gmsh_crossquad.source.formula import Singularities
from gmsh_crossquad.source.function import Function
from gmsh_crossquad.source.parse import parse_field, parse_text
from gmsh_crossquad.source.per_face import PerFace
from gmsh_crossquad.source.smooth import Smooth

VIEW, VIEWS = Smooth(1.0), Smooth(2.0)


def parsed(value):
    """With loaders that return what they were called with, at `parsed.calls`."""
    parsed.calls = []

    def load_view(tag):
        parsed.calls.append(tag)
        return VIEW

    def load_views(path, name):
        parsed.calls.append((path, name))
        return VIEWS

    return parse_field(value, load_view, load_views)


def test_smooth():
    assert parsed("smooth") == Smooth()
    assert parsed(" Smooth ") == Smooth()
    assert parsed("smooth:0.05") == Smooth(0.05)
    assert parsed("smooth: 5e-2") == Smooth(0.05)


@pytest.mark.parametrize(
    "text, positions, quarters",
    [
        ("singularities:(-0.4,0):1,(0.4,0):1", [(-0.4, 0, np.nan), (0.4, 0, np.nan)], [1, 1]),
        ("singularities: ( -.4 , 1e-1 ) : -9 , ( 4. , 0 , -2 ) : +5", [(-0.4, 0.1, np.nan), (4, 0, -2)], [-9, 5]),
        ("singularities:(0,0):0", [(0, 0, np.nan)], [0]),
        ("singularities:", np.zeros((0, 3)), []),
    ],
)
def test_singularities(text, positions, quarters):
    source = parsed(text)
    assert isinstance(source, Singularities)
    assert np.array_equal(source.positions, np.asarray(positions, float), equal_nan=True)
    assert source.quarters.tolist() == quarters


@pytest.mark.parametrize(
    "text, expected",
    [
        ("eigenmode:4", Eigenmode(4)),
        ("eigenmode:4:neumann", Eigenmode(4, "neumann")),
        ("eigenmode:4:isolines", Eigenmode(4, "dirichlet", "isolines")),
        ("eigenmode: 4 : neumann : isolines", Eigenmode(4, "neumann", "isolines")),
        ("EIGENMODE:12:Isolines:Dirichlet", Eigenmode(12, "dirichlet", "isolines")),
    ],
)
def test_eigenmodes(text, expected):
    assert parsed(text) == expected


@pytest.mark.parametrize(
    "text, call, source",
    [
        ("view:3", 3, VIEW),
        ("out.msh", ("out.msh", None), VIEWS),
        ("some folder/out.MSH:a view: v", ("some folder/out.MSH", "a view: v"), VIEWS),
        (Path("a/out.msh"), ("a/out.msh", None), VIEWS),
        ("C:/models/out.msh:v", ("C:/models/out.msh", "v"), VIEWS),
    ],
)
def test_views_are_loaded_by_the_caller(text, call, source):
    assert parsed(text) is source
    assert parsed.calls == [call]


def test_files_have_array_names():
    for text, file in (
        ("stress.vtu:principal", ("stress.vtu", "principal")),
        ("stress.vtk", ("stress.vtk", None)),
        ("a.b/c d.vtu:x:principal", ("a.b/c d.vtu", "x:principal")),
    ):
        assert parse_text(text)[None].arguments == file
    with pytest.raises(InputError, match=r"no such file 'there_is_no.vtu'"):
        parsed("there_is_no.vtu:principal")


def test_functions():
    assert parsed("numpy:zeros_like").function is np.zeros_like
    f = lambda p: p  # noqa: E731
    assert parsed(f) == Function(f)
    assert parsed("numpy:linalg.norm").function is np.linalg.norm
    with pytest.raises(InputError, match="there is no module 'no_such_module'"):
        parsed("no_such_module:f")


def test_sources_stay():
    source = Singularities([(0, 0)], [1])
    assert parsed(source) is source


def test_per_face():
    for value in ("1=eigenmode:4;3=smooth", " 1 = eigenmode:4 ; 3 = smooth ;", {1: "eigenmode:4", np.int64(3): Smooth()}):
        source = parsed(value)
        assert source == PerFace({1: Eigenmode(4), 3: Smooth()}, Smooth())
        assert (source.of(1), source.of(2)) == (Eigenmode(4), Smooth())
    for value in ("eigenmode:2; 7=view:1", {None: Eigenmode(2), 7: "view:1"}):
        assert parsed(value) == PerFace({7: VIEW}, Eigenmode(2))
        assert parsed.calls == [1]
    points = parsed("1=singularities:(0,1):1;2=singularities:(5,6,7):-1").points()
    assert np.array_equal(points, [[0, 1, np.nan], [5, 6, 7]], equal_nan=True)


@pytest.mark.parametrize(
    "value, words",
    [
        ("", "the field '' is none: write smooth, singularities:"),
        ("smoth", "the field 'smoth' is none: write smooth"),
        ("smooth:", None),
        ("smooth:0", "no positive number"),
        ("smooth:-1", "no positive number"),
        ("smooth:nan", "no positive number"),
        ("smooth:1e999", "epsilon is inf"),
        ("smooth:0.1:2", "no positive number"),
        ("singularities", None),
        ("singularities:(0,0)", r"cannot be read from '\(0,0\)' on: write"),
        ("singularities:(0,0):1/4", r"cannot be read from '\(0,0\):1/4' on"),
        ("singularities:(0,0):0.25", "whole numbers q of quarter turns"),
        ("singularities:(0,0):1(1,1):1", "cannot be read"),
        ("singularities:(0,0):1,(1):1", r"cannot be read from '\(1\):1' on"),
        ("singularities:(0,0,0,0):1", "cannot be read"),
        ("singularities:(a,0):1", "cannot be read"),
        ("singularities:(nan,0):1", "cannot be read"),
        ("eigenmode", "the eigenmode 'eigenmode' is none: write eigenmode:4"),
        ("eigenmode:0", "is none"),
        ("eigenmode:-2", "is none"),
        ("eigenmode:1.5", "is none"),
        ("eigenmode:2:robin", "is none"),
        ("eigenmode:2:neumann:dirichlet", "is none"),
        ("view", "has no tag"),
        ("stress.csv", "is none"),
        ("module:", "is none"),
        ("module:f()", "is none"),
        ("a module:f", "is none"),
        ("1=smooth;1=smooth", "two fields for surface 1"),
        ("smooth;smooth", "two fields in"),
        ("1=", "the field '' is none"),
        ("x=smooth", "is none"),
        (7, "cannot be made of int"),
        (np.zeros((3, 3)), "cannot be made of ndarray"),
        (None, "cannot be made of NoneType"),
        ({1.5: "smooth"}, "surface 1.5: give the tag"),
        ({"rotor": "smooth"}, "surface 'rotor': give the tag"),
        ({1: 3}, "cannot be made of int"),
        (Fraction(1, 4), "cannot be made of Fraction"),
    ],
)
def test_what_is_no_field(value, words):
    if words is None:
        parsed(value)
        return
    with pytest.raises((InputError, FieldError), match=words) as caught:
        parsed(value)
    assert "\n" not in str(caught.value)
    assert parsed.calls == []


def test_syntax_is_checked_without_heavy_modules():
    code = (
        "import sys; from gmsh_crossquad.source.parse import parse_text;"
        "parse_text('1=eigenmode:4;2=a.vtu:b;3=smooth:1;4=singularities:(0,0):1;5=view:1;m:f');"
        "print([m for m in ('numpy', 'scipy', 'meshio', 'gmsh', 'vtk') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
