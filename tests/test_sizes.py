import gmsh
import models
import numpy as np
import pytest

from gmsh_crossquad.cad.background import background_meshes
from gmsh_crossquad.cad.read import read_model
from gmsh_crossquad.cad.session import guest
from gmsh_crossquad.cad.sizes import target_sizes
from gmsh_crossquad.errors import InputError
from gmsh_crossquad.options import MeshOptions


@pytest.fixture
def square():
    """A 10 x 10 square as the user's model."""
    with guest():
        gmsh.model.add("square")
        gmsh.model.occ.addRectangle(0, 0, 0, 10, 10)
        gmsh.model.occ.synchronize()
        yield
        for name in ("Mesh.MeshSizeMax", "Mesh.MeshSizeFactor"):
            gmsh.option.setNumber(name, 1e22 if name.endswith("Max") else 1)
        gmsh.model.remove()


def measured(options=MeshOptions()):  # noqa: B008
    model = read_model(options)
    meshes = background_meshes(model, options)
    return model, meshes, target_sizes(model, meshes, options)


def test_given_size_is_scaled(square):
    model, _, sizes = measured(MeshOptions(size=0.5))
    assert sizes.constant == pytest.approx(0.5 / np.hypot(10, 10))
    np.testing.assert_allclose(sizes.at_face(0, np.zeros((3, 2))) * model.scale, 0.5)
    np.testing.assert_allclose(sizes.at_curve(0, np.array([0.1, 0.2])) * model.scale, 0.5)


@pytest.mark.parametrize("size", [0.0, -1.0, float("nan"), float("inf"), 1e-5])
def test_bad_sizes(square, size):
    with pytest.raises(InputError):
        measured(MeshOptions(size=size))


def test_larger_than_the_model_is_allowed(square):
    assert measured(MeshOptions(size=1e3))[2].constant > 1


@pytest.mark.parametrize("size", [0.5, 1.0])
def test_mesh_size_max(square, size):
    gmsh.option.setNumber("Mesh.MeshSizeMax", size)
    model, meshes, sizes = measured()
    np.testing.assert_allclose(sizes.at_face(0, meshes[0].points) * model.scale, size, rtol=0.02)


def test_size_factor(square):
    gmsh.option.setNumber("Mesh.MeshSizeMax", 1.0)
    gmsh.option.setNumber("Mesh.MeshSizeFactor", 0.5)
    model, meshes, sizes = measured()
    np.testing.assert_allclose(sizes.at_face(0, meshes[0].points) * model.scale, 0.5, rtol=0.02)


def test_point_sizes_grade_from_corner_to_corner(square):
    for tag, h in zip((1, 2, 3, 4), (0.2, 1.0, 1.0, 0.2), strict=True):
        gmsh.model.mesh.setSize([(0, tag)], h)
    model, _, sizes = measured()
    left, middle, right = (sizes.at_face(0, model.faces[0].local((np.array([[x, 5.0, 0.0]]) - model.origin) / model.scale))[0]
                           * model.scale for x in (0.1, 5.0, 9.9))  # fmt: skip
    assert left == pytest.approx(0.2, rel=0.15)
    assert right == pytest.approx(1.0, rel=0.15)
    assert 0.3 < middle < 0.9


def test_size_field_inside_is_seen(square):
    field = gmsh.model.mesh.field
    law = field.add("MathEval")
    field.setString(law, "F", "0.1 + 0.2 * sqrt((x - 5)^2 + (y - 5)^2)")
    field.setAsBackgroundMesh(law)
    model, _, sizes = measured()
    local = model.faces[0].local((np.array([[5.0, 5.0, 0.0], [0.5, 5.0, 0.0]]) - model.origin) / model.scale)
    inside, outside = sizes.at_face(0, local) * model.scale
    assert inside < 0.2
    assert outside == pytest.approx(1.0, rel=0.25)


def test_mesh_and_options_of_the_user_stay(square):
    gmsh.option.setNumber("Mesh.MeshSizeMax", 2.0)
    gmsh.model.mesh.generate(2)
    before = gmsh.model.mesh.getNodes()
    elements = gmsh.model.mesh.getElements(2)
    measured()
    after = gmsh.model.mesh.getNodes()
    order, other = np.argsort(before[0]), np.argsort(after[0])
    np.testing.assert_array_equal(before[0][order], after[0][other])
    np.testing.assert_array_equal(before[1].reshape(-1, 3)[order], after[1].reshape(-1, 3)[other])
    np.testing.assert_array_equal(elements[2][0], gmsh.model.mesh.getElements(2)[2][0])
    assert gmsh.option.getNumber("Mesh.MeshSizeFactor") == 1
    assert gmsh.option.getNumber("Mesh.MeshSizeMax") == 2.0


def test_absurdly_fine_model_is_refused_fast(square):
    gmsh.option.setNumber("Mesh.MeshSizeMax", 1e-4)
    with pytest.raises(InputError, match="quads"):
        measured()


def test_size_map_on_hand_made_model():
    model = models.two_materials()
    sizes = target_sizes(model, models.background(model, 0.05), MeshOptions(size=0.1))
    assert sizes.at_face(1, np.zeros((2, 2))) == pytest.approx(0.1 / np.sqrt(2))


def test_periodic_curves_and_a_mesh_of_the_user(square):
    shift = [1, 0, 0, 10, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
    gmsh.model.mesh.setPeriodic(1, [2], [4], shift)
    gmsh.option.setNumber("Mesh.MeshSizeMax", 1.0)
    gmsh.model.mesh.generate(2)
    model, meshes, sizes = measured()
    np.testing.assert_allclose(sizes.at_face(0, meshes[0].points) * model.scale, 1.0, rtol=0.02)
    gmsh.model.mesh.clear()
    gmsh.model.mesh.generate(2)  # the mesher still works
    assert len(gmsh.model.mesh.getNodes()[0]) > 100
