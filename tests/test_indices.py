"""Indices in the names of physical points and in Python."""

from fractions import Fraction

import gmsh
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gmsh_crossquad.cad.indices import prescribed_indices
from gmsh_crossquad.cad.read import read_model
from gmsh_crossquad.errors import InputError
from gmsh_crossquad.options import MeshOptions

# two unit squares side by side; points 2 and 5 are shared, 7 is embedded in surface 1, 8 inside it but not embedded,
# 9 on curve 1, 10 above the model, 11 at the place of point 3
GEO = """
Point(1) = {0, 0, 0}; Point(2) = {1, 0, 0}; Point(3) = {2, 0, 0}; Point(4) = {2, 1, 0}; Point(5) = {1, 1, 0};
Point(6) = {0, 1, 0}; Point(7) = {.3, .4, 0};
Point(8) = {.6, .7, 0}; Point(9) = {.5, 0, 0}; Point(10) = {.5, .5, 1}; Point(11) = {2, 0, 0};
Line(1) = {1, 2}; Line(2) = {2, 3}; Line(3) = {3, 4}; Line(4) = {4, 5}; Line(5) = {5, 6}; Line(6) = {6, 1}; Line(7) = {2, 5};
Curve Loop(1) = {1, 7, 5, 6}; Plane Surface(11) = {1};
Curve Loop(2) = {2, 3, 4, -7}; Plane Surface(12) = {2};
Point{7} In Surface{11};
Physical Surface("left part") = {11}; Physical Surface("right") = {12}; Physical Surface("all") = {11, 12};
"""


pytestmark = pytest.mark.usefixtures("gmsh_session")


@pytest.fixture
def found(tmp_path):
    """Indices of the model with named points, by (surface tag, point tag)."""

    def read(names=(), options=None, geo=GEO):
        path = tmp_path / "model.geo"
        path.write_text(geo + "".join(f"Physical Point('{name}') = {{{tags}}};\n" for tags, name in names))
        gmsh.clear()
        gmsh.open(str(path))
        model = read_model(MeshOptions())
        out = prescribed_indices(model, options)
        return {(model.faces[f].tag, int(model.vertex_tags[v])): q for (f, v), q in out.items()}

    return read


def test_nothing_prescribed(found):
    assert found([(1, "corner"), (2, "refractive index 1/4"), (3, "subindex=7"), (4, "face=77")]) == {}


@pytest.mark.parametrize(
    ("text", "quarters"),
    [
        ("index=1/4", 1),
        ("index=+1/4", 1),
        ("index = -1/2", -2),
        ("INDEX=0", 0),
        ("trailing edge (index=2/4)", 2),
        ("index=1", 4),
        ("index=-1", -4),
        ("index=.25, sharp", 1),
        ("index=-0.75", -3),
        ("index=6/8; wall", 3),
        ("a=1 index=-00/04", 0),
    ],
)
def test_forms(found, text, quarters):
    assert found([(1, text)]) == {(11, 1): quarters}


@pytest.mark.parametrize("text", ["", "1/3", "0.3", "x", "1/0", "--1/4", "1/4/2", "nan", "1e0", "face=3", "1//4", "\u00bd"])
def test_what_is_no_index(found, text):
    with pytest.raises(InputError, match="quarter turns") as error:
        found([(1, f"sharp index={text}")])
    assert "\n" not in str(error.value)
    assert f"'sharp index={text}'" in str(error.value)


def test_several_points_of_one_name_and_an_embedded_one(found):
    assert found([("1, 4, 7", "index=-1/4")]) == {(11, 1): -1, (12, 4): -1, (11, 7): -1}


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("index=1/4 face=11", {(11, 2): 1}),
        ('index=1/4 face="left part" index=0 face=right', {(11, 2): 1, (12, 2): 0}),
        ("index=-1/4 face=12 face=11", {(11, 2): -1, (12, 2): -1}),
        ("index=1/2 face=all", {(11, 2): 2, (12, 2): 2}),
        ("index=1/2 face=all index=1/2 face=12", {(11, 2): 2, (12, 2): 2}),
    ],
)
def test_face_of_a_shared_point(found, text, expected):
    assert found([(2, text)]) == expected


@pytest.mark.parametrize(
    ("tag", "text", "message"),
    [
        (2, "index=1/4", "surfaces 11, 12 meet"),
        (2, "index=1/4 face=13", "surface 13, which is not meshed"),
        (2, "index=1/4 face=rotor", "physical surface 'rotor', which is not meshed"),
        (1, "index=1/4 face=12", "surface 12, which does not have this point"),
        (1, "index=1/4 face=right", "physical surface 'right', which does not have this point"),
        (1, "face=11 index=1/4", "face without an index"),
        (1, "index=1/4 face=", "face without an index"),
        (1, "index=1/4 index=0", "different indices in surface 11"),
        (2, "index=1/4 face=all index=0 face=12", "different indices in surface 12"),
        (8, "index=1/4", "not embedded in surface 11, point 8 at .*: write Point.8. In Surface.11.;"),
        (9, "index=1/4", "lies on curve 1 without dividing it"),
        (10, "index=1/4", "on none of the meshed surfaces"),
        (11, "index=1/4", "same place as point 3"),
    ],
)
def test_errors_of_names(found, tag, text, message):
    with pytest.raises(InputError, match=message) as error:
        found([(tag, text)])
    assert repr(text) in str(error.value)
    assert "\n" not in str(error.value)


def test_two_names_of_one_point(found):
    assert found([(1, "index=1/4"), (1, "wall index=2/8")]) == {(11, 1): 1}
    with pytest.raises(InputError, match=r"'index=1/4' and the name 'wall index=0' give different"):
        found([(1, "index=1/4"), (1, "wall index=0")])


def test_option_has_priority(found):
    names = [(1, "index=1/4"), (2, "index=1/4 face=11 index=0 face=12"), (3, "index=-1/4")]
    options = {1: 0, (2, 11): "-1/4", 4: Fraction(1, 4), (np.int64(6), "left part"): -0.25, 7: 0.5}
    expected = {(11, 1): 0, (11, 2): -1, (12, 2): 0, (12, 3): -1, (12, 4): 1, (11, 6): -1, (11, 7): 2}
    assert found(names, options) == expected


def test_option_settles_an_ambiguous_name(found):
    assert found([(2, "index=1/4")], {(2, 11): 1, (2, 12): 0}) == {(11, 2): 4, (12, 2): 0}
    with pytest.raises(InputError, match="surfaces 11, 12 meet"):
        found([(2, "index=1/4")], {(2, 11): 1})


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({99: 1}, "point 99, which the model does not have"),
        ({8: 1}, "not embedded in surface 11"),
        ({2: 1}, "surfaces 11, 12 meet"),
        ({(1, 12): 1}, "does not have this point"),
        ({1: 0.3}, "the index 0.3"),
        ({1: "a"}, "the index 'a'"),
        ({1: float("nan")}, "the index nan"),
        ({1: True}, "the index True"),
        ({1: None}, "the index None"),
        ({"1": 1}, "no valid key"),
        ({(1, 2, 3): 1}, "no valid key"),
        ({(1, 11): 1, 1: 0}, "different indices"),
    ],
)
def test_errors_of_the_option(found, options, message):
    with pytest.raises(InputError, match=message) as error:
        found([], options)
    assert "boundary_index" in str(error.value)


@given(st.integers(-40, 40))
def test_every_way_to_write_an_index_is_the_same(quarters):
    from gmsh_crossquad.cad.indices import _quarters

    index = Fraction(quarters, 4)
    for value in (
        index,
        str(index),
        float(index),
        np.float32(index),
        f"{quarters}/4",
        f"{2 * quarters:+d}/8",
        repr(float(index)),
    ):
        assert _quarters(value, "") == quarters


def test_names_stay_in_the_model(found):
    found([(1, "index=1/4")])
    assert "index=1/4" in [gmsh.model.getPhysicalName(*group) for group in gmsh.model.getPhysicalGroups(0)]
