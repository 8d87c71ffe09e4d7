"""Faces that have no divisions together: the mismatch, the pair that mends it, and the notch of a box."""

from __future__ import annotations

from dataclasses import replace

import gmsh
import numpy as np
import pytest

import gmsh_crossquad as cq
from gmsh_crossquad import faces_stage, stages
from gmsh_crossquad.errors import LayoutError
from gmsh_crossquad.field.pipeline import aligned_field
from gmsh_crossquad.field.repair import with_pairs
from gmsh_crossquad.layout.alone import has_divisions
from gmsh_crossquad.layout.cuts import Cut
from gmsh_crossquad.layout.face_tmesh import trace_face
from gmsh_crossquad.layout.glue import glue
from gmsh_crossquad.layout.quantize import Indivisible, quantize
from gmsh_crossquad.layout.together import divisible_together, mismatch
from gmsh_crossquad.options import MeshOptions
from gmsh_crossquad.source.formula import Singularities
from gmsh_crossquad.watch import Watch

from . import models, tmeshes

MODEL, TMESH = tmeshes.l_shape()
BOTTOM, TOP, RIGHT, LEFT = 0, 2, 1, 3  # curves of the square


def contradiction():
    """The L with n9 = n5 + n2 in its third patch and n5 = n9 in its second one; curve 2 has n2 >= 1."""
    one, two, three = TMESH.patches
    two = (((5, 1),), two[1], ((9, 1),), two[3])
    three = (three[0], three[1], ((2, 1), (5, 1)), three[3])
    return replace(TMESH, patches=(one, two, three))


def test_no_mismatch_where_there_are_divisions():
    assert not mismatch(MODEL, TMESH, [], np.ones(3)).any()


@pytest.mark.parametrize("cheap", [1, 2])
def test_the_mismatch_is_where_it_is_cheapest(cheap):
    tmesh = contradiction()
    weight = np.full(3, 5.0)
    weight[cheap] = 1.0
    # n9 = n5 + n2 + s: s = -1;  n5 = n9 + s: s = -1 with n9 = n5 + n2, n2 = 1
    expected = np.zeros((3, 2))
    expected[cheap, 0] = -1.0
    assert mismatch(MODEL, tmesh, [], weight) == pytest.approx(expected, abs=1e-6)
    with pytest.raises(Indivisible):
        quantize(MODEL, tmesh, np.ones(10))


def test_cuts_count():
    # n9 = n0 >= 3 and n9 = n5 <= 2: at least 1 is missing; a disjunction is read by its first option
    low, high = Cut(((((0, 1),), 3),)), Cut(((((5, -1),), -2), (((5, 1),), 0)))
    assert not mismatch(MODEL, TMESH, [low], np.ones(3)).any()
    assert np.abs(mismatch(MODEL, TMESH, [low, high], np.ones(3))).sum() == pytest.approx(1.0, abs=1e-6)


def test_no_divisions_are_missed_by_a_relaxation():
    # 2 n = 1 has no solution in whole numbers, but its multiple 2 n = 2 has: the conditions are lower bounds only
    double = replace(TMESH, patches=((((0, 1), (0, 1)), *TMESH.patches[0][1:]), *TMESH.patches[1:]))
    assert not mismatch(MODEL, double, [], np.ones(3)).any()
    assert quantize(MODEL, double, np.full(10, 0.3)).divisions[9] % 2 == 0


@pytest.mark.parametrize(
    "step, more, less", [((0, -1), BOTTOM, TOP), ((1, 0), RIGHT, LEFT), ((0, 1), TOP, BOTTOM), ((-1, 0), LEFT, RIGHT)]
)
def test_the_side_towards_the_plus_has_more_edges(step, more, less):
    model = models.square()
    (mesh,) = models.background(model, 0.05)
    half = 0.15 / model.scale
    places = half * np.array([step, np.negative(step)], float)
    aligned = with_pairs(mesh, aligned_field(mesh), places[None])
    plus, minus = aligned.added
    assert aligned.index[[plus, minus]].tolist() == [1, -1]
    assert np.linalg.norm(mesh.points[[plus, minus]] - places, axis=1).max() < 0.05
    tmesh = glue(model, [mesh], [trace_face(mesh, aligned)])
    n = quantize(model, tmesh, tmesh.length / 0.02).divisions
    count = [int(n[list(pieces)].sum()) for pieces in tmesh.pieces]
    one, other = sorted({0, 1, 2, 3} - {more, less})
    # the vertices of the pair are not exactly in line with the square
    assert count[more] - count[less] > max(5, 3 * abs(count[one] - count[other]))


def test_a_pair_without_room_is_refused():
    (mesh,) = models.background(models.square(), 0.05)
    aligned = aligned_field(mesh)
    assert with_pairs(mesh, aligned, np.zeros((1, 2, 2))) is None


@pytest.fixture
def notch():
    """A box, the unit of length, with a quarter of a cylinder cut out of one edge, not over its whole length."""
    gmsh.initialize(interruptible=False, readConfigFiles=False)
    gmsh.option.setNumber("General.Terminal", 0)
    occ = gmsh.model.occ
    occ.cut([(3, occ.addBox(0, 0, 0, 1, 1, 1))], [(3, occ.addCylinder(0.6, 1, 0, 1, 0, 0, 0.5))])
    occ.synchronize()
    yield
    gmsh.finalize()


def notch_faces():
    options = MeshOptions(size=0.15)
    model = stages.read_model(options)
    return model, faces_stage.faces_of_model(model, options, faces_stage.wishes(model, options), "keep", Watch(), [])


def test_the_faces_of_a_notch_have_divisions_alone_only(notch):
    model, faces = notch_faces()
    for mesh, tmesh in zip(faces.meshes, faces.tmeshes, strict=True):
        assert has_divisions(model, mesh, tmesh)
    tmesh = glue(model, faces.meshes, faces.tmeshes)
    with pytest.raises(Indivisible) as error:
        quantize(model, tmesh, tmesh.length / 0.1)
    found = divisible_together(model, faces.meshes, faces.fields, faces.tmeshes, error.value.cuts)
    (changed,) = found.pairs
    assert found.pairs[changed] == 1
    for f in range(len(model.faces)):
        assert (found.fields[f] is faces.fields[f]) == (f != changed)
    assert found.fields[changed].index.sum() == faces.fields[changed].index.sum()
    tmesh = glue(model, faces.meshes, found.tmeshes)
    assert not mismatch(model, tmesh, [], np.ones(len(tmesh.patches))).any()
    quantize(model, tmesh, tmesh.length / 0.1)
    assert divisible_together(model, faces.meshes, found.fields, found.tmeshes, ()) is None


def test_a_box_with_a_notch_is_meshed(notch):
    result = cq.mesh(0.15)
    assert result.quality.min_scaled_jacobian > 0.5
    assert any("a pair of singularities was added in surface" in note for note in result.notes)
    # the quarter disc has three corners, the pentagon five: index +1/4 and -1/4, and the pair
    _, _, nodes = gmsh.model.mesh.getElements(2)
    assert len(nodes) == 1
    quads = nodes[0].reshape(-1, 4)
    inside = np.unique(np.concatenate([gmsh.model.mesh.getNodes(2, tag)[0] for _, tag in gmsh.model.getEntities(2)]))
    valence = np.bincount(quads.ravel().astype(np.int64))[inside.astype(np.int64)]
    assert sorted(valence[valence != 4].tolist()) == [3, 3, 5, 5]


def test_other_sizes_of_blocks_are_not_tried_in_vain(notch, monkeypatch):
    tried = []

    def hopeless(*_):
        raise Indivisible("no divisions", entity=(2, 1), remedy="none")

    def mesh(model, faces, options, attempt, *rest):
        tried.append(attempt)
        return before(model, faces, options, attempt, *rest)

    before = stages.lay_out
    monkeypatch.setattr(faces_stage, "divisible_together", hopeless)
    monkeypatch.setattr(stages, "lay_out", mesh)
    with pytest.raises(LayoutError, match="no divisions"):
        stages.block_mesh(MeshOptions(size=0.15))
    keys = [(a.background, a.rule) for a in tried]
    assert keys == [(1.0, "keep"), (0.7, "keep"), (1.0, "divisible")]


def test_singularities_on_a_torus_get_a_pair():
    # cone points of 270 and 450 degrees must fit the holonomy of the handles, and there is no hole to help
    angles = np.array([[0.3, 0.5], [2.0, 1.5]])
    ring = 1 + 0.4 * np.cos(angles[:, 1])
    places = np.stack([ring * np.cos(angles[:, 0]), ring * np.sin(angles[:, 0]), 0.4 * np.sin(angles[:, 1])], axis=1)
    options = MeshOptions(size=0.12, field=Singularities(places, [1, -1]))
    gmsh.initialize(interruptible=False, readConfigFiles=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.model.occ.addTorus(0, 0, 0, 1, 0.4)
        gmsh.model.occ.synchronize()
        model = stages.read_model(options)
        wanted = faces_stage.wishes(model, options)
        given, found = (faces_stage.faces_of_model(model, options, wanted, rule, Watch(), []) for rule in ("keep", "divisible"))
    finally:
        gmsh.finalize()
    assert not has_divisions(model, given.meshes[0], given.tmeshes[0])
    assert has_divisions(model, found.meshes[0], found.tmeshes[0])
    index = found.fields[0].index
    assert sorted(index[index != 0].tolist()) == [-1, -1, 1, 1]
    assert index[list(found.fields[0].added)].tolist() == [1, -1]
