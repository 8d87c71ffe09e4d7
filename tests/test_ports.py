import numpy as np
import pytest
from models import background, l_shape, square, wedge
from tracing import field_of, midpoints, polygon_mesh

from gmsh_crossquad.errors import LayoutError
from gmsh_crossquad.field.pipeline import aligned_field
from gmsh_crossquad.field.surface_mesh import SurfaceMesh
from gmsh_crossquad.layout.ports import Fan, fan
from gmsh_crossquad.layout.step import CLEAR
from gmsh_crossquad.layout.trace_mesh import TraceMesh, next_of, previous_of, trace_mesh
from gmsh_crossquad.records import AlignedField, FaceMesh


def polygon_field(n: int, divisions: int, turn: float = 0.0, order=None) -> tuple[FaceMesh, AlignedField, int]:
    """A regular n-gon whose centre carries the index 4 - n by prescription, and the centre's row."""
    mesh = polygon_mesh(n, divisions, turn, order)
    centre = int(np.linalg.norm(mesh.points, axis=1).argmin())
    mid = midpoints(mesh)
    angle = (4 - n) / 4 * np.arctan2(mid[:, 1], mid[:, 0])
    return mesh, aligned_field(mesh, field_of(mesh, angle)), centre


def laid_out(mesh: FaceMesh, aligned: AlignedField) -> TraceMesh:
    return trace_mesh(mesh, SurfaceMesh(mesh.points, mesh.triangles), aligned, mesh.port | (aligned.index != 0))


def half_edge_at(tracing: TraceMesh, vertex: int) -> int:
    candidates = [h for h, v in enumerate(tracing.start) if v == vertex]
    return next((h for h in candidates if tracing.wall[h] >= 0), candidates[0])


def directions(tracing: TraceMesh, vertex: int, found: Fan) -> np.ndarray:
    crossing = np.array([tracing.point(p.half_edge, p.fraction) for p in found.ports]) - tracing.points[vertex]
    return np.arctan2(crossing[:, 1], crossing[:, 0])


@pytest.mark.parametrize("n", [3, 5, 6])
@pytest.mark.parametrize("turn", [0.0, 0.3, 1.9])
def test_ports_of_a_regular_polygon_face_its_sides(n: int, turn: float) -> None:
    rng = np.random.default_rng(n)
    order = rng.permutation(1 + n * 6 * 7 // 2)
    mesh, aligned, centre = polygon_field(n, 6, turn, order)
    assert aligned.index[centre] == 4 - n
    tracing = laid_out(mesh, aligned)
    found = directions(tracing, centre, fan(tracing, half_edge_at(tracing, centre), 4 - n))
    expected = turn + 2 * np.pi * (np.arange(n) + 0.5) / n
    assert np.abs(np.sort(found % (2 * np.pi)) - np.sort(expected % (2 * np.pi))).max() < 1e-2
    steps = np.diff(np.append(found, found[0])) % (2 * np.pi)
    assert np.all(steps < np.pi)  # counter-clockwise, once around
    assert np.isclose(steps.sum(), 2 * np.pi)


@pytest.mark.parametrize("n", [3, 5])
def test_branches_count_up_around_a_singularity(n: int) -> None:
    mesh, aligned, centre = polygon_field(n, 6)
    tracing = laid_out(mesh, aligned)
    h = half_edge_at(tracing, centre)
    ports = fan(tracing, h, 4 - n).ports
    star = tracing.star(h)
    by_triangle = {p.half_edge // 3: p for p in ports}
    branch, previous = None, None
    for g in star + star[:1]:
        if branch is not None:
            branch = (branch + tracing.shift[previous_of(previous)]) % 4
        port = by_triangle.get(g // 3)
        if port is not None:
            if branch is not None:
                assert port.branch == (branch + 1) % 4
            branch = port.branch
        previous = g


def test_a_reentrant_corner_sends_two_separatrices_straight_on() -> None:
    model = l_shape()
    (mesh,) = background(model, 0.08)
    aligned = aligned_field(mesh)
    tracing = laid_out(mesh, aligned)
    v = int(np.flatnonzero(aligned.index == -1)[0])
    found = directions(tracing, v, fan(tracing, half_edge_at(tracing, v), -1))
    assert np.abs(np.sin(2 * found)).max() < 1e-9
    assert len(found) == 2


@pytest.mark.parametrize(("degrees", "quads"), [(30, 1), (60, 1), (90, 1), (120, 1), (200, 2), (270, 3), (330, 4)])
def test_a_sector_is_divided_equally(degrees: float, quads: int) -> None:
    (mesh,) = background(wedge(np.radians(degrees)), 0.06)
    aligned = aligned_field(mesh)
    tip = int(np.flatnonzero(mesh.vertex == 0)[0])
    assert 2 - aligned.index[tip] == quads
    mesh.port[tip] = True
    tracing = laid_out(mesh, aligned)
    found = directions(tracing, tip, fan(tracing, half_edge_at(tracing, tip), 2 - quads)) if quads > 1 else np.zeros(0)
    expected = np.radians(degrees) * np.arange(1, quads) / quads
    assert np.allclose(found % (2 * np.pi), expected, atol=2 * CLEAR)


def test_a_port_at_a_regular_vertex_is_a_cross() -> None:
    mesh = polygon_mesh(4, 5, np.pi / 4)
    aligned = aligned_field(mesh)
    mesh.port[0] = True
    tracing = laid_out(mesh, aligned)
    found = directions(tracing, 0, fan(tracing, half_edge_at(tracing, 0), 0))
    assert len(found) == 4
    assert np.abs(np.sin(2 * found)).max() < 4e-3  # clear of the vertices that lie exactly in the way


@pytest.mark.parametrize("n", [3, 5, 6])
def test_every_branch_crosses_a_spoke_one_way(n: int) -> None:
    mesh, aligned, centre = polygon_field(n, 4)
    tracing = laid_out(mesh, aligned)
    found = fan(tracing, half_edge_at(tracing, centre), 4 - n)
    gates = dict(found.gates)
    assert len(gates) == 2 * n
    for h, branches in gates.items():
        there = {(b + tracing.shift[h]) % 4 for b in range(4) if branches >> b & 1}
        back = {b for b in range(4) if gates[tracing.twin[h]] >> b & 1}
        assert len(there) == 2 and there.isdisjoint(back) and there | back == {0, 1, 2, 3}


def test_regular_boundary_vertices_are_passed_along_the_boundary() -> None:
    (mesh,) = background(square(), 0.2)
    tracing = laid_out(mesh, aligned_field(mesh))
    regular = [h for h, w in enumerate(tracing.wall) if w >= 0 and mesh.vertex[tracing.start[h]] < 0]
    assert regular
    for h in regular:
        star = tracing.star(h)
        along = tracing.wall[h]
        assert not tracing.gate[tracing.twin[star[1]]] >> along & 1
        assert tracing.gate[star[1]] >> ((along + tracing.shift[tracing.twin[star[1]]]) % 4) & 1


@pytest.mark.parametrize("index", [2, 3])
def test_an_index_without_room_is_an_error(index: int) -> None:
    (mesh,) = background(square(), 0.2)
    tracing = laid_out(mesh, aligned_field(mesh))
    corner = int(np.flatnonzero(mesh.vertex == 0)[0])
    with pytest.raises(LayoutError, match="no room"):
        fan(tracing, half_edge_at(tracing, corner), index)


def test_a_wrong_index_is_an_error() -> None:
    mesh, aligned, centre = polygon_field(5, 4)
    tracing = laid_out(mesh, aligned)
    with pytest.raises(LayoutError, match="does not have index"):
        fan(tracing, half_edge_at(tracing, centre), 1)


def test_edges_between_seeds_are_bisected() -> None:
    (mesh,) = background(square(), 0.2)
    aligned = aligned_field(mesh)
    seed = np.zeros(len(mesh.points), bool)
    seed[mesh.triangles[:4].ravel()] = True
    surface = SurfaceMesh(mesh.points, mesh.triangles)
    tracing = trace_mesh(mesh, surface, aligned, seed)
    m = len(tracing.start)
    assert not any(
        tracing.start[h] < len(seed)
        and seed[tracing.start[h]]
        and tracing.start[next_of(h)] < len(seed)
        and seed[tracing.start[next_of(h)]]
        for h in range(m)
    )
    for h in range(m):
        g = tracing.twin[h]
        if g >= 0:
            assert tracing.twin[g] == h
            assert tracing.start[g] == tracing.start[next_of(h)]
            assert (tracing.shift[h] + tracing.shift[g]) % 4 == 0
        else:
            a, b = mesh.points[mesh.boundary[tracing.row[h]]]
            low, high = tracing.span[h]
            assert np.allclose(tracing.points[tracing.start[h]], (1 - low) * a + low * b)
            assert np.allclose(tracing.points[tracing.start[next_of(h)]], (1 - high) * a + high * b)
    ex, ey = np.array(tracing.ex).reshape(-1, 3), np.array(tracing.ey).reshape(-1, 3)
    areas = 0.5 * (ex[:, 0] * -ey[:, 2] + ey[:, 0] * ex[:, 2])
    assert areas.min() > 0 and np.isclose(areas.sum(), surface.area.sum())


def test_a_misaligned_field_is_an_error() -> None:
    mesh = polygon_mesh(4, 4)
    field = field_of(mesh, np.full(len(midpoints(mesh)), 0.2))
    aligned = AlignedField(
        field,
        np.zeros(len(mesh.points), np.int64),
        np.zeros(1, np.int64),
        np.zeros(1),
        0.0,
        field,
        np.zeros_like(field.theta),
        np.zeros_like(field.theta),
    )
    with pytest.raises(LayoutError, match="aligned"):
        laid_out(mesh, aligned)
