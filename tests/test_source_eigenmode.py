import numpy as np
import pytest
from scipy.special import jn_zeros, jnp_zeros

from gmsh_crossquad.errors import FieldError, InputError
from gmsh_crossquad.field.edge_frames import EdgeFrames
from gmsh_crossquad.field.singularities import snap_to_vertices
from gmsh_crossquad.field.smooth import edge_angle, wrap
from gmsh_crossquad.field.surface_mesh import SurfaceMesh
from gmsh_crossquad.records import CrossField
from gmsh_crossquad.source.eigenmode import Eigenmode
from gmsh_crossquad.source.elements import QuadraticElements
from gmsh_crossquad.source.neighbours import cancel_neighbours

from .field_meshes import annulus, at, disc, grid, prescribed, singular_angle
from .source_frames import drift, frames_of, inner_indices, random_square


def rectangle(n, width=1.7, shake=0.25):
    """An irregular mesh of [0, width] x [0, 1]."""
    mesh = grid(round(1.7 * n), n)
    free = ~mesh.boundary_vertex
    points = mesh.points + shake * free[:, None] * np.random.default_rng(1).uniform(-0.7, 0.7, mesh.points.shape)
    return SurfaceMesh(points * [width / round(1.7 * n), 1 / n], mesh.triangles)


def found(mesh, field):
    """(index, place) of all singularities inside."""
    triangles, vertices = inner_indices(mesh, field)
    assert not np.any(triangles)
    here = np.flatnonzero(vertices)
    return vertices[here], mesh.points[here]


def assert_singularities(mesh, field, expected):
    """Expected (index, x, y), each near a vertex that has it, and no others."""
    index, place = found(mesh, field)
    assert sorted(index.tolist()) == sorted(q for q, _, _ in expected)
    for q, x, y in expected:
        near = np.hypot(place[:, 0] - x, place[:, 1] - y)
        assert near[index == q].min() < 1.5 * np.sqrt(mesh.area.mean())


def rectangle_modes(count, boundary, width=1.7):
    """(nx, ny) by eigenvalue."""
    first = 1 if boundary == "dirichlet" else 0
    pairs = [(i, j) for i in range(first, 30) for j in range(first, 30) if i + j > 0]
    return sorted(pairs, key=lambda p: (p[0] / width) ** 2 + p[1] ** 2)[:count]


@pytest.mark.parametrize("number", [1, 2, 5, 7, 9])
def test_dirichlet_modes_of_a_rectangle(number):
    # sin(i pi x / a) sin(j pi y): i j extrema and (i - 1)(j - 1) saddles inside
    i, j = rectangle_modes(12, "dirichlet")[number - 1]
    expected = [(1, 1.7 * (a + 0.5) / i, (b + 0.5) / j) for a in range(i) for b in range(j)]
    expected += [(-1, 1.7 * a / i, b / j) for a in range(1, i) for b in range(1, j)]
    mesh = rectangle(20)
    assert_singularities(mesh, Eigenmode(number).on(frames_of(mesh)), expected)


@pytest.mark.parametrize("number", [1, 2, 3, 5, 10])
def test_neumann_modes_of_a_rectangle(number):
    # cos(i pi x / a) cos(j pi y): the roles are exchanged
    i, j = rectangle_modes(12, "neumann")[number - 1]
    expected = [(-1, 1.7 * (a + 0.5) / i, (b + 0.5) / j) for a in range(i) for b in range(j)]
    expected += [(1, 1.7 * a / i, b / j) for a in range(1, i) for b in range(1, j)] if i * j else []
    mesh = rectangle(20)
    assert_singularities(mesh, Eigenmode(number, "neumann").on(frames_of(mesh)), expected if i * j else [])


@pytest.mark.parametrize(
    "number, n, ring, turned",
    [(1, 0, 1, False), (2, 1, 1, False), (3, 1, 1, True), (4, 2, 1, False), (5, 2, 1, True), (9, 1, 2, False), (10, 1, 2, True)],
)
def test_dirichlet_modes_of_a_disc(number, n, ring, turned):
    # J_n(k r) cos(n phi), or sin: extrema where J_n' = 0 and cos = 1, saddles where J_n = 0 and cos = 0
    mesh = disc(22, 64)
    k = jn_zeros(n, ring)[-1]
    if n == 0:
        expected = [(1, 0.0, 0.0)]
    else:
        start = np.pi / (2 * n) if turned else 0.0
        a = start + np.pi * np.arange(2 * n) / n
        expected = [(1, r * np.cos(t), r * np.sin(t)) for r in jnp_zeros(n, ring) / k for t in a]
        b = a + np.pi / (2 * n)
        expected += [(-1, r * np.cos(t), r * np.sin(t)) for r in jn_zeros(n, ring)[:-1] / k for t in b]
        expected += [(-1, 0.0, 0.0)] if n == 2 else []
    assert_singularities(mesh, Eigenmode(number).on(frames_of(mesh)), expected)


def test_a_zero_of_second_order():
    # J_3 cos(3 phi): index -2 in the centre, which a mesh without symmetry sees as two of -1
    mesh = disc(22, 64)
    shaken = SurfaceMesh(
        mesh.points + 0.006 * ~mesh.boundary_vertex[:, None] * np.random.default_rng(0).uniform(-1, 1, mesh.points.shape),
        mesh.triangles,
    )
    index, place = found(shaken, Eigenmode(7).on(frames_of(shaken)))
    centre = np.hypot(*place.T) < 0.15
    assert (index[centre].sum(), index[~centre].tolist()) == (-2, [1] * 6)
    assert np.all(index[centre] < 0)


@pytest.mark.parametrize("boundary", ["dirichlet", "neumann"])
def test_angles_are_a_quarter_of_the_gradients(boundary):
    def error(n):
        mesh = rectangle(n, shake=0.0)
        x, y = np.pi * mesh.points[mesh.edges].mean(axis=1).T / [[1.7], [1.0]]
        if boundary == "dirichlet":  # sin(2 x) sin(y), positive for small x
            gradient = 2 / 1.7 * np.cos(2 * x) * np.sin(y) + 1j * np.sin(2 * x) * np.cos(y)
            number = 2
        else:  # cos(x) cos(y)
            gradient = -1 / 1.7 * np.sin(x) * np.cos(y) - 1j * np.cos(x) * np.sin(y)
            number = 3
        field = Eigenmode(number, boundary).on(frames_of(mesh))
        assert drift(mesh, field) < 1e-9
        turn = wrap(field.theta + edge_angle(mesh) - np.angle(gradient) / 4)
        turn = np.minimum(np.abs(turn), np.pi / 4 - np.abs(turn))  # either sign of the mode
        return turn[np.abs(gradient) > 0.5].max()

    coarse, fine = error(8), error(16)
    assert fine < 0.01
    assert np.log2(coarse / fine) > 1.6


def test_boundary_values_are_exact():
    mesh = disc(10, 40)
    on = mesh.boundary_edge
    across = Eigenmode(2).on(frames_of(mesh)).theta + edge_angle(mesh) - 0.25 * (edge_angle(mesh) + np.pi / 2)
    along = Eigenmode(1, "neumann").on(frames_of(mesh)).theta + edge_angle(mesh) - 0.25 * edge_angle(mesh)
    for angle in (across, along):
        assert np.abs(np.sin(4 * angle[on])).max() < 1e-9


def test_isolines_turn_all_crosses_alike():
    mesh = rectangle(10)
    a, b = Eigenmode(2).on(frames_of(mesh)), Eigenmode(2, lines="isolines").on(frames_of(mesh))
    assert np.abs(wrap(b.theta - a.theta - np.pi / 8)).max() < 1e-9
    assert np.abs(a.rotation - b.rotation).max() < 1e-9


def test_place_and_size_of_the_face_do_not_matter():
    mesh = rectangle(10)
    axes = np.array([[0.6, 0.0, 0.8], [0.0, 1.0, 0.0]])
    a, b = Eigenmode(3).on(frames_of(mesh)), Eigenmode(3).on(frames_of(mesh, axes, (900.0, 1, 2), 1e-3))
    assert np.abs(wrap(a.theta - b.theta)).max() < 1e-6
    assert np.abs(a.rotation - b.rotation).max() < 1e-6
    again = Eigenmode(3).on(frames_of(mesh))
    assert np.array_equal(a.theta, again.theta)


def test_every_component_has_its_own_mode():
    left = rectangle(12)
    n = len(left.points)
    both = SurfaceMesh(
        np.concatenate([left.points, left.points + [5.0, 0.0]]), np.concatenate([left.triangles, left.triangles + n])
    )
    field = Eigenmode(2).on(frames_of(both))
    expected = [(1, x + 1.7 * c, 0.5) for x in (0.0, 5.0) for c in (0.25, 0.75)]
    assert_singularities(both, field, expected)


def test_holes():
    # chi = 0: the indices inside and those of the boundary's zeros cancel
    mesh = annulus(0.4, 12, 60)
    index, place = found(mesh, Eigenmode(2).on(frames_of(mesh)))
    assert index.tolist() == [1, 1]
    assert np.abs(np.abs(place[:, 0]) - 0.69).max() < 0.05


@pytest.mark.parametrize(
    "source, mesh, words",
    [
        (
            Eigenmode(6),
            disc(22, 64),
            "jumps by 45 degrees along a curve, surface 1 at .*: the gradient of this mode vanishes there",
        ),
        (Eigenmode(4, "neumann"), rectangle(12), "jumps by 45 degrees along a curve"),
        (Eigenmode(30), disc(8, 20), "too coarse for eigenmode 30, surface 1: take a mode up to 14, or use a finer"),
        (Eigenmode(1), grid(1, 1), "too coarse for eigenmode 1, surface 1: use a finer background"),
    ],
)
def test_modes_that_cannot_be_used(source, mesh, words):
    with pytest.raises(FieldError, match=words):
        source.on(frames_of(mesh))


def test_curved_faces_are_refused():
    mesh = disc(6, 18)
    points = np.column_stack([mesh.points, 0.3 * mesh.points[:, 0] ** 2])
    with pytest.raises(FieldError, match="an eigenmode needs a planar face, surface 7"):
        Eigenmode(1).on(EdgeFrames(7, mesh, points, frames_of(mesh).normal))


@pytest.mark.parametrize("arguments", [(0,), (-1,), (1.5,), (True,), (1, "robin"), (1, "dirichlet", "level")])
def test_wrong_arguments(arguments):
    with pytest.raises(InputError):
        Eigenmode(*arguments)


def test_quadratic_elements_are_exact_for_quadratic_functions():
    mesh = random_square(60, 4)
    elements = QuadraticElements(mesh, mesh.points)
    x, y = np.concatenate([mesh.points, mesh.points[mesh.edges].mean(axis=1)]).T
    one, f = 1 + 0 * x, 1 + 2 * x - y + 3 * x * x - 4 * x * y + 0.5 * y * y
    fx, fy = 2 + 6 * x - 4 * y, -1 - 4 * x + y
    assert np.abs(elements.edge_gradients(f) - np.stack([fx, fy], axis=1)[len(mesh.points) :]).max() < 1e-9
    # integrals over the unit square
    mass, stiffness = elements.mass(), elements.stiffness()
    assert one @ mass @ one == pytest.approx(1)
    assert x @ mass @ y == pytest.approx(1 / 4)
    assert (x * x) @ mass @ (x * y) == pytest.approx(1 / 8)
    assert (x * x) @ mass @ (x * x) == pytest.approx(1 / 5)
    assert x @ stiffness @ f == pytest.approx(2 + 3 - 2)
    assert (x * x) @ stiffness @ (x * x) == pytest.approx(4 / 3)
    assert np.abs(stiffness @ one).max() < 1e-9


def test_neighbours_of_opposite_index_cancel():
    mesh = disc(10, 30)
    a, b, c = at(mesh, 0.3, 0.0), at(mesh, 0.4, 0.0), at(mesh, -0.5, 0.0)
    rotation = snap_to_vertices(mesh, prescribed(mesh, singular_angle(mesh, [a, b, c], [1, -1, -1])).rotation)
    field = CrossField(np.zeros(len(mesh.edges)), cancel_neighbours(mesh, rotation))
    _, vertices = inner_indices(mesh, field)
    assert {int(v): int(vertices[v]) for v in np.flatnonzero(vertices)} == {c: -1}
    far = snap_to_vertices(mesh, prescribed(mesh, singular_angle(mesh, [a, c], [1, -1])).rotation)
    assert np.array_equal(cancel_neighbours(mesh, far), far)
