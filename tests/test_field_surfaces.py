"""The field stage on curved surfaces."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gmsh_crossquad.errors import GeometryError, LayoutError
from gmsh_crossquad.field.align import Aligner
from gmsh_crossquad.field.cancel import _Energies
from gmsh_crossquad.field.clearance import Clearance
from gmsh_crossquad.field.connection import ConnectionOperators
from gmsh_crossquad.field.flux import flux_slope
from gmsh_crossquad.field.geodesic import geodesic
from gmsh_crossquad.field.handles import handle_loops
from gmsh_crossquad.field.operators import FieldOperators
from gmsh_crossquad.field.pipeline import aligned_field
from gmsh_crossquad.field.repair import alternatives
from gmsh_crossquad.field.singularities import QUARTER, move_index, shortest_path, singular_vertices, triangle_index, vertex_index
from gmsh_crossquad.field.smooth import from_angles, smooth_field, wrap
from gmsh_crossquad.field.split import open_up
from gmsh_crossquad.field.surface_mesh import SurfaceMesh
from gmsh_crossquad.records import CrossField

from . import models
from .field_meshes import disc
from .surface_meshes import (
    bump,
    cylinder,
    double_torus,
    face_mesh,
    frustum,
    hemisphere,
    holed_sphere,
    moved,
    nearest,
    octant,
    saddle,
    sphere,
    torus,
)

SQUARE = [(x, y, 0) for x in (-1, 1) for y in (-1, 1)]


def with_corners(mesh, places, angle=QUARTER):
    return face_mesh(mesh, {nearest(mesh, p): angle for p in places})


def notched_torus():
    mesh = torus(holes=[(3, 8, 2, 7)])
    corners = np.flatnonzero(mesh.boundary_vertex & (mesh.angle_sum > 1.25 * np.pi))
    return face_mesh(mesh, {int(v): 3 * QUARTER for v in corners})


# name: the face, indices inside (None: not known beforehand, except for their sum), chi, number of loops
FACES = {
    "octant": (with_corners(octant(), np.eye(3)), [1], 1, 1),
    "hemisphere": (face_mesh(hemisphere()), [1] * 4, 1, 1),
    "sphere": (face_mesh(sphere()), [1] * 8, 2, 0),
    "sphere, 1 hole": (face_mesh(holed_sphere([])), [1] * 4, 1, 1),
    "sphere, 2 holes": (face_mesh(holed_sphere([(0j, 0.3)])), [], 0, 2),
    "sphere, 3 holes": (face_mesh(holed_sphere([(0.5 + 0j, 0.3), (-0.6j, 0.25)])), None, -1, 3),
    "cylinder": (face_mesh(cylinder()), [], 0, 2),
    "frustum": (face_mesh(frustum()), [], 0, 2),
    "half torus": (face_mesh(torus(np.pi)), [], 0, 2),
    "torus": (face_mesh(torus()), [], 0, 0),
    "torus, 1 hole": (notched_torus(), [], -1, 1),
    "double torus": (face_mesh(double_torus()), [-1] * 8, -2, 0),
    "saddle": (with_corners(saddle(), [(x, y, 0) for x, y, _ in SQUARE]), [], 1, 1),
    "bump": (with_corners(bump(), SQUARE), [], 1, 1),
}


def surface(face):
    return SurfaceMesh(face.points, face.triangles)


@pytest.mark.parametrize("name", FACES)
def test_indices_add_up_with_curvature(name):
    face, expected, euler, loops = FACES[name]
    mesh = surface(face)
    assert mesh.euler == euler
    assert len(mesh.loops) == loops
    # Gauss–Bonnet: interior angle defects and turns of the boundary
    assert abs(mesh.curvature.sum() - 2 * np.pi * euler) < 1e-12 * len(mesh.points)
    aligned = aligned_field(face)
    assert aligned.index.sum() == 4 * euler
    inside = np.sort(aligned.index[~mesh.boundary_vertex & (aligned.index != 0)]).tolist()
    if expected is not None:
        assert inside == expected
    corner = np.isfinite(face.opening_angle)
    assert np.array_equal(aligned.index[corner], 2 - np.rint(face.opening_angle[corner] / QUARTER))
    assert not np.any(aligned.index[mesh.boundary_vertex & ~corner])
    # every index again, from the curvature and the angles alone
    angle = aligned.field.theta[mesh.triangle_edges] + mesh.edge_direction
    assert np.abs(wrap(np.roll(angle, -1, axis=1) - angle - aligned.field.rotation)).max() < 1e-10
    assert not np.any(triangle_index(aligned.field.rotation))
    assert np.abs(vertex_index(mesh, aligned.field.rotation) - aligned.index).max() < 1e-10
    assert np.abs(aligned.field.theta[mesh.boundary_edge]).max(initial=0.0) < 1e-10
    # harmonic: no edge inside is pulled
    assert np.abs(FieldOperators(mesh).divergence(aligned.field.rotation)[~mesh.boundary_edge]).max() < 1e-9


@pytest.mark.parametrize("name", ["octant", "sphere, 3 holes", "half torus", "bump"])
def test_rigid_motions_do_not_matter(name):
    face = FACES[name][0]
    a, b = aligned_field(face), aligned_field(replace(face, points=moved(surface(face)).points))
    assert np.array_equal(a.index, b.index)
    assert np.array_equal(a.periods, b.periods)
    assert np.abs(wrap(a.field.theta - b.field.theta)).max() < 1e-9
    assert np.allclose(a.flux, b.flux, atol=1e-9)


def test_a_sphere_gets_the_corners_of_a_cube():
    mesh = sphere(10)
    index = aligned_field(face_mesh(mesh)).index
    places = mesh.points[index != 0]
    corners = np.stack(np.meshgrid(*[[-1, 1]] * 3), axis=3).reshape(-1, 3) / np.sqrt(3)
    distance = np.linalg.norm(places[:, None] - corners, axis=2)
    assert sorted(distance.argmin(axis=1)) == list(range(8))
    assert distance.min(axis=1).max() < mesh.edge_length.max()


def test_the_singularity_of_an_octant_is_in_its_middle():
    mesh = octant()
    index = aligned_field(FACES["octant"][0]).index
    (v,) = np.flatnonzero(~mesh.boundary_vertex & (index != 0))
    assert np.allclose(mesh.points[v], 1 / np.sqrt(3), atol=1e-9)


@pytest.mark.parametrize("mesh", [cylinder(), frustum(), torus(np.pi), torus(), holed_sphere([(0j, 0.3)])])
def test_surfaces_of_revolution_get_their_circles_and_meridians(mesh):
    field = aligned_field(face_mesh(mesh)).field
    middle = mesh.points[mesh.edges].mean(axis=1)
    around = np.stack([-middle[:, 1], middle[:, 0], 0 * middle[:, 0]], axis=1)
    x = mesh.points[mesh.edges[:, 1]] - mesh.points[mesh.edges[:, 0]]
    y = np.cross(mesh.edge_normal, x)
    unit = [v / np.linalg.norm(v, axis=1)[:, None] for v in (x, y)]
    exact = np.arctan2(*(np.sum(around * v, axis=1) for v in unit[::-1]))
    assert np.abs(wrap(field.theta - exact)).max() < 0.1
    # not twisted, and no more than that
    assert np.abs(wrap(field.theta - exact)).mean() < 0.02


def test_energy_of_the_field_of_a_torus():
    # 1/2 int kappa_g^2 of its circles: pi r int sin^2 b / (R + r cos b) db = 2 pi^2 (R - sqrt(R^2 - r^2)) / r
    big, small = 1.0, 0.4
    mesh = torus(radii=(big, small))
    energy = FieldOperators(mesh).energy(aligned_field(face_mesh(mesh)).field.rotation)
    assert energy == pytest.approx(2 * np.pi**2 * (big - np.sqrt(big**2 - small**2)) / small, rel=0.02)


@pytest.mark.parametrize("model", [models.disc(), models.annulus(), models.wedge(np.radians(20)), models.plate_with_holes()])
@pytest.mark.parametrize("epsilon", [None, 0.05])
def test_a_plane_in_space_is_a_plane(model, epsilon):
    face = models.background(model, 0.05)[0]
    axes = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0][:2]
    a = aligned_field(face, epsilon=epsilon)
    b = aligned_field(replace(face, points=face.points @ axes + 0.7), epsilon=epsilon)
    assert np.array_equal(a.index, b.index)
    assert np.abs(wrap(a.field.theta - b.field.theta)).max() < 1e-9
    others = [list(alternatives(f, a, np.zeros(0, np.int64))) for f in (face, replace(face, points=face.points @ axes))]
    assert [x.index.tolist() for x in others[0]] == [x.index.tolist() for x in others[1]]


@pytest.mark.parametrize("model", [models.wedge(np.radians(20)), models.annulus(), models.l_shape()])
def test_bending_without_stretching_changes_nothing(model):
    face = models.background(model, 0.03)[0]
    x, y = face.points.T
    bent = replace(face, points=np.stack([0.5 * np.sin(2 * x), y, 0.5 * np.cos(2 * x)], axis=1))
    a, b = aligned_field(face), aligned_field(bent)
    inside = ~surface(face).boundary_vertex
    assert sorted(a.index[inside]) == sorted(b.index[inside])
    for q in (-1, 1):
        p, r = (face.points[inside & (f.index == q)] for f in (a, b))
        if len(p):
            assert np.linalg.norm(p[:, None] - r[None], axis=2).min(axis=1).max() < 0.1


# -- operators -----------------------------------------------------------------------------------------------------------


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 2**31))
def test_the_connection_is_hermitian_and_gives_the_energy(seed):
    mesh = double_torus((8, 8))
    along = ConnectionOperators(FieldOperators(mesh))
    assert abs(along.stiffness - along.stiffness.conj().T).max() < 1e-12
    z = np.random.default_rng(seed).normal(size=(len(mesh.edges), 2))
    w = (z[:, 0] + 1j * z[:, 1])[mesh.triangle_edges] * np.exp(4j * mesh.edge_direction)
    energy = np.sum(along.scalar.weight * np.abs(np.roll(w, -1, axis=1) - w) ** 2)
    assert np.sum(z * along.apply(z)) == pytest.approx(energy, rel=1e-12)
    assert energy > 0


@pytest.mark.parametrize("mesh", [sphere(4), torus(cells=(12, 6))])
def test_without_boundary_the_solution_is_unique_up_to_a_constant(mesh):
    operators = FieldOperators(mesh)
    r = np.random.default_rng(0).normal(size=(len(mesh.triangles), 3))
    x = operators.solve(np.zeros(len(mesh.edges)), r)
    assert len(operators.free) == len(mesh.edges) - 1
    assert np.abs(operators.divergence(operators.difference(x) + r)).max() < 1e-9
    assert operators.solve(np.zeros(len(mesh.edges))) == pytest.approx(0.0)


def test_closed_and_open_components_together():
    one, other = sphere(4), cylinder(cells=(12, 4))
    points = np.concatenate([one.points, other.points + [5.0, 0, 0]])
    mesh = SurfaceMesh(points, np.concatenate([one.triangles, other.triangles + len(one.points)]))
    assert mesh.component_closed.tolist() == [True, False]
    index = aligned_field(face_mesh(mesh)).index
    assert np.bincount(mesh.components, np.abs(index)).tolist() == [8, 0]


def test_a_surface_on_which_crosses_are_parallel():
    # the surface of a cube: transport around a corner turns by 90 degrees, so the matrix is singular and the field has no energy
    n = 4
    g = np.stack(np.meshgrid(*[np.arange(n)] * 2, indexing="ij"), axis=2).reshape(-1, 2)
    squares = np.concatenate([g[:, None] + c for c in ([0, 0], [1, 0], [1, 1], [0, 1])], axis=1).reshape(-1, 4, 2)
    quads = []
    for axis in range(3):
        for side in (0, n):
            q = np.insert(squares, 2, side, axis=2)[..., [[2, 0, 1], [1, 2, 0], [0, 1, 2]][axis]]
            quads.append(q if side else q[:, ::-1])
    corners = np.concatenate(quads)
    points, rows = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    rows = rows.reshape(-1, 4)
    mesh = SurfaceMesh(points.astype(float), np.concatenate([rows[:, [0, 1, 2]], rows[:, [0, 2, 3]]]))
    aligned = aligned_field(face_mesh(mesh))
    assert sorted(aligned.index[aligned.index != 0]) == [1] * 8
    at_corner = np.isin(mesh.points, [0, n]).all(axis=1)
    assert np.array_equal(aligned.index != 0, at_corner)
    assert FieldOperators(mesh).energy(aligned.field.rotation) < 1e-12


def test_handles_of_surfaces():
    for face, _, euler, loops in FACES.values():
        assert len(handle_loops(surface(face))) == 2 - euler - loops


def test_loops_around_handles_are_independent_and_change_no_index():
    mesh = double_torus((16, 8))
    operators = FieldOperators(mesh)
    aligner = Aligner(mesh, operators, np.zeros(len(mesh.points), np.int64))
    loops = handle_loops(mesh)
    field = aligned_field(face_mesh(mesh)).field
    energies = _Energies(aligner, field, loops, [])
    assert np.linalg.eigvalsh(energies.form).min() > 1e-3
    before = operators.energy(field.rotation)
    for amount in ([1, 0, 0, 0], [0, -2, 1, 0], [1, 1, -1, 3]):
        rotation = field.rotation.copy()
        for loop, n in zip(loops, amount, strict=True):
            assert loop[0] == loop[-1]
            move_index(mesh, rotation, loop, n)
        assert np.allclose(vertex_index(mesh, rotation), vertex_index(mesh, field.rotation), atol=1e-9)
        after = operators.energy(aligner.rotate(CrossField(field.theta, rotation)).field.rotation)
        assert energies.best(np.array(amount))[0] == pytest.approx(after - before, rel=1e-8)
        assert after > before


def test_a_given_field_keeps_its_turns_around_a_torus():
    # crosses that turn once against circles and meridians on the way around: smooth, without singularities
    mesh = torus()
    middle = mesh.points[mesh.edges].mean(axis=1)
    straight = aligned_field(face_mesh(mesh)).field
    twisted = from_angles(mesh, straight.theta + np.arctan2(middle[:, 1], middle[:, 0]))
    for keep in (True, False):
        aligned = aligned_field(face_mesh(mesh), twisted, keep=keep)
        assert not np.any(aligned.index)
        turn = aligned.field.rotation - twisted.rotation
        potential = FieldOperators(mesh).solve(np.zeros(len(mesh.edges)), -turn)
        assert np.allclose(FieldOperators(mesh).difference(potential), turn, atol=1e-9)


# -- distances, forces and moves -------------------------------------------------------------------------------------------


def test_straight_lines():
    mesh = sphere(10)
    v = nearest(mesh, (0, 0, 1))
    for angle in np.linspace(0, mesh.angle_sum[v], 7, endpoint=False):
        line = geodesic(mesh, v, angle, np.pi / 2)
        assert line.arclength[-1] == pytest.approx(np.pi / 2)
        plane = np.cross(line.points[0], line.points[len(line.points) // 2])
        assert np.abs(line.points @ plane).max() / np.linalg.norm(plane) < 0.06
        assert line.points[0] @ line.points[-1] == pytest.approx(0.0, abs=0.06)


def test_straight_lines_in_a_plane_end_at_the_boundary():
    flat = disc(6, 24)
    mesh = SurfaceMesh(np.concatenate([flat.points, np.zeros((len(flat.points), 1))], axis=1), flat.triangles)
    first = mesh.points[mesh.neighbours(0)[0]]
    for angle in np.linspace(0, 2 * np.pi, 11, endpoint=False):
        line = geodesic(mesh, 0, angle, 7.0)
        direction = np.arctan2(first[1], first[0]) + angle
        r = np.hypot(*line.points[:, :2].T)
        assert np.allclose(r, line.arclength)
        assert np.cos(np.pi / 24) - 1e-12 <= r[-1] <= 1 + 1e-12
        assert np.allclose(line.points[:, :2], np.outer(r, [np.cos(direction), np.sin(direction)]), atol=1e-9)
        assert np.allclose(line.at(np.array([0.25, 99.0])), [0.25 * line.points[-1] / r[-1], line.points[-1]])


def test_clearance_without_boundary():
    mesh = sphere(4)
    clearance = Clearance(mesh, [])
    assert np.all(clearance.distance(mesh.points[:3])[0] == np.inf)
    assert np.all(clearance.wanted(mesh.points[:3]) == np.inf)
    assert clearance.room(mesh.points[:1])[0] == pytest.approx(2.0, rel=0.03)
    half = 0.5 * np.linalg.norm(mesh.points[0] - mesh.points[1])
    assert clearance.room(mesh.points[:2]) == pytest.approx(half)


def test_wanted_clearance_on_a_long_pipe_is_that_of_its_ends():
    mesh = cylinder(1.0, 12.0, (24, 48))
    clearance = Clearance(mesh, Aligner(mesh, FieldOperators(mesh), np.zeros(len(mesh.points), np.int64)).rims)
    middle = mesh.points[[nearest(mesh, (1, 0, 6))]]
    assert clearance.wanted(middle)[0] == pytest.approx(0.6, rel=0.01)


@pytest.mark.parametrize("seed", [0, 1])
def test_the_flux_follows_a_singularity(seed):
    mesh = moved(holed_sphere([(0.5 + 0j, 0.3), (-0.6j, 0.25)], 0.08), seed)
    aligner = Aligner(mesh, FieldOperators(mesh), np.zeros(len(mesh.points), np.int64))
    field = aligner.rotate(aligned_field(face_mesh(mesh)).field).field
    vertices, index = singular_vertices(mesh, field.rotation)
    slope = flux_slope(aligner, vertices, index)
    assert np.abs(np.einsum("hkc,kc->hk", slope, mesh.vertex_normal[vertices])).max() < 1e-9
    before = aligner.flux(field.rotation)[aligner.holes]
    for k, v in enumerate(vertices.tolist()):
        for w in mesh.neighbours(v)[:3]:
            rotation = field.rotation.copy()
            move_index(mesh, rotation, [v, w], int(index[k]))
            change = aligner.flux(aligner.rotate(CrossField(field.theta, rotation)).field.rotation)[aligner.holes] - before
            step = mesh.points[w] - mesh.points[v]
            size = np.linalg.norm(slope[:, k]) * np.linalg.norm(step)
            assert np.abs(change - slope[:, k] @ step).max() < 0.35 * size


def test_flux_around_holes_of_a_sphere_vanishes():
    face = FACES["sphere, 3 holes"][0]
    aligned = aligned_field(face)
    flux = np.abs(aligned.flux).max()
    others = list(alternatives(face, aligned, np.zeros(0, np.int64)))
    assert np.abs(others[0].flux).max() < 0.1 * flux
    assert len(others[0].added) == 2
    assert np.abs(others[-1].flux).max() < 0.2 * flux
    assert others[-1].moved
    for other in others:
        assert other.index.sum() == -4


def test_a_strong_singularity_of_a_sphere_is_shared():
    mesh = sphere(10)
    field = aligned_field(face_mesh(mesh)).field
    rotation = field.rotation.copy()
    pole = nearest(mesh, (0, 0, 1))
    target = np.zeros(len(mesh.points), bool)
    target[pole] = True
    for v in singular_vertices(mesh, rotation)[0].tolist():
        move_index(mesh, rotation, shortest_path(mesh, [v], target, ~target, 1000), 1)
    given_field = CrossField(field.theta, rotation)
    assert aligned_field(face_mesh(mesh), given_field, split=False).index[pole] == 8
    shared = aligned_field(face_mesh(mesh), given_field)
    assert sorted(shared.index[shared.index != 0]) == [1] * 8
    assert len(shared.split) == 8
    distance = np.linalg.norm(mesh.points[shared.index != 0] - mesh.points[pole], axis=1)
    assert np.ptp(distance) < 2 * mesh.edge_length.max()


@pytest.mark.parametrize("height", [0.3, 1.0, 5.0])
def test_the_apex_of_a_cone_is_left_regular(height):
    flat = disc(12, 40)
    r = np.hypot(*flat.points.T)
    mesh = SurfaceMesh(np.concatenate([flat.points, height * (1 - r)[:, None]], axis=1), flat.triangles)
    index = aligned_field(face_mesh(mesh)).index
    assert sorted(index[index != 0]) == [1] * 4
    assert index[0] == 0


def test_the_same_field_every_time():
    mesh = sphere(5)
    a, b = (smooth_field(mesh, FieldOperators(mesh)) for _ in range(2))
    assert np.array_equal(a.theta, b.theta)
    assert np.array_equal(a.rotation, b.rotation)


def test_splits_on_curved_faces():
    mesh = octant(3)
    corner = np.zeros(len(mesh.points), bool)
    corner[[nearest(mesh, p) for p in np.eye(3)]] = True
    points, triangles = open_up(mesh.points, mesh.triangles, corner)
    opened = SurfaceMesh(points, triangles)
    assert opened.euler == 1
    assert np.array_equal(points[: len(mesh.points)], mesh.points)
    assert len(opened.loops[0]) == len(mesh.loops[0])
    across = opened.boundary_vertex[opened.edges].all(axis=1) & ~opened.boundary_edge
    assert not np.any(across)
    assert all(len(opened.star(int(v))) >= 3 for v in np.flatnonzero(corner))
    assert aligned_field(face_mesh(opened, dict.fromkeys(np.flatnonzero(corner).tolist(), QUARTER))).index.sum() == 4


def test_indices_that_contradict_a_surface_are_refused():
    mesh = cylinder(cells=(12, 4))
    wanted = np.zeros(len(mesh.points), np.int64)
    wanted[mesh.loops[0][0]] = 1
    rotation = aligned_field(face_mesh(mesh)).field.rotation
    with pytest.raises(LayoutError, match="do not fit"):
        Aligner(mesh, FieldOperators(mesh), wanted).close(rotation)


def test_a_strip_with_one_side_is_refused():
    # a Moebius strip of triangles between its two sides
    n, w = 24, 4
    i, j = np.meshgrid(np.arange(n), np.arange(w), indexing="ij")

    def at(a, b):
        return np.where(a == n, w - b, a % n * (w + 1) + b)

    a, b, c, d = (at(i + p, j + q).ravel() for p, q in ((0, 0), (1, 0), (1, 1), (0, 1)))
    u = np.repeat(np.arange(n), w + 1) * 2 * np.pi / n
    v = np.tile(np.linspace(-0.4, 0.4, w + 1), n)
    r = 1 + v * np.cos(u / 2)
    points = np.stack([r * np.cos(u), r * np.sin(u), v * np.sin(u / 2)], axis=1)
    strip = SurfaceMesh(points, np.concatenate([np.stack(t, axis=1) for t in ((a, b, c), (a, c, d))]))
    face = replace(FACES["cylinder"][0], points=points, triangles=strip.triangles)
    with pytest.raises(GeometryError, match="one side only"):
        aligned_field(face)


@pytest.mark.parametrize(
    "triangles, match", [([[0, 1, 2], [1, 0, 3], [0, 1, 4]], "more than two"), ([[0, 1, 2], [0, 3, 4]], "touches itself")]
)
def test_what_is_no_surface_is_refused(triangles, match):
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1]])
    face = replace(FACES["cylinder"][0], points=points, triangles=np.array(triangles))
    with pytest.raises(GeometryError, match=match):
        aligned_field(face)


@pytest.mark.parametrize("mesh, expected", [(sphere(6), 8), (hemisphere(8), 4), (torus(cells=(20, 10)), 0)])
def test_a_core_size_on_curved_surfaces(mesh, expected):
    index = aligned_field(face_mesh(mesh), epsilon=0.15).index
    assert index[index != 0].tolist() == [1] * expected


def test_normals_of_a_sphere():
    mesh = moved(sphere(6))
    centre = np.array([0.3, -2.0, 1.1])
    for normal, place in (
        (mesh.triangle_normal, mesh.points[mesh.triangles].mean(axis=1)),
        (mesh.edge_normal, mesh.points[mesh.edges].mean(axis=1)),
        (mesh.vertex_normal, mesh.points),
    ):
        exact = (place - centre) / np.linalg.norm(place - centre, axis=1)[:, None]
        assert np.abs(np.linalg.norm(normal, axis=1) - 1).max() < 1e-12
        assert np.linalg.norm(normal - exact, axis=1).max() < 0.05
    flat = disc(3, 8)
    assert flat.triangle_normal is None
    assert flat.edge_normal is None
    assert flat.vertex_normal is None
