"""CAD models become records: samples, loops, frames, angles, transfinite curves."""

import gmsh
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gmsh_crossquad.cad.intersect import contacts
from gmsh_crossquad.cad.loops import boundary_loops, polygon, signed_area
from gmsh_crossquad.cad.read import read_model
from gmsh_crossquad.cad.session import options
from gmsh_crossquad.cad.tangents import end_directions, end_tangents, sector_angles
from gmsh_crossquad.errors import GeometryError
from gmsh_crossquad.options import MeshOptions
from gmsh_crossquad.records import Curve

pytestmark = pytest.mark.usefixtures("gmsh_session")


@pytest.fixture(autouse=True)
def fresh():
    gmsh.clear()
    gmsh.model.add("model")


def read():
    return read_model(MeshOptions())


def built_in(points, loops):
    """A plane surface of the built-in kernel from points (n, 2 or 3) and loops of point numbers (from 0)."""
    geo = gmsh.model.geo
    tags = [geo.addPoint(*p, *[0.0] * (3 - len(p))) for p in points]
    lines = {}
    wires = []
    for loop in loops:
        wire = []
        for a, b in zip(loop, loop[1:] + loop[:1]):
            if (b, a) in lines:
                wire.append(-lines[b, a])
            else:
                lines[a, b] = geo.addLine(tags[a], tags[b])
                wire.append(lines[a, b])
        wires.append(geo.addCurveLoop(wire))
    surface = geo.addPlaneSurface(wires)
    geo.synchronize()
    return surface


def area(model, row=0):
    """Area of a face in the user's units, from its loops."""
    face = model.faces[row]
    flat = {c: face.local(model.curves[c].points) for loop in face.loops for c, _ in loop}
    return model.scale**2 * sum(signed_area(polygon(loop, flat)) for loop in face.loops)


def loop_areas(model, row=0):
    face = model.faces[row]
    flat = {c: face.local(model.curves[c].points) for loop in face.loops for c, _ in loop}
    return [model.scale**2 * signed_area(polygon(loop, flat)) for loop in face.loops]


def degrees(model, row=0):
    return [sorted(np.degrees(a).round(6).tolist()) for a in sector_angles(model, row)]


SQUARE = [(0, 0), (1, 0), (1, 1), (0, 1)]


# ---- scale and samples


@pytest.mark.parametrize("size", [1e-9, 1e-3, 1.0, 1e6])
@pytest.mark.parametrize("shift", [0.0, 1e6])
def test_scale_is_the_diagonal(size, shift):
    built_in([(size * (x + shift), size * y) for x, y in SQUARE], [[0, 1, 2, 3]])
    model = read()
    assert model.scale == pytest.approx(size * np.sqrt(2), rel=1e-9)
    assert model.origin == pytest.approx([size * (shift + 0.5), size * 0.5, 0], rel=1e-9)
    assert np.ptp(model.vertices, axis=0) == pytest.approx([np.sqrt(0.5), np.sqrt(0.5), 0], abs=1e-9)
    assert len(model.faces[0].loops) == 1
    assert area(model) == pytest.approx(size**2, rel=1e-8)


@pytest.mark.parametrize("radius", [1e-5, 1.0, 1e6])
def test_circle_is_sampled_densely_and_closed(radius):
    gmsh.model.occ.addDisk(3 * radius, 0, 0, radius, radius)
    gmsh.model.occ.synchronize()
    model = read()
    (curve,) = model.curves
    assert curve.closed and len(curve.points) <= 2000
    assert np.array_equal(curve.points[0], curve.points[-1])
    assert np.array_equal(curve.points[0], model.vertices[curve.start])
    r = 1 / np.sqrt(8)  # the box is a square of diagonal 1
    assert np.linalg.norm(curve.points, axis=1) == pytest.approx(np.full(len(curve.points), r), abs=1e-12)
    middle = 0.5 * (curve.points[1:] + curve.points[:-1])
    assert r - np.linalg.norm(middle, axis=1).min() < 1e-6
    assert curve.length == pytest.approx(2 * np.pi * r, rel=1e-5)
    assert (np.diff(curve.parameters) > 0).all()
    at = gmsh.model.getValue(1, curve.tag, curve.parameters).reshape(-1, 3)
    np.testing.assert_allclose(model.origin + model.scale * curve.points, at, atol=1e-9 * model.scale)


def test_spline_turns_little_between_samples():
    occ = gmsh.model.occ
    points = [occ.addPoint(x, 0.2 * np.sin(6 * x), 0) for x in np.linspace(0, 1, 12)]
    spline = occ.addSpline(points)
    far = occ.addPoint(0.5, -2, 0)
    loop = occ.addCurveLoop([spline, occ.addLine(points[-1], far), occ.addLine(far, points[0])])
    occ.addPlaneSurface([loop])
    occ.synchronize()
    model = read()
    curve = next(c for c in model.curves if gmsh.model.getType(1, c.tag) not in ("Line",))
    d = np.diff(curve.points, axis=0)
    d /= np.linalg.norm(d, axis=1)[:, None]
    assert np.degrees(np.arccos(np.clip((d[1:] * d[:-1]).sum(1), -1, 1))).max() < 2.0
    between = gmsh.model.getValue(1, curve.tag, 0.5 * (curve.parameters[1:] + curve.parameters[:-1])).reshape(-1, 3)
    middle = model.origin + model.scale * 0.5 * (curve.points[1:] + curve.points[:-1])
    step = np.diff(curve.arclength).max()
    off = between - middle
    tangent = d * (off * d).sum(1)[:, None]
    assert np.linalg.norm(off - tangent, axis=1).max() < 1.1e-6 * model.scale
    assert step < 0.1


def test_straight_lines_have_few_samples():
    built_in(SQUARE, [[0, 1, 2, 3]])
    assert all(len(c.points) == 3 for c in read().curves)


KNOTS = {
    "the vertex on the loop": [(1.0005, 0.001), (0.9998, 0.0015), (0.9992, 0.0008)],
    "before the vertex": [(1.0008, -0.001), (0.9998, -0.0002), (1.0002, -0.0015), (1.0004, -0.0005)],
    "past the vertex": [(1.0004, 0.002), (0.9996, 0.0015)],
}


@pytest.mark.parametrize("end", KNOTS.values(), ids=KNOTS)
def test_a_tiny_knot_is_cut_off(end):
    """A ring whose end does not meet its beginning: the knot is no corner and takes no area."""
    geo = gmsh.model.geo
    t = np.linspace(0, 2 * np.pi, 60, endpoint=False)[1:]
    ring = [(1, 0), (1, 0.01), (1, 0.04), (0.997, 0.15), *zip(4 * np.cos(t) - 3, 4 * np.sin(t)), (1, -0.03), (1, -0.008), *end]
    tags = [geo.addPoint(x, y, 0) for x, y in ring]
    geo.addPlaneSurface([geo.addCurveLoop([geo.addSpline([*tags, tags[0]])])])
    geo.synchronize()
    model = read()
    curve = model.curves[0]
    assert model.notes == (f"curve {curve.tag} crosses itself; the tiny loop was cut off",)
    assert area(model) == pytest.approx(16 * np.pi, rel=1e-3)
    assert (np.diff(curve.arclength) > 0).all() and (np.diff(curve.parameters) > 0).all()
    assert not contacts([model.faces[0].local(curve.points)], [(0, 0)])
    assert sector_angles(model, 0)[0][0] == pytest.approx(np.pi, abs=0.3)
    assert model.vertex_tags.tolist() == [tags[0]]


# ---- frames


def triangle_normals():
    gmsh.model.mesh.generate(2)
    tags, xyz, _ = gmsh.model.mesh.getNodes()
    row = {int(t): i for i, t in enumerate(tags)}
    out = {}
    for _, face in gmsh.model.getEntities(2):
        nodes = gmsh.model.mesh.getElements(2, face)[2][0].reshape(-1, 3)
        p = xyz.reshape(-1, 3)[[[row[int(n)] for n in t] for t in nodes]]
        vector = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]).sum(0)
        out[face] = vector / np.linalg.norm(vector)
    return out


def check_normals():
    model = read()
    expected = triangle_normals()
    for face in model.faces:
        assert np.cross(*face.axes) == pytest.approx(expected[face.tag], abs=1e-9)
        np.testing.assert_allclose(face.axes @ face.axes.T, np.eye(2), atol=1e-14)


@pytest.mark.parametrize("loop", [[0, 1, 2, 3], [3, 2, 1, 0]])
@pytest.mark.parametrize("plane", ["xy", "xz", "tilted"])
def test_normal_is_that_of_gmsh_triangles_built_in(loop, plane):
    lift = {"xy": lambda x, y: (x, y, 0), "xz": lambda x, y: (x, 0, y), "tilted": lambda x, y: (x, y, 0.3 * x + 0.7 * y)}[plane]
    built_in([lift(*p) for p in SQUARE], [loop])
    check_normals()


@pytest.mark.parametrize("first", range(8))
@pytest.mark.parametrize("turn", [1, -1])
def test_normal_of_a_non_convex_face(first, turn):
    points = [(0, 0), (3, 0), (3, 3), (2, 3), (2, 1), (1, 1), (1, 3), (0, 3)]
    loop = [(first + k) % 8 for k in range(8)][::turn]
    hole = [8, 9, 10]
    built_in([*points, (0.2, 0.2), (2.8, 0.2), (2.8, 0.4)], [loop, hole])
    check_normals()


def test_normal_is_that_of_gmsh_triangles_occ():
    occ = gmsh.model.occ
    box = occ.addBox(0, 0, 0, 1, 2, 3)
    occ.rotate([(3, box)], 0, 0, 0, 1, 2, 3, 0.7)
    circle = occ.addCircle(9, 0, 0, 1)
    loop = occ.addCurveLoop([-circle])
    occ.addPlaneSurface([loop])
    occ.synchronize()
    check_normals()


def test_axes_are_the_coordinate_axes_in_the_plane():
    built_in(SQUARE, [[0, 1, 2, 3]])
    np.testing.assert_array_equal(read().faces[0].axes, np.eye(3)[:2])


@pytest.mark.parametrize("shape", ["cylinder", "sphere", "torus", "dome"])
def test_curved_faces(shape):
    """Seams and poles are no curves of the model; areas are the kernel's."""
    occ = gmsh.model.occ
    if shape == "cylinder":
        occ.addCylinder(0, 0, 0, 0, 0, 1, 1)
    elif shape == "sphere":
        occ.addSphere(0, 0, 0, 1)
    elif shape == "torus":
        occ.addTorus(0, 0, 0, 2, 0.5)
    else:  # its boundary is a plane circle
        occ.addSphere(0, 0, 0, 1, angle1=0)
    occ.synchronize()
    if shape == "dome":
        dome = next(f for _, f in gmsh.model.getEntities(2) if gmsh.model.getType(2, f) != "Plane")
        gmsh.model.addPhysicalGroup(2, [dome])
    model = read()
    loops = {"cylinder": 2, "sphere": 0, "torus": 0, "dome": 1}[shape]
    curved = [face for face in model.faces if face.curved]
    assert len(curved) == 1
    assert len(curved[0].loops) == loops
    assert len(model.curves) == loops
    assert len(model.vertices) == loops
    expected = {"cylinder": 2 * np.pi, "sphere": 4 * np.pi, "torus": 4 * np.pi**2, "dome": 2 * np.pi}[shape]
    assert curved[0].area * model.scale**2 == pytest.approx(expected, rel=1e-6)
    np.testing.assert_array_equal(curved[0].local(model.vertices), model.vertices)


def test_a_seam_in_a_physical_group_is_kept():
    tag = gmsh.model.occ.addCylinder(0, 0, 0, 0, 0, 1, 1)
    gmsh.model.occ.synchronize()
    assert tag == 1
    side = next(f for _, f in gmsh.model.getEntities(2) if gmsh.model.getType(2, f) != "Plane")
    bound = [abs(c) for _, c in gmsh.model.getBoundary([(2, side)], combined=False, oriented=False)]
    seam = next(c for c in bound if bound.count(c) == 2)
    gmsh.model.addPhysicalGroup(1, [seam])
    model = read()
    face = next(face for face in model.faces if face.curved)
    assert [model.curves[c].tag for c in face.embedded_curves] == [seam]


def test_a_face_that_another_one_touches_at_its_pole_is_refused():
    """The mesh of a box around a sphere that touches it would not be joined there."""
    occ = gmsh.model.occ
    occ.cut([(3, occ.addBox(-1, -1, -1, 2, 2, 2))], [(3, occ.addSphere(0, 0, 0, 1))])
    occ.synchronize()
    with pytest.raises(GeometryError, match="touches this one"):
        read()


def test_a_flat_spline_surface_is_planar():
    occ = gmsh.model.occ
    points = [occ.addPoint(x, y, 2.0) for y in (0, 1, 2) for x in (0, 1, 3)]
    occ.addBSplineSurface(points, 3, degreeU=2, degreeV=2)
    occ.synchronize()
    model = read()
    assert abs(area(model)) == pytest.approx(6.0, rel=1e-6)


def test_a_plane_surface_with_a_bent_boundary():
    built_in([(0, 0, 0), (1, 0, 0), (1, 1, 1e-4), (0, 1, 0)], [[0, 1, 2, 3]])
    assert read().faces[0].curved


def test_a_plane_surface_far_from_any_plane_is_refused():
    built_in([(0, 0, 0), (1, 0, 0), (1, 1, 0.5), (0, 1, 0)], [[0, 1, 2, 3]])
    with pytest.raises(GeometryError, match="not planar"):
        read()


def test_a_curve_without_length_is_a_point():
    built_in([(0, 0, 0), (1, 0, 0), (1, 1e-11, 0), (1, 1, 0), (0, 1, 0)], [[0, 1, 2, 3, 4]])
    model = read()
    assert len(model.curves) == 4
    assert len(model.vertices) == 4


# ---- loops


@pytest.mark.parametrize("outer", [[0, 1, 2, 3], [3, 2, 1, 0]])
@pytest.mark.parametrize("hole", [[4, 5, 6, 7], [7, 6, 5, 4]])
def test_face_is_on_the_left(outer, hole):
    built_in([*SQUARE, (0.2, 0.2), (0.5, 0.2), (0.5, 0.6), (0.2, 0.6)], [outer, hole])
    model = read()
    assert loop_areas(model) == pytest.approx([1.0, -0.12])
    assert degrees(model) == [[90.0] * 4, [270.0] * 4]


def test_annulus():
    occ = gmsh.model.occ
    occ.cut([(2, occ.addDisk(0, 0, 0, 2, 2))], [(2, occ.addDisk(0.5, 0, 0, 1, 1))])
    occ.synchronize()
    model = read()
    assert loop_areas(model) == pytest.approx([4 * np.pi, -np.pi], rel=1e-5)
    assert degrees(model) == [[180.0], [180.0]]


def test_bridge_to_a_hole_is_embedded():
    points = [(0, 0), (4, 0), (4, 4), (0, 4), (1, 1), (2, 1), (2, 2), (1, 2)]
    built_in(points, [[0, 1, 2, 3, 0, 4, 7, 6, 5, 4]])
    model = read()
    assert loop_areas(model) == pytest.approx([16.0, -1.0])
    (row,) = model.faces[0].embedded_curves
    place = model.origin + model.scale * model.vertices[[model.curves[row].start, model.curves[row].end]]
    ends = {tuple(p) for p in np.round(place[:, :2], 9).tolist()}
    assert ends == {(0.0, 0.0), (1.0, 1.0)}


def test_slit_that_is_run_back_and_forth_is_embedded():
    built_in([(0, 0), (4, 0), (4, 4), (0, 4), (1, 1)], [[0, 1, 2, 3, 0, 4]])
    model = read()
    assert loop_areas(model) == pytest.approx([16.0])
    assert len(model.faces[0].embedded_curves) == 1


def test_hole_that_touches_the_outer_loop_joins_it():
    built_in([*SQUARE, (0.5, 0.2), (0.5, 0.5)], [[0, 1, 2, 3], [0, 4, 5]])
    model = read()
    assert loop_areas(model) == pytest.approx([1.0 - 0.5 * 0.5 * 0.3])
    (angles,) = sector_angles(model, 0)
    at = [model.curves[c].start if s > 0 else model.curves[c].end for c, s in model.faces[0].loops[0]]
    corner = next(v for v in range(len(model.vertices)) if at.count(v) == 2)
    expected = sorted([np.arctan2(0.2, 0.5), np.pi / 4])
    assert sorted(a for a, v in zip(angles, at) if v == corner) == pytest.approx(expected)
    assert angles.sum() == pytest.approx((len(angles) - 2) * np.pi)


def test_two_holes_that_touch_make_one_loop():
    points = [(-4, -4), (4, -4), (4, 4), (-4, 4), (0, 0), (2, -1), (2, 1), (-2, 1), (-2, -1)]
    built_in(points, [[0, 1, 2, 3], [4, 5, 6], [4, 7, 8]])
    model = read()
    assert loop_areas(model) == pytest.approx([64.0, -4.0])
    assert [len(loop) for loop in model.faces[0].loops] == [4, 6]


def curve(tag, start, end, points):
    p = np.array([(*q, 0.0) for q in points], float)
    s = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(p, axis=0), axis=1))])
    return Curve(tag, start, end, p, s, s)


def test_a_chain_that_does_not_close_is_reported_with_its_end():
    corner = [(0, 0), (1, 0), (1, 1), (0, 1)]
    curves = [curve(i + 1, i, i + 1, [corner[i], corner[i + 1]]) for i in range(3)]
    flat = {i: c.points[:, :2] for i, c in enumerate(curves)}
    with pytest.raises(GeometryError, match="does not close") as caught:
        boundary_loops([0, 1, 2], curves, flat, 9, np.array([(*p, 0.0) for p in corner]))
    assert caught.value.entity == (2, 9)
    assert caught.value.location in ((0.0, 0.0, 0.0), (0.0, 1.0, 0.0))


@settings(max_examples=25, deadline=None)
@given(
    st.permutations(range(8)),
    st.lists(st.booleans(), min_size=8, max_size=8),
    st.floats(0, 6.3),
    st.floats(-3, 3),
)
def test_loops_do_not_depend_on_order_direction_or_position(order, flips, angle, shift):
    corner = np.array([(0, 0), (3, 0), (3, 3), (0, 3), (1, 1), (2, 1), (2, 2), (1, 2)], float)
    corner = corner @ [[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]] + shift
    pairs = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4)]
    pairs = [(b, a) if f else (a, b) for f, (a, b) in zip(flips, pairs)]
    curves = [curve(i + 1, a, b, [corner[a], corner[b]]) for i, (a, b) in enumerate(pairs)]
    flat = {i: c.points[:, :2] for i, c in enumerate(curves)}
    loops, inner = boundary_loops(order, curves, flat, 1, np.zeros((8, 3)))
    assert inner == ()
    assert [signed_area(polygon(loop, flat)) for loop in loops] == pytest.approx([9.0, -1.0])


# ---- what belongs to the model


def test_physical_surfaces_select_the_faces():
    occ = gmsh.model.occ
    occ.addRectangle(0, 0, 0, 1, 1)
    wanted = occ.addRectangle(5, 0, 0, 1, 2)
    occ.synchronize()
    assert [f.tag for f in read().faces] == [1, wanted]
    gmsh.model.addPhysicalGroup(2, [wanted])
    model = read()
    assert [f.tag for f in model.faces] == [wanted]
    assert len(model.curves) == len(model.vertices) == 4
    assert model.scale == pytest.approx(np.sqrt(5))


def test_faces_share_curves_and_vertices():
    occ = gmsh.model.occ
    occ.fragment([(2, occ.addRectangle(0, 0, 0, 1, 1))], [(2, occ.addRectangle(1, 0, 0, 1, 1))])
    occ.synchronize()
    model = read()
    assert (len(model.faces), len(model.curves), len(model.vertices)) == (2, 7, 6)
    used = [dict(f.loops[0]) for f in model.faces]
    (shared,) = used[0].keys() & used[1].keys()
    assert used[0][shared] == -used[1][shared]


def test_coincident_but_separate_curves_stay_separate():
    built_in(SQUARE, [[0, 1, 2, 3]])
    built_in([(x + 1, y) for x, y in SQUARE], [[0, 1, 2, 3]])
    model = read()
    assert (len(model.faces), len(model.curves), len(model.vertices)) == (2, 8, 8)


def test_unsynchronised_model_is_read():
    gmsh.model.occ.addRectangle(0, 0, 0, 1, 1)
    assert len(read().faces) == 1


def test_no_surfaces():
    gmsh.model.occ.addCircle(0, 0, 0, 1)
    gmsh.model.occ.synchronize()
    with pytest.raises(GeometryError, match="no surfaces"):
        read()


def test_embedded_entities_and_ports():
    surface = built_in(SQUARE, [[0, 1, 2, 3]])
    geo = gmsh.model.geo
    a, b, c, d = (geo.addPoint(*p, 0) for p in ((0.2, 0.5), (0.4, 0.5), (0.7, 0.7), (0.9, 0.1)))
    line = geo.addLine(a, b)
    geo.synchronize()
    gmsh.model.mesh.embed(1, [line], 2, surface)
    gmsh.model.mesh.embed(0, [c, a], 2, surface)
    gmsh.model.addPhysicalGroup(0, [1])
    model = read()
    face = model.faces[0]
    assert [model.curves[r].tag for r in face.embedded_curves] == [line]
    assert [model.vertex_tags[v] for v in face.embedded_points] == [c]
    assert d not in model.vertex_tags
    assert {int(t) for t in model.vertex_tags[model.vertex_ports]} == {1, c, a}


def test_reading_changes_nothing():
    gmsh.model.occ.addRectangle(0, 0, 0, 1, 1)
    gmsh.model.occ.synchronize()
    gmsh.model.mesh.setTransfiniteCurve(1, 9)
    gmsh.model.mesh.generate(2)
    nodes = [np.array(a) for a in gmsh.model.mesh.getNodes()[:2]]
    entities = gmsh.model.getEntities()
    saved = {k: gmsh.option.getNumber(f"Mesh.{k}") for k in ("MeshSizeMin", "MeshSizeMax", "ElementOrder", "MinimumCircleNodes")}
    read()
    after = gmsh.model.mesh.getNodes()[:2]
    order = [np.argsort(nodes[0]), np.argsort(after[0])]
    np.testing.assert_array_equal(nodes[0][order[0]], after[0][order[1]])
    np.testing.assert_array_equal(nodes[1].reshape(-1, 3)[order[0]], after[1].reshape(-1, 3)[order[1]])
    assert gmsh.model.getEntities() == entities
    assert saved == {k: gmsh.option.getNumber(f"Mesh.{k}") for k in saved}


def test_a_mesh_with_topology_is_read(tmp_path):
    occ = gmsh.model.occ
    occ.cut([(2, occ.addRectangle(0, 0, 0, 2, 1))], [(2, occ.addDisk(1, 0.5, 0, 0.2, 0.2))])
    occ.synchronize()
    with options(**{"Mesh.MeshSizeMax": 0.02}):
        gmsh.model.mesh.generate(2)
    gmsh.write(str(tmp_path / "plate.msh"))
    gmsh.clear()
    gmsh.open(str(tmp_path / "plate.msh"))
    model = read()
    assert loop_areas(model) == pytest.approx([2.0, -0.04 * np.pi], rel=5e-3)
    assert sum(c.closed for c in model.curves) == 1
    np.testing.assert_allclose(np.cross(*model.faces[0].axes), [0, 0, 1])


# ---- transfinite curves


def tagged(model):
    return {c.tag: c for c in model.curves}


def test_transfinite_spacing():
    built_in(SQUARE, [[0, 1, 2, 3]])
    mesh = gmsh.model.mesh
    mesh.setTransfiniteCurve(1, 6, "Progression", 2.0)
    mesh.setTransfiniteCurve(2, 5)
    mesh.setTransfiniteCurve(3, 2)
    curves = tagged(read())
    steps = np.diff(curves[1].spacing)
    assert steps[1:] / steps[:-1] == pytest.approx(np.full(4, 2.0), rel=1e-3)
    assert curves[2].spacing == pytest.approx(np.linspace(0, curves[2].length, 5))
    assert curves[3].spacing == pytest.approx([0, curves[3].length])
    assert curves[4].spacing is None


def test_transfinite_counts_on_circles_and_with_a_size_field():
    occ = gmsh.model.occ
    occ.cut([(2, occ.addRectangle(0, 0, 0, 4, 4))], [(2, occ.addDisk(1, 1, 0, 0.5, 0.5)), (2, occ.addDisk(3, 3, 0, 0.01, 0.01))])
    occ.synchronize()
    field = gmsh.model.mesh.field.add("MathEval")
    gmsh.model.mesh.field.setString(field, "F", "0.1")
    gmsh.model.mesh.field.setAsBackgroundMesh(field)
    assert all(c.spacing is None for c in read().curves)
    big = next(c for c in read().curves if c.closed and c.length * read().scale > 1)
    gmsh.model.mesh.setTransfiniteCurve(big.tag, 13)
    prescribed = [c for c in read().curves if c.spacing is not None]
    assert [c.tag for c in prescribed] == [big.tag]
    assert len(np.diff(prescribed[0].spacing)) == 12
    assert prescribed[0].spacing == pytest.approx(np.linspace(0, big.length, 13), rel=1e-6)


def test_curves_with_a_minimum_count_of_gmsh_are_not_transfinite():
    occ = gmsh.model.occ
    a, b, c = (occ.addPoint(*p, 0) for p in ((0, 0), (1, 0), (0.5, 0.5)))
    loop = occ.addCurveLoop([occ.addLine(a, b), occ.addSpline([b, c, a])])
    occ.addPlaneSurface([loop])
    occ.synchronize()
    assert all(curve.spacing is None for curve in read().curves)


# ---- angles


def test_corners_of_an_l_shape():
    built_in([(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)], [[0, 1, 2, 3, 4, 5]])
    assert degrees(read()) == [[90.0] * 5 + [270.0]]


def test_corner_between_line_and_arc_is_exact():
    geo = gmsh.model.geo
    a, centre, b = (geo.addPoint(x, 0, 0) for x in (-1, 0, 1))
    top = geo.addPoint(0, 1, 0)
    loop = geo.addCurveLoop([geo.addLine(a, b), geo.addCircleArc(b, centre, top), geo.addCircleArc(top, centre, a)])
    geo.addPlaneSurface([loop])
    geo.synchronize()
    (angles,) = sector_angles(read(), 0)
    assert np.sort(np.degrees(angles)) == pytest.approx([90.0, 90.0, 180.0], abs=1e-5)


def test_vanishing_derivative_falls_back_to_chords():
    occ = gmsh.model.occ
    p = [occ.addPoint(*q, 0) for q in ((0, 0), (0, 0), (1, 1), (2, 0))]
    bezier = occ.addBezier([p[0], p[1], p[2], p[3]])  # the first derivative is zero at the start, the direction is (1, 1)
    low = occ.addPoint(1, -1, 0)
    occ.addPlaneSurface([occ.addCurveLoop([bezier, occ.addLine(p[3], low), occ.addLine(low, p[0])])])
    occ.synchronize()
    model = read()
    row = next(i for i, c in enumerate(model.curves) if gmsh.model.getType(1, c.tag) != "Line")
    directions = end_directions(model, 0)
    end = 0 if model.curves[row].points[0, 0] < model.curves[row].points[-1, 0] else 1
    side = np.sign(np.cross(*model.faces[0].axes)[2])
    assert np.degrees(directions[row, end]) == pytest.approx(side * 45.0, abs=0.1)


def test_crack_of_two_lips_has_an_angle_of_2_pi():
    points = [(-1, -1), (1, -1), (1, 0), (0, 0), (1, 0), (1, 1), (-1, 1)]
    built_in(points, [list(range(7))])
    assert degrees(read()) == [[90.0] * 6 + [360.0]]


def test_lens_hole_and_lens_face_are_told_apart():
    geo = gmsh.model.geo
    a, b = geo.addPoint(0, 0, 0), geo.addPoint(1, 0, 0)
    up, down = geo.addBezier([a, geo.addPoint(0.5, 1e-3, 0), b]), geo.addBezier([a, geo.addPoint(0.5, -1e-3, 0), b])
    lens = geo.addCurveLoop([up, -down])
    corner = [geo.addPoint(*p, 0) for p in ((-1, -1), (2, -1), (2, 1), (-1, 1))]
    outer = geo.addCurveLoop([geo.addLine(p, q) for p, q in zip(corner, corner[1:] + corner[:1])])
    geo.addPlaneSurface([lens])
    geo.addPlaneSurface([outer, lens])
    geo.synchronize()
    model = read()
    sharp = np.degrees(2 * np.arctan2(1e-3, 0.5))
    assert np.degrees(sector_angles(model, 0)[0]) == pytest.approx([sharp, sharp], abs=1e-6)
    assert np.degrees(sector_angles(model, 1)[1]) == pytest.approx([360 - sharp] * 2, abs=1e-6)


def test_tangents_of_samples_without_cad():
    t = np.linspace(0, 1, 101)
    arc = np.stack([np.cos(t), np.sin(t), 0 * t], axis=1)
    s = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(arc, axis=0), axis=1))])
    tangents = end_tangents(Curve(1, 0, 1, arc, t, s))
    np.testing.assert_allclose(tangents, [[0, 1, 0], [np.sin(1), -np.cos(1), 0]], atol=1e-4)


@settings(max_examples=15, deadline=None)
@given(st.floats(0.0, 6.0), st.floats(-1.0, 1.0), st.floats(-1.5, 1.5), st.sampled_from([1e-6, 1.0, 1e5]))
def test_angles_and_areas_do_not_depend_on_the_position(turn, tilt, slide, size):
    gmsh.clear()
    rotation = np.array([[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
    rotation = np.array([[1, 0, 0], [0, np.cos(tilt), -np.sin(tilt)], [0, np.sin(tilt), np.cos(tilt)]]) @ rotation
    flat = np.array([(0, 0, 0), (3, 0, 0), (3, 1, 0), (1, 1, 0), (0, 4, 0)], float)
    built_in((size * (flat @ rotation.T + slide)).tolist(), [[0, 1, 2, 3, 4]])
    model = read()
    assert area(model) == pytest.approx(size**2 * 4.5, rel=1e-9)
    assert np.degrees(sector_angles(model, 0)[0]).sum() == pytest.approx(540.0)
    assert np.degrees(sector_angles(model, 0)[0]).max() == pytest.approx(180 + np.degrees(np.arctan(3)), abs=1e-6)


# ---- curves without length


def test_an_edge_that_the_cad_calls_a_point_is_left_out():
    occ = gmsh.model.occ
    side = occ.addLine(occ.addPoint(9e-8, 0, 0), occ.addPoint(1, 0, 0.5))  # within the kernel's tolerance of the axis
    occ.revolve([(1, side)], 0, 0, 0, 0, 0, 1, np.pi / 2)
    occ.synchronize()
    assert [gmsh.model.getType(1, c) for _, c in gmsh.model.getEntities(1)].count("Unknown") == 1
    model = read()
    assert sorted(gmsh.model.getType(1, c.tag) for c in model.curves) == ["Circle", "Line", "Line"]
    assert [len(loop) for loop in model.faces[0].loops] == [3]
    assert model.vertex_twins == () and model.notes == ()


@pytest.mark.parametrize("asked", [0, 1])
def test_ends_of_a_curve_without_length_become_one_vertex(asked):
    points = [(0, 0), (1, 0), (1, 1), (1 - 1e-10, 1), (0, 1)]
    built_in(points, [[0, 1, 2, 3, 4]])
    pair = [3, 4]  # tags of the two points at (1, 1)
    gmsh.model.addPhysicalGroup(0, [pair[asked]], name="corner")
    model = read()
    stays = model.vertex_tags.tolist().index(pair[asked])
    assert model.vertex_twins == ((pair[1 - asked], stays),)
    assert len(model.curves) == len(model.vertices) == 4
    assert model.vertex_ports.tolist() == [v == stays for v in range(4)]
    assert area(model) == pytest.approx(1.0, abs=1e-9)
    assert any("without length" in note for note in model.notes)


def test_a_short_curve_with_a_length_is_kept():
    built_in([(0, 0), (1, 0), (1, 1), (1 - 1e-7, 1), (0, 1)], [[0, 1, 2, 3, 4]])
    assert len(read().curves) == 5
