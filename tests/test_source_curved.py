"""Sources of cross fields on curved faces: frames, angles, directions, eigenmodes, files, principal directions, heat frames."""

import sys
from dataclasses import replace

import gmsh
import numpy as np
import pytest

from gmsh_crossquad.cad.bending import edge_bending
from gmsh_crossquad.cad.curved_background import curved_meshes
from gmsh_crossquad.cad.read import read_model
from gmsh_crossquad.cad.spacing import curve_spacing, face_sizes
from gmsh_crossquad.errors import FieldError, InputError
from gmsh_crossquad.field.edge_frames import EdgeFrames
from gmsh_crossquad.field.singularities import QUARTER, corner_rotation, singular_vertices, snap_to_vertices, vertex_index
from gmsh_crossquad.field.smooth import wrap
from gmsh_crossquad.field.surface_mesh import SurfaceMesh
from gmsh_crossquad.field_stage import edge_frames
from gmsh_crossquad.options import MeshOptions
from gmsh_crossquad.source.curvature import Curvature
from gmsh_crossquad.source.eigenmode import Eigenmode
from gmsh_crossquad.source.frame import frame_angles, has_frame
from gmsh_crossquad.source.function import Function
from gmsh_crossquad.source.heat_frame import HeatFrame, _check_zeros
from gmsh_crossquad.source.parse import parse_field, parse_text
from gmsh_crossquad.source.samples import Samples
from tests import surface_meshes as sm
from tests.field_meshes import disc
from tests.source_frames import drift, frames_of, random_square


def curved(mesh: SurfaceMesh) -> EdgeFrames:
    return EdgeFrames(1, mesh, mesh.points, mesh.edge_normal)


def in_space(mesh: SurfaceMesh) -> SurfaceMesh:
    """A plane mesh as a surface in space."""
    return SurfaceMesh(np.c_[mesh.points, np.zeros(len(mesh.points))], mesh.triangles)


def folded(mesh: SurfaceMesh, angle: float) -> SurfaceMesh:
    """A mesh of the unit square, folded about the line x = .5 on which it has vertices: all lengths stay."""
    x, y = mesh.points.T
    beyond = np.maximum(x - 0.5, 0.0)
    return SurfaceMesh(np.c_[np.minimum(x, 0.5) + beyond * np.cos(angle), y, beyond * np.sin(angle)], mesh.triangles)


def grid(n: int = 12) -> SurfaceMesh:
    """The unit square; rows of equal triangles, turned alternately."""
    x, y = np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, n + 1))
    node = np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
    a, b, c, d = (k.ravel() for k in (node[:-1, :-1], node[:-1, 1:], node[1:, 1:], node[1:, :-1]))
    odd = np.add.outer(np.arange(n), np.arange(n)).ravel() % 2 == 1
    lower = np.where(odd[:, None], np.c_[a, b, d], np.c_[a, b, c])
    upper = np.where(odd[:, None], np.c_[b, c, d], np.c_[a, c, d])
    return SurfaceMesh(np.c_[x.ravel(), y.ravel()], np.concatenate([lower, upper]))


def angle_of(frames: EdgeFrames, direction):
    return np.arctan2(np.einsum("ec,ec->e", direction, frames.y), np.einsum("ec,ec->e", direction, frames.x))


def around_z(frames: EdgeFrames):
    x, y, _ = frames.places.T
    return angle_of(frames, np.stack([-y, x, np.zeros(len(x))], axis=1))


# ---- the frame


def test_frame_of_a_plane_is_the_x_axis():
    frames = curved(in_space(random_square(200)))
    axis = angle_of(frames, np.tile([1.0, 0, 0], (len(frames.places), 1)))
    assert np.abs(np.angle(np.exp(1j * (frame_angles(frames) - axis)))).max() < 1e-9


def test_frame_of_a_folded_plane_is_parallel():
    mesh = folded(grid(), np.radians(70))
    theta = frame_angles(curved(mesh))
    step = theta[mesh.triangle_edges] + mesh.edge_direction
    step = np.roll(step, -1, axis=1) - step
    assert np.abs(np.angle(np.exp(1j * step))).max() < 1e-9


@pytest.mark.parametrize(
    "mesh",
    [sm.octant(8), sm.cylinder(), sm.torus(cells=(24, 12)), sm.holed_sphere([(0.6 + 0.2j, 0.3), (-0.6 - 0.1j, 0.25)], 0.18),
     sm.torus(cells=(24, 12), holes=[(3, 7, 3, 6)])],
    ids=["octant", "cylinder", "torus", "holed sphere", "torus with a hole"],
)  # fmt: skip
def test_frames_have_no_zeros(mesh):
    """The turn around every triangle and every vertex is that of the surface, and directions come back after every way."""
    frames = curved(mesh)
    theta = frame_angles(frames)
    angle = theta[mesh.triangle_edges] + mesh.edge_direction
    step = np.roll(angle, -1, axis=1) - angle
    step -= 2 * np.pi * np.rint(step / (2 * np.pi))
    np.testing.assert_allclose(step.sum(axis=1), 0.0, atol=1e-9)
    turn = (mesh.curvature - corner_rotation(mesh, step))[~mesh.boundary_vertex]
    np.testing.assert_allclose(turn, 0.0, atol=1e-9)


def test_frame_of_a_cylinder_is_along_or_around():
    frames = curved(sm.cylinder())
    off = frame_angles(frames) - around_z(frames)
    assert np.abs(np.angle(np.exp(1j * (off - off[0])))).max() < 5e-3  # edges are chords


def test_a_sphere_has_no_frame():
    assert not has_frame(sm.sphere(3))
    with pytest.raises(FieldError, match="other than a torus has no frame"):
        Function(lambda p: np.zeros(len(p))).on(curved(sm.sphere(3)))


# ---- functions and samples


def test_angles_of_a_function_are_from_the_frame():
    frames = curved(folded(grid(), 0.6))
    field = Function(lambda p: 0.3 + 0.2 * p[:, 1]).on(frames)
    base = frame_angles(frames)
    assert np.abs(wrap(field.theta - base - 0.3 - 0.2 * frames.places[:, 1])).max() < 1e-9
    assert drift(frames.surface, field) < 1e-9


def test_directions_of_a_function_are_projected():
    """The z axis on a hemisphere: along the meridians, with an index of +1 at the pole."""
    mesh = sm.hemisphere(12)
    frames = curved(mesh)
    field = Function(lambda p: np.tile([0, 0, 1.0], (len(p), 1))).on(frames)
    far = frames.places[:, 2] < 0.9
    assert np.abs(wrap(field.theta - around_z(frames)))[far].max() < 1e-6 + 0.02
    rotation = snap_to_vertices(mesh, field.rotation)
    vertices, index = singular_vertices(mesh, rotation)
    assert index.sum() == 4
    assert mesh.points[vertices, 2].min() > 0.9


def test_samples_on_a_curved_mesh():
    """Vectors in space on another mesh of the same cylinder."""
    other = sm.cylinder()
    x, y, _ = other.points.T
    r = np.hypot(x, y)
    vectors = np.stack([-y / r, x / r, 0.7 + 0 * r], axis=1) + np.c_[x, y, 0 * x] / r[:, None]  # and a normal part
    mesh = sm.cylinder()
    turned = SurfaceMesh(
        mesh.points @ np.array([[np.cos(0.05), np.sin(0.05), 0], [-np.sin(0.05), np.cos(0.05), 0], [0, 0, 1]]), mesh.triangles
    )
    frames = curved(turned)
    field = Samples(other.points, other.triangles, vectors, "direction").on(frames)
    x, y, _ = frames.places.T
    wanted = angle_of(frames, np.stack([-y, x, 0.7 * np.hypot(x, y)], axis=1))
    assert np.abs(wrap(field.theta - wanted)).max() < 0.03


# ---- eigenmodes


@pytest.mark.parametrize("options", [{}, {"boundary": "neumann"}, {"lines": "isolines"}])
@pytest.mark.parametrize("number", [1, 4])
def test_eigenmodes_of_a_plane_in_space(number, options):
    """The intrinsic path gives what the plane one gives."""
    mesh = disc(11)
    source = Eigenmode(number, **options)
    plane, space = source.on(frames_of(mesh)), source.on(curved(in_space(mesh)))
    assert np.abs(wrap(plane.theta - space.theta)).max() < 1e-6
    assert np.abs(plane.rotation - space.rotation).max() < 1e-6


def test_eigenmode_of_a_folded_square_is_that_of_the_square():
    """Nothing but lengths counts."""
    flat, bent = Eigenmode(1).on(frames_of(grid(16))), Eigenmode(1).on(curved(folded(grid(16), 1.0)))
    assert np.abs(wrap(flat.theta - bent.theta)).max() < 1e-6


def test_eigenmode_of_a_sphere_has_the_sum_of_a_sphere():
    """x, y or z: a source and a sink, each of index +1."""
    mesh = sm.sphere(8)
    field = Eigenmode(1, "neumann").on(curved(mesh))
    vertices, index = singular_vertices(mesh, field.rotation)
    assert index.tolist() == [4, 4]
    np.testing.assert_allclose(mesh.points[vertices[0]], -mesh.points[vertices[1]], atol=0.25)
    assert drift(mesh, field) < 1e-9


def test_eigenmode_of_a_spherical_cap():
    """The first one has its extremum, of index 1/4 against the frame, at the pole."""
    mesh = sm.hemisphere(10)
    field = Eigenmode(1).on(curved(mesh))
    vertices, index = singular_vertices(mesh, field.rotation)
    assert index.tolist() == [1]
    assert mesh.points[vertices[0], 2] > 0.97


# ---- principal directions


@pytest.fixture
def occ():
    gmsh.initialize(readConfigFiles=False)
    gmsh.option.setNumber("General.Terminal", 0)
    yield gmsh.model.occ
    gmsh.finalize()


def cad_frames(kind):
    """Frames of the first face of a kind of the current model."""
    gmsh.model.occ.synchronize()
    gmsh.model.geo.synchronize()
    model = read_model(MeshOptions(background=1.5))
    row = next(i for i, f in enumerate(model.faces) if gmsh.model.getType(2, f.tag) == kind)
    sizes = face_sizes(model, MeshOptions())
    (mesh,) = curved_meshes(model, [row], curve_spacing(model, MeshOptions(), sizes), sizes)
    return model, mesh, edge_frames(model, mesh)


def test_cylinder_is_bent_around(occ):
    occ.addCylinder(0, 0, 0, 0, 0, 2, 0.7)
    _, _, frames = cad_frames("Cylinder")
    field = Curvature().on(frames)
    assert np.abs(wrap(field.theta - around_z(frames))).max() < 5e-3
    assert not np.any(snap_to_vertices(frames.surface, field.rotation).sum(axis=1).round(6))


def test_bending_of_a_torus(occ):
    """Principal curvatures 1 / r and cos(t) / (R + r cos(t)), along circles around the tube and around the axis."""
    occ.addTorus(0, 0, 0, 1, 0.4)
    model, mesh, frames = cad_frames("Torus")
    xx, yy, xy = edge_bending(model, mesh).T / (model.faces[0].extent * model.scale)
    ring = np.hypot(frames.places[:, 0], frames.places[:, 1])
    around = angle_of(frames, np.stack([-frames.places[:, 1], frames.places[:, 0], 0 * ring], axis=1))
    c, s = np.cos(around), np.sin(around)
    along, across = np.abs(c * c * xx + 2 * c * s * xy + s * s * yy), np.abs(s * s * xx - 2 * c * s * xy + c * c * yy)
    np.testing.assert_allclose(across, 1 / 0.4, rtol=0.05)
    np.testing.assert_allclose(along, np.abs(ring - 1) / 0.4 / ring, atol=0.08)
    field = Curvature().on(frames)
    assert np.abs(wrap(field.theta - around)).max() < 0.02


def test_cone_and_its_apex(occ):
    occ.addCone(0, 0, 0, 0, 0, 1, 1, 0)
    _, _, frames = cad_frames("Cone")
    field = Curvature().on(frames)
    off = np.abs(wrap(field.theta - around_z(frames)))
    assert off[frames.places[:, 2] < 0.85].max() < 0.05


def test_sphere_is_left_to_the_smooth_field(occ):
    occ.addSphere(0, 0, 0, 1)
    assert Curvature().on(cad_frames("Sphere")[2]) is None


def test_plane_is_left_to_the_smooth_field():
    assert Curvature().on(frames_of(disc(6))) is None


def test_umbilic_parts_are_filled():
    """A cylinder with an umbilic band: the field goes on along and around."""
    mesh = sm.cylinder()
    frames = curved(mesh)
    theta = around_z(frames)
    c, s = np.cos(theta), np.sin(theta)
    tensor = np.stack([c * c, s * s, c * s], axis=1)
    low, high = mesh.points[:, 2].min(), mesh.points[:, 2].max()
    band = np.abs(frames.places[:, 2] - 0.5 * (low + high)) < 0.25 * (high - low)
    tensor[band] += np.stack([s * s, c * c, -c * s], axis=1)[band]
    field = Curvature().on(replace(frames, bending=lambda: 3.0 * tensor))
    assert np.abs(wrap(field.theta - theta)).max() < 5e-3


def test_quick_turns_of_ninety_degrees_are_none():
    """The directions change places in a strip that is narrower than a triangle."""
    frames = curved(sm.cylinder())
    middle = 0.5 * np.ptp(frames.points[:, 2]) + frames.points[:, 2].min() + 0.011
    turn = QUARTER / (1 + np.exp(-(frames.places[:, 2] - middle) / 0.01))
    theta = around_z(frames)
    c, s = np.cos(theta + turn), np.sin(theta + turn)
    tensor = np.stack([c * c, s * s, c * s], axis=1)
    assert np.abs(wrap(turn)).max() > 0.2  # some edges are in the strip
    field = Curvature().on(replace(frames, bending=lambda: 3.0 * tensor))
    off = np.abs(wrap(field.theta - theta))
    assert off.max() < 0.45 and off[np.abs(frames.places[:, 2] - middle) > 0.15].max() < 0.01
    assert not np.any(singular_vertices(frames.surface, snap_to_vertices(frames.surface, field.rotation))[1])


def test_no_curvature_without_a_parametrization():
    mesh = sm.cylinder()
    with pytest.raises(FieldError, match="without a parametrization has no principal directions, surface 1"):
        Curvature().on(replace(curved(mesh), bending=lambda: np.full((len(mesh.edges), 3), np.nan)))


# ---- the vector heat method


def test_heat_frame_of_a_plane_is_the_x_axis():
    pytest.importorskip("potpourri3d")
    frames = curved(in_space(random_square(200)))
    axis = angle_of(frames, np.tile([1.0, 0, 0], (len(frames.places), 1)))
    for turn, field in ((0.0, HeatFrame()), (0.2, HeatFrame(0.2)), (0.2, HeatFrame(lambda p: 0.2 + 0 * p[:, 0]))):
        off = np.abs(wrap(field.on(frames).theta - axis - turn))
        assert np.median(off) < 0.01 and off.max() < 0.15  # the library bends frames at corners of the boundary


def test_heat_frame_of_an_octant_is_near_the_smoothest_one():
    pytest.importorskip("potpourri3d")
    frames = curved(sm.octant(12))
    field = HeatFrame().on(frames)
    inside = ~frames.surface.boundary_vertex
    np.testing.assert_allclose(vertex_index(frames.surface, field.rotation)[inside], 0.0, atol=1e-9)


def test_heat_frame_of_a_sphere_has_zeros():
    pytest.importorskip("potpourri3d")
    with pytest.raises(FieldError, match=r"vector heat method has [1-9]\d* zeros, surface 1 at \("):
        HeatFrame().on(curved(sm.sphere(6)))


def test_zeros_are_counted_by_integers():
    """(x, y) has one zero, of index 1, and (x^2 - y^2, -2 x y) one of index -2, wherever they are."""
    frames = curved(in_space(disc(8)))
    for power in (1, -2):
        z = (frames.places[:, 0] - 0.11) + 1j * (frames.places[:, 1] + 0.07)
        z = z if power > 0 else np.conj(z) ** 2
        direction = np.stack([z.real, z.imag, 0 * z.real], axis=1)
        with pytest.raises(FieldError, match=r"zeros") as caught:
            _check_zeros(frames, angle_of(frames, direction))
        assert np.linalg.norm(np.array(caught.value.location)[:2] - [0.11, -0.07]) < 0.3
    _check_zeros(frames, angle_of(frames, np.tile([0.3, 1.0, 0], (len(frames.places), 1))))


def test_heat_frame_without_the_package(monkeypatch):
    monkeypatch.setitem(sys.modules, "potpourri3d", None)
    with pytest.raises(FieldError, match=r"needs the package potpourri3d: pip install gmsh-crossquad\[heat\]"):
        HeatFrame().on(curved(sm.octant(4)))


def test_a_function_against_a_heat_frame_gives_angles():
    pytest.importorskip("potpourri3d")
    with pytest.raises(FieldError, match="gives directions"):
        HeatFrame(lambda p: p).on(curved(sm.octant(4)))
    with pytest.raises(InputError, match="angle of a heat frame"):
        HeatFrame(float("nan"))


# ---- texts


def test_texts():
    assert parse_text("curvature")[None].kind == "curvature"
    assert parse_text("1=heat-frame;2=heat-frame:numpy:sin")[2].arguments == ("numpy:sin",)
    loaders = (lambda tag: None, lambda path, view: None)
    assert isinstance(parse_field("curvature", *loaders), Curvature)
    assert parse_field("heat-frame", *loaders) == HeatFrame()
    assert parse_field("heat-frame:numpy:sin", *loaders).angle is np.sin
    for text in ("curvature:3", "heat-frame:0.3"):
        with pytest.raises(InputError, match="is none"):
            parse_text(text)
