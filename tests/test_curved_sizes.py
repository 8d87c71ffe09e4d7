"""Sizes on curved and closed faces, against Gmsh's own meshes."""

from __future__ import annotations

import gmsh
import numpy as np
import pytest
from cad_shapes import GEO, OCC, ORIGIN, SCALE, curved_tag, records, shape

from gmsh_crossquad.cad import session
from gmsh_crossquad.cad.gmsh_sizes import triangle_areas
from gmsh_crossquad.cad.sizes import SizeMap, target_sizes
from gmsh_crossquad.cad.surfaces import CadSurfaces
from gmsh_crossquad.errors import InputError, MeshError
from gmsh_crossquad.options import MeshOptions


def measured(tags: list[int], **options: float) -> SizeMap:
    """Gmsh's own sizes under options of the user; the background stays as it is."""
    model, meshes = records(tags)
    with session.options(**{"Mesh.MeshSizeMax": 1e22, **{f"Mesh.{k}": v for k, v in options.items()}}):
        return target_sizes(model, meshes, MeshOptions())


def ratios(sizes: SizeMap, **options: float) -> np.ndarray:
    """Our size over the mean edge length of every triangle that Gmsh makes on the only face."""
    with session.options(**{"Mesh.MeshSizeMax": 1e22, **{f"Mesh.{k}": v for k, v in options.items()}}):
        gmsh.model.mesh.clear()
        gmsh.model.mesh.generate(2)
    tags, x, _ = gmsh.model.mesh.getNodes()
    place = np.zeros((int(tags.max()) + 1, 3))
    place[tags.astype(np.int64)] = (x.reshape(-1, 3) - ORIGIN) / SCALE
    corner = place[gmsh.model.mesh.getElementsByType(2, sizes.model.faces[0].tag)[1].astype(np.int64).reshape(-1, 3)]
    theirs = np.linalg.norm(corner - np.roll(corner, 1, axis=1), axis=2).mean(axis=1)
    return sizes.at_face(0, corner.mean(axis=1)) / theirs


def test_areas_of_a_sphere() -> None:
    with shape(OCC["sphere"], 0.1):
        _, (mesh,) = records([1])
        assert triangle_areas(mesh).sum() * SCALE**2 == pytest.approx(4 * np.pi, rel=5e-3)


def test_curvatures() -> None:
    with shape(OCC["torus"]):
        model, meshes = records([1])
        (curvature,) = CadSurfaces(model, meshes).seed_curvatures
        np.testing.assert_allclose(curvature / SCALE, 1 / 0.3, rtol=1e-4)
    with shape(GEO["in sphere"]):  # where Gmsh itself is wrong
        model, meshes = records([1])
        (curvature,) = CadSurfaces(model, meshes).seed_curvatures
        np.testing.assert_allclose(curvature / SCALE, 1.0, rtol=5e-3)
    with shape(OCC["cone"]):
        tag = curved_tag()
        model, meshes = records([tag])
        (curvature,) = CadSurfaces(model, meshes).seed_curvatures
        radius = np.hypot(*(ORIGIN + SCALE * meshes[0].points)[:, :2].T)
        far = radius > 0.05
        np.testing.assert_allclose(curvature[far] / SCALE, 1 / (np.sqrt(2) * radius[far]), rtol=1e-3)
        assert np.isfinite(curvature).all()


@pytest.mark.parametrize("name", ["sphere", "torus"])
@pytest.mark.parametrize("options", [{}, {"MeshSizeMax": 0.2}, {"MeshSizeFactor": 0.7}], ids=str)
def test_closed_faces_have_gmsh_sizes(name: str, options: dict[str, float]) -> None:
    with shape(OCC[name]):
        sizes = measured([1], **options)
        assert np.median(ratios(sizes, **options)) == pytest.approx(1.0, abs=0.15)


@pytest.mark.parametrize("name", ["torus", "cylinder", "B-spline", "revolution"])
def test_curvature_in_the_user_s_options(name: str) -> None:
    with shape(OCC[name]):
        tag = curved_tag()
        sizes = measured([tag], MeshSizeFromCurvature=24)
        assert len(sizes.model.curves) == {"torus": 0, "cylinder": 2, "B-spline": 4, "revolution": 2}[name]
        low, middle, high = np.quantile(ratios(sizes, MeshSizeFromCurvature=24), [0.1, 0.5, 0.9])
        assert low > 0.8 and middle == pytest.approx(1.05, abs=0.15) and high < 1.8


def test_curvature_inside_counts_not_only_on_the_boundary() -> None:
    """A bump in a plate whose border is straight."""

    def bump() -> None:
        occ = gmsh.model.occ
        places = [(i / 6, j / 6, 0.5 * (i == j == 3)) for j in range(7) for i in range(7)]
        occ.addBSplineSurface([occ.addPoint(*p) for p in places], 7)

    with shape(bump, 0.05):
        sizes = measured([1], MeshSizeFromCurvature=40)
        middle = (np.array([[0.5, 0.5, gmsh.model.getValue(2, 1, [2.0, 2.0])[2]]]) - ORIGIN) / SCALE
        top = max(abs(k[0]) for k in gmsh.model.getPrincipalCurvatures(1, [2.0, 2.0])[:2])
        edge = sizes.at_curve(0, np.array([0.01 / SCALE]))[0] * SCALE
        assert 0.95 < sizes.at_face(0, middle)[0] * SCALE / (2 * np.pi / 40 / top) < 1.3  # at the nearest background point
        assert sizes.at_face(0, middle)[0] * SCALE < 0.5 * edge
        bounded = measured([1], MeshSizeFromCurvature=40, MeshSizeMin=0.05, MeshSizeFactor=1.5)
        assert bounded.at_face(0, middle)[0] * SCALE >= 0.075 * (1 - 1e-12)


def test_a_size_field_on_a_curved_face() -> None:
    with shape(OCC["cylinder"]):
        tag = curved_tag()
        field = gmsh.model.mesh.field
        law = field.add("MathEval")
        field.setString(law, "F", "0.05 + 0.2 * abs(z - 1)")
        field.setAsBackgroundMesh(law)
        sizes = measured([tag])
        place = (np.array([[0.7, 0, 1.0], [-0.7, 0, 0.2]]) - ORIGIN) / SCALE
        fine, coarse = sizes.at_face(0, place) * SCALE
        assert fine < 0.12 and coarse == pytest.approx(0.21, rel=0.3)


def test_a_closed_discrete_face_has_the_sizes_of_its_triangles() -> None:
    with shape(OCC["sphere"], 0.3):
        nodes, x, _ = gmsh.model.mesh.getNodes()
        _, elements = gmsh.model.mesh.getElementsByType(2)
        with session.scratch_model():
            tag = gmsh.model.addDiscreteEntity(2)
            gmsh.model.mesh.addNodes(2, tag, nodes, x)
            gmsh.model.mesh.addElementsByType(tag, 2, [], elements)
            sizes = measured([tag], MeshSizeFromCurvature=20)
            (mesh,) = sizes.meshes
            corner = mesh.points[mesh.triangles]
            edges = np.linalg.norm(corner - np.roll(corner, 1, axis=1), axis=2)
            assert sizes.face[0].mean() == pytest.approx(edges.mean(), rel=0.05)
            assert len(gmsh.model.mesh.getElementsByType(2, tag)[0]) == len(elements) // 3


def test_a_face_without_any_size_is_told() -> None:
    with shape(OCC["sphere"]):
        model, meshes = records([1])
        with session.scratch_model() as name:
            tag = gmsh.model.addDiscreteEntity(2, 1)
            bare = type(model)(**{**vars(model), "name": name})
            with pytest.raises(MeshError, match=f"surface {tag}"):
                target_sizes(bare, meshes, MeshOptions())


def test_too_many_quads_on_a_curved_face() -> None:
    with shape(OCC["sphere"]):
        model, meshes = records([1])
        number = 4 * np.pi / 0.01**2
        target_sizes(model, meshes, MeshOptions(size=0.01, max_quads=int(number * 1.05)))
        with pytest.raises(InputError, match="quads"):
            target_sizes(model, meshes, MeshOptions(size=0.01, max_quads=int(number * 0.95)))


def test_an_apex_ends() -> None:
    with shape(OCC["cone"]):
        tag = curved_tag()
        sizes = measured([tag], MeshSizeFromCurvature=16)
        assert sizes.face[0].min() >= 1e-5
        base = (np.array([[1.0, 0.0, 0.0]]) - ORIGIN) / SCALE
        assert 0.15 < sizes.at_face(0, base)[0] * SCALE < 2 * np.pi / 16 * np.sqrt(2)
        assert gmsh.option.getNumber("Mesh.MeshSizeMin") == 0
