from dataclasses import replace

import numpy as np
import pytest

from gmsh_crossquad.cad.files import MeshArrays
from gmsh_crossquad.check import check_mesh, format_report
from gmsh_crossquad.compare import _distance, compare
from gmsh_crossquad.fill.pipeline import fill
from gmsh_crossquad.surfaces import Planes
from tests.models import disc, two_materials, two_squares
from tests.results import two_squares_mesh
from tests.test_fill_surfaces import tube, uniform

GROUPS = {(1, "left"): (6,), (2, "right square"): (2,)}


def arrays(**changes):
    """The hand-made mesh of two squares as if read from a file."""
    mesh = two_squares_mesh()
    lines = np.concatenate([np.stack([c[:-1], c[1:]], axis=1) for c in mesh.curve_nodes])
    owner = np.repeat(np.arange(len(mesh.curve_nodes)) + 1, [len(c) - 1 for c in mesh.curve_nodes])
    good = MeshArrays(
        points=mesh.points,
        quads=mesh.quads,
        triangles=np.zeros((0, 3), np.int64),
        lines=lines,
        quad_entity=mesh.quad_face + 1,
        triangle_entity=np.zeros(0, np.int64),
        line_entity=owner,
        groups=GROUPS,
        physical={},
    )
    return replace(good, **changes)


def compared(mesh, model, groups):
    return compare(check_mesh(mesh), mesh, model, Planes(model), groups, np.full(len(model.faces), np.nan))


def judged(mesh, groups=GROUPS):
    return compared(mesh, two_squares(), groups)


def test_a_good_mesh_has_no_faults():
    report = judged(arrays())
    assert report.faults == ()
    assert (report.quads, report.triangles, report.irregular, report.hanging, report.inverted) == (24, 0, 0, 0, 0)
    assert report.min_scaled_jacobian == pytest.approx(1.0)
    assert report.groups == ("left", "right square")
    assert format_report(report, "x.msh").splitlines()[-1] == "ok"


def split_quad(mesh, quad):
    a, b, c, d = mesh.quads[quad]
    return replace(
        mesh,
        quads=np.delete(mesh.quads, quad, axis=0),
        quad_entity=np.delete(mesh.quad_entity, quad),
        triangles=np.array([[a, b, c], [a, c, d]]),
        triangle_entity=np.full(2, mesh.quad_entity[quad]),
    )


def test_triangles_are_a_fault():
    report = judged(split_quad(arrays(), 0))
    assert report.faults == ("2 triangles",)
    assert report.hanging == 0


def test_equilateral_triangle_is_perfect():
    points = np.array([(0, 0, 0), (1, 0, 0), (0.5, np.sqrt(0.75), 0)])
    none = np.zeros((0, 4), np.int64)
    mesh = arrays(points=points, quads=none, quad_entity=none[:, 0], lines=none[:, :2], line_entity=none[:, 0])
    mesh = replace(mesh, triangles=np.array([[0, 1, 2]]), triangle_entity=np.array([1]))
    assert check_mesh(mesh).min_scaled_jacobian == pytest.approx(1.0)


def test_a_folded_quad_is_a_fault():
    points = arrays().points.copy()
    points[two_squares_mesh().face_nodes[0][0]] += (0.5, 0.0, 0.0)
    report = judged(arrays(points=points))
    assert report.inverted >= 1
    assert any("inverted" in f for f in report.faults)


def test_a_crack_of_duplicate_nodes_is_a_fault():
    mesh = arrays()
    node = two_squares_mesh().face_nodes[0]
    copy = {int(v): len(mesh.points) + k for k, v in enumerate(node)}
    quads = mesh.quads.copy()
    row = [k for k in range(len(quads)) if mesh.points[quads[k], 1].mean() > 0.5]
    quads[row] = np.vectorize(lambda v: copy.get(int(v), int(v)))(quads[row])
    report = check_mesh(replace(mesh, quads=quads, points=np.vstack([mesh.points, mesh.points[node]])))
    assert report.hanging > 0
    assert any("not conforming" in f for f in report.faults)


def test_a_hanging_node_is_a_fault():
    # one square of side 1 beside two of side 1/2
    xy = [(0, 0), (1, 0), (1, 1), (0, 1), (1, 0.5), (1.5, 0), (1.5, 0.5), (1.5, 1)]
    points = np.c_[np.array(xy), np.zeros(8)]
    quads = np.array([[0, 1, 2, 3], [1, 5, 6, 4], [4, 6, 7, 2]])
    report = check_mesh(
        arrays(points=points, quads=quads, quad_entity=np.ones(3, np.int64), lines=np.zeros((0, 2), np.int64), groups={})
    )
    assert report.hanging == 1


@pytest.mark.parametrize("drawn, surfaces, hanging", [(True, 1, 0), (False, 1, 2), (True, 2, 2)])
def test_a_crack_is_conforming_where_the_model_has_it(drawn, surfaces, hanging):
    # two squares side by side; their common side is there twice, with a line element on both or on none
    xy = [(0, 0), (1, 0), (1, 1), (0, 1), (1, 0), (2, 0), (2, 1), (1, 1)]
    lines = np.array([[1, 2], [4, 7]] if drawn else np.zeros((0, 2)), np.int64)
    mesh = arrays(
        points=np.c_[np.array(xy, float), np.zeros(8)],
        quads=np.arange(8).reshape(2, 4),
        quad_entity=np.array([1, surfaces]),
        lines=lines,
        line_entity=np.arange(len(lines)),
        groups={},
    )
    assert check_mesh(mesh).hanging == hanging


def test_a_turned_quad_is_a_fault():
    quads = arrays().quads.copy()
    quads[0] = quads[0][::-1]
    report = check_mesh(arrays(quads=quads))
    assert any("oriented differently" in f for f in report.faults)


def test_a_missing_quad_leaves_the_boundary_loose():
    mesh = arrays()
    inner = np.flatnonzero(np.isclose(mesh.points[mesh.quads].mean(axis=1)[:, 0], 0.5))[1]
    holed = replace(mesh, quads=np.delete(mesh.quads, inner, axis=0), quad_entity=np.delete(mesh.quad_entity, inner))
    report = judged(holed)
    assert any("not on the boundary of the model" in f for f in report.faults)


def test_a_missing_face_shows_in_the_area():
    mesh = arrays()
    left = mesh.quad_entity == 1
    report = judged(replace(mesh, quads=mesh.quads[left], quad_entity=mesh.quad_entity[left]))
    assert "the area is 1 and not 2" in report.faults


def test_a_missed_cad_vertex_is_a_fault():
    points = arrays().points.copy()
    corner = two_squares_mesh().vertex_node[0]
    points[corner] += (0.02, 0.0, 0.0)
    assert any("1 CAD vertices are no nodes" in f for f in judged(arrays(points=points)).faults)


def octagon(radius):
    """The unit square around a disc that is meshed with the octagon inside it, by 8 + 12 quads, as file arrays and model."""
    model = two_materials()
    angle = np.arange(8) * np.pi / 4
    ring = 0.5 + radius * np.c_[np.cos(angle), np.sin(angle)]
    outer = np.array([(1, 0.5), (1, 1), (0.5, 1), (0, 1), (0, 0.5), (0, 0), (0.5, 0), (1, 0)])
    core = 0.5 + 0.1 * np.c_[np.cos(angle), np.sin(angle)]
    xy = np.vstack([ring, outer, core, [[0.5, 0.5]]])
    k, n = np.arange(8), np.roll(np.arange(8), -1)
    around = np.c_[k, 8 + k, 8 + n, n]
    inside = np.c_[16 + k, k, n, 16 + n]
    middle = np.array([[24, 16 + i, 17 + i, 16 + (i + 2) % 8] for i in range(0, 8, 2)])
    mesh = arrays(
        points=np.c_[xy, np.zeros(len(xy))],
        quads=np.vstack([around, inside, middle]),
        quad_entity=np.repeat([1, 2, 2], [8, 8, 4]),
        lines=np.c_[k, n],
        line_entity=np.full(8, 5),
        groups={(2, "disc"): (2,)},
    )
    return mesh, model


@pytest.mark.parametrize("radius, faults", [(0.25, 0), (0.2, 1)])
def test_chords_of_a_circle_may_cut_off_their_segments_but_no_more(radius, faults):
    # the octagon lacks 10 % of the disc; one that is smaller by a fifth is another shape
    mesh, model = octagon(radius)
    report = compared(mesh, model, {(2, "disc"): (2,)})
    assert report.inverted == 0
    assert len([f for f in report.faults if "'disc'" in f]) == faults


def test_many_short_segments_do_not_hide_a_long_one():
    # the middle of the long segment is farther from the point than all of the short ones, which are above it
    x = np.linspace(-1e-3, 1e-3, 41)
    a = np.r_[[[-0.004, 0, 0]], np.c_[x[:-1], np.full(40, 1e-3), np.zeros(40)]]
    b = np.r_[[[0.006, 0, 0]], np.c_[x[1:], np.full(40, 1e-3), np.zeros(40)]]
    distance, length = _distance(np.array([[0.0, 1e-4, 0.0]]), a, b)
    assert distance == pytest.approx(1e-4)
    assert length == pytest.approx(0.01)


@pytest.mark.parametrize("last, faults", [(90, 1), (270, 0)])
def test_an_edge_that_cuts_across_a_curve_is_a_fault(last, faults):
    # a quad inside a circle: its last edge runs from that angle to 360 degrees, its other edges share the rest
    model = disc()
    angle = np.radians(np.linspace(0, last, 4))
    points = 0.5 * (model.curves[0].points.min(0) + model.curves[0].points.max(0))
    radius = 0.5 * np.ptp(model.curves[0].points[:, 0])
    points = (points + radius * np.c_[np.cos(angle), np.sin(angle), np.zeros(4)]) * model.scale + model.origin
    one = np.ones(1, np.int64)
    mesh = arrays(points=points, quads=np.arange(4)[None], quad_entity=one, lines=np.zeros((0, 2), np.int64), groups={})
    report = compared(mesh, model, {})
    assert len([f for f in report.faults if "does not follow curve" in f]) == faults


@pytest.mark.parametrize("lost, what", [((1, "left"), "curve 'left'"), ((2, "right square"), "surface 'right square'")])
def test_a_lost_group_is_a_fault(lost, what):
    kept = {k: v for k, v in GROUPS.items() if k != lost}
    report = judged(arrays(groups=kept))
    assert [f for f in report.faults if what in f and "not carried in full" in f]


def test_no_quads_is_a_fault():
    none = np.zeros((0, 4), np.int64)
    report = judged(arrays(quads=none, quad_entity=none[:, 0]))
    assert "no quads" in report.faults
    assert np.isnan(report.min_scaled_jacobian)


def tube_arrays(k=4):
    """A tube with its exact area, and its mesh as if read from a file."""
    model, surface, guide, evaluate = tube(8, 2)
    mesh = fill(model, surface, guide, uniform(guide, k), evaluate)
    lines = np.concatenate([np.stack([c[:-1], c[1:]], axis=1) for c in mesh.curve_nodes])
    return (
        model,
        surface,
        arrays(
            points=mesh.points,
            quads=mesh.quads,
            quad_entity=mesh.quad_face + 1,
            lines=lines,
            line_entity=np.repeat([1, 2], 8 * k),
            groups={(2, "skin"): (1,)},
        ),
    )


def compared_tube(model, surface, mesh):
    area = np.array([2 * np.pi * 0.2 * 0.5])
    return compare(check_mesh(mesh), mesh, model, surface, {(2, "skin"): (1,)}, area)


def test_a_mesh_of_a_tube_has_no_faults():
    model, surface, mesh = tube_arrays()
    report = compared_tube(model, surface, mesh)
    assert report.faults == ()
    assert (report.inverted, report.irregular, report.hanging) == (0, 0, 0)


@pytest.mark.parametrize("entity", [1, 7])
def test_a_node_beside_a_curved_face_is_a_fault(entity):
    model, surface, mesh = tube_arrays()
    mesh = replace(mesh, quad_entity=np.full(len(mesh.quads), entity), groups={})
    assert compared_tube(model, surface, mesh).faults == ()
    inner = np.setdiff1d(np.arange(len(mesh.points)), mesh.lines)
    mesh.points[inner[:3]] += [0.0, 0.0, 1e-3]  # along the tube
    assert compared_tube(model, surface, mesh).faults == ()
    mesh.points[inner[:3], :2] += (mesh.points[inner[:3], :2] - model.origin[:2]) * 1e-3
    assert compared_tube(model, surface, mesh).faults == ("3 nodes are not on the faces of the model",)


def test_a_node_on_a_curve_that_is_off_its_face_is_right():
    model, surface, mesh = tube_arrays()
    rim = np.unique(mesh.lines)
    wide = np.array([1.001, 1.001, 1.0])
    mesh.points[rim] = model.origin + wide * (mesh.points[rim] - model.origin)
    assert f"{len(rim)} nodes are not on the faces of the model" in compared_tube(model, surface, mesh).faults
    curves = tuple(replace(c, points=c.points * wide) for c in model.curves)
    off = replace(model, curves=curves, vertices=model.vertices * wide)
    assert compared_tube(off, surface, mesh).faults == ()


def test_a_tube_that_is_too_coarse_lacks_area():
    # a hexagonal prism lacks 4.5 %, and more where its free edges bound what may be cut off
    model, surface, guide, evaluate = tube(3, 1)
    mesh = fill(model, surface, guide, uniform(guide, 1), evaluate)
    lines = np.concatenate([np.stack([c[:-1], c[1:]], axis=1) for c in mesh.curve_nodes])
    ones = np.ones(len(mesh.quads), np.int64)
    coarse = arrays(points=mesh.points, quads=mesh.quads, quad_entity=ones, lines=lines, line_entity=ones, groups={})
    assert any("area" in f for f in compared_tube(model, surface, coarse).faults)


def test_a_folded_cell_of_a_tube_is_inverted():
    """The inner nodes of one ring are moved past the next ring: the cells between lie against their neighbours."""
    _, _, mesh = tube_arrays()
    z = np.unique(np.round(mesh.points[:, 2], 9))
    second = np.abs(mesh.points[:, 2] - z[2]) < 1e-6
    mesh.points[second, 2] = z[3] + 0.3 * (z[4] - z[3])
    report = check_mesh(mesh)
    assert report.inverted == 32
    assert report.min_scaled_jacobian == pytest.approx(-1.0, abs=1e-3)


def test_a_crease_along_a_line_is_no_fold():
    # two squares of one surface that meet at 60 degrees, with and without the line between them
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0, 0.75**0.5], [0.5, 1, 0.75**0.5]])
    quads = np.array([[0, 1, 2, 3], [0, 3, 5, 4]])
    ones = np.ones(2, np.int64)
    mesh = arrays(points=points, quads=quads, quad_entity=ones, lines=np.zeros((0, 2), np.int64), groups={})
    assert check_mesh(mesh).inverted == 2
    assert check_mesh(replace(mesh, lines=np.array([[3, 0]]), line_entity=ones[:1])).inverted == 0
