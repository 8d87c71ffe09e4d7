"""The mesh on the entities of a Gmsh model, with both CAD kernels."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import gmsh
import numpy as np
import pytest

from gmsh_crossquad import mesh
from gmsh_crossquad.cad.put import curve_points, put_mesh, vertex_points
from gmsh_crossquad.cad.read import read_model
from gmsh_crossquad.errors import MeshError
from gmsh_crossquad.fill.numbering import guide_chords
from gmsh_crossquad.fill.pipeline import fill
from gmsh_crossquad.options import MeshOptions
from gmsh_crossquad.records import Model, QuadMesh
from gmsh_crossquad.surfaces import Planes

from .guides import hole_in_plate, make_guide, project

POINT, LINE, QUAD, LINE3, QUAD9 = 15, 1, 3, 8, 10


@pytest.fixture
def session() -> Iterator[None]:
    gmsh.initialize(readConfigFiles=False, interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    yield
    gmsh.finalize()


def plate(kernel: str) -> None:
    """The unit square with a hole of radius .2; two points and a line aside of it, one of the points in a group."""
    if kernel == "occ":
        occ = gmsh.model.occ
        occ.cut([(2, occ.addRectangle(0, 0, 0, 1, 1))], [(2, occ.addDisk(0.5, 0.5, 0, 0.2, 0.2))])
        lonely, _ = occ.addPoint(3, 3, 0), occ.addPoint(4, 4, 0)
        occ.addLine(occ.addPoint(5, 0, 0), occ.addPoint(5, 1, 0))
        occ.synchronize()
    else:
        geo = gmsh.model.geo
        corners = [geo.addPoint(x, y, 0) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]
        sides = [geo.addLine(corners[i], corners[(i + 1) % 4]) for i in range(4)]
        a = 2 * np.pi * np.arange(32) / 32
        hole = [geo.addPoint(0.5 + 0.2 * np.cos(t), 0.5 + 0.2 * np.sin(t), 0) for t in a]
        circle = geo.addSpline([*hole, hole[0]])
        geo.addPlaneSurface([geo.addCurveLoop(sides), geo.addCurveLoop([circle])])
        lonely, _ = geo.addPoint(3, 3, 0), geo.addPoint(4, 4, 0)
        geo.addLine(geo.addPoint(5, 0, 0), geo.addPoint(5, 1, 0))
        geo.synchronize()
    face = gmsh.model.getEntities(2)[0][1]
    outline = [tag for _, tag in gmsh.model.getBoundary([(2, face)], oriented=False)]
    gmsh.model.addPhysicalGroup(0, [lonely], name="probe")
    gmsh.model.addPhysicalGroup(1, outline, name="outline")
    gmsh.model.addPhysicalGroup(2, [face], name="plate")


def mesh_of_plate(k: int, n: int = 2) -> tuple[Model, QuadMesh]:
    """Read the plate from Gmsh and fill a hand-made guide of 16 n quads."""
    model = read_model(MeshOptions(size=0.1))
    model = replace(model, curves=tuple(replace(c, spacing=None) for c in model.curves))
    own, guide, _ = hole_in_plate(n)
    xyz = guide.points * own.scale + own.origin
    chains = []
    for curve in model.curves:
        for chain in [c[::turn] for c in guide.chains for turn in (1, -1)]:
            p = (xyz[chain] - model.origin) / model.scale
            s = [project(curve, x) for x in p[1:-1]]
            ends = np.abs(p[[0, -1]] - curve.points[[0, -1]]).max()
            off = np.abs(curve.at(np.array(s)) - p[1:-1]).max()
            if ends < 1e-9 and off < 1e-3 and np.all(np.diff(s) > 0):
                chains.append(chain)
    assert len(chains) == len(model.curves) == 5
    guide = make_guide(model, xyz, guide.quads, chains)
    divisions = np.full(guide_chords(guide.quads)[3], k)
    return model, fill(model, Planes(model), guide, divisions, lambda row, t: curve_points(model, row, t), vertex_points(model))


def test_vertices_are_exact(session: None) -> None:
    occ = gmsh.model.occ
    occ.addRectangle(0.1, 0.2, 0, 0.7, 0.3)
    occ.synchronize()
    model = read_model(MeshOptions(size=0.1))
    got = vertex_points(model)
    for tag, point in zip(model.vertex_tags.tolist(), got):
        assert point.tolist() == gmsh.model.getValue(0, tag, []).tolist()


@pytest.mark.parametrize("kernel", ["occ", "geo"])
def test_everything_arrives(session: None, kernel: str) -> None:
    plate(kernel)
    model, mesh = mesh_of_plate(3)
    put_mesh(model, mesh)
    tags, x, _ = gmsh.model.mesh.getNodes()
    x = x.reshape(-1, 3)[np.argsort(tags)]
    assert np.array_equal(np.sort(tags), np.arange(1, len(mesh.points) + 2))
    assert np.array_equal(x[:-1], mesh.points)
    assert x[-1].tolist() == [3, 3, 0]
    kinds, elements, nodes = gmsh.model.mesh.getElements()
    count = dict(zip(kinds.tolist(), (len(e) for e in elements)))
    assert count == {POINT: 6, LINE: sum(len(c) - 1 for c in mesh.curve_nodes), QUAD: len(mesh.quads)}
    assert np.array_equal(np.sort(np.concatenate(elements)), np.arange(1, sum(count.values()) + 1))
    quads = nodes[kinds.tolist().index(QUAD)].astype(int).reshape(-1, 4) - 1
    assert np.array_equal(quads, mesh.quads)
    assert gmsh.model.mesh.getDuplicateNodes().size == 0


@pytest.mark.parametrize("kernel", ["occ", "geo"])
def test_curves_carry_parameters_and_lines_run_with_them(session: None, kernel: str) -> None:
    plate(kernel)
    model, mesh = mesh_of_plate(3)
    put_mesh(model, mesh)
    for curve in model.curves:
        tags, x, t = gmsh.model.mesh.getNodes(1, curve.tag)
        np.testing.assert_array_equal(gmsh.model.getValue(1, curve.tag, t), x)
        _, _, nodes = gmsh.model.mesh.getElements(1, curve.tag)
        line = nodes[0].reshape(-1, 2)
        assert np.array_equal(line[1:, 0], line[:-1, 1])
        assert np.array_equal(line[1:, 0], tags)
        assert np.all(np.diff(t) > 0)


def test_hole_is_exact(session: None) -> None:
    plate("occ")
    model, mesh = mesh_of_plate(5)
    put_mesh(model, mesh)
    row = next(i for i, c in enumerate(model.curves) if c.closed)
    p = mesh.points[mesh.curve_nodes[row]] - [0.5, 0.5, 0]
    np.testing.assert_allclose(np.hypot(p[:, 0], p[:, 1]), 0.2, atol=2e-16)


@pytest.mark.parametrize("kernel", ["occ", "geo"])
@pytest.mark.parametrize("binary", [0, 1])
def test_groups_survive_a_file(session: None, kernel: str, binary: int, tmp_path: Path) -> None:
    plate(kernel)
    model, mesh = mesh_of_plate(2)
    put_mesh(model, mesh)
    path = str(tmp_path / "plate.msh")
    gmsh.option.setNumber("Mesh.Binary", binary)
    gmsh.write(path)
    gmsh.model.add("read back")
    gmsh.merge(path)
    names = {gmsh.model.getPhysicalName(d, g): (d, g) for d, g in gmsh.model.getPhysicalGroups()}
    assert set(names) == {"probe", "outline", "plate"}
    counts = {}
    for name, (d, g) in names.items():
        parts = [gmsh.model.mesh.getElements(d, int(e)) for e in gmsh.model.getEntitiesForPhysicalGroup(d, g)]
        counts[name] = sum(len(e) for _, elements, _ in parts for e in elements)
    assert counts == {"probe": 1, "outline": sum(len(c) - 1 for c in mesh.curve_nodes), "plate": len(mesh.quads)}


@pytest.mark.parametrize("kernel", ["occ", "geo"])
def test_second_order_works_on_top(session: None, kernel: str) -> None:
    plate(kernel)
    model, mesh = mesh_of_plate(2)
    put_mesh(model, mesh)
    gmsh.model.mesh.setOrder(2)
    kinds, elements, _ = gmsh.model.mesh.getElements()
    count = dict(zip(kinds.tolist(), (len(e) for e in elements)))
    assert count == {POINT: 6, LINE3: sum(len(c) - 1 for c in mesh.curve_nodes), QUAD9: len(mesh.quads)}
    circle = next(c for c in model.curves if c.closed)
    _, x, _ = gmsh.model.mesh.getNodes(1, circle.tag)
    x = x.reshape(-1, 3) - [0.5, 0.5, 0]
    # the built-in spline through 32 points of the circle leaves it by 7e-6 itself; straight mid-nodes would by .001
    np.testing.assert_allclose(np.hypot(x[:, 0], x[:, 1]), 0.2, atol=1e-14 if kernel == "occ" else 1e-5)
    assert len(x) == 2 * (len(mesh.curve_nodes[model.curves.index(circle)]) - 1) - 1


def test_former_mesh_goes_and_a_second_time_is_the_same(session: None) -> None:
    plate("occ")
    model, mesh = mesh_of_plate(2)
    gmsh.model.mesh.generate(2)
    put_mesh(model, mesh)
    assert len(gmsh.model.mesh.getElementsByType(2)[0]) == 0
    first = [a.tolist() for a in gmsh.model.mesh.getNodes()[:2]]
    put_mesh(model, mesh)
    assert [a.tolist() for a in gmsh.model.mesh.getNodes()[:2]] == first
    wanted = {(1, c.tag) for c in model.curves} | {(2, f.tag) for f in model.faces}
    for dim, tag in gmsh.model.getEntities(1) + gmsh.model.getEntities(2):
        assert bool(gmsh.model.mesh.getElements(dim, tag)[0].size) == ((dim, tag) in wanted)


def test_quads_out_of_order_are_refused(session: None) -> None:
    plate("occ")
    model, mesh = mesh_of_plate(1)
    face = mesh.quad_face.copy()
    face[0] = 1
    with pytest.raises(MeshError, match="not ordered by face"):
        put_mesh(model, replace(mesh, quad_face=face))


def test_a_curve_without_vertex_keeps_its_first_node(session: None) -> None:
    plate("occ")
    model, mesh = mesh_of_plate(2)
    row = next(i for i, c in enumerate(model.curves) if c.closed)
    tags = model.vertex_tags.copy()
    tags[model.curves[row].start] = -1
    put_mesh(replace(model, vertex_tags=tags), mesh)
    got = gmsh.model.mesh.getNodes(1, model.curves[row].tag)[0]
    assert np.array_equal(got, mesh.curve_nodes[row][:-1] + 1)
    assert len(gmsh.model.mesh.getElementsByType(POINT)[0]) == 5


def test_a_discrete_curve_is_its_polyline(session: None) -> None:
    plate("occ")
    model, _ = mesh_of_plate(1)
    gmsh.model.add("discrete")
    tag = gmsh.model.addDiscreteEntity(1, model.curves[0].tag)
    curve = model.curves[0]
    got = curve_points(model, 0, 0.5 * (curve.parameters[:1] + curve.parameters[1:2]))
    want = 0.5 * (curve.points[0] + curve.points[1]) * model.scale + model.origin
    assert tag == curve.tag
    np.testing.assert_allclose(got[0], want, atol=1e-14)


def test_both_ends_of_a_curve_without_length_carry_the_node(session):
    geo = gmsh.model.geo
    tags = [geo.addPoint(*p, 0) for p in ((0, 0), (1, 0), (1, 1), (1 - 1e-10, 1), (0, 1))]
    bend = geo.addSpline([tags[3], geo.addPoint(0.5, 1.1, 0), tags[4]])
    lines = [geo.addLine(tags[i], tags[(i + 1) % 5]) for i in (0, 1, 2)]
    face = geo.addPlaneSurface([geo.addCurveLoop([*lines, bend, geo.addLine(tags[4], tags[0])])])
    geo.synchronize()
    groups = [gmsh.model.addPhysicalGroup(0, [tags[i]]) for i in (2, 3)]
    gmsh.model.addPhysicalGroup(2, [face])
    mesh(size=0.25)
    (one,), place = gmsh.model.mesh.getNodesForPhysicalGroup(0, groups[0])
    (two,), _ = gmsh.model.mesh.getNodesForPhysicalGroup(0, groups[1])
    assert one == two
    assert np.allclose(place, [1, 1, 0])
    points = gmsh.model.mesh.getNodes()[1].reshape(-1, 3)
    apart = np.linalg.norm(points[:, None] - points[None], axis=2) + np.eye(len(points))
    assert apart.min() > 0.02  # no crack


def test_physical_curves_on_no_face_get_edges(session: None) -> None:
    occ = gmsh.model.occ
    square = occ.addRectangle(0, 0, 0, 1, 1)
    corner = occ.addPoint(1, 1, 0)
    occ.fragment([(2, square)], [(0, corner)])
    occ.synchronize()
    corner = gmsh.model.getEntitiesInBoundingBox(0.9, 0.9, -0.1, 1.1, 1.1, 0.1, 0)[0][1]
    wire = occ.addLine(corner, occ.addPoint(1, 1, 2))
    ring = occ.addCircle(5, 0, 0, 1)
    occ.synchronize()
    gmsh.model.addPhysicalGroup(1, [wire, ring], name="wires")
    gmsh.model.addPhysicalGroup(2, [tag for _, tag in gmsh.model.getEntities(2)], name="plate")
    mesh(size=0.1)
    for tag, exact in ((wire, 2.0), (ring, 2 * np.pi)):
        kinds, numbers, nodes = gmsh.model.mesh.getElements(1, tag)
        assert kinds.tolist() == [LINE]
        ends = np.array([gmsh.model.mesh.getNode(int(n))[0] for n in nodes[0]]).reshape(-1, 2, 3)
        length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
        assert length.max() <= 0.12
        assert exact * (1 - 0.12**2 / 20) <= length.sum() <= exact * (1 + 1e-12)
        inner = np.unique(nodes[0])
        assert len(inner) == len(numbers[0]) + (tag == wire)
    for order in (1, 2):
        mesh(size=0.1, order=order)
        tags, all_nodes, _ = gmsh.model.mesh.getNodes()
        assert len(np.unique(tags)) == len(tags)
        assert (
            np.sum(np.linalg.norm(all_nodes.reshape(-1, 3) - [1, 1, 0], axis=1) < 1e-9) == 1
        )  # the square's corner is the wire's end
