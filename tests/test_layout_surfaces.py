"""The layout of curved faces: patches, Euler characteristics, quantization, handles and turning, on analytic surfaces."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from gmsh_crossquad.errors import LayoutError
from gmsh_crossquad.field.pipeline import aligned_field
from gmsh_crossquad.field.smooth import from_angles
from gmsh_crossquad.field.surface_mesh import SurfaceMesh
from gmsh_crossquad.layout import bends, face_tmesh
from gmsh_crossquad.layout.alone import has_divisions
from gmsh_crossquad.layout.arc_bends import arc_bends
from gmsh_crossquad.layout.assemble import assemble
from gmsh_crossquad.layout.blocks import base_complex
from gmsh_crossquad.layout.branches import branch
from gmsh_crossquad.layout.chords import arc_divisions, find_chords
from gmsh_crossquad.layout.cuts import separation_cuts
from gmsh_crossquad.layout.divisions import BEND, chord_divisions, segments
from gmsh_crossquad.layout.face_tmesh import trace_face
from gmsh_crossquad.layout.glue import glue, uncut_euler
from gmsh_crossquad.layout.handles import handle_cuts, homology
from gmsh_crossquad.layout.quantize import quantize
from gmsh_crossquad.layout.quotient import quotient
from gmsh_crossquad.layout.trace import Growth
from gmsh_crossquad.layout.verify import problems
from gmsh_crossquad.records import AlignedField, CrossField, Curve, Face, FaceMesh, FaceTMesh, Float, Model, TMesh
from tests import models
from tests import surface_meshes as sm
from tests.surface_models import model_of

# with the Euler characteristic and the number of loops
SURFACES: dict[str, tuple[Callable[[], SurfaceMesh], int, int]] = {
    "octant": (lambda: sm.octant(10), 1, 1),
    "hemisphere": (lambda: sm.hemisphere(8), 1, 1),
    "sphere": (lambda: sm.sphere(6), 2, 0),
    "sphere without a cap": (lambda: sm.holed_sphere([], 0.18), 1, 1),
    "sphere with two holes": (lambda: sm.holed_sphere([(0.3 + 0.2j, 0.3)], 0.18), 0, 2),
    "sphere with three holes": (lambda: sm.holed_sphere([(0.6 + 0.2j, 0.3), (-0.6 - 0.1j, 0.25)], 0.18), -1, 3),
    "cylinder": (sm.cylinder, 0, 2),
    "frustum": (sm.frustum, 0, 2),
    "elbow": (lambda: sm.torus(np.pi / 2, cells=(12, 14)), 0, 2),
    "half torus": (lambda: sm.torus(np.pi, cells=(20, 14)), 0, 2),
    "torus": (lambda: sm.torus(cells=(24, 12)), 0, 0),
    "torus with a hole": (lambda: sm.torus(cells=(24, 12), holes=[(3, 7, 3, 6)]), -1, 1),
    "double torus": (lambda: sm.double_torus((20, 10)), -2, 0),
    "saddle": (lambda: sm.saddle(10), 1, 1),
    "bump": (lambda: sm.bump(12), 1, 1),
}


@cache
def traced(name: str) -> tuple[Model, FaceMesh, AlignedField, FaceTMesh, TMesh]:
    """Everything up to the glued T-mesh."""
    model, mesh = model_of(SURFACES[name][0]())
    aligned = aligned_field(mesh)
    tmesh = trace_face(mesh, aligned)
    return model, mesh, aligned, tmesh, glue(model, [mesh], [tmesh])


def check(mesh: FaceMesh, index: np.ndarray, tmesh: FaceTMesh) -> None:
    """What holds for every T-mesh: four sides, both sides of every arc, quads around every node, the Euler characteristic."""
    uses: Counter[tuple[int, int]] = Counter()
    quads = np.zeros(len(tmesh.position), np.int64)
    for patch in tmesh.patches:
        halves = [half for side in patch for half in side]
        assert len(patch) == 4 and all(patch)
        uses.update(halves)
        start = [int(tmesh.arcs[arc, 0 if way > 0 else 1]) for arc, way in halves]
        end = [int(tmesh.arcs[arc, 1 if way > 0 else 0]) for arc, way in halves]
        assert end == start[1:] + start[:1]
        corners = set(np.cumsum([0, *(len(side) for side in patch)])[:-1].tolist())
        for k, node in enumerate(start):
            quads[node] += 1 if k in corners else 2
    assert all(uses[arc, 1] == 1 for arc in range(len(tmesh.arcs)))
    assert all(uses[arc, -1] == (loop < 0) for arc, loop in enumerate(tmesh.loop))
    expected = np.where(tmesh.half_edge >= 0, 2, 4) - np.where(tmesh.vertex >= 0, index[tmesh.vertex], 0)
    assert quads.tolist() == expected.tolist()
    assert set(np.flatnonzero(index).tolist()) <= set(tmesh.vertex.tolist())
    assert len(tmesh.position) - len(tmesh.arcs) + len(tmesh.patches) == SurfaceMesh(mesh.points, mesh.triangles).euler
    for (a, b), line in zip(tmesh.arcs, tmesh.polyline):
        assert np.array_equal(line[[0, -1]], tmesh.position[[a, b]])
        assert np.linalg.norm(np.diff(line, axis=0), axis=1).min() > 0


@pytest.mark.parametrize("name", SURFACES)
def test_all_patches_have_four_sides(name: str) -> None:
    _, mesh, aligned, tmesh, whole = traced(name)
    check(mesh, aligned.index, tmesh)
    assert whole.euler.tolist() == [SURFACES[name][1]]
    assert len(whole.loops) == SURFACES[name][2]


@pytest.mark.parametrize("blocks", [0.1, 1.0, 6.0])
@pytest.mark.parametrize("name", SURFACES)
def test_the_quantized_layout_is_valid(name: str, blocks: float) -> None:
    model, _, _, _, tmesh = traced(name)
    divisions = quantize(model, tmesh, np.maximum(blocks * tmesh.length / tmesh.length.max(), 0.01)).divisions
    assert problems(model, tmesh, quotient(tmesh, 3 * divisions)) == []


@pytest.mark.parametrize("name", SURFACES)
def test_no_guide_cell_turns_much(name: str) -> None:
    model, _, _, _, tmesh = traced(name)
    coarse = quantize(model, tmesh, tmesh.length).divisions
    chords = find_chords(tmesh, quotient(tmesh, coarse))
    found = chord_divisions(model, tmesh, coarse, chords, *[np.full(len(tmesh.length), 1.0)] * 2)
    guide = arc_divisions(chords, found.guide)
    complex_ = quotient(tmesh, guide)
    assert problems(model, tmesh, complex_) == []
    assert segments(model, tmesh, coarse, chords).bend.max(initial=0.0) <= BEND * found.guide.max()
    # evenly divided segments need not turn evenly
    assert segments(model, tmesh, guide, find_chords(tmesh, complex_)).bend.max(initial=0.0) < 1.5 * BEND


def test_octant_is_three_patches_around_one_node() -> None:
    _, _, aligned, tmesh, whole = traced("octant")
    assert len(tmesh.patches) == 3
    (centre,) = np.flatnonzero((tmesh.half_edge < 0) & (tmesh.index != 0)).tolist()
    assert whole.quads_at[0, int(np.flatnonzero(np.all(whole.position == tmesh.position[centre], axis=1))[0])] == 3
    assert (aligned.index != 0).sum() == 4


@pytest.mark.parametrize(("name", "patches"), [("cylinder", 1), ("frustum", 1), ("saddle", 1)])
def test_what_bends_one_way_is_not_divided(name: str, patches: int) -> None:
    assert len(traced(name)[3].patches) == patches


def test_a_tube_is_cut_from_loop_to_loop() -> None:
    model, _, _, tmesh, whole = traced("cylinder")
    (cut,) = np.flatnonzero(tmesh.loop < 0).tolist()
    assert set(whole.curve[tmesh.arcs[cut]].tolist()) <= {-1, 0, 1}
    assert {int(tmesh.half_edge[n]) >= 0 for n in tmesh.arcs[cut].tolist()} == {True}
    z = tmesh.polyline[cut][:, 2] * model.scale
    assert abs(abs(z[-1] - z[0]) - 2.0) < 1e-9 and np.all(np.diff(z) * np.sign(z[-1] - z[0]) > 0)
    assert abs(tmesh.length[cut] * model.scale - 2.0) < 1e-3


@pytest.mark.parametrize("name", ["elbow", "half torus", "torus", "sphere with two holes"])
def test_no_patch_wraps_around_in_both_directions(name: str) -> None:
    tmesh = traced(name)[3]
    for patch in tmesh.patches:
        lines = [np.concatenate([tmesh.polyline[arc][::way] for arc, way in side]) for side in patch]
        turn = [bends.turning(*bends.resampled([line], np.array([12]))).sum() for line in lines]
        both = sorted([0.5 * (turn[0] + turn[2]), 0.5 * (turn[1] + turn[3])])
        assert both[0] < bends.CROSS_TURN or both[1] < bends.LONG_TURN


def test_dividing_keeps_the_traces_there_were(monkeypatch: pytest.MonkeyPatch) -> None:
    _, mesh, aligned, tmesh, _ = traced("half torus")
    monkeypatch.setattr(bends, "LONG_TURN", 100.0)
    whole = trace_face(mesh, aligned)
    check(mesh, aligned.index, whole)
    assert len(whole.patches) == 1 < len(tmesh.patches)
    old = whole.polyline[int(np.flatnonzero(whole.loop < 0)[0])]
    assert {tuple(p) for p in old} <= {tuple(p) for line in tmesh.polyline for p in line}


@pytest.mark.parametrize(
    "surface",
    [
        sm.torus(0.40637838682287164, (1.0, 0.6206820981360709), (20, 11)),
        sm.torus(cells=(16, 10), holes=[(3, 5, 1, 3)]),
    ],
)
def test_many_branches_close_to_one_another(surface: SurfaceMesh, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bends, "LONG_TURN", np.radians(60.0))
    monkeypatch.setattr(bends, "CROSS_TURN", np.radians(15.0))
    monkeypatch.setattr(bends, "SPREAD", np.radians(5.0))
    _, mesh = model_of(surface)
    aligned = aligned_field(mesh)
    tmesh = trace_face(mesh, aligned)
    check(mesh, aligned.index, tmesh)
    assert (tmesh.vertex < 0).sum() > 10


def test_a_branch_without_an_end_leaves_no_trace(monkeypatch: pytest.MonkeyPatch) -> None:
    _, mesh, aligned, _, _ = traced("half torus")
    grown: list[Growth] = []
    monkeypatch.setattr(face_tmesh, "Divider", lambda _, growth: grown.append(growth) or Idle())
    whole = trace_face(mesh, aligned)
    (growth,) = grown
    chords = {t: list(found) for t, found in growth.chords.items()}
    limit, growth.max_steps = growth.max_steps, 1
    assert not branch(growth, 0, 8, True)
    assert len(growth.traces) == 1 and {t: c for t, c in growth.chords.items() if c} == chords
    growth.max_steps = limit
    assert branch(growth, 0, 9, True) and len(growth.traces) == 2
    surface = SurfaceMesh(mesh.points, mesh.triangles)
    seeds = np.unique([trace.seed for trace in growth.traces]).tolist()
    tmesh, _ = assemble(mesh, surface, aligned, growth.mesh, seeds, growth.traces)
    check(mesh, aligned.index, tmesh)
    assert len(tmesh.patches) == len(whole.patches) + 1


class Idle:
    """Divides nothing."""

    def divide(self, *_: object) -> bool:
        return False


@pytest.mark.parametrize("model", [models.annulus(), models.l_shape(), models.disc()])
def test_a_plane_face_given_in_space_has_the_layout_that_it_has_in_the_plane(model: Model) -> None:
    (mesh,) = models.background(model, 0.08)
    aligned = aligned_field(mesh)
    q, _ = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))
    axes = np.stack([q[0], q[1]])
    one, two = trace_face(mesh, aligned), trace_face(replace(mesh, points=mesh.points @ axes), aligned)
    assert one.patches == two.patches and np.array_equal(one.arcs, two.arcs)
    assert np.allclose(one.position @ axes, two.position, atol=1e-9)


# -- closed faces ----------------------------------------------------------------------------------------------------------


def along_the_parallels(mesh: FaceMesh, tube: float, turn: float) -> CrossField:
    """A field at an angle `turn` from the parallels of a torus about z."""
    surface = SurfaceMesh(mesh.points, mesh.triangles)
    a, b = mesh.points[surface.edges].transpose(1, 0, 2)
    x, edge = 0.5 * (a + b), b - a
    r = np.hypot(x[:, 0], x[:, 1])
    far = np.hypot(mesh.points[:, 0], mesh.points[:, 1]).max()
    east = np.stack([-x[:, 1], x[:, 0], 0 * r], axis=1) / r[:, None]
    out = x * np.array([1.0, 1.0, 0.0]) / r[:, None]
    normal = x - (far - tube) * out
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    north = np.cross(normal, east)
    return from_angles(surface, turn - np.arctan2((edge * north).sum(axis=1), (edge * east).sum(axis=1)))


@pytest.mark.parametrize("turn", [0.0, 0.3, np.pi / 4])
@pytest.mark.parametrize("tube", [0.4, 0.2])
def test_torus_with_a_field_in_any_direction(tube: float, turn: float) -> None:
    model, mesh = model_of(sm.torus(radii=(1.0, tube), cells=(24, 12)))
    aligned = aligned_field(mesh, along_the_parallels(mesh, tube / model.scale, turn))
    assert not aligned.index.any()
    tmesh = trace_face(mesh, aligned)
    check(mesh, aligned.index, tmesh)
    whole = glue(model, [mesh], [tmesh])
    for blocks in (0.1, 2.0):
        divisions = quantize(model, whole, blocks * whole.length / whole.length.max()).divisions
        complex_ = quotient(whole, 3 * divisions)
        assert problems(model, whole, complex_) == []


def test_a_torus_without_singularities_is_one_block() -> None:
    model, mesh = model_of(sm.torus(cells=(24, 12)))
    whole = glue(model, [mesh], [trace_face(mesh, aligned_field(mesh, along_the_parallels(mesh, 0.4 / model.scale, 0.0)))])
    complex_ = quotient(whole, 3 * quantize(model, whole, whole.length / whole.length.max()).divisions)
    no_edges, n = np.zeros((0, 2), np.int64), complex_.n_vertices
    block, separators = base_complex(complex_.quads, np.zeros(len(complex_.quads), np.int64), no_edges, n, np.zeros(n, bool))
    assert block.max() == 0
    # two closed lines through one vertex cut the torus open
    use = np.bincount(separators.ravel(), minlength=n)
    assert sorted(np.unique(use).tolist()) == [0, 2, 4] and (use == 4).sum() == 1


@pytest.mark.parametrize(
    ("name", "classes"),
    [("octant", 0), ("sphere", 0), ("cylinder", 1), ("sphere with three holes", 2), ("torus", 2), ("double torus", 4)],
)
def test_homology_has_its_rank_and_cancels_around_patches(name: str, classes: int) -> None:
    model, _, _, _, tmesh = traced(name)
    bits = homology(model, tmesh)
    combined = 0
    for value in bits.values():
        combined |= value
    assert combined.bit_count() == classes
    for patch in tmesh.patches:
        total = 0
        for side in patch:
            for arc, _ in side:
                total ^= bits.get(arc, 0)
        assert total == 0


def test_a_torus_without_any_division_is_cut_at_its_handles() -> None:
    model, _, _, _, tmesh = traced("torus")
    nothing = quotient(tmesh, np.zeros(len(tmesh.length), np.int64))
    assert separation_cuts(tmesh, nothing) == []
    cuts = handle_cuts(tmesh, nothing, homology(model, tmesh))
    assert len(cuts) >= 2 and all(bound == 1 for cut in cuts for _, bound in cut.options)
    fine = quantize(model, tmesh, 20.0 * tmesh.length).divisions
    assert handle_cuts(tmesh, quotient(tmesh, fine), homology(model, tmesh)) == []


def test_a_closed_face_that_cannot_be_divided_is_an_error_without_a_loop(monkeypatch: pytest.MonkeyPatch) -> None:
    from gmsh_crossquad.layout import alone

    model, mesh, aligned, tmesh, _ = traced("torus")
    assert has_divisions(model, mesh, tmesh)
    monkeypatch.setattr(alone, "has_divisions", lambda *_: False)
    monkeypatch.setattr(alone, "alternatives", lambda *_, **__: [])
    with pytest.raises(LayoutError, match="no layout of the cross field has integer divisions, surface 1 at"):
        alone.divisible(model, mesh, aligned, tmesh, np.zeros(0, np.int64))


# -- seams -----------------------------------------------------------------------------------------------------------------


def tube_with_a_kept_seam(nu: int = 16, nv: int = 6) -> tuple[Model, FaceMesh]:
    """A cylinder cut open along a curve from loop to loop, which its only loop uses twice."""
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, nu + 1), np.linspace(0.0, 2.0, nv + 1), indexing="ij")
    points = np.stack([np.cos(u), np.sin(u), v], axis=2).reshape(-1, 3)
    row = np.arange((nu + 1) * (nv + 1)).reshape(nu + 1, nv + 1)
    a, b, c, d = (x.ravel() for x in (row[:-1, :-1], row[1:, :-1], row[1:, 1:], row[:-1, 1:]))
    lines = [row[:, 0], row[-1], row[::-1, -1], row[0, ::-1]]  # around the face
    curves, use = [], [(0, 1), (2, 1), (1, -1), (2, -1)]
    for c_, (start, end, rows) in enumerate([(0, 0, row[:, 0]), (1, 1, row[:, -1]), (0, 1, row[0])]):
        s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points[rows], axis=0), axis=1))])
        curves.append(Curve(c_ + 1, start, end, points[rows], np.linspace(0, 1, len(rows)), s))
    arclength: list[Float] = []
    for (curve, sign), line in zip(use, lines):
        s = curves[curve].arclength[::sign]
        assert len(s) == len(line)
        arclength.append(np.stack([s[:-1], s[1:]], axis=1))
    vertex = np.full(len(points), -1, np.int64)
    vertex[row[[0, -1], 0]], vertex[row[[0, -1], -1]] = 0, 1
    mesh = FaceMesh(
        face=0,
        points=points,
        triangles=np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)]),
        boundary=np.concatenate([np.stack([line[:-1], line[1:]], axis=1) for line in lines]),
        boundary_curve=np.concatenate([np.full(len(line) - 1, curve) for (curve, _), line in zip(use, lines)]),
        boundary_arclength=np.concatenate(arclength),
        vertex=vertex,
        opening_angle=np.where(vertex >= 0, np.pi / 2, np.nan),
        port=np.zeros(len(points), bool),
    )
    vertices = points[[row[0, 0], row[0, -1]]]
    face = Face(1, np.zeros(3), np.eye(3), (tuple(use),))
    return Model("tube", np.zeros(3), 1.0, np.array([1, 2]), vertices, np.zeros(2, bool), tuple(curves), (face,)), mesh


def test_a_seam_that_is_kept_is_like_a_crack() -> None:
    model, mesh = tube_with_a_kept_seam()
    assert uncut_euler(mesh) == 0
    aligned = aligned_field(mesh)
    tmesh = trace_face(mesh, aligned)
    check(mesh, aligned.index, tmesh)
    whole = glue(model, [mesh], [tmesh])
    assert {n: q for (_, n), q in whole.quads_at.items()} == {0: 2, 1: 2}
    divisions = quantize(model, whole, whole.length / 0.5).divisions
    assert problems(model, whole, quotient(whole, 3 * divisions)) == []


# -- turning ---------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("angle", [0.5, 2.0, 6.0])
def test_turning_of_a_circular_arc(angle: float) -> None:
    model, _, _, _, tmesh = traced("cylinder")
    (cut,) = np.flatnonzero(tmesh.arc_curve < 0).tolist()
    t = np.linspace(0, angle, 200)
    lines = list(tmesh.polyline)
    lines[cut] = np.stack([np.cos(t), np.sin(t), 0 * t], axis=1)
    total = arc_bends(model, replace(tmesh, polyline=tuple(lines)))[cut]
    assert np.allclose(total, np.linspace(0, angle, len(total)), atol=1e-3)


def test_the_middle_of_a_side_is_in_its_bend() -> None:
    t = np.linspace(0, np.pi, 60)
    bent = np.stack([np.sin(t), 1 - np.cos(t), 0 * t], axis=1)
    line = np.concatenate([[[-8.0, 0, 0]], bent])
    assert bends.middle(line) > 8.0
    assert np.isclose(bends.middle(np.array([[0.0, 0, 0], [1, 0, 0], [4, 0, 0]])), 2.0)
    assert np.isclose(bends.middle(bent), 0.5 * np.linalg.norm(np.diff(bent, axis=0), axis=1).sum(), rtol=1e-6)
