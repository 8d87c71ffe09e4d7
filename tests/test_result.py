from dataclasses import replace

import numpy as np
import pytest

from gmsh_crossquad.block_layout import build_layout
from gmsh_crossquad.errors import MeshError
from gmsh_crossquad.quality import measure_quality, quad_quality, twins
from gmsh_crossquad.records import QuadMesh
from tests.models import annulus
from tests.results import NX, NY, hand_made, two_squares_mesh

UP = np.array([[0.0, 0.0, 1.0]] * 2)


def test_layout_of_a_grid():
    result = hand_made()
    layout = result.layout
    assert [b.face for b in layout.blocks] == [1, 1, 2, 2]
    assert {tuple(sorted(b.divisions)) for b in layout.blocks} == {tuple(sorted((NX, NY)))}
    # a grid of 2 x 2 blocks has 12 edges: 4 cut the squares in half or lie on the shared side
    assert len(layout.edges) == 12
    assert sum(e.curve is None for e in layout.edges) == 2
    assert sum(e.curve == 7 for e in layout.edges) == 2
    uses = np.bincount([e for b in layout.blocks for e, _ in b.sides], minlength=12)
    assert sorted(uses) == [1] * 8 + [2] * 4


def test_sides_of_a_block_form_a_counter_clockwise_loop():
    layout = hand_made().layout
    for block in layout.blocks:
        runs = [layout.edges[e].points[::sign] for e, sign in block.sides]
        for a, b in zip(runs, runs[1:] + runs[:1], strict=True):
            np.testing.assert_array_equal(a[-1], b[0])
        ring = np.concatenate([r[:-1] for r in runs])
        following = np.roll(ring, -1, axis=0)
        area = 0.5 * np.sum(ring[:, 0] * following[:, 1] - following[:, 0] * ring[:, 1])
        assert area == pytest.approx(0.5)
        assert tuple(layout.edges[e].divisions for e, _ in block.sides) == block.divisions * 2


def test_layout_does_not_depend_on_where_quads_start():
    mesh = two_squares_mesh()
    turned = np.array([np.roll(q, k % 4) for k, q in enumerate(mesh.quads)])
    layout = build_layout(replace(mesh, quads=turned), hand_made().stages.model)
    assert len(layout.edges) == 12
    assert {frozenset(e.nodes.tolist()) for e in layout.edges} == {frozenset(e.nodes.tolist()) for e in hand_made().layout.edges}


def test_block_that_is_no_grid_is_refused():
    mesh = two_squares_mesh()
    block = mesh.quad_block.copy()
    block[0] = 1  # block 0 loses a corner quad: five corners
    with pytest.raises(MeshError, match="not a grid"):
        build_layout(replace(mesh, quad_block=block), hand_made().stages.model)


def test_quality_of_squares_and_parallelograms():
    mesh = two_squares_mesh()
    quality = measure_quality(mesh, UP)
    assert (quality.quads, quality.blocks, quality.irregular, quality.inverted) == (4 * NX * NY, 4, 0, 0)
    assert quality.conforming
    assert quality.min_scaled_jacobian == pytest.approx(1.0)
    sheared = mesh.points.copy()
    sheared[:, 0] += sheared[:, 1] / np.tan(np.radians(50))
    quality = measure_quality(replace(mesh, points=sheared), UP)
    assert quality.min_scaled_jacobian == pytest.approx(np.sin(np.radians(50)))
    assert quality.mean_scaled_jacobian == pytest.approx(np.sin(np.radians(50)))


def test_quality_sees_a_fold_and_a_slit():
    mesh = two_squares_mesh()
    folded = mesh.points.copy()
    folded[mesh.face_nodes[0][0]] += (5.0, 0.0, 0.0)
    assert measure_quality(replace(mesh, points=folded), UP).inverted > 0
    slit = mesh.quads.copy()
    inner = mesh.face_nodes[0][0]
    first = np.flatnonzero((slit == inner).any(axis=1))[0]
    slit[first][slit[first] == inner] = len(mesh.points)
    cut = replace(mesh, quads=slit, points=np.vstack([mesh.points, mesh.points[inner]]))
    assert not measure_quality(cut, UP).conforming


def test_conformity_wants_equal_orientation_and_single_quads():
    mesh = two_squares_mesh()
    turned = mesh.quads.copy()
    turned[0] = turned[0][::-1]
    assert not measure_quality(replace(mesh, quads=turned), UP).conforming
    twice = {n: np.concatenate([getattr(mesh, n)] * 2) for n in ("quads", "quad_face", "quad_block")}
    assert not measure_quality(replace(mesh, **twice), UP).conforming
    other = mesh.quad_face.copy()
    other[0] = 1  # an inner edge between two faces
    assert not measure_quality(replace(mesh, quad_face=other), UP).conforming


def test_irregular_vertices_are_counted_inside_only():
    # three quads around a vertex: the hexagon
    angle = np.arange(6) * np.pi / 3
    points = np.vstack([np.c_[np.cos(angle), np.sin(angle), np.zeros(6)], np.zeros(3)])
    quads = np.array([[6, 0, 1, 2], [6, 2, 3, 4], [6, 4, 5, 0]])
    mesh = replace(
        two_squares_mesh(),
        points=points,
        quads=quads,
        quad_face=np.zeros(3, np.int64),
        quad_block=np.arange(3),
        vertex_node=np.array([0]),
        curve_nodes=(np.array([0, 1, 2, 3, 4, 5, 0]),),
    )
    quality = measure_quality(mesh, UP)
    assert quality.irregular == 1
    assert quality.conforming
    assert quality.min_scaled_jacobian == pytest.approx(np.sin(np.pi / 3))


def test_twins():
    quads = np.array([[0, 1, 4, 3], [1, 2, 5, 4]])
    twin = twins(quads)
    assert twin[1] == 7 and twin[7] == 1
    assert (np.delete(twin, [1, 7]) == -1).all()
    three = twins(np.array([[0, 1, 4, 3], [1, 2, 5, 4], [1, 6, 7, 4]]))
    assert three[1] == -2


def test_singularities_and_field_are_in_user_coordinates():
    result = hand_made()
    assert len(result.singularities) == 1
    spot = result.singularities[0]
    np.testing.assert_allclose(spot.point, [0.5, 0.5, 0.0], atol=1e-12)
    assert (spot.index, spot.valence, spot.face) == (1, 3, 1)
    for field in result.field:
        np.testing.assert_allclose(np.abs(field.directions), np.tile([1.0, 0.0, 0.0], (8, 1)), atol=1e-12)
        low, high = field.places.min(axis=0), field.places.max(axis=0)
        np.testing.assert_allclose(high - low, [1.0, 1.0, 0.0], atol=1e-12)


def test_a_ring_is_one_block_that_is_cut_once():
    # 12 x 3 quads around a hole; one CAD vertex on either circle, not opposite of each other
    model = annulus()
    n, rows = 12, 3
    r, a = np.meshgrid(np.linspace(0.4, 1.0, rows + 1), 2 * np.pi * np.arange(n) / n, indexing="ij")
    node = np.arange(n * (rows + 1)).reshape(rows + 1, n)
    after = np.roll(node, -1, axis=1)
    quads = np.stack([node[:-1], node[1:], after[1:], after[:-1]], axis=-1).reshape(-1, 4)
    circle = [np.append(node[k], node[k, 0]) for k in (rows, 0)]
    mesh = QuadMesh(
        points=np.stack([r * np.cos(a), r * np.sin(a), 0 * r], axis=-1).reshape(-1, 3),
        quads=quads,
        quad_face=np.zeros(len(quads), np.int64),
        quad_block=np.zeros(len(quads), np.int64),
        vertex_node=np.array([c[0] for c in circle]),
        curve_nodes=tuple(circle),
        curve_parameters=tuple(np.linspace(0, 1, n + 1) for _ in circle),
        face_nodes=(node[1:-1].ravel(),),
    )
    layout = build_layout(mesh, model)
    (block,) = layout.blocks
    assert sorted(block.divisions) == [rows, n]
    assert len(layout.edges) == 3
    (cut,) = [i for i, e in enumerate(layout.edges) if e.curve is None]
    assert sorted(sign for edge, sign in block.sides if edge == cut) == [-1, 1]
    assert layout.edges[cut].divisions == rows
    assert {int(layout.edges[cut].nodes[0]), int(layout.edges[cut].nodes[-1])} & set(mesh.vertex_node.tolist())


def rolled_up(n=12, rows=5):
    """A strip of n x rows quads on a tube of radius 1, not closed."""
    a, z = np.meshgrid(np.radians(20.0) * np.arange(n + 1), np.arange(rows + 1) / 3, indexing="ij")
    node = np.arange(a.size).reshape(a.shape)
    quads = np.stack([node[:-1, :-1], node[1:, :-1], node[1:, 1:], node[:-1, 1:]], axis=-1).reshape(-1, 4)
    outline = np.concatenate([node[:, 0], node[-1, 1:], node[-2::-1, -1], node[0, -2::-1]])
    return QuadMesh(
        points=np.stack([np.cos(a), np.sin(a), z], axis=-1).reshape(-1, 3),
        quads=quads,
        quad_face=np.zeros(len(quads), np.int64),
        quad_block=np.zeros(len(quads), np.int64),
        vertex_node=np.array([0]),
        curve_nodes=(outline,),
        curve_parameters=(np.linspace(0, 1, len(outline)),),
        face_nodes=(node[1:-1, 1:-1].ravel(),),
    )


CURVED = np.full((1, 3), np.nan)


def test_quads_of_a_curved_face_are_judged_by_themselves():
    quality = measure_quality(rolled_up(), CURVED)
    assert (quality.inverted, quality.irregular, quality.conforming) == (0, 0, True)
    assert quality.min_scaled_jacobian == pytest.approx(1.0)


def test_a_quad_that_lies_against_its_neighbours_is_inverted():
    mesh = rolled_up()
    x = mesh.points.reshape(13, 6, 3).copy()
    x[4:8, 2, 2] = 1.2  # part of one row of nodes beyond the next row, at z = 1: three quads turned over, two crossed
    quality = measure_quality(replace(mesh, points=x.reshape(-1, 3)), CURVED)
    assert quality.inverted == 5
    value = quad_quality(replace(mesh, points=x.reshape(-1, 3)), CURVED)
    turned = {(3 + i) * 5 + 2 for i in range(5)}
    assert set(np.flatnonzero(value <= 0).tolist()) == turned


def test_plane_and_curved_faces_in_one_mesh():
    mesh, tube = two_squares_mesh(), rolled_up()
    n = len(mesh.points)
    both = replace(
        mesh,
        points=np.vstack([mesh.points, tube.points]),
        quads=np.vstack([mesh.quads[:, ::-1], tube.quads + n]),
        quad_face=np.concatenate([mesh.quad_face, tube.quad_face + 2]),
        quad_block=np.concatenate([mesh.quad_block, tube.quad_block + 9]),
        curve_nodes=(*mesh.curve_nodes, tube.curve_nodes[0] + n),
    )
    value = quad_quality(both, np.vstack([UP, CURVED]))
    assert value[: len(mesh.quads)] == pytest.approx(-1.0)
    assert value[len(mesh.quads) :] == pytest.approx(1.0)
