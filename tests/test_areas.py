"""Areas of curved faces, and meshes of solids judged against their CAD."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import gmsh
import numpy as np
import pytest

from gmsh_crossquad.cad.areas import curved_areas
from gmsh_crossquad.cad.background import background_meshes
from gmsh_crossquad.cad.files import physical_groups, read_mesh
from gmsh_crossquad.cad.put import put_mesh
from gmsh_crossquad.cad.read import read_model
from gmsh_crossquad.cad.surfaces import CadSurfaces
from gmsh_crossquad.check import check_mesh
from gmsh_crossquad.compare import compare
from gmsh_crossquad.options import MeshOptions

from .test_high_order import made


@pytest.fixture
def session() -> Iterator[None]:
    gmsh.initialize(readConfigFiles=False, interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    yield
    gmsh.finalize()


SOLIDS = {
    "sphere": (lambda occ: occ.addSphere(1, 2, 3, 0.5), np.pi),
    "cylinder": (lambda occ: occ.addCylinder(0, 0, 0, 1, 2, 2, 0.5), 3 * np.pi),
    "cone": (lambda occ: occ.addCone(0, 0, 0, 0, 0, 4, 5, 2), 7 * 5 * np.pi),
    "torus": (lambda occ: occ.addTorus(0, 0, 0, 3, 1), 12 * np.pi**2),
}


@pytest.mark.parametrize("name", SOLIDS)
def test_area_of_the_curved_face(session: None, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    add, expected = SOLIDS[name]
    add(gmsh.model.occ)
    gmsh.model.occ.synchronize()
    model = read_model(MeshOptions())
    meshes = background_meshes(model, MeshOptions())
    surfaces = CadSurfaces(model, meshes)
    found = curved_areas(model, surfaces, meshes)
    assert np.array_equal(np.isnan(found), ~surfaces.curved)
    assert np.nansum(found) * model.scale**2 == pytest.approx(expected, rel=1e-9)
    # the same from the triangles, as for other kernels; halving them leaves a quarter of the error
    monkeypatch.setattr(gmsh.model.occ, "getEntities", lambda dim: [])
    found = curved_areas(model, surfaces, meshes)
    assert np.nansum(found) * model.scale**2 == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("kind", ["sphere", "tube", "torus"])
def test_mesh_read_back_is_good(session: None, kind: str) -> None:
    own, _, mesh = made(kind, 4)
    put_mesh(own, mesh)
    arrays = read_mesh()
    model = read_model(MeshOptions())
    meshes = background_meshes(model, MeshOptions())
    surfaces = CadSurfaces(model, meshes)
    areas = curved_areas(model, surfaces, meshes)
    report = compare(check_mesh(arrays), arrays, model, surfaces, physical_groups(), areas)
    assert report.faults == ()
    assert report.quads == len(mesh.quads)
    bad = arrays.points.copy()
    bad[mesh.face_nodes[0][7]] += 1e-3 * (bad[mesh.face_nodes[0][7]] - model.origin)
    report = compare(check_mesh(replace(arrays, points=bad)), replace(arrays, points=bad), model, surfaces, {}, areas)
    assert report.faults == ("1 nodes are not on the faces of the model",)


def test_parameters_of_nodes_inside_faces_are_kept(session: None) -> None:
    model, _, mesh = made("torus", 1)
    rng = np.random.default_rng(5)
    uv = rng.uniform(0, 6, (len(mesh.face_nodes[0]), 2))
    put_mesh(model, mesh, [uv])
    tags, _, found = gmsh.model.mesh.getNodes(2, model.faces[0].tag)
    np.testing.assert_array_equal(found.reshape(-1, 2)[np.argsort(tags)], uv)
    put_mesh(model, mesh)
    assert len(gmsh.model.mesh.getNodes(2, model.faces[0].tag)[0]) == len(uv)
