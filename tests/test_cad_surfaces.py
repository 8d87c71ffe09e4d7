"""Nearest points, parameters and normals of CAD faces, against formulas and Gmsh's own projection."""

from __future__ import annotations

from collections.abc import Callable

import gmsh
import numpy as np
import pytest
from cad_shapes import EVERY, GEO, OCC, ORIGIN, SCALE, curved_tag, records, shape

from gmsh_crossquad.cad import session
from gmsh_crossquad.cad import surfaces as module
from gmsh_crossquad.cad.facets import Facets
from gmsh_crossquad.cad.surfaces import CadSurfaces
from gmsh_crossquad.errors import MeshError
from gmsh_crossquad.records import FaceMesh, Float
from gmsh_crossquad.surfaces import Planes

DISTANCE: dict[str, Callable[[Float], Float]] = {
    "cylinder": lambda x: np.hypot(x[:, 0], x[:, 1]) - 0.7,
    "part of a cylinder": lambda x: np.hypot(x[:, 0], x[:, 1]) - 0.7,
    "cone": lambda x: (np.hypot(x[:, 0], x[:, 1]) + x[:, 2] - 1) / np.sqrt(2),
    "sphere": lambda x: np.linalg.norm(x, axis=1) - 1,
    "torus": lambda x: np.hypot(np.hypot(x[:, 0], x[:, 1]) - 1, x[:, 2]) - 0.3,
    "in sphere": lambda x: np.linalg.norm(x, axis=1) - 1,
    "ruled, three sides": lambda x: np.linalg.norm(x, axis=1) - 1,
}


def on_triangles(mesh: FaceMesh, count: int) -> Float:
    """Random points (count, 3) on a mesh."""
    random = np.random.default_rng(1)
    triangles = mesh.triangles[random.integers(len(mesh.triangles), size=count)]
    return np.einsum("nk,nkc->nc", random.dirichlet([1.0, 1.0, 1.0], count), mesh.points[triangles])


def curvature(tag: int, uv: Float) -> Float:
    """Greatest curvature (n,) of a face by its own formula: that of Gmsh is for some faces only."""
    e = 1e-4
    moved = [gmsh.model.getNormal(tag, (uv + d).ravel()).reshape(-1, 3) for d in ([0, 0], [e, 0], [0, e])]
    first = gmsh.model.getDerivative(2, tag, uv.ravel()).reshape(-1, 2, 3)
    return sum(
        np.linalg.norm(moved[1 + k] - moved[0], axis=1) / (e * np.maximum(np.linalg.norm(first[:, k], axis=1), 1e-9))
        for k in range(2)
    )


@pytest.mark.parametrize("name", EVERY)
def test_points_moved_off_a_face_come_back(name: str) -> None:
    with shape(EVERY[name]):
        tag = curved_tag()
        model, (mesh,) = records([tag])
        cad = CadSurfaces(model, (mesh,))
        face = np.zeros(400, np.int64)
        place = cad.feet(face, on_triangles(mesh, 400))
        own = cad.parameters(0, place)
        value = gmsh.model.getValue(2, tag, own.ravel()).reshape(-1, 3)
        assert np.abs((value - ORIGIN) / SCALE - place).max() < 1e-12
        low, high = gmsh.model.getParametrizationBounds(2, tag)
        assert (own >= low - 1e-12).all() and (own <= high + 1e-12).all()
        # a tenth of the radius of curvature, and of the model at most
        exact = gmsh.model.getNormal(tag, own.ravel()).reshape(-1, 3)
        radius = 1.0 / np.maximum(curvature(tag, own), 1.0)
        away = 0.1 * np.random.default_rng(2).uniform(-1, 1, 400) * radius
        moved = place + away[:, None] * exact / SCALE
        back = cad.feet(face, moved)
        again = gmsh.model.getValue(2, tag, cad.parameters(0, moved).ravel()).reshape(-1, 3)
        assert np.abs((again - ORIGIN) / SCALE - back).max() < 1e-12
        # difference quotients are the derivatives of the built-in kernel
        assert np.abs(back - place).max() < (1e-8 if name in GEO else 1e-12)
        if name in DISTANCE:
            user = ORIGIN + SCALE * back
            assert np.abs(DISTANCE[name](user)).max() < 1e-12
            assert np.abs(np.abs(DISTANCE[name](ORIGIN + SCALE * moved)) - np.abs(away)).max() < 1e-12


@pytest.mark.parametrize("name", EVERY)
def test_normals_are_those_of_the_cad_on_the_side_of_the_triangles(name: str) -> None:
    with shape(EVERY[name]):
        tag = curved_tag()
        model, (mesh,) = records([tag])
        cad = CadSurfaces(model, (mesh,))
        place = cad.feet(np.zeros(500, np.int64), on_triangles(mesh, 500))
        normal = cad.normals(np.zeros(500, np.int64), place)
        exact = gmsh.model.getNormal(tag, cad.parameters(0, place).ravel()).reshape(-1, 3)
        angle = np.degrees(np.arccos(np.clip(np.abs(np.einsum("nc,nc->n", normal, exact)), 0.0, 1.0)))
        assert angle.mean() < 0.3 and np.quantile(angle, 0.99) < 2.5
        corner = mesh.points[mesh.triangles]
        area = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
        own = cad.normals(np.zeros(len(area), np.int64), corner.mean(axis=1))
        assert (np.einsum("nc,nc->n", own, area) > 0).all()


@pytest.mark.parametrize("flipped", [False, True])
def test_the_side_follows_the_triangles_not_the_parameters(flipped: bool) -> None:
    with shape(OCC["sphere"]):
        model, (mesh,) = records([1])
        if flipped:
            mesh = FaceMesh(**{**vars(mesh), "triangles": mesh.triangles[:, ::-1]})
        cad = CadSurfaces(model, (mesh,))
        (normal,) = cad.seed_normals
        outwards = (ORIGIN + SCALE * mesh.points) * (-1 if flipped else 1)
        # the poles, where the CAD has no normal, have the mean of the triangles
        assert np.degrees(np.arccos(np.einsum("nc,nc->n", normal, outwards).clip(-1, 1))).max() < 2


def test_feet_near_poles() -> None:
    for name in ("sphere", "revolution to the axis"):
        with shape(OCC[name]):
            tag = curved_tag()
            model, (mesh,) = records([tag])
            cad = CadSurfaces(model, (mesh,))
            a = np.linspace(0, 2 * np.pi, 60, endpoint=False)
            pole = [0, 0, -1.0] if name == "sphere" else [0.0, 0.0, 0.0]
            for r in (0.0, 1e-9, 1e-5, 1e-3, 0.02, 0.1):
                # so near the pole that the parameters are lost, the pole itself may be taken
                tolerance = 1e-11 + (r if r < 1e-6 else 0)
                x = np.stack([r * np.cos(a), r * np.sin(a), np.full(60, pole[2])], axis=1)
                foot = ORIGIN + SCALE * cad.feet(np.zeros(60, np.int64), (x - ORIGIN) / SCALE)
                if name == "sphere":
                    assert np.abs(foot - x / np.linalg.norm(x, axis=1)[:, None]).max() < tolerance
                else:  # all alike, in their own meridian planes
                    out = np.stack([np.cos(a), np.sin(a)], axis=1)
                    along = np.einsum("nc,nc->n", foot[:, :2], out)
                    assert np.ptp(along) < tolerance and np.ptp(foot[:, 2]) < tolerance
                    assert np.abs(foot[:, :2] - along[:, None] * out).max() < tolerance


@pytest.mark.parametrize("name", ["cylinder", "torus", "tube", "revolution"])
def test_feet_do_not_stop_at_the_seam(name: str) -> None:
    with shape(OCC[name]):
        tag = curved_tag()
        model, (mesh,) = records([tag])
        cad = CadSurfaces(model, (mesh,))
        low, high = gmsh.model.getParametrizationBounds(2, tag)
        v = 0.5 * (low[1] + high[1])
        both = np.array([[low[0] + 1e-3, v], [high[0] - 1e-3, v]])
        place = gmsh.model.getValue(2, tag, both.ravel()).reshape(-1, 3)
        middle = gmsh.model.getValue(2, tag, [low[0], v])
        # samples on one side of the seam alone
        near = np.linalg.norm(ORIGIN + SCALE * mesh.points - middle, axis=1) < 0.6
        for side in (mesh.parameters[:, 0] > 0.5 * (low[0] + high[0]), mesh.parameters[:, 0] < 0.5 * (low[0] + high[0])):
            own = np.where((near & side)[:, None], mesh.parameters, np.nan)
            half = CadSurfaces(model, (FaceMesh(**{**vars(mesh), "parameters": own}),))
            assert np.abs(half.feet(np.zeros(2, np.int64), (place - ORIGIN) / SCALE) * SCALE + ORIGIN - place).max() < 1e-12
        assert np.abs(cad.parameters(0, (place - ORIGIN) / SCALE) - both).max() < 1e-9


def test_feet_stay_within_the_parameters_of_a_spline() -> None:
    with shape(OCC["B-spline"]):
        model, (mesh,) = records([1])
        cad = CadSurfaces(model, (mesh,))
        edge = gmsh.model.getValue(2, 1, [0.0, 0.7])
        out = edge - 0.05 * gmsh.model.getDerivative(2, 1, [0.0, 0.7])[:3]
        own = cad.parameters(0, (out[None] - ORIGIN) / SCALE)
        assert own[0, 0] == 0.0
        x = gmsh.model.getValue(2, 1, own.ravel())
        slope = gmsh.model.getDerivative(2, 1, own.ravel()).reshape(2, 3) @ (out - x)
        assert slope[0] < 0 and abs(slope[1]) < 1e-12


@pytest.mark.parametrize("name", ["B-spline", "filling", "extrusion", "trimmed"])
def test_feet_are_not_farther_than_those_of_gmsh(name: str) -> None:
    with shape(OCC[name]):
        tag = curved_tag()
        model, (mesh,) = records([tag])
        random = np.random.default_rng(3)
        x = on_triangles(mesh, 60) + random.normal(0, 0.02, (60, 3))
        foot = CadSurfaces(model, (mesh,)).feet(np.zeros(60, np.int64), x)
        user = ORIGIN + SCALE * x
        theirs = gmsh.model.getClosestPoint(2, tag, user.ravel())[0].reshape(-1, 3)
        mine = np.linalg.norm(x - foot, axis=1) * SCALE
        # theirs leaves the range of the parameters where the surface goes on
        assert (mine <= np.linalg.norm(user - theirs, axis=1) + 1e-9).mean() > 0.9


def test_many_faces_at_once() -> None:
    with shape(lambda: gmsh.model.occ.addCylinder(0, 0, 0, 0, 0, 2, 0.7), 0.3):
        tags = [t for _, t in gmsh.model.getEntities(2)]
        model, meshes = records(tags)
        cad = CadSurfaces(model, meshes)
        assert cad.curved.tolist() == [True, False, False]
        face = np.array([1, 0, 2, 0, 1, 0])
        user = np.array([[0.1, 0.2, 2.1], [0.9, 0, 1], [0.3, 0, 0.2], [0, 0.5, 0.3], [0, 0, 1.9], [-0.8, 0, 0.5]])
        foot = ORIGIN + SCALE * cad.feet(face, (user - ORIGIN) / SCALE)
        expected = [[0.1, 0.2, 2], [0.7, 0, 1], [0.3, 0, 0], [0, 0.7, 0.3], [0, 0, 2], [-0.7, 0, 0.5]]
        assert np.abs(foot - expected).max() < 1e-12
        normal = [[0, 0, 1], [1, 0, 0], [0, 0, -1], [0, 1, 0], [0, 0, 1], [-1, 0, 0]]
        assert np.abs(cad.normals(face, (foot - ORIGIN) / SCALE) - normal).max() < 1e-3
        own = cad.parameters(1, (user[[0]] - ORIGIN) / SCALE)
        assert np.abs(gmsh.model.getValue(2, tags[1], own.ravel()) - foot[0]).max() < 1e-12


def test_a_model_that_is_not_current() -> None:
    with shape(OCC["sphere"]):
        model, meshes = records([1])
        cad = CadSurfaces(model, meshes)
        with session.scratch_model() as other:
            foot = cad.feet(np.zeros(1, np.int64), (np.array([[0, 2.0, 0]]) - ORIGIN) / SCALE)
            assert gmsh.model.getCurrent() == other
        assert np.abs(ORIGIN + SCALE * foot - [0, 1, 0]).max() < 1e-12


def test_discrete_faces_are_their_triangles() -> None:
    with shape(OCC["sphere"], 0.3):
        nodes, x, _ = gmsh.model.mesh.getNodes()
        _, elements = gmsh.model.mesh.getElementsByType(2)
        with session.scratch_model():
            tag = gmsh.model.addDiscreteEntity(2)
            gmsh.model.mesh.addNodes(2, tag, nodes, x)
            gmsh.model.mesh.addElementsByType(tag, 2, [], elements)
            model, (mesh,) = records([tag])
            cad = CadSurfaces(model, (mesh,))
            face = np.zeros(200, np.int64)
            inside = on_triangles(mesh, 200)
            centre = -ORIGIN / SCALE
            x = centre + 1.05 * (inside - centre)
            foot = cad.feet(face, x)
            corner = mesh.points[mesh.triangles]
            normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
            normal /= np.linalg.norm(normal, axis=1)[:, None]
            assert np.abs(np.einsum("ntc,tc->nt", foot[:, None] - corner[None, :, 0], normal)).min(axis=1).max() < 1e-12
            assert (np.linalg.norm(foot - x, axis=1) <= np.linalg.norm(inside - x, axis=1)).all()
            out = (foot - centre) / np.linalg.norm(foot - centre, axis=1)[:, None]
            assert np.linalg.norm(cad.normals(face, foot) - out, axis=1).max() < 1e-6  # weights that are exact on a sphere
            assert np.isnan(cad.parameters(0, foot)).all()


def test_nearest_triangle_against_dense_sampling() -> None:
    random = np.random.default_rng(4)
    points = random.normal(size=(60, 3))
    triangles = random.permuted(np.tile(np.arange(60), (40, 1)), axis=1)[:, :3]
    x = random.normal(size=(50, 3))
    foot, triangle, weight = Facets(points, triangles).nearest(x)
    assert np.abs(np.einsum("nk,nkc->nc", weight, points[triangles[triangle]]) - foot).max() < 1e-14
    assert weight.min() >= 0 and np.abs(weight.sum(axis=1) - 1).max() < 1e-14
    t = np.stack([a.ravel() for a in np.mgrid[0:41, 0:41]], axis=1) / 40.0
    t = t[t.sum(axis=1) <= 1 + 1e-9]
    dense = np.einsum("wk,tkc->twc", np.column_stack([t, 1 - t.sum(axis=1)]), points[triangles]).reshape(-1, 3)
    reference = np.sqrt(((x[:, None] - dense[None]) ** 2).sum(axis=2)).min(axis=1)
    mine = np.linalg.norm(x - foot, axis=1)
    assert (mine <= reference + 1e-12).all() and (mine >= reference - 0.15).all()


def test_a_point_that_is_none() -> None:
    with shape(OCC["sphere"]):
        model, meshes = records([1])
        with pytest.raises(MeshError, match="surface 1"):
            CadSurfaces(model, meshes).feet(np.zeros(1, np.int64), np.array([[np.nan, 0, 0]]))


def test_gmsh_projects_what_newton_does_not(monkeypatch: pytest.MonkeyPatch) -> None:
    with shape(OCC["B-spline"]):
        model, (mesh,) = records([1])
        x = on_triangles(mesh, 5)
        expected = CadSurfaces(model, (mesh,)).feet(np.zeros(5, np.int64), x)
        true = module.newton

        def failing(*args: object) -> object:
            uv, point, good = true(*args)  # type: ignore[arg-type]
            return uv, point + 1.0, good & False

        cad = CadSurfaces(model, (mesh,))
        assert len(cad._samples.face)
        monkeypatch.setattr(module, "newton", failing)
        assert np.abs(cad.feet(np.zeros(5, np.int64), x) - expected).max() < 1e-7


def test_same_bits_every_time() -> None:
    with shape(OCC["torus"]):
        model, meshes = records([1])
        x = on_triangles(meshes[0], 1000)
        face = np.zeros(1000, np.int64)
        runs = [(CadSurfaces(model, meshes).feet(face, x), CadSurfaces(model, meshes).normals(face, x)) for _ in range(2)]
        assert np.array_equal(runs[0][0], runs[1][0]) and np.array_equal(runs[0][1], runs[1][1])


def test_plane_models_are_their_planes_and_do_not_ask_gmsh(monkeypatch: pytest.MonkeyPatch) -> None:
    with shape(lambda: gmsh.model.occ.addBox(0, 0, 0, 1, 2, 3), 0.8):
        model, meshes = records([t for _, t in gmsh.model.getEntities(2)])
    random = np.random.default_rng(5)
    face, x = random.integers(6, size=50), random.normal(size=(50, 3))
    monkeypatch.delattr(gmsh.model, "getCurrent")
    cad, planes = CadSurfaces(model, meshes), Planes(model)
    assert np.array_equal(cad.feet(face, x), planes.feet(face, x))
    assert np.array_equal(cad.normals(face, x), planes.normals(face, x))
