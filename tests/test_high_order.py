"""Elements of order 2 and 3 on OCC models: nodes on the CAD, Jacobians positive."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import gmsh
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gmsh_crossquad.cad.high_order import raise_order
from gmsh_crossquad.cad.put import put_mesh
from gmsh_crossquad.errors import InputError, MeshError
from gmsh_crossquad.fill.high_order import GRID, high_order
from gmsh_crossquad.fill.jacobians import corner_jacobian, least_jacobian, quad_normals
from gmsh_crossquad.fill.pipeline import fill
from gmsh_crossquad.records import Bool, Float, Int, Model, QuadMesh
from gmsh_crossquad.surfaces import Planes

from .test_fill_surfaces import Round, ball, no_curve, ring, tube, uniform
from .test_put import mesh_of_plate, plate

LINES, QUADS = {2: 8, 3: 26}, {2: 10, 3: 36}


@pytest.fixture
def session() -> Iterator[None]:
    gmsh.initialize(readConfigFiles=False, interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    yield
    gmsh.finalize()


def shell(kind: str) -> int:
    """The curved face of an OCC sphere, cylinder or torus at the place of `test_fill_surfaces`' models, alone in the model."""
    occ = gmsh.model.occ
    x, y, z = 3.0, -2.0, 1.0
    if kind == "sphere":
        solid = occ.addSphere(x, y, z, 0.75)
    elif kind == "tube":
        solid = occ.addCylinder(x, y, z, 0, 0, 1.25, 0.5)
    else:
        solid = occ.addTorus(x, y, z, 0.75, 0.25)
    occ.synchronize()
    gmsh.model.removeEntities([(3, solid)])
    face = next(t for _, t in gmsh.model.getEntities(2) if gmsh.model.getType(2, t) != "Plane")
    others = [(2, t) for _, t in gmsh.model.getEntities(2) if t != face]
    gmsh.model.removeEntities(others)
    return face


def made(kind: str, k: int) -> tuple[Model, Round, QuadMesh]:
    """A mesh of the curved face, with the tags of the current Gmsh model."""
    face = shell(kind)
    if kind == "tube":
        model, surface, guide, evaluate = tube(6, 2)
        curves = [t for _, t in gmsh.model.getEntities(1) if gmsh.model.getType(1, t) == "Circle"]
        curves.sort(key=lambda t: gmsh.model.getBoundingBox(1, t)[2])
        vertex = [gmsh.model.getBoundary([(1, c)], combined=False)[0][1] for c in curves]
        angle = [replace(c, tag=t, parameters=2 * np.pi * c.parameters) for c, t in zip(model.curves, curves, strict=True)]
        model = replace(model, curves=tuple(angle), vertex_tags=np.array(vertex))
        mesh = fill(model, surface, guide, uniform(guide, k), lambda row, t: evaluate(row, t / (2 * np.pi)))
    else:
        model, surface, guide = ball(2) if kind == "sphere" else ring(8, 6)
        mesh = fill(model, surface, guide, uniform(guide, k), no_curve)
    return replace(model, faces=(replace(model.faces[0], tag=face),)), surface, mesh


def nodes_of(dim: int, tag: int) -> Float:
    return np.asarray(gmsh.model.mesh.getNodes(dim, tag, includeBoundary=True)[1]).reshape(-1, 3)


@pytest.mark.parametrize("order", [2, 3])
@pytest.mark.parametrize(("kind", "k"), [("tube", 1), ("tube", 3), ("sphere", 1), ("sphere", 2), ("torus", 1), ("torus", 2)])
def test_curved_faces(session: None, kind: str, k: int, order: int) -> None:
    model, surface, mesh = made(kind, k)
    put_mesh(model, mesh)
    assert raise_order(model, surface, mesh, order) == ()
    face = model.faces[0].tag
    types, tags, nodes = gmsh.model.mesh.getElements(2, face)
    assert types.tolist() == [QUADS[order]]
    assert len(tags[0]) == len(mesh.quads)
    inner = order - 1
    edges = (len(mesh.quads) * 4 + sum(len(c) - 1 for c in mesh.curve_nodes)) // 2
    assert len(np.unique(nodes[0])) == len(mesh.points) + inner * edges + inner**2 * len(mesh.quads)
    x = nodes_of(2, face)
    closest = np.asarray(gmsh.model.getClosestPoint(2, face, x.ravel())[0]).reshape(-1, 3)
    assert np.abs(closest - x).max() < 1e-9
    for curve in model.curves:
        x = nodes_of(1, curve.tag)
        assert np.abs(np.hypot(x[:, 0] - 3, x[:, 1] + 2) - 0.5).max() < 1e-14
        assert gmsh.model.mesh.getElements(1, curve.tag)[0].tolist() == [LINES[order]]
    for measure in ("minSJ", "minSICN", "minDetJac"):
        assert np.min(gmsh.model.mesh.getElementQualities(tags[0], measure)) > 0
    if kind != "tube":
        assert not len(gmsh.model.mesh.getDuplicateNodes())
        _, _, closed = gmsh.model.mesh.getElements(2, face)
        corners = np.sort(closed[0].reshape(len(mesh.quads), -1)[:, :4], axis=1)
        assert len(np.unique(corners, axis=0)) == len(mesh.quads)


@pytest.mark.parametrize("order", [2, 3])
def test_area_converges_with_the_order(session: None, order: int) -> None:
    """Integrated by Gmsh over the elements of a sphere: the points of both orders converge with h^4."""
    errors = []
    for k in (1, 2):
        gmsh.clear()
        model, surface, mesh = made("sphere", k)
        put_mesh(model, mesh)
        raise_order(model, surface, mesh, order)
        points, weights = gmsh.model.mesh.getIntegrationPoints(QUADS[order], "Gauss8")
        _, determinants, _ = gmsh.model.mesh.getJacobians(QUADS[order], points)
        errors.append(abs(np.sum(determinants.reshape(-1, len(weights)) @ weights) / (4 * np.pi * 0.75**2) - 1))
    assert errors[0] < 2e-3
    assert errors[0] > 14 * errors[1]


@pytest.mark.parametrize("kernel", ["occ", "geo"])
@pytest.mark.parametrize("order", [2, 3])
def test_plate_with_hole(session: None, kernel: str, order: int) -> None:
    plate(kernel)
    model, mesh = mesh_of_plate(1, 1)
    put_mesh(model, mesh)
    before = [gmsh.model.mesh.getElements(d, t)[1] for d, t in gmsh.model.getEntities()]
    assert raise_order(model, Planes(model), mesh, order) == ()
    after = [gmsh.model.mesh.getElements(d, t)[1] for d, t in gmsh.model.getEntities()]
    for a, b in zip(before, after, strict=True):
        assert [x.tolist() for x in a] == [x.tolist() for x in b]
    for curve in model.curves:
        tags, x, t = gmsh.model.mesh.getNodes(1, curve.tag)
        assert len(tags) == len(gmsh.model.mesh.getElements(1, curve.tag)[1][0]) * order - 1
        np.testing.assert_array_equal(gmsh.model.getValue(1, curve.tag, t), x)
    # new nodes of lines are at equal chord lengths
    _, _, line = gmsh.model.mesh.getElements(1, model.curves[-1].tag)
    for nodes in line[0].reshape(-1, order + 1)[:, [0, *range(2, order + 1), 1]]:
        p = np.array([gmsh.model.mesh.getNode(n)[0] for n in nodes])
        d = np.linalg.norm(np.diff(p, axis=0), axis=1)
        assert d == pytest.approx(d[0], rel=1e-2)
    _, tags, _ = gmsh.model.mesh.getElements(2, model.faces[0].tag)
    assert np.min(gmsh.model.mesh.getElementQualities(tags[0], "minSJ")) > 0
    group = {gmsh.model.getPhysicalName(d, t): (d, t) for d, t in gmsh.model.getPhysicalGroups()}
    nodes, _ = gmsh.model.mesh.getNodesForPhysicalGroup(*group["outline"])
    assert len(nodes) == order * sum(len(c) - 1 for c in mesh.curve_nodes)
    assert len(gmsh.model.mesh.getNodesForPhysicalGroup(*group["probe"])[0]) == 1


@dataclass(frozen=True)
class Flat:
    """The plane z = 0 as if it were a curved face."""

    curved: Bool

    def feet(self, face: Int, points: Float) -> Float:
        return points * [1, 1, 0]

    def normals(self, face: Int, points: Float) -> Float:
        return np.broadcast_to([0.0, 0.0, 1.0], points.shape)


@pytest.mark.parametrize("order", [2, 3])
def test_elements_that_turn_over_are_straightened(order: int) -> None:
    """A ring of 6 quads that is thinner than the bulge of its inner circle's edges: 1 - cos 30 degrees = .134 of the radius."""
    from .guides import ring as annulus

    model, guide, evaluate = annulus(6, 1, 0.8, 1.0)
    wide = fill(model, Planes(model), guide, uniform(guide, 1), evaluate)
    assert not high_order(model, Planes(model), wide, order, evaluate).notes
    flat = [n for n in range(len(wide.points)) if n not in wide.curve_nodes[0]]
    points = wide.points.copy()
    points[flat] *= 0.95 / np.linalg.norm(points[flat], axis=1, keepdims=True)

    def close(row: int, t: Float) -> Float:
        # the inner circle bulges as much as the outer one is straight: curve 0 is the hexagon of its nodes
        if row == 1:
            return evaluate(row, t) * (0.95 / 0.8)
        whole = np.floor(6 * t + 1e-9)
        u = (6 * t - whole)[:, None]
        return (1 - u) * evaluate(0, whole / 6) + u * evaluate(0, (whole + 1) / 6)

    thin = replace(wide, points=points)
    new = high_order(model, Planes(model), thin, order, close)
    assert len(new.notes) == 1 and "6 elements" in new.notes[0] and "6 of their edges (6 on curves)" in new.notes[0]
    x = np.concatenate([thin.points, new.points])
    p, grid = order, np.array(GRID[order])
    grids = np.empty((len(new.quads), p + 1, p + 1, 3))
    grids[:, grid[:, 0], grid[:, 1]] = x[new.quads]
    normals = quad_normals(thin.points[thin.quads])
    assert (least_jacobian(grids, normals, np.zeros(len(grids))) > 0).all()
    # not straighter than needed: an edge with twice the bulge is turned over
    inner = x[new.lines[1][:, 2:]]
    bulge = np.linalg.norm(inner.mean(axis=1), axis=1) - 0.95 * np.cos(np.pi / 6)
    assert (bulge > 0).all()


@pytest.mark.parametrize("order", [2, 3])
@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10_000), size=st.floats(0.0, 0.3))
def test_bound_on_the_jacobian(order: int, seed: int, size: float) -> None:
    """Never above the least of 41 x 41 samples of the Jacobian, and close to it; exact for a straight quad."""
    random = np.random.default_rng(seed)
    u = np.arange(order + 1) / order
    grid = np.stack([*np.meshgrid(u, u, indexing="ij"), np.zeros((order + 1, order + 1))], axis=-1)[None]
    grid = grid + size * np.concatenate([random.uniform(-1, 1, grid.shape[:-1] + (2,)), np.zeros((*grid.shape[:-1], 1))], axis=-1)
    normal = np.array([[0.0, 0.0, 1.0]])
    t = np.linspace(0, 1, 41)
    fit = np.linalg.inv(np.vander(u, increasing=True))
    value = np.vander(t, order + 1, increasing=True) @ fit
    slope = np.stack([k * t ** max(k - 1, 0) for k in range(order + 1)], axis=1) @ fit
    du = np.einsum("si,tj,ijc->stc", slope, value, grid[0])
    dv = np.einsum("si,tj,ijc->stc", value, slope, grid[0])
    true = np.cross(du, dv)[..., 2].min()
    (rough,) = least_jacobian(grid, normal, np.array([-np.inf]))
    (fine,) = least_jacobian(grid, normal, np.array([np.inf]))
    assert rough <= fine + 1e-12
    assert fine <= true + 1e-12
    spread = np.cross(du, dv)[..., 2].max() - true
    assert fine >= true - 0.35 * spread - 1e-9


def test_bound_of_a_straight_quad_is_that_of_its_corners() -> None:
    corner = np.array([[[0, 0, 0], [2, 0, 0], [1.5, 1, 0], [0, 1, 0.0]]])
    normals = quad_normals(corner)
    u = np.arange(3) / 2
    grid = np.einsum("i,j,c->ijc", 1 - u, 1 - u, corner[0, 0]) + np.einsum("i,j,c->ijc", u, 1 - u, corner[0, 1])
    grid += np.einsum("i,j,c->ijc", u, u, corner[0, 2]) + np.einsum("i,j,c->ijc", 1 - u, u, corner[0, 3])
    assert corner_jacobian(corner, normals) == pytest.approx(1.5)
    assert least_jacobian(grid[None], normals, np.zeros(1)) == pytest.approx(1.5)


def test_bad_input(session: None) -> None:
    model, surface, guide = ball(1)
    mesh = fill(model, surface, guide, uniform(guide, 2), no_curve)
    with pytest.raises(InputError, match="order 4"):
        high_order(model, surface, mesh, 4, no_curve)
    with pytest.raises(MeshError, match="two quads"):
        high_order(model, surface, replace(mesh, quads=mesh.quads[1:], quad_face=mesh.quad_face[1:]), 2, no_curve)
    with pytest.raises(MeshError, match="gap"):
        gap = replace(mesh, curve_nodes=(np.array([0, len(mesh.points) - 1]),), curve_parameters=(np.zeros(2),))
        high_order(model, surface, gap, 2, no_curve)
    assert raise_order(model, surface, mesh, 1) == ()


def test_order_of_another_mesh_is_refused(session: None) -> None:
    model, surface, mesh = made("torus", 1)
    put_mesh(model, mesh)
    finer = fill(model, surface, ring(8, 6)[2], uniform(ring(8, 6)[2], 2), no_curve)
    with pytest.raises(MeshError, match="not the one"):
        raise_order(model, surface, finer, 2)
