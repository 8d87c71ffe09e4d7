"""Fill of guide grids on curved faces: tube, sphere, torus, and a plane face beside a curved one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from gmsh_crossquad.errors import InputError, MeshError
from gmsh_crossquad.fill.area_loss import followed
from gmsh_crossquad.fill.coons import surface_quality
from gmsh_crossquad.fill.curve_edges import chords_to_divide, graded
from gmsh_crossquad.fill.curve_fit import curve_fit
from gmsh_crossquad.fill.numbering import guide_chords
from gmsh_crossquad.fill.pipeline import fill, poor_cells
from gmsh_crossquad.quality import twins
from gmsh_crossquad.records import Bool, Curve, Face, Float, Guide, Int, Model, QuadMesh
from gmsh_crossquad.surfaces import Planes

ORIGIN, SCALE = np.array([3.0, -2.0, 1.0]), 2.5
"""Of all models here."""

Evaluate = Callable[[int, Float], Float]


@dataclass(frozen=True)
class Round:
    """Faces that are all points at distance `radius` from a core (sphere: a point, tube: the z axis, torus: a circle of radius
    `ring` in z = 0); face 1, if there is one, is plane."""

    kind: str
    radius: float
    ring: float = 0.0
    curved: Bool = field(default_factory=lambda: np.array([True]))

    def core(self, points: Float) -> Float:
        if self.kind == "sphere":
            return np.zeros_like(points)
        if self.kind == "tube":
            return points * [0, 0, 1]
        flat = points * [1, 1, 0]
        return self.ring * flat / np.linalg.norm(flat, axis=1, keepdims=True)

    def feet(self, face: Int, points: Float) -> Float:
        assert self.curved[face].all()
        core = self.core(points)
        away = points - core
        return core + self.radius * away / np.linalg.norm(away, axis=1, keepdims=True)

    def normals(self, face: Int, points: Float) -> Float:
        away = points - self.core(points)
        out = away / np.linalg.norm(away, axis=1, keepdims=True)
        out[~self.curved[face]] = [0, 1, 0]
        return out


def no_curve(row: int, t: Float) -> Float:
    raise AssertionError("there is no curve")


def model_of(curves: tuple[Curve, ...], vertices: Float, faces: int = 1) -> Model:
    loops = tuple(((c, 1),) for c in range(len(curves)))
    round_face = Face(1, np.zeros(3), np.eye(3), loops)
    return Model(
        "test",
        ORIGIN,
        SCALE,
        np.arange(1, len(vertices) + 1),
        vertices,
        np.zeros(len(vertices), bool),
        curves,
        (round_face,) * faces,
    )


def guide_of(points: Float, quads: Int, chains: tuple[Int, ...] = (), turn: Float | None = None) -> Guide:
    """A guide whose chains are closed curves with evenly spaced vertices, the first a CAD vertex."""
    curve, s, cad = np.full(len(points), -1), np.zeros(len(points)), np.full(len(points), -1)
    for row, chain in enumerate(chains):
        curve[chain[1:-1]] = row
        if turn is not None:
            s[chain[1:-1]] = turn[1:-1]
        cad[chain[0]] = row
    zero = np.zeros(len(quads), np.int64)
    return Guide(points, curve, s, cad >= 0, cad, quads, zero, np.arange(len(quads)), np.ones((len(quads), 2)), chains)


def tube(n: int, layers: int, radius: float = 0.2, height: float = 0.5) -> tuple[Model, Round, Guide, Evaluate]:
    """A tube around z with n x layers guide quads; both ends are circles with a CAD vertex at angle 0."""
    t = np.linspace(0, 1, 361)
    rings = [np.stack([radius * np.cos(2 * np.pi * t), radius * np.sin(2 * np.pi * t), 0 * t + z], 1) for z in (0, height)]
    curves = tuple(Curve(k + 1, k, k, p, t, 2 * np.pi * radius * t) for k, p in enumerate(rings))
    a = 2 * np.pi * np.arange(n) / n
    z = np.linspace(0, height, layers + 1)
    xyz = np.stack(np.broadcast_arrays(radius * np.cos(a), radius * np.sin(a), z[:, None]), axis=-1).reshape(-1, 3)
    g = np.arange(n * (layers + 1)).reshape(layers + 1, n)
    g = np.concatenate([g, g[:, :1]], axis=1)
    quads = np.stack([g[:-1, :-1], g[:-1, 1:], g[1:, 1:], g[1:, :-1]], axis=2).reshape(-1, 4)
    guide = guide_of(xyz, quads, (g[0], g[-1]), 2 * np.pi * radius * np.arange(n + 1) / n)

    def evaluate(row: int, t: Float) -> Float:
        p = np.stack([radius * np.cos(2 * np.pi * t), radius * np.sin(2 * np.pi * t), 0 * t + row * height], axis=1)
        return p * SCALE + ORIGIN

    return model_of(curves, np.array([p[0] for p in rings])), Round("tube", radius), guide, evaluate


def ball(n: int, radius: float = 0.3) -> tuple[Model, Round, Guide]:
    """A sphere as a cube with n x n guide quads per side: no curve, no vertex."""
    u = np.tan(np.pi / 4 * np.linspace(-1, 1, n + 1))
    x, y = np.meshgrid(u, u, indexing="ij")
    square = np.stack([x, y, np.ones_like(x)], axis=-1)
    sides = [square @ turn for turn in _cube_turns()]
    points = np.concatenate([s.reshape(-1, 3) for s in sides])
    points = radius * points / np.linalg.norm(points, axis=1, keepdims=True)
    _, first, same = np.unique(np.round(points, 9), axis=0, return_index=True, return_inverse=True)
    g = same.reshape(6, n + 1, n + 1)
    quads = np.stack([g[:, :-1, :-1], g[:, 1:, :-1], g[:, 1:, 1:], g[:, :-1, 1:]], axis=-1).reshape(-1, 4)
    return model_of((), np.zeros((0, 3))), Round("sphere", radius), guide_of(points[first], quads)


def _cube_turns() -> list[Float]:
    """Six rotations that take the side z = 1 of a cube to all its sides."""
    x = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]], float)
    y = np.array([[0, 0, -1], [0, 1, 0], [1, 0, 0]], float)
    return [np.eye(3), x, x @ x, x @ x @ x, y, y.T]


def ring(n: int, m: int) -> tuple[Model, Round, Guide]:
    """A torus with n x m guide quads."""
    a, b = np.meshgrid(2 * np.pi * np.arange(n) / n, 2 * np.pi * np.arange(m) / m, indexing="ij")
    d = 0.3 + 0.1 * np.cos(b)
    points = np.stack([d * np.cos(a), d * np.sin(a), 0.1 * np.sin(b)], axis=-1).reshape(-1, 3)
    g = np.arange(n * m).reshape(n, m)
    i, j = np.roll(g, -1, axis=0), np.roll(g, -1, axis=1)
    quads = np.stack([g, i, np.roll(i, -1, axis=1), j], axis=-1).reshape(-1, 4)
    return model_of((), np.zeros((0, 3))), Round("torus", 0.1, 0.3), guide_of(points, quads)


def off_surface(mesh: QuadMesh, surface: Round) -> float:
    p = (mesh.points - ORIGIN) / SCALE
    return float(np.abs(np.linalg.norm(p - surface.core(p), axis=1) - surface.radius).max())


def quality(mesh: QuadMesh, surface: Round) -> Float:
    """Least sine of the corners of every quad against its own area vector, on the side of the normal."""
    p = (mesh.points[mesh.quads] - ORIGIN) / SCALE
    area = np.cross(p[:, 2] - p[:, 0], p[:, 3] - p[:, 1])
    side = np.sum(area * surface.normals(np.zeros(len(p), int), p.mean(axis=1)), axis=1)
    area *= (np.sign(side) / np.linalg.norm(area, axis=1))[:, None]
    e, f = np.roll(p, -1, axis=1) - p, np.roll(p, 1, axis=1) - p
    out: Float = (np.cross(e, f) * area[:, None]).sum(-1) / np.linalg.norm(e, axis=2) / np.linalg.norm(f, axis=2)
    return out.min(axis=1)


def uniform(guide: Guide, k: int) -> Int:
    return np.full(guide_chords(guide.quads)[3], k)


@pytest.mark.parametrize(("n", "layers", "k"), [(8, 1, 1), (8, 2, 3), (12, 3, 20), (6, 1, 7)])
def test_tube_is_filled_with_rectangles(n: int, layers: int, k: int) -> None:
    model, surface, guide, evaluate = tube(n, layers)
    mesh = fill(model, surface, guide, uniform(guide, k), evaluate)
    assert off_surface(mesh, surface) < 1e-15
    assert len(mesh.quads) == n * layers * k * k
    assert quality(mesh, surface).min() == pytest.approx(1.0, abs=1e-5)
    p = (mesh.points[mesh.quads] - ORIGIN) / SCALE
    area = 0.5 * np.linalg.norm(np.cross(p[:, 2] - p[:, 0], p[:, 3] - p[:, 1]), axis=1)
    # a prism of n k sides; the cubics of chords are even to 1 %
    assert area == pytest.approx(2 * 0.2 * np.sin(np.pi / (n * k)) * 0.5 / (layers * k), rel=0.015)
    assert area.sum() == pytest.approx(2 * 0.2 * np.sin(np.pi / (n * k)) * 0.5 * n * k, rel=1e-3)


@pytest.mark.parametrize(("n", "k"), [(1, 8), (2, 1), (2, 4), (3, 9)])
def test_sphere_without_curves(n: int, k: int) -> None:
    model, surface, guide = ball(n)
    assert len(guide.points) == 6 * n * n + 2
    mesh = fill(model, surface, guide, uniform(guide, k), no_curve)
    assert off_surface(mesh, surface) < 1e-15
    assert len(mesh.points) == 6 * (n * k) ** 2 + 2  # Euler: V - E + F = 2 with E = 2 F
    assert (twins(mesh.quads) >= 0).all()
    # on the sphere the angles at a corner of the cube are 120 degrees, in the flat quads a little less
    assert quality(mesh, surface).min() > np.sin(np.pi * 2 / 3)
    assert np.array_equal(np.sort(mesh.face_nodes[0]), np.arange(len(mesh.points)))


def test_torus_without_curves() -> None:
    model, surface, guide = ring(12, 8)
    mesh = fill(model, surface, guide, uniform(guide, 5), no_curve)
    assert off_surface(mesh, surface) < 1e-15
    assert len(mesh.points) == len(mesh.quads) == 12 * 8 * 25
    assert (twins(mesh.quads) >= 0).all()
    assert quality(mesh, surface).min() > 0.97


def test_vertices_beside_the_surface_are_put_on_it() -> None:
    model, surface, guide = ball(2)
    moved = replace(guide, points=guide.points * (1 + 0.05 * np.sin(np.arange(len(guide.points))))[:, None])
    mesh = fill(model, surface, moved, uniform(guide, 3), no_curve)
    assert off_surface(mesh, surface) < 1e-15
    want = fill(model, surface, guide, uniform(guide, 3), no_curve)
    np.testing.assert_allclose(mesh.points, want.points, atol=1e-14)


def test_a_rotation_of_the_guide_rotates_the_mesh() -> None:
    model, surface, guide = ball(2)
    c, s = np.cos(0.7), np.sin(0.7)
    turn = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) @ np.array([[1, 0, 0], [0, c, s], [0, -s, c]])
    a = fill(model, surface, guide, uniform(guide, 4), no_curve)
    b = fill(model, surface, replace(guide, points=guide.points @ turn), uniform(guide, 4), no_curve)
    np.testing.assert_allclose((a.points - ORIGIN) @ turn, b.points - ORIGIN, atol=1e-13)


def test_guide_quads_seen_from_behind_are_counted() -> None:
    model, surface, guide = ball(2)
    mesh = fill(model, surface, replace(guide, quads=guide.quads[:, ::-1].copy()), uniform(guide, 2), no_curve)
    assert quality(mesh, surface).max() < 0
    assert mesh.notes == ("24 inverted guide quads were filled as they are",)


def test_a_cell_that_folds_is_named() -> None:
    """The outermost vertex of one guide quad of a tube is moved over its neighbours on the surface: the quads beside it fold."""
    model, surface, guide, evaluate = tube(8, 4)
    assert [len(r) for r in poor_cells(model, surface, guide, uniform(guide, 4), evaluate)] == [0, 0]
    p = guide.points.copy()
    p[8 * 2 + 3] = p[8 * 2 + 4] * [1, 1, 0] + [0, 0, 0.05]
    poor, folded = poor_cells(model, surface, replace(guide, points=p), uniform(guide, 4), evaluate)
    moved = np.flatnonzero((guide.quads == 8 * 2 + 3).any(axis=1))
    assert len(folded) and np.isin(folded, moved).any()
    assert np.isin(folded, poor).all()


def test_a_thin_cell_under_a_bent_curve_is_refused() -> None:
    """Three cells around the end of a tube whose next layer is so close that the straightened guide edges cross the circle."""
    model, surface, guide, evaluate = tube(8, 2)
    p = guide.points.copy()
    # the middle layer runs in waves: its vertices alternate between both ends of the tube
    p[8:16, 2] = np.where(np.arange(8) % 2, 0.499, 0.001)
    wavy = replace(guide, points=p)
    mesh = fill(model, surface, wavy, uniform(guide, 6), evaluate)
    assert quality(mesh, surface).min() > 0
    assert off_surface(mesh, surface) < 1e-15


def test_faces_of_both_kinds() -> None:
    """A tube's quads of one half belong to a plane face's record: filled in that plane, the others on the tube."""
    model, surface, _, _ = tube(4, 1)
    flat = Face(2, np.array([0.0, 0.1, 0.0]), np.array([[0.0, 0, 1], [1.0, 0, 0]]), ())
    both = replace(model, faces=(model.faces[0], flat), curves=())
    # the sheet: one guide quad in the plane y = .1 beside a strip of the tube, both with straight chains
    a = np.radians(30)  # where the tube has y = .1
    x = 0.2 * np.cos(a)
    points = np.array([[x, 0.1, 0], [x, 0.1, 0.5], [-x, 0.1, 0.5], [-x, 0.1, 0], [0, 0.2, 0], [0, 0.2, 0.5]])
    ends = [(0, 1), (3, 2), (0, 4), (4, 3), (1, 5), (5, 2), (0, 3), (1, 2)]
    t = np.linspace(0, 1, 91)
    curves, shapes = [], []
    for i, (p, q) in enumerate(ends):
        samples = points[p] + t[:, None] * (points[q] - points[p])
        if 2 <= i < 6:
            angle = np.arctan2(points[p, 1], points[p, 0]) * (1 - t) + np.arctan2(points[q, 1], points[q, 0]) * t
            samples = np.stack([0.2 * np.cos(angle), 0.2 * np.sin(angle), 0 * t + points[p, 2]], axis=1)
        s = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(samples, axis=0), axis=1))])
        curves.append(Curve(i + 1, p, q, samples, t, s))
        shapes.append(samples)
    both = replace(both, curves=tuple(curves), vertices=points, vertex_tags=np.arange(1, 7), vertex_ports=np.zeros(6, bool))
    guide = replace(
        guide_of(points, np.array([[0, 4, 5, 1], [4, 3, 2, 5], [0, 1, 2, 3]])),
        cad_vertex=np.arange(6),
        fixed=np.ones(6, bool),
        quad_face=np.array([0, 0, 1]),
        chains=tuple(np.array(e) for e in ends),
    )

    def exact(row: int, t: Float) -> Float:
        c = curves[row]
        p = np.stack([np.interp(t, c.parameters, c.points[:, k]) for k in range(3)], axis=1)
        return (surface.feet(np.zeros(len(p), int), p) if 2 <= row < 6 else p) * SCALE + ORIGIN

    kinds = replace(surface, curved=np.array([True, False]))
    mesh = fill(both, kinds, guide, uniform(guide, 4), exact)
    scaled = (mesh.points - ORIGIN) / SCALE
    on_tube = np.unique(mesh.quads[mesh.quad_face == 0])
    assert np.abs(np.linalg.norm(scaled[on_tube, :2], axis=1) - 0.2).max() < 1e-15
    assert np.abs(scaled[mesh.face_nodes[1], 1] - 0.1).max() < 1e-15
    assert quality(mesh, kinds)[mesh.quad_face == 0].min() > 0.99
    # the plane face comes out as it does alone
    alone = replace(both, faces=(flat,), curves=tuple(curves[i] for i in (0, 1, 6, 7)))
    only = replace(
        guide, quads=guide.quads[2:], quad_face=np.zeros(1, int), points=points[:4], cad_vertex=np.arange(4),
        curve=np.full(4, -1), arclength=np.zeros(4), chains=tuple(guide.chains[i] for i in (0, 1, 6, 7)),
    )  # fmt: skip
    flat_mesh = fill(alone, Planes(alone), only, uniform(only, 4), lambda row, t: exact((0, 1, 6, 7)[row], t))
    np.testing.assert_array_equal(
        mesh.points[mesh.quads[mesh.quad_face == 1]].reshape(-1, 3), flat_mesh.points[flat_mesh.quads].reshape(-1, 3)
    )


def test_quality_against_the_own_normal() -> None:
    """One quad with corners of 60 and 120 degrees, tilted; turned over it is negative."""
    x = np.array([[0, 0], [1, 0], [1.5, np.sqrt(0.75)], [0.5, np.sqrt(0.75)]]) @ np.array([[0.6, 0, 0.8], [0, 1, 0]])
    grid = np.moveaxis(x[[0, 3, 1, 2]].reshape(1, 2, 2, 3), -1, 0)
    normal = np.array([-0.8, 0, 0.6]).reshape(3, 1, 1, 1)
    assert surface_quality(grid, normal) == pytest.approx(np.sin(np.pi / 3))
    assert surface_quality(grid, -normal) == pytest.approx(-np.sin(np.pi / 3))


def test_gmsh_fills_plane_faces_only() -> None:
    model, surface, guide = ball(1)
    with pytest.raises(InputError, match="curved"):
        fill(model, surface, guide, uniform(guide, 2), no_curve, filler="gmsh")


def test_divisions_must_fit() -> None:
    model, surface, guide = ball(1)
    with pytest.raises(MeshError, match="divisions"):
        fill(model, surface, guide, np.ones(2, int), no_curve)


def test_without_curves_no_edge_is_badly_graded() -> None:
    model, surface, guide = ball(2)
    fine = uniform(guide, 3)
    assert (graded(model, guide, fine) == fine).all()
    assert curve_fit(fill(model, surface, guide, fine, no_curve)) == 0.0


@pytest.mark.parametrize(("pieces", "wanted"), [(1, 4), (2, 4), (3, 4), (4, 4), (5, 5)])
def test_final_edges_must_follow_a_tube(pieces: int, wanted: int) -> None:
    """Three guide edges around: 120 degrees each.  Two edges of 60 degrees lose 4.5 % of the area, three 2 %, four 1.1 %."""
    model, surface, guide, _ = tube(3, 2)
    edges, _, chord, n = guide_chords(guide.quads)
    around = np.unique(chord[np.abs(np.diff(guide.points[edges][:, :, 2], axis=1)[:, 0]) < 1e-9])
    fine = np.full(n, 1)
    fine[around] = pieces
    found = followed(model, surface, guide, fine)
    fine[around] = wanted
    assert found.tolist() == fine.tolist()


def test_a_small_round_face_may_be_coarse_unless_it_is_named() -> None:
    """Of a tube with 9 sides (40 degrees, 2 % lost) that is 1/10 of the model, unless it is a physical surface."""
    model, surface, guide, _ = tube(9, 1)
    fine = uniform(guide, 1)
    assert np.count_nonzero(followed(model, surface, guide, fine) > 1) == 9
    z = guide.points[:, 2]
    more = np.concatenate([guide.points, [[0, 0, 9], [1.0, 0, 9], [1, 6, 9], [0, 6, 9]]])
    quads = np.concatenate([guide.quads, len(z) + np.arange(4)[None]])
    flat = Face(2, np.array([0.0, 0, 9]), np.eye(3)[:2], ())
    kinds = replace(surface, curved=np.array([True, False]))
    big = replace(model, faces=(replace(model.faces[0], loops=()), flat), curves=())
    wide = replace(guide, points=more, quads=quads, quad_face=np.append(guide.quad_face, 1), chains=())
    fine = uniform(wide, 1)
    assert (followed(big, kinds, wide, fine) == fine).all()
    named = replace(big, face_groups=((1,), ()))
    assert np.count_nonzero(followed(named, kinds, wide, fine) > 1) == 9


def test_only_the_bulging_edges_of_a_flat_cell_are_divided() -> None:
    """Cells of a tube that turn by 72 degrees and are .02 high: they bulge by .038."""
    model, surface, guide, _ = tube(5, 25)
    edges, quad_edges, chord, _ = guide_chords(guide.quads)
    bad = np.array([5 * 12])
    found = chords_to_divide(model, surface, guide, bad)
    low = guide.points[edges[quad_edges[bad[0]]]][:, :, 2]
    (around,) = np.unique(chord[quad_edges[bad[0]]][np.abs(low[:, 1] - low[:, 0]) < 1e-9])
    assert found.tolist() == [around]
