"""Faces that meet in smooth joints are one surface."""

from __future__ import annotations

import math
from collections.abc import Callable

import gmsh
import numpy as np
import pytest

import gmsh_crossquad
from gmsh_crossquad.cad.background import background_meshes
from gmsh_crossquad.cad.bending import edge_bending
from gmsh_crossquad.cad.read import read_model
from gmsh_crossquad.errors import InputError
from gmsh_crossquad.field.surface_mesh import SurfaceMesh
from gmsh_crossquad.fill.high_order import GRID, turned_over
from gmsh_crossquad.options import MeshOptions
from gmsh_crossquad.records import Float, Int

BOX = np.array([1.0, 1.3, 1.6])
RADIUS = 0.2


pytestmark = pytest.mark.usefixtures("fresh_gmsh")


def two_halves() -> None:
    """The side of a cylinder of radius 1 and height 2 in two halves."""
    arcs = [gmsh.model.occ.addCircle(0, 0, 0, 1, angle1=a, angle2=a + np.pi) for a in (0.0, np.pi)]
    gmsh.model.occ.fragment([(1, arcs[0])], [(1, arcs[1])])
    gmsh.model.occ.extrude([(1, a) for a in arcs], 0, 0, 2)
    gmsh.model.occ.removeAllDuplicates()
    gmsh.model.occ.synchronize()


def rounded_box() -> None:
    box = gmsh.model.occ.addBox(0, 0, 0, *BOX)
    gmsh.model.occ.synchronize()
    gmsh.model.occ.fillet([box], [c for _, c in gmsh.model.getEntities(1)], [RADIUS])
    gmsh.model.occ.synchronize()


def roof(degrees: float, turned: bool = False) -> None:
    """Two unit squares on the line x = 0, the second (surface 2) bent up from the plane of the first."""
    a = math.radians(degrees)
    places = [(-1, 0, 0), (0, 0, 0), (0, 1, 0), (-1, 1, 0), (math.cos(a), 0, math.sin(a)), (math.cos(a), 1, math.sin(a))]
    for x in places:
        gmsh.model.geo.addPoint(*x)
    for p, q in ((1, 2), (2, 3), (3, 4), (4, 1), (2, 5), (5, 6), (6, 3)):
        gmsh.model.geo.addLine(p, q)
    gmsh.model.geo.addCurveLoop([1, 2, 3, 4])
    gmsh.model.geo.addCurveLoop([2, -7, -6, -5] if turned else [5, 6, 7, -2])
    gmsh.model.geo.addPlaneSurface([1])
    gmsh.model.geo.addPlaneSurface([2])
    gmsh.model.geo.synchronize()


def read(angle: float | None = 20.0) -> tuple[tuple[int, ...], list[tuple[int, ...]]]:
    """Ignored curves, and the CAD faces of every face."""
    model = read_model(MeshOptions(feature_angle=angle))
    return model.ignored_curves, [face.tags for face in model.faces]


def quads_of(face: int) -> Int:
    types, _, nodes = gmsh.model.mesh.getElements(2, face)
    corners = {3: 4, 10: 9, 36: 16}
    assert set(types.tolist()) <= set(corners)
    return np.concatenate([n.reshape(-1, corners[t])[:, :4] for t, n in zip(types.tolist(), nodes)]).astype(np.int64)


def places() -> Float:
    """Coordinates by node tag."""
    tags, x, _ = gmsh.model.mesh.getNodes()
    out = np.full((int(tags.max()) + 1, 3), np.nan)
    out[tags.astype(np.int64)] = x.reshape(-1, 3)
    return out


def area_vector(quads: Int) -> Float:
    """Sum of the area vectors of quads."""
    p = places()[quads]
    out: Float = 0.5 * np.cross(p[:, 2] - p[:, 0], p[:, 3] - p[:, 1]).sum(axis=0)
    return out


def outside_the_box(x: Float) -> Float:
    """Distance from the box with rounded edges."""
    core = np.clip(x, RADIUS, BOX - RADIUS)
    return np.abs(np.linalg.norm(x - core, axis=1) - RADIUS)


def test_a_cylinder_in_two_halves_has_no_seam():
    two_halves()
    result = gmsh_crossquad.mesh(0.25, feature_angle=20.0)
    assert len(result.ignored_curves) == 2
    assert result.notes == ("2 smooth curves were not followed",)
    assert result.quality.irregular == 0
    assert result.quality.conforming
    for curve in result.ignored_curves:
        assert not gmsh.model.mesh.getElements(1, curve)[0].size
    x = places()[1:]
    np.testing.assert_allclose(np.hypot(x[:, 0], x[:, 1]), 1.0, atol=1e-12)
    # a quad of a row belongs to the half where its middle is
    for _, face in gmsh.model.getEntities(2):
        middle = places()[quads_of(face)].mean(axis=1)
        side = np.sign(middle[:, 1])
        assert len(middle) > 0 and np.all(side[np.abs(middle[:, 1]) > 1e-9] == side[np.abs(middle[:, 1]).argmax()])


def test_a_rounded_box_is_one_surface_with_eight_singularities():
    rounded_box()
    result = gmsh_crossquad.mesh(0.2, feature_angle=20.0)
    assert len(result.stages.model.faces) == 1
    assert not result.stages.model.curves
    assert len(result.stages.model.faces[0].tags) == 26
    assert result.quality.irregular == 8  # chi = 2 = 8/4
    assert result.quality.blocks == 6
    assert result.quality.min_scaled_jacobian > 0.7
    assert outside_the_box(places()[1:]).max() < 1e-12
    assert sum(len(quads_of(f)) for _, f in gmsh.model.getEntities(2)) == result.quality.quads


@pytest.mark.parametrize("order", [2, 3])
def test_nodes_of_higher_order_are_on_the_parts(order):
    rounded_box()
    gmsh_crossquad.mesh(0.4, feature_angle=20.0, order=order)
    assert outside_the_box(places()[1:]).max() < 1e-12
    elements = np.concatenate([t for _, f in gmsh.model.getEntities(2) for t in gmsh.model.mesh.getElements(2, f)[1]])
    assert min(gmsh.model.mesh.getElementQualities(elements, "minSICN")) > 0
    for _, face in gmsh.model.getEntities(2):  # nodes are where Gmsh would find them
        for x in gmsh.model.mesh.getNodes(2, face)[1].reshape(-1, 3)[:3]:
            np.testing.assert_allclose(gmsh.model.getClosestPoint(2, face, x)[0], x, atol=1e-12)


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("order", [1, 2])
def test_quads_are_oriented_as_their_cad_face(turned, order):
    roof(0.0, turned)
    gmsh.model.mesh.generate(2)
    wanted = []
    for face in (1, 2):
        corner = places()[gmsh.model.mesh.getElementsByType(2, face)[1].reshape(-1, 3).astype(int)]
        wanted.append(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]).sum(axis=0) / 2)
    assert (wanted[1][2] < 0) == turned
    result = gmsh_crossquad.mesh(0.25, feature_angle=20.0, order=order)
    assert result.stages.model.faces[0].tags == (1, 2)
    for face in (1, 2):
        np.testing.assert_allclose(area_vector(quads_of(face)) / wanted[face - 1][2], [0, 0, 1], atol=0.3)
    total = area_vector(quads_of(1)) + (-1 if turned else 1) * area_vector(quads_of(2))
    np.testing.assert_allclose(total, [0, 0, 2], atol=1e-12)
    if order == 2:
        elements = gmsh.model.mesh.getElementsByType(10, 2)[0]
        assert min(np.abs(gmsh.model.mesh.getElementQualities(elements, "minDetJac"))) > 0


def test_nodes_beside_a_blunt_edge_are_on_the_faces():
    roof(15.0)
    result = gmsh_crossquad.mesh(0.13, feature_angle=20.0)
    assert len(result.ignored_curves) == 1
    x = places()[1:]
    np.testing.assert_allclose(x[:, 2], np.maximum(x[:, 0], 0.0) * math.tan(math.radians(15.0)), atol=1e-12)


def test_bending_is_that_of_the_nearest_part():
    two_halves()
    model = read_model(MeshOptions(feature_angle=20.0))
    (mesh,) = background_meshes(model, MeshOptions())
    edges = SurfaceMesh(mesh.points, mesh.triangles).edges
    along = np.diff(mesh.points[edges], axis=1)[:, 0]
    axial = along[:, 2] ** 2 / (along**2).sum(axis=1)
    out = edge_bending(model, mesh) / model.faces[0].extent
    side = np.sign(out[np.abs(out[:, 0]).argmax(), 0])
    curvature = side * model.scale  # of radius 1, in scaled units
    np.testing.assert_allclose(out[:, 0], curvature * (1 - axial), atol=0.06 * model.scale)
    np.testing.assert_allclose(out[:, 0] + out[:, 1], curvature, rtol=1e-5)


def test_singular_points_on_different_parts():
    rounded_box()
    x, y, z = BOX
    wanted = [(x / 2, y / 2, 0), (x / 2, y / 2, z), (0, y / 2, z / 2), (x, y / 2, z / 2)]
    wanted += [(x / 2, side, h) for side in (0, y) for h in (z / 4, 3 * z / 4)]
    text = ",".join(f"({a},{b},{c}):1" for a, b, c in wanted)
    (field,) = gmsh_crossquad.cross_field(feature_angle=20.0, field=f"singularities:{text}").faces
    found = field.points[np.flatnonzero(field.index)]
    assert len(found) == 8
    for place in wanted:
        assert np.linalg.norm(found - place, axis=1).min() < 1e-9


@pytest.mark.parametrize(("bent", "angle", "smooth"), [(10, 20, True), (10, 5, False), (-10, 20, True), (172, 20, False)])
def test_the_angle_decides_and_a_fold_is_none(bent, angle, smooth):
    roof(bent)
    assert read(angle) == (((2,), [(1, 2)]) if smooth else ((), [(1,), (2,)]))


def test_every_curve_is_followed_by_default():
    roof(0.0)
    assert read(None) == ((), [(1,), (2,)])
    assert gmsh_crossquad.mesh(0.5).ignored_curves == ()


def transfinite() -> None:
    gmsh.model.mesh.setTransfiniteCurve(2, 7)


def different_groups() -> None:
    gmsh.model.addPhysicalGroup(2, [1])
    gmsh.model.addPhysicalGroup(2, [2])


@pytest.mark.parametrize("wish", [lambda: gmsh.model.addPhysicalGroup(1, [2]), transfinite, different_groups])
def test_curves_that_the_user_wants_are_followed(wish: Callable[[], None]):
    roof(0.0)
    wish()
    assert read() == ((), [(1,), (2,)])


def test_one_group_of_both_faces_does_not_hinder():
    roof(0.0)
    gmsh.model.addPhysicalGroup(2, [1, 2])
    assert read() == ((2,), [(1, 2)])


def test_a_physical_point_on_a_joint_stays():
    gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1)
    gmsh.model.occ.addBox(1, 0, 0, 1, 1, 1)
    gmsh.model.occ.fuse([(3, 1)], [(3, 2)], removeObject=True)
    gmsh.model.occ.synchronize()
    model = read_model(MeshOptions(feature_angle=20.0))
    assert len(model.faces) == 6
    four_squares()
    centre = next(p for _, p in gmsh.model.getEntities(0) if np.abs(gmsh.model.getValue(0, p, [])).max() < 1e-9)
    model = read_model(MeshOptions(feature_angle=20.0))
    assert len(model.faces) == 1 and centre not in model.vertex_tags
    gmsh.model.addPhysicalGroup(0, [centre])
    gmsh_crossquad.mesh(0.5, feature_angle=20.0)
    assert gmsh.model.mesh.getNodes(0, centre)[0].size == 1


def four_squares(size: float = 1.0) -> None:
    """Four coplanar rectangles around the origin, two of them of another size."""
    gmsh.clear()
    squares = [(2, gmsh.model.occ.addRectangle(x, y, 0, 1, 1 if y else size)) for x in (-1, 0) for y in (-1, 0)]
    gmsh.model.occ.fragment(squares[:1], squares[1:])
    gmsh.model.occ.synchronize()


@pytest.mark.parametrize("order", [2, 3])
def test_the_other_side_of_an_element_has_the_same_nodes_at_transposed_places(order):
    places = np.array(GRID[order])
    np.testing.assert_array_equal(places[turned_over(order)], places[:, ::-1])


@pytest.mark.parametrize("angle", [-1.0, 90.0, "x", math.nan])
def test_bad_angles(angle):
    roof(0.0)
    with pytest.raises(InputError, match="feature_angle"):
        gmsh_crossquad.mesh(0.5, feature_angle=angle)


def test_zero_overrules_what_the_model_sets():
    roof(0.0)
    gmsh.onelab.set('[{"type":"number", "name":"CrossQuad/Feature angle", "values":[20]}]')
    assert gmsh_crossquad.mesh(0.5).ignored_curves == (2,)
    assert gmsh_crossquad.mesh(0.5, feature_angle=0).ignored_curves == ()


def test_check_does_not_ask_for_ignored_curves(tmp_path):
    from gmsh_crossquad.cli import main

    four_squares(0.83)
    gmsh.write(str(tmp_path / "plate.brep"))
    gmsh_crossquad.mesh(0.5, feature_angle=20.0)
    gmsh.write(str(tmp_path / "plate.msh"))
    call = ["check", str(tmp_path / "plate.msh"), "--model", str(tmp_path / "plate.brep")]
    assert main(call) == 1
    assert main([*call, "--feature-angle", "20"]) == 0
