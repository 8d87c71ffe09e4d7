"""Prescribed numbers of edges: found where the user asked for them only, and kept where blocks would be smaller."""

import gmsh
import numpy as np
import pytest

from gmsh_crossquad import mesh
from gmsh_crossquad.cad.files import open_model
from gmsh_crossquad.cad.read import read_model
from gmsh_crossquad.cad.session import guest
from gmsh_crossquad.cad.validate import validate
from gmsh_crossquad.errors import GeometryError
from gmsh_crossquad.options import MeshOptions


@pytest.fixture(autouse=True)
def session():
    with guest():
        gmsh.model.add("square")
        gmsh.model.occ.addRectangle(0, 0, 0, 1, 1)
        gmsh.model.occ.synchronize()
        yield


def prescribe(*counts):
    for tag, n in enumerate(counts, start=1):
        gmsh.model.mesh.setTransfiniteCurve(tag, n + 1)


def test_large_prescribed_edges_with_a_small_size():
    prescribe(3, 3, 3, 3)
    assert mesh(size=0.02).quality.quads == 9


def test_large_prescribed_edges_of_a_side_with_several_blocks():
    gmsh.model.add("L")
    occ = gmsh.model.occ
    corners = [occ.addPoint(x, y, 0) for x, y in ((0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2))]
    sides = [occ.addLine(p, q) for p, q in zip(corners, corners[1:] + corners[:1])]
    occ.addPlaneSurface([occ.addCurveLoop(sides)])
    occ.synchronize()
    gmsh.model.mesh.setTransfiniteCurve(sides[0], 4)  # blocks at its size would be more
    mesh(size=0.02)
    assert len(gmsh.model.mesh.getElements(1, sides[0])[1][0]) == 3
    parts = [len(gmsh.model.mesh.getElements(1, side)[1][0]) for side in (sides[2], sides[4])]
    assert sum(parts) == 3


def test_an_anisotropic_background_mesh_prescribes_nothing():
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 0, 0], [1, 1, 0], [0, 1, 0]], float).reshape(2, 3, 3)
    metric = np.diag([1 / 0.05**2, 1 / 0.1**2, 1.0]).ravel()
    view = gmsh.view.add("metric")
    data = [np.concatenate([c.T.ravel(), np.tile(metric, 3)]) for c in corners]
    gmsh.view.addListData(view, "TT", 2, np.concatenate(data))
    field = gmsh.model.mesh.field.add("PostView")
    gmsh.model.mesh.field.setNumber(field, "ViewTag", view)
    gmsh.model.mesh.field.setAsBackgroundMesh(field)
    gmsh.model.mesh.generate(1)
    assert len(gmsh.model.mesh.getNodes(1, 1)[0]) > 4  # the view is at work
    assert all(c.spacing is None for c in read_model(MeshOptions()).curves)
    prescribe(7)
    assert [len(c.spacing) for c in read_model(MeshOptions()).curves if c.spacing is not None] == [8]


@pytest.mark.parametrize("last", [5, 6])
def test_the_boundary_of_a_quad_mesh_is_even(last):
    prescribe(4, 5, 4, last)
    model = read_model(MeshOptions())
    if last == 5:
        validate(model)
        return
    with pytest.raises(GeometryError, match="19 edges, an odd number") as caught:
        validate(model)
    assert caught.value.entity == (2, 1)


def test_a_partitioned_mesh_is_no_geometry(tmp_path):
    gmsh.model.addPhysicalGroup(2, [1], name="all")
    gmsh.model.mesh.generate(2)
    gmsh.option.setNumber("Mesh.PartitionCreateTopology", 1)
    gmsh.model.mesh.partition(2)
    assert len(gmsh.model.getEntities(2)) == 3
    model = read_model(MeshOptions())
    assert [f.tag for f in model.faces] == [1]
    assert [c.tag for c in model.curves] == [1, 2, 3, 4]
    script = tmp_path / "parts.geo"
    script.write_text('SetFactory("OpenCASCADE"); Rectangle(1) = {0, 0, 0, 1, 1}; Mesh 2; PartitionMesh 2;')
    open_model(script)
    try:
        assert gmsh.model.getEntities(2) == [(2, 1)]
    finally:
        gmsh.model.remove()
