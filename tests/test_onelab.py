"""Options in a .geo file."""

import gmsh
import pytest

from gmsh_crossquad.cad.onelab import forget_options, onelab_options
from gmsh_crossquad.errors import InputError

SQUARE = 'SetFactory("OpenCASCADE"); Rectangle(1) = {0, 0, 0, 1, 1};\n'


pytestmark = pytest.mark.usefixtures("gmsh_session")


@pytest.fixture(autouse=True)
def fresh():
    gmsh.clear()
    gmsh.onelab.clear()


@pytest.fixture
def opened(tmp_path):
    def open_(text, name="model.geo"):
        path = tmp_path / name
        path.write_text(f"{SQUARE}{text}\n")
        gmsh.open(str(path))
        return onelab_options()

    return open_


def test_a_model_without_options(opened):
    assert opened('DefineConstant[ a = {1, Name "Parameters/Element size"} ];') == {}
    gmsh.model.add("no file")
    assert onelab_options() == {}


def test_all_options(opened):
    found = opened(
        """
        DefineConstant[ h = {0.2, Min 0.1, Max 1, Name "CrossQuad/Element size"} ];
        DefineConstant[ n = {1000, Name "CrossQuad/1Max quads"} ];
        b = DefineNumber[ 3, Name "CrossQuad/Advanced/02 block SIZE" ];
        DefineConstant[ c = {0.5, Name "0crossquad/3Background"} ];
        DefineConstant[ d = {1, Choices{0, 1}, Name "CrossQuad/Fix indices"} ];
        DefineConstant[ e = {0, Choices{0, 1}, Name "CrossQuad/Relax"} ];
        DefineConstant[ f = {"eigenmode:4", Name "CrossQuad/Field"} ];
        """
    )
    assert found == {
        "size": 0.2,
        "max_quads": 1000,
        "block_size": 3,
        "background": 0.5,
        "fix_indices": True,
        "relax": False,
        "field": "eigenmode:4",
    }
    assert found["fix_indices"] is True
    assert found["relax"] is False


def test_fields_of_surfaces(opened):
    found = opened(
        'DefineConstant[ f = {"smooth", Name "CrossQuad/Field"} ];\n'
        'DefineConstant[ g = {"singularities:(0,0):1", Name "CrossQuad/1Field 12"} ];\n'
    )
    assert found == {"field": {None: "smooth", 12: "singularities:(0,0):1"}}
    forget_options()
    assert opened('DefineConstant[ g = {"smooth", Name "CrossQuad/Field 3"} ];') == {"field": {3: "smooth"}}


@pytest.mark.parametrize(
    ("line", "message"),
    [
        (
            'a = DefineNumber[1, Name "CrossQuad/Mesh size"];',
            "'CrossQuad/Mesh size': the parameters of CrossQuad are Element size",
        ),
        ('a = DefineNumber[1, Name "CrossQuad/Field x"];', "unknown"),
        ('a = DefineNumber[1, Name "CrossQuad/Field"];', "no single text"),
        ('a = DefineString["x", Name "CrossQuad/Element size"];', "no single number"),
        ('a = DefineNumber[2, Name "CrossQuad/Relax"];', "is 2: it must be 0 or 1"),
        ('a = DefineNumber[1, Name "CrossQuad/Relax"]; b = DefineNumber[1, Name "CrossQuad/2relax"];', "the same option"),
    ],
)
def test_errors(opened, line, message):
    with pytest.raises(InputError, match=message) as error:
        opened(line)
    assert "\n" not in str(error.value)


def test_a_value_that_was_changed_in_the_session(opened):
    opened('DefineConstant[ h = {0.2, Name "CrossQuad/Element size"} ];')
    gmsh.onelab.setNumber("CrossQuad/Element size", [0.7])
    assert onelab_options() == {"size": 0.7}


def test_a_second_model_has_its_own_parameters(opened):
    assert opened('DefineConstant[ h = {0.2, Name "CrossQuad/Element size"} ];', "first.geo") == {"size": 0.2}
    assert opened('DefineConstant[ b = {2, Name "CrossQuad/Block size"} ];', "second.geo") == {"block_size": 2}
    assert opened('// DefineConstant[ h = {0.2, Name "CrossQuad/Element size"} ];', "third.geo") == {}
    gmsh.model.setCurrent("first")
    assert onelab_options() == {"size": 0.2}
    gmsh.model.add("from a program")
    assert onelab_options() == {}


def test_gmsh_keeps_values_between_files(opened):
    """That is Gmsh's way, for the variable in the file as well; `forget_options` ends it."""
    line = 'DefineConstant[ h = {%g, Name "CrossQuad/Element size"} ]; Point(99) = {h, 9, 9};'
    assert opened(line % 0.2, "first.geo") == {"size": 0.2}
    assert opened(line % 0.3, "second.geo") == {"size": 0.2}
    assert gmsh.model.getValue(0, 99, [])[0] == 0.2
    forget_options()
    assert opened(line % 0.3, "third.geo") == {"size": 0.3}


def test_parameters_of_an_included_file(opened, tmp_path):
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "common.geo").write_text(
        'DefineConstant[ h = {0.2, Name "CrossQuad/Element size"} ];\nInclude "more.geo";\n'
    )
    (tmp_path / "sub" / "more.geo").write_text('DefineConstant[ b = {2, Name "CrossQuad/Block size"} ];\n')
    assert opened('Include "sub/common.geo";') == {"size": 0.2, "block_size": 2}


@pytest.mark.parametrize("name", ['StrCat["CrossQuad/", "Element size"]', 'Sprintf["CrossQuad/%gElement size", 1]'])
def test_a_name_made_of_pieces(opened, name):
    assert opened(f"DefineConstant[ h = {{0.2, Name {name}}} ];") == {"size": 0.2}


def test_parameters_of_a_program():
    gmsh.model.add("program")
    gmsh.onelab.set('[{"type": "number", "name": "CrossQuad/Element size", "values": [0.25]}]')
    assert onelab_options() == {"size": 0.25}


def test_forget_leaves_other_parameters(opened):
    opened('DefineConstant[ a = {1, Name "Mine/a"} ]; DefineConstant[ h = {0.2, Name "CrossQuad/Element size"} ];')
    forget_options()
    assert onelab_options() == {}
    assert "Mine/a" in gmsh.onelab.getNames()


def test_a_file_that_is_gone(opened, tmp_path):
    opened('DefineConstant[ h = {0.2, Name "CrossQuad/Element size"} ];')
    (tmp_path / "model.geo").unlink()
    assert onelab_options() == {"size": 0.2}
