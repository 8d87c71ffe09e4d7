import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gmsh_crossquad.field.cut import cut_open
from gmsh_crossquad.field.split import open_up, split_edges
from gmsh_crossquad.field.surface_mesh import SurfaceMesh


def grid(n):
    """n x n unit cells, each of two triangles; point (i, j) is j (n + 1) + i."""
    x, y = np.meshgrid(np.arange(n + 1.0), np.arange(n + 1.0))
    points = np.stack([x.ravel(), y.ravel()], axis=1)
    a = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    b, c, d = a + 1, a + n + 2, a + n + 1
    return points, np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])


def path(*points):
    return np.stack([points[:-1], points[1:]], axis=1)


def at(n, i, j):
    return j * (n + 1) + i


def copies(source, point):
    return int((source == point).sum())


@pytest.mark.parametrize(
    ("cuts", "euler", "loops", "split"),
    [
        # inside: the two tips stay, the middle doubles; one more loop
        ([[(1, 2), (2, 2), (3, 2)]], 0, 2, {(1, 2): 1, (2, 2): 2, (3, 2): 1}),
        # from the boundary: no new loop, the mouth doubles
        ([[(2, 0), (2, 1), (2, 2)]], 1, 1, {(2, 0): 2, (2, 1): 2, (2, 2): 1}),
        # from side to side: two components of Euler characteristic 1
        ([[(2, 0), (2, 1), (2, 2), (2, 3), (2, 4)]], 2, 2, {(2, 0): 2, (2, 2): 2, (2, 4): 2}),
        # a cross: the centre has four sectors
        ([[(1, 2), (2, 2), (3, 2)], [(2, 1), (2, 2), (2, 3)]], 0, 2, {(2, 2): 4, (1, 2): 1, (2, 1): 1}),
        # a closed square: a disc and a square with a hole
        ([[(1, 1), (2, 1), (3, 1), (3, 2), (3, 3), (2, 3), (1, 3), (1, 2), (1, 1)]], 1, 3, {(1, 1): 2, (2, 2): 1, (3, 2): 2}),
        # a single edge inside has tips only: nothing splits
        ([[(1, 2), (2, 2)]], 1, 1, {(1, 2): 1, (2, 2): 1}),
    ],
)
def test_cut_topology(cuts, euler, loops, split):
    n = 4
    points, triangles = grid(n)
    edges = np.concatenate([path(*(at(n, i, j) for i, j in cut)) for cut in cuts])
    cut, source = cut_open(triangles, len(points), edges)
    np.testing.assert_array_equal(source[cut], triangles)
    assert np.all(np.diff(source) >= 0)
    mesh = SurfaceMesh(points[source], cut)
    if len(edges) > 1:
        assert mesh.euler == euler
        assert len(mesh.loops) == loops
    for (i, j), count in split.items():
        assert copies(source, at(n, i, j)) == count


def test_tip_keeps_its_full_fan():
    n = 4
    points, triangles = grid(n)
    cut, source = cut_open(triangles, len(points), path(at(n, 1, 2), at(n, 2, 2), at(n, 3, 2)))
    mesh = SurfaceMesh(points[source], cut)
    tip = int(np.flatnonzero(source == at(n, 1, 2))[0])
    assert mesh.angle_sum[tip] == pytest.approx(2 * np.pi)
    assert mesh.boundary_vertex[tip]
    middle = np.flatnonzero(source == at(n, 2, 2))
    np.testing.assert_allclose(mesh.angle_sum[middle], np.pi)


def test_boundary_that_touches_itself_is_taken_apart():
    triangles = np.array([[0, 1, 2], [0, 3, 4]])
    cut, source = cut_open(triangles, 5, np.zeros((0, 2), np.int64))
    assert copies(source, 0) == 2
    assert len(set(cut.ravel().tolist())) == 6


@given(st.permutations(range(25)), st.integers(0, 2**31))
def test_cut_does_not_depend_on_numbering(numbers, seed):
    n = 4
    points, triangles = grid(n)
    edges = path(at(n, 2, 0), at(n, 2, 1), at(n, 2, 2), at(n, 3, 2), at(n, 4, 2))
    number = np.array(numbers)
    order = np.random.default_rng(seed).permutation(len(triangles))
    renumbered = np.empty_like(points)
    renumbered[number] = points
    cut, source = cut_open(number[triangles][order], len(points), number[edges])
    mesh = SurfaceMesh(renumbered[source], cut)
    assert mesh.euler == 2
    assert len(source) == 25 + 5
    assert mesh.area.sum() == pytest.approx(16.0)


@given(st.integers(0, 2**31), st.floats(0.0, 1.0))
def test_split_edges_keeps_area_orientation_and_topology(seed, share):
    rng = np.random.default_rng(seed)
    points, triangles = grid(3)
    points = points + rng.uniform(-0.2, 0.2, points.shape)
    old = SurfaceMesh(points, triangles)
    marked = rng.random(len(old.edges)) < share
    new_points, new_triangles = split_edges(points, triangles, marked)
    new = SurfaceMesh(new_points, new_triangles)
    p = new_points[new_triangles]
    u, v = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]
    signed = 0.5 * (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])
    assert (signed > 0).all()
    assert signed.sum() == pytest.approx(old.area.sum())
    assert new.euler == old.euler
    assert len(new_points) == len(points) + marked.sum()
    assert len(new_triangles) == len(triangles) + (marked & old.boundary_edge).sum() + 2 * (marked & ~old.boundary_edge).sum()


@pytest.mark.parametrize("n", [1, 2, 3])
def test_open_up_leaves_the_field_room(n):
    points, triangles = grid(n)
    corner = np.zeros(len(points), bool)
    corner[[0, n, n * (n + 1), (n + 1) ** 2 - 1]] = True
    boundary = SurfaceMesh(points, triangles).boundary_vertex
    new_points, new_triangles = open_up(points, triangles, corner)
    mesh = SurfaceMesh(new_points, new_triangles)
    assert not (mesh.boundary_vertex[mesh.edges].all(axis=1) & ~mesh.boundary_edge).any()
    assert not mesh.boundary_vertex[mesh.triangles].all(axis=1).any()
    np.testing.assert_array_equal(mesh.boundary_vertex[: len(points)], boundary)
    assert not mesh.boundary_vertex[len(points) :].any()
    fan = np.bincount(mesh.triangles.ravel())
    assert (fan[np.flatnonzero(corner)] >= 3).all()
    assert mesh.area.sum() == pytest.approx(n * n)


def test_lone_triangle_is_split_at_its_centroid():
    points = np.array([[0.0, 0.0], [3.0, 0.0], [0.0, 3.0]])
    new_points, _ = open_up(points, np.array([[0, 1, 2]]), np.zeros(3, bool))
    assert (np.linalg.norm(new_points - [1.0, 1.0], axis=1) < 1e-12).any()
