"""The field stage on Gmsh models: prescribed indices, sources per face, and what is said when they do not fit."""

import gmsh
import numpy as np
import pytest

from gmsh_crossquad.cad.background import background_meshes
from gmsh_crossquad.cad.read import read_model
from gmsh_crossquad.errors import CrossQuadError, FieldError
from gmsh_crossquad.faces_stage import face_fields
from gmsh_crossquad.field_stage import field_of_face, wishes
from gmsh_crossquad.options import MeshOptions
from gmsh_crossquad.source.formula import Singularities
from gmsh_crossquad.source.function import Function
from gmsh_crossquad.source.per_face import PerFace
from gmsh_crossquad.stages import block_mesh

pytestmark = pytest.mark.usefixtures("fresh_gmsh")


def round_plate(arcs, names=(), inside=()):
    """Unit disc of `arcs` equal arcs, points 1 to `arcs` on its rim, embedded points after them, with named physical points."""
    geo = gmsh.model.geo
    centre = geo.addPoint(0, 0, 0, tag=100)
    rim = [geo.addPoint(np.cos(a), np.sin(a), 0, tag=1 + k) for k, a in enumerate(2 * np.pi * np.arange(arcs) / arcs)]
    loop = geo.addCurveLoop([geo.addCircleArc(a, centre, b) for a, b in zip(rim, rim[1:] + rim[:1])])
    surface = geo.addPlaneSurface([loop])
    points = [geo.addPoint(x, y, 0, tag=arcs + 1 + k) for k, (x, y) in enumerate(inside)]
    geo.synchronize()
    gmsh.model.mesh.embed(0, points, 2, surface)
    for tag, name in names:
        gmsh.model.addPhysicalGroup(0, [tag], name=f"point {tag} {name}")  # Gmsh wants unique names
    gmsh.model.addPhysicalGroup(2, [surface], name="plate")


def two_plates():
    """Two unit squares side by side, surfaces 1 and 2."""
    occ = gmsh.model.occ
    faces = [(2, occ.addRectangle(x, 0, 0, 1, 1)) for x in (0, 1)]
    occ.fragment(faces, [])
    occ.synchronize()


def inside(mesh, aligned):
    inner = np.ones(len(mesh.points), bool)
    inner[mesh.boundary.ravel()] = False
    return sorted(aligned.index[inner & (aligned.index != 0)].tolist())


def test_indices_in_names_shape_the_field():
    round_plate(3, [(1, "index=1/4"), (2, "rim index=1/4"), (3, "index=.25"), (4, "index=+1/4")], [(0.1, 0.2)])
    model, (mesh,), (aligned,), notes = face_fields(MeshOptions())
    assert notes == []
    assert inside(mesh, aligned) == [1]
    v = int(np.flatnonzero(aligned.index * ~np.isin(np.arange(len(mesh.points)), mesh.boundary))[0])
    assert model.vertex_tags[mesh.vertex[v]] == 4
    rim = np.flatnonzero(np.isin(np.arange(len(mesh.points)), mesh.boundary) & (aligned.index != 0))
    assert sorted(model.vertex_tags[mesh.vertex[rim]]) == [1, 2, 3]
    assert aligned.residual < 1e-12


def test_smooth_singularities_follow_the_boundary_indices():
    round_plate(4)
    for wanted, expected in (({}, [1, 1, 1, 1]), ({1: "1/4", 3: "1/4"}, [1, 1]), ({2: -0.25}, [1, 1, 1, 1, 1])):
        _, (mesh,), (aligned,), _ = face_fields(MeshOptions(boundary_index=wanted))
        assert inside(mesh, aligned) == expected


def test_blocks_around_singular_points():
    # valence 4 - 4 I inside, 2 - 4 I quads at the boundary
    round_plate(3, [(1, "index=1/4"), (2, "index=1/4"), (3, "index=1/4"), (4, "index=1/4")], [(0.1, 0.2)])
    result = block_mesh(MeshOptions(size=0.2))
    quads = np.bincount(result.mesh.quads.ravel())
    row = {int(tag): quads[node] for tag, node in zip(result.model.vertex_tags, result.mesh.vertex_node)}
    assert [row[k] for k in (1, 2, 3, 4)] == [1, 1, 1, 3]


def test_negative_boundary_index_and_three_inside():
    round_plate(
        4, [(1, "index=1/4"), (2, "index=-1/4"), (3, "index=1/4")] + [(k, "index=1/4") for k in (5, 6, 7)],
        [(0.4, 0.3), (-0.4, 0.3), (0.0, -0.4)],
    )  # fmt: skip
    result = block_mesh(MeshOptions(size=0.15))
    quads = np.bincount(result.mesh.quads.ravel())
    row = {int(tag): quads[node] for tag, node in zip(result.model.vertex_tags, result.mesh.vertex_node)}
    assert [row[k] for k in (1, 2, 3, 5, 6, 7)] == [1, 3, 1, 3, 3, 3]
    assert row[4] == 2


def test_misfit_is_one_line_with_repairs():
    round_plate(4, [(1, "index=1/4"), (3, "index=-1/4"), (5, "index=1/4")], [(0.1, 0.2)])
    with pytest.raises(FieldError) as caught:
        face_fields(MeshOptions())
    line = str(caught.value)
    assert "\n" not in line
    assert line.startswith("the indices add up to +1/4 where chi = 1 is needed (inside: +1/4 at point 5; ")
    assert "boundary: +1/4 at point 1, -1/4 at point 3), surface 1: add 3 interior +1/4" in line
    assert "fix_indices" in line
    assert caught.value.exit_status == 2


def test_misfit_that_one_point_can_mend_names_it():
    round_plate(4, [(1, "index=1/4")])
    source = Singularities([(0.4, 0.0), (-0.4, 0.1), (0.0, 0.4), (0.1, -0.4)], [1, 1, 1, 1])
    with pytest.raises(
        FieldError, match=r"\+5/4 where chi = 1 .*add one interior -1/4, or remove the \+1/4 at .*, or set point 1"
    ):
        face_fields(MeshOptions(field=source))


def test_fix_indices_reports_what_it_changed():
    round_plate(4, [(1, "index=1/4")])
    four = Singularities([(0.4, 0.0), (-0.4, 0.1), (0.0, 0.4), (0.1, -0.4)], [1, 1, 1, 1])
    _, (mesh,), (aligned,), notes = face_fields(MeshOptions(field=four, fix_indices=True))
    assert notes == ["the index of point 1 was changed from +1/4 to 0"]
    assert inside(mesh, aligned) == [1, 1, 1, 1]
    three = Singularities([(0.4, 0.0), (-0.4, 0.1), (0.0, 0.4)], [1, 1, 1])
    _, (mesh,), (aligned,), notes = face_fields(MeshOptions(field=three, fix_indices=True, boundary_index={1: 0}))
    assert len(notes) == 1 and notes[0].startswith("a singularity of +1/4 was added at (")
    assert inside(mesh, aligned) == [1, 1, 1, 1]


def test_formula_and_embedded_point_join():
    round_plate(4, [(5, "index=1/4")], [(0.1, -0.4)])
    three = Singularities([(0.4, 0.0), (-0.4, 0.1), (0.0, 0.4)], [1, 1, 1])
    _, (mesh,), (aligned,), _ = face_fields(MeshOptions(field=three))
    assert inside(mesh, aligned) == [1, 1, 1, 1]
    assert aligned.index[np.flatnonzero(mesh.seed >= 0)].tolist() == [1, 1, 1]
    assert aligned.index[(mesh.vertex >= 0) & (mesh.opening_angle != mesh.opening_angle)].tolist() == [1]


def test_every_face_has_its_own_field():
    two_plates()
    pair = Singularities([(0.4, 0.5), (0.7, 0.4)], [1, -1])
    _, meshes, fields, _ = face_fields(MeshOptions(field=PerFace({1: pair})))
    assert [inside(m, a) for m, a in zip(meshes, fields)] == [[-1, 1], []]
    everywhere = Singularities([(0.4, 0.5), (0.7, 0.4), (1.4, 0.5), (1.7, 0.4)], [1, -1, 1, -1])
    _, meshes, fields, _ = face_fields(MeshOptions(field=everywhere))
    assert [inside(m, a) for m, a in zip(meshes, fields)] == [[-1, 1], [-1, 1]]
    result = block_mesh(MeshOptions(field=everywhere, size=0.1))
    assert len(result.mesh.quads) > 100


@pytest.mark.parametrize(
    "options, message",
    [
        ({"field": PerFace({7: Singularities([], [])})}, "a field is given for surface 7, which is not meshed"),
        ({"boundary_index": {1: "1/2"}}, r"index \+1/2 at a boundary point leaves no room for a block, point 1 at"),
        ({"boundary_index": {1: 1.5}}, r"leaves no room for a block, point 1"),
        ({"field": Singularities([(1.0, 0.0)], [1])}, "a singularity on the boundary.*boundary index"),
        ({"field": Singularities([(0.0, 0.2)], [5])}, r"\+5/4 where chi = 1 .*add one interior -1/4"),
    ],
)
def test_errors(options, message):
    round_plate(4)
    with pytest.raises(FieldError, match=message):
        face_fields(MeshOptions(**options))


def test_a_field_of_its_own_and_a_singular_point_contradict_each_other():
    class Own:
        def points(self):
            return np.zeros((0, 3))

        def on(self, frames):
            raise AssertionError

    round_plate(4, [(5, "index=1/4")], [(0.1, -0.4)])
    with pytest.raises(FieldError, match="a singular point is set in a face whose field has its own, point 5"):
        wishes(read_model(MeshOptions()), MeshOptions(field=Own()))


def test_an_index_at_a_point_with_two_sectors_is_refused():
    geo = gmsh.model.geo
    corners = [geo.addPoint(x, y, 0) for x, y in ((0, 0), (2, 0), (2, 2), (0, 2))]
    a, b = geo.addPoint(0.7, 1, 0), geo.addPoint(1.3, 1, 0)
    middle = geo.addPoint(1, 1, 0, tag=50)
    sides = [geo.addLine(p, q) for p, q in zip(corners, corners[1:] + corners[:1])]
    crack = [geo.addLine(a, middle), geo.addLine(middle, b)]
    surface = geo.addPlaneSurface([geo.addCurveLoop(sides)])
    geo.synchronize()
    gmsh.model.mesh.embed(1, crack, 2, surface)
    with pytest.raises(CrossQuadError, match="an index is set at a point where the surface has 2 sectors, point 50 at"):
        face_fields(MeshOptions(boundary_index={50: "1/4"}))


def ring():
    occ = gmsh.model.occ
    occ.cut([(2, occ.addDisk(0, 0, 0, 1, 1))], [(2, occ.addDisk(0.2, 0, 0, 0.4, 0.4))])
    occ.synchronize()


PAIR = Singularities([(-0.6, 0.4), (-0.5, -0.4)], [1, -1])


def test_relaxed_singularities_have_no_flux_around_holes():
    ring()
    _, _, (as_given,), _ = face_fields(MeshOptions(field=PAIR))
    _, (mesh,), (relaxed,), notes = face_fields(MeshOptions(field=PAIR, relax=True))
    assert abs(as_given.flux[1]) > 1.0
    assert abs(relaxed.flux[1]) < 0.01
    assert inside(mesh, relaxed) == [-1, 1]
    assert len(notes) == 1 and "singularities of surface 1 were moved, by up to" in notes[0]
    assert len(relaxed.moved) == 2
    turn = relaxed.given.theta + relaxed.phi + relaxed.psi - relaxed.field.theta
    assert np.abs(turn - np.pi / 2 * np.rint(turn / (np.pi / 2))).max() < 1e-9


def test_a_field_with_flux_gets_a_pair_or_moves():
    ring()
    result = block_mesh(MeshOptions(field=PAIR, size=0.08))
    assert sum("was added at" in note for note in result.notes) == 2
    (aligned,), (mesh,) = result.fields, result.meshes
    assert inside(mesh, aligned) == [-1, -1, 1, 1]
    assert len(aligned.added) == 2
    relaxed = block_mesh(MeshOptions(field=PAIR, size=0.08, relax=True))
    assert inside(relaxed.meshes[0], relaxed.fields[0]) == [-1, 1]


def test_a_field_that_is_not_kept_is_told():
    round_plate(4)
    model = read_model(MeshOptions())
    source = Function(lambda p: np.angle((p[:, 0] + 1j * p[:, 1]) ** 4 - 0.1) / 4)
    wanted = wishes(model, MeshOptions(field=source))
    (mesh,) = background_meshes(model, MeshOptions(), wanted.seeds)
    assert field_of_face(model, mesh, wanted)[1] == []
    assert field_of_face(model, mesh, wanted, "divisible")[1] == [
        "the given field of surface 1 was smoothed, its singularities kept"
    ]


def test_strong_singularities_are_split_for_a_mesh_only():
    round_plate(4)
    options = MeshOptions(field=Singularities([(0.1, 0.0)], [4]), size=0.15)
    _, (mesh,), (aligned,), notes = face_fields(options)
    assert inside(mesh, aligned) == [4] and notes == []
    result = block_mesh(options)
    assert inside(result.meshes[0], result.fields[0]) == [1, 1, 1, 1]
    assert any("was split into 4 of +1/4" in note for note in result.notes)
