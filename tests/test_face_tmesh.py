from dataclasses import replace

import models
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tracing import check_tmesh, crossings, field_of, midpoints

from gmsh_crossquad.errors import LayoutError
from gmsh_crossquad.field.pipeline import aligned_field
from gmsh_crossquad.field.surface_mesh import SurfaceMesh
from gmsh_crossquad.layout.face_tmesh import trace_face
from gmsh_crossquad.records import FaceMesh, FaceTMesh, Model

MODELS = {
    "square": models.square(),
    "l_shape": models.l_shape(),
    "triangle": models.regular(3),
    "hexagon": models.regular(6),
    "disc": models.disc(),
    "disc of four arcs": models.disc(arcs=4),
    "annulus": models.annulus(),
    "eccentric annulus": models.annulus(0.3, 1.0, (0.4, 0.1)),
    "plate": models.plate_with_holes(),
    "two holes": models.plate_with_holes(((0.5, 0.5, 0.2), (1.4, 0.4, 0.25)), 2.0, 1.0),
    "crack": models.square_with_crack(),
    "edge crack": models.square_with_edge_crack(),
    "cross": models.square_with_cross(),
    "embedded circle": models.square_with_embedded_circle(),
    "two materials": models.two_materials(),
    "triple junction": models.triple_junction(),
    "embedded point": models.polygon([(0, 0), (1, 0), (1, 1), (0, 1)], embedded_points=[(0.4, 0.6)]),
    "square hole": models.polygon(
        [(0, 0), (4, 0), (4, 2), (0, 2)],
        holes=[[(1.0, 1.0), (1.3, 1.4), (1.7, 1.1), (1.4, 0.7)], [(2.6, 0.5), (2.6, 1), (3.1, 1), (3.1, 0.5)]],
    ),
    "wedge 5": models.wedge(np.radians(5)),
    "wedge 12": models.wedge(np.radians(12)),
    "wedge 200": models.wedge(np.radians(200)),
    "wedge 355": models.wedge(np.radians(355)),
}


def components_checked(mesh: FaceMesh, index: np.ndarray, tmesh: FaceTMesh) -> None:
    """`check_tmesh`, and no crossing."""
    check_tmesh(mesh, index, tmesh)
    assert crossings(tmesh) == 0


@pytest.mark.parametrize("h", [0.08, 0.04])
@pytest.mark.parametrize("name", MODELS)
def test_all_patches_have_four_sides(name: str, h: float) -> None:
    for mesh in models.background(MODELS[name], h):
        aligned = aligned_field(mesh)
        components_checked(mesh, aligned.index, trace_face(mesh, aligned))


@pytest.mark.parametrize(
    ("name", "patches", "nodes"),
    [("square", 1, 4), ("l_shape", 3, 8), ("annulus", 1, 2)],
)
def test_known_layouts(name: str, patches: int, nodes: int) -> None:
    (mesh,) = models.background(MODELS[name], 0.06)
    tmesh = trace_face(mesh, aligned_field(mesh))
    assert (len(tmesh.patches), len(tmesh.position)) == (patches, nodes)


def test_l_shape_is_cut_along_its_sides() -> None:
    model = MODELS["l_shape"]
    (mesh,) = models.background(model, 0.06)
    tmesh = trace_face(mesh, aligned_field(mesh))
    found = tmesh.position[tmesh.vertex < 0] * model.scale + model.origin[:2]
    assert np.allclose(found[np.argsort(found[:, 0])], [[0, 1], [1, 0]], atol=2e-3)


def test_embedded_circle_has_a_disc_and_a_ring() -> None:
    (mesh,) = models.background(MODELS["embedded circle"], 0.05)
    surface = SurfaceMesh(mesh.points, mesh.triangles)
    assert sorted(surface.component_euler.tolist()) == [0, 1]
    aligned = aligned_field(mesh)
    tmesh = trace_face(mesh, aligned)
    assert set(tmesh.loop[tmesh.loop >= 0].tolist()) == {0, 1, 2}
    check_tmesh(mesh, aligned.index, tmesh)


def test_extra_port_in_a_square_makes_four_patches() -> None:
    (mesh,) = models.background(models.square(), 0.1)
    aligned = aligned_field(mesh)
    inside = int(np.linalg.norm(mesh.points - mesh.points.mean(axis=0), axis=1).argmin())
    tmesh = trace_face(mesh, aligned, [inside])
    check_tmesh(mesh, aligned.index, tmesh)
    assert len(tmesh.patches) == 4 and (tmesh.half_edge < 0).sum() == 1


def test_the_field_given_is_not_changed() -> None:
    (mesh,) = models.background(models.annulus(), 0.08)
    aligned = aligned_field(mesh)
    before = [a.copy() for a in (aligned.index, aligned.field.theta, aligned.field.rotation, mesh.port, mesh.points)]
    trace_face(mesh, aligned)
    after = (aligned.index, aligned.field.theta, aligned.field.rotation, mesh.port, mesh.points)
    assert all(np.array_equal(a, b) for a, b in zip(before, after))


def test_repeatable() -> None:
    (mesh,) = models.background(MODELS["two holes"], 0.05)
    aligned = aligned_field(mesh)
    one, two = trace_face(mesh, aligned), trace_face(mesh, aligned)
    assert one.patches == two.patches
    assert all(np.array_equal(p, q) for p, q in zip(one.polyline, two.polyline))


@pytest.mark.parametrize("name", ["two holes", "wedge 200", "crack"])
@given(st.floats(0, 6.28), st.floats(-3, 3), st.floats(-5, 5))
@settings(max_examples=4, deadline=None, derandomize=True)
def test_motion_and_scale_change_nothing(name: str, angle: float, log_scale: float, shift: float) -> None:
    (mesh,) = models.background(MODELS[name], 0.08)
    aligned = aligned_field(mesh)
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])

    def moved(points: np.ndarray) -> np.ndarray:
        return 10.0**log_scale * (points @ turn + shift)

    one, two = trace_face(mesh, aligned), trace_face(replace(mesh, points=moved(mesh.points)), aligned)
    assert one.patches == two.patches and np.array_equal(one.arcs, two.arcs)
    assert np.allclose(moved(one.position), two.position, atol=1e-7 * 10.0**log_scale)


def star(seed: int) -> Model:
    """A random star with sharp tips."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(3, 7))
    radius = np.where(np.arange(2 * n) % 2, rng.uniform(0.1, 0.5), 1.0) * rng.uniform(0.8, 1.0, 2 * n)
    a = np.pi * np.arange(2 * n) / n + rng.uniform(0, 6)
    return models.polygon(np.stack([radius * np.cos(a), radius * np.sin(a)], axis=1).tolist())


@given(st.integers(0, 10**6), st.floats(0.03, 0.12))
@settings(max_examples=15, deadline=None, derandomize=True)
def test_random_stars(seed: int, h: float) -> None:
    (mesh,) = models.background(star(seed), h)
    aligned = aligned_field(mesh)
    if (2 - aligned.index[mesh.boundary[:, 0]]).min() > 0:
        components_checked(mesh, aligned.index, trace_face(mesh, aligned))


@pytest.fixture(scope="module")
def disc_mesh() -> FaceMesh:
    return models.background(models.disc(), 0.04)[0]


@given(seed=st.integers(0, 10**6))
@settings(max_examples=15, deadline=None, derandomize=True)
def test_random_singularities_in_a_disc(disc_mesh: FaceMesh, seed: int) -> None:
    """Fields with given singularities need not be integrable: their separatrices miss one another and spiral."""
    mesh = disc_mesh
    rng = np.random.default_rng(seed)
    extra = int(rng.integers(0, 4))
    degree = [1] * (4 + extra) + [-1] * extra
    centre = np.zeros((0, 2))
    while len(centre) < len(degree):  # in the disc, of radius 0.354, and apart
        p = rng.uniform(-0.29, 0.29, 2)
        if np.hypot(*p) < 0.29 and np.all(np.linalg.norm(centre - p, axis=1) > 0.08):
            centre = np.vstack([centre, p])
    mid = midpoints(mesh)
    angle = sum(d / 4 * np.arctan2(*(mid - c)[:, ::-1].T) for d, c in zip(degree, centre))
    aligned = aligned_field(mesh, field_of(mesh, np.asarray(angle)))
    components_checked(mesh, aligned.index, trace_face(mesh, aligned))


def test_a_loop_without_cad_vertex_is_an_error() -> None:
    (mesh,) = models.background(models.annulus(), 0.1)
    aligned = aligned_field(mesh)
    with pytest.raises(LayoutError, match="no CAD vertex"):
        trace_face(replace(mesh, vertex=np.full(len(mesh.points), -1)), aligned)


def test_an_index_that_the_field_does_not_have_is_an_error() -> None:
    (mesh,) = models.background(models.square(), 0.1)
    aligned = aligned_field(mesh)
    index = aligned.index.copy()
    index[mesh.boundary[np.flatnonzero(mesh.vertex[mesh.boundary[:, 0]] < 0)[0], 0]] = -1
    with pytest.raises(LayoutError, match="does not have index"):
        trace_face(mesh, replace(aligned, index=index))
