"""Files of bare triangles are cut into the faces that the part had."""

import gmsh
import numpy as np
import pytest

from gmsh_crossquad import mesh
from gmsh_crossquad.cad.files import open_model
from gmsh_crossquad.cad.session import guest


@pytest.fixture(autouse=True)
def session():
    with guest():
        gmsh.model.add("cad")
        yield
        gmsh.clear()


def as_triangles(path, size):
    """Write the model as STL, 10 significant digits, and open the file."""
    gmsh.model.occ.synchronize()
    gmsh.option.setNumber("Mesh.MeshSizeMax", size)
    gmsh.model.mesh.generate(2)
    gmsh.write(str(path))
    gmsh.clear()
    gmsh.option.setNumber("Mesh.MeshSizeMax", 1e22)
    open_model(path)


def numbers():
    return [len(gmsh.model.getEntities(dim)) for dim in range(3)]


def test_a_box_has_its_faces_again(tmp_path):
    gmsh.model.occ.addBox(0, 0, 0, 1, 2, 1)
    as_triangles(tmp_path / "box.stl", 0.8)
    assert numbers() == [8, 12, 6]
    quality = mesh(size=0.25).quality
    assert (quality.blocks, quality.irregular, quality.quads) == (6, 0, 2 * 16 + 4 * 32)
    assert quality.min_scaled_jacobian == pytest.approx(1.0, abs=1e-6)


def test_a_cylinder_is_two_discs_and_a_tube(tmp_path):
    gmsh.model.occ.addCylinder(0, 0, 0, 0, 0, 2, 0.5)
    as_triangles(tmp_path / "cylinder.stl", 0.15)
    assert numbers()[1:] == [2, 3]
    mesh(size=0.25)
    tags, points, _ = gmsh.model.mesh.getNodes()
    quads = np.searchsorted(np.sort(tags), gmsh.model.mesh.getElementsByType(3)[1]).reshape(-1, 4)
    p = points.reshape(-1, 3)[np.argsort(tags)]
    assert (
        np.unique(np.sort(np.stack([quads, np.roll(quads, -1, 1)], 2).reshape(-1, 2), 1), axis=0, return_counts=True)[1].min()
        == 2
    )
    r, wall = np.linalg.norm(p[:, :2], axis=1), np.minimum(p[:, 2], 2 - p[:, 2]) > 1e-6
    sagitta = 0.5 * (1 - np.cos(0.5 * 0.15 / 0.5))  # of the triangles, which are within it of the circle
    assert r.max() <= 0.5 + 1e-6 and r[wall].min() >= 0.5 - 3 * sagitta


def test_a_closed_surface_is_cut_so_that_its_pieces_have_maps(tmp_path):
    gmsh.model.occ.addSphere(0, 0, 0, 1)
    as_triangles(tmp_path / "sphere.stl", 0.4)
    assert numbers()[2] > 1
    assert all(gmsh.model.getBoundary([s]) for s in gmsh.model.getEntities(2))


def test_a_model_with_curves_is_left_as_it_is(tmp_path):
    script = tmp_path / "square.geo"
    script.write_text('SetFactory("OpenCASCADE"); Rectangle(1) = {0, 0, 0, 1, 1};')
    open_model(script)
    assert numbers() == [4, 4, 1]
    assert gmsh.model.getType(2, 1) == "Plane"
