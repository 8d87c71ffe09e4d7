"""Models that cannot be meshed are refused with the place; models that can pass."""

import itertools
from dataclasses import replace

import gmsh
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gmsh_crossquad.cad.intersect import CHUNK, contacts
from gmsh_crossquad.cad.read import read_model
from gmsh_crossquad.cad.session import guest
from gmsh_crossquad.cad.validate import validate
from gmsh_crossquad.errors import GeometryError
from gmsh_crossquad.options import MeshOptions


@pytest.fixture
def session():
    with guest():
        gmsh.model.add("model")
        yield


def polygon_surface(points, holes=()):
    geo = gmsh.model.geo
    wires = []
    for ring in (points, *holes):
        tags = [geo.addPoint(x, y, 0) for x, y in ring]
        wires.append(geo.addCurveLoop([geo.addLine(a, b) for a, b in zip(tags, tags[1:] + tags[:1])]))
    surface = geo.addPlaneSurface(wires)
    geo.synchronize()
    return surface


def embed(points, surface):
    geo = gmsh.model.geo
    tags = [geo.addPoint(x, y, 0) for x, y in points]
    lines = [geo.addLine(a, b) for a, b in itertools.pairwise(tags)]
    geo.synchronize()
    gmsh.model.mesh.embed(1 if lines else 0, lines or tags, 2, surface)


def check():
    validate(read_model(MeshOptions()))


def refused(match):
    with pytest.raises(GeometryError, match=match) as caught:
        check()
    assert "\n" not in str(caught.value)
    return caught.value


SQUARE = [(0, 0), (1, 0), (1, 1), (0, 1)]


# ---- refused


@pytest.mark.parametrize("size", [1e-9, 1.0, 1e6])
def test_bow_tie(session, size):
    polygon_surface([(0, 0), (size, size), (size, 0), (0, size)])
    error = refused("cross")
    assert error.location == pytest.approx((0.5 * size, 0.5 * size, 0), rel=1e-9, abs=1e-12 * size)
    assert error.entity[0] == 2


def test_no_area(session):
    polygon_surface([(0, 0), (1, 0), (2, 0)])
    assert refused("no area").location is not None


def test_hole_that_crosses_the_outer_loop(session):
    polygon_surface(SQUARE, [[(0.5, 0.5), (1.5, 0.5), (0.5, 0.75)]])
    assert refused("cross").location[0] == pytest.approx(1.0)


def test_hole_that_shares_part_of_an_edge(session):
    polygon_surface(SQUARE, [[(0.25, 0), (0.5, 0), (0.5, 0.5), (0.25, 0.5)]])
    assert refused("touch").location[1] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(("gap", "touching"), [(0.0, True), (-1e-5, True), (1e-7, False), (1e-4, False)])
def test_circle_that_touches_a_line(session, gap, touching):
    geo = gmsh.model.geo
    y, r = 0.5 + gap, 0.5
    centre = geo.addPoint(0, y, 0)
    angles = (0.0, 2.0, 4.0)  # the lowest point of the circle is no vertex
    around = [geo.addPoint(r * np.cos(a), y + r * np.sin(a), 0) for a in angles]
    arcs = [geo.addCircleArc(a, centre, b) for a, b in zip(around, around[1:] + around[:1])]
    hole = geo.addCurveLoop(arcs)
    corner = [geo.addPoint(*p, 0) for p in ((-2, 0), (2, 0), (2, 2), (-2, 2))]
    outer = geo.addCurveLoop([geo.addLine(p, q) for p, q in zip(corner, corner[1:] + corner[:1])])
    geo.addPlaneSurface([outer, hole])
    geo.synchronize()
    if touching:
        assert refused("touch").location == pytest.approx((0, 0, 0), abs=0.01)
    else:
        check()


def test_sharp_corner(session):
    polygon_surface([(0, 0), (1, 0), (1, np.tan(np.radians(0.3)))])
    error = refused("too sharp")
    assert error.location == pytest.approx((0, 0, 0), abs=1e-9)
    assert error.entity == (0, 1)


def test_tangent_hole_at_a_common_vertex(session):
    occ = gmsh.model.occ
    occ.cut([(2, occ.addRectangle(-2, -1, 0, 4, 2))], [(2, occ.addDisk(0, 0.5, 0, 0.5, 0.5))])
    occ.synchronize()
    check()  # two cusps: the curves touch in the vertex and part


def test_two_triangles_with_a_common_vertex(session):
    geo = gmsh.model.geo
    p = [geo.addPoint(x, y, 0) for x, y in ((0, 0), (1, -1), (1, 1), (-1, 1), (-1, -1))]
    pairs = ((0, 1), (1, 2), (2, 0), (0, 3), (3, 4), (4, 0))
    geo.addPlaneSurface([geo.addCurveLoop([geo.addLine(p[a], p[b]) for a, b in pairs])])
    geo.synchronize()
    refused("2 outer boundaries")


@pytest.mark.parametrize(
    ("points", "match"),
    [
        ([(0.5, 0.5), (1.5, 0.5)], "touch or cross"),
        ([(0.5, 0.5), (1.0, 0.5)], "touch or cross"),
        ([(0.2, 0.2), (0.8, 0.8), (0.8, 0.2), (0.2, 0.8)], "touch or cross"),
        ([(2.0, 2.0), (3.0, 2.0)], "outside"),
        ([(2.0, 2.0)], "outside"),
        ([(0.5, 0.0)], "lies on curve"),
        ([(0.2, 0.2), (0.8, 0.2), (0.2, 0.201)], "too sharp"),
    ],
)
def test_embedded_entities_in_the_wrong_place(session, points, match):
    embed(points, polygon_surface(SQUARE))
    refused(match)


def test_embedded_points_at_one_place(session):
    surface = polygon_surface(SQUARE)
    embed([(0.5, 0.5)], surface)
    embed([(0.5, 0.5)], surface)
    refused("coincides with point")


def test_no_faces(session):
    polygon_surface(SQUARE)
    with pytest.raises(GeometryError, match="no surfaces"):
        validate(replace(read_model(MeshOptions()), faces=()))


# ---- accepted


@pytest.mark.parametrize(
    "points",
    [
        SQUARE,
        SQUARE[::-1],
        [(0, 0), (1, 0), (1, np.tan(np.radians(0.7)))],
        [(0, 0), (1, 0), (0.5, 0.5), (1, 1), (0, 1), (0.5, 0.5000001)],
        [(-1, -1), (1, -1), (1, 0), (0, 0), (1, 1e-3), (1, 1), (-1, 1)],
    ],
)
def test_polygons_that_pass(session, points):
    polygon_surface(points)
    check()


def test_lips_of_a_crack_with_two_mouths_pass(session):
    polygon_surface([(-1, -1), (1, -1), (1, 0), (0.5, 0), (0, 0), (0.5, 0), (1, 0), (1, 1), (-1, 1)])
    check()


def test_overlapping_faces_pass(session):
    polygon_surface(SQUARE)
    polygon_surface([(x + 0.5, y + 0.5) for x, y in SQUARE])
    check()


def test_embedded_entities_pass(session):
    surface = polygon_surface(SQUARE)
    embed([(0.2, 0.2), (0.8, 0.2), (0.5, 0.7)], surface)
    embed([(0.1, 0.9)], surface)
    check()


# ---- contacts of polylines


def brute_force(polylines, ends):
    """Pairs of polylines with properly crossing segments."""
    out = set()
    segments = [(c, p[k], p[k + 1]) for c, p in enumerate(polylines) for k in range(len(p) - 1)]

    def turn(a, b, c):
        return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])

    for i, (c, p, q) in enumerate(segments):
        for d, r, s in segments[i + 1 :]:
            if turn(p, q, r) * turn(p, q, s) < 0 and turn(r, s, p) * turn(r, s, q) < 0:
                out.add((min(c, d), max(c, d)))
    return out


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10**6), st.integers(2, 5), st.integers(2, 3 * CHUNK))
def test_contacts_are_those_of_brute_force(seed, count, length):
    rng = np.random.default_rng(seed)
    # straight polylines: the cubics through their points are the polylines
    lines = []
    for _ in range(count):
        a, b = rng.random((2, 2))
        t = np.sort(np.concatenate([[0, 1], rng.random(length)]))[:, None]
        lines.append(a + t * (b - a))
    ends = [(2 * i, 2 * i + 1) for i in range(count)]
    found = contacts(lines, ends)
    assert {(c.first, c.second) for c in found} == brute_force(lines, ends)
    for c in found:
        for row, k in ((c.first, c.segments[0]), (c.second, c.segments[1])):
            p, q = lines[row][k : k + 2]
            across = (q - p)[0] * (c.point - p)[1] - (q - p)[1] * (c.point - p)[0]
            assert abs(across) <= 1e-9


def circle(x, y, r, n=900):
    t = np.linspace(0, 2 * np.pi, n)
    p = np.stack([x + r * np.cos(t), y + r * np.sin(t)], axis=1)
    p[-1] = p[0]
    return p


@pytest.mark.parametrize(("gap", "count"), [(-1e-6, 1), (0.0, 1), (1e-7, 0), (1e-3, 0)])
@pytest.mark.parametrize("turn", [0.0, 0.1234])
def test_tangent_circles_are_told_from_nearly_tangent_ones(gap, count, turn):
    rotation = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    first, second = circle(0, 0, 0.2), circle(0.3 + gap, 0, 0.1, 701) @ rotation
    assert len(contacts([first, second], [(0, 0), (1, 1)])) == count


def test_common_ends_are_no_contacts_but_common_pieces_are():
    one = np.array([(0, 0), (0.5, 0), (1, 0)], float)
    other = np.array([(1, 0), (1, 0.5), (1, 1)], float)
    back = np.array([(1, 0), (0.75, 0), (0.25, 0)], float)
    assert contacts([one, other], [(0, 1), (1, 2)]) == []
    assert len(contacts([one, back], [(0, 1), (1, 2)])) == 1


def test_a_long_curve_that_crosses_itself():
    t = np.linspace(0, 2 * np.pi, 400)
    eight = np.stack([0.5 * np.sin(t), 0.25 * np.sin(2 * t)], axis=1)[20:]
    (found,) = contacts([eight], [(0, 1)])
    assert (found.first, found.second) == (0, 0)
    assert found.point == pytest.approx([0, 0], abs=1e-6)
