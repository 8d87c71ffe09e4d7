"""The pipeline: from the current Gmsh model to a block-structured quad mesh, stage by stage.

    read -> background -> field -> trace -> glue -> quantize -> guide -> smooth -> fill

Nothing here touches the user's mesh; `cad.put.put_mesh` does, at the end, when everything has been checked.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple, TypeVar

import numpy as np

from .cad.background import background_meshes
from .cad.curve_places import CurvePlaces
from .cad.joined_surfaces import JoinedSurfaces, cad_surfaces
from .cad.put import vertex_points
from .cad.read import read_model
from .cad.sizes import target_sizes
from .cad.validate import validate
from .errors import CrossQuadError, LayoutError, MeshError
from .field.surface_mesh import surface_of
from .field_stage import Rule, Wishes, changes_of, field_of_face, located, wishes
from .fill.curve_fit import curve_fit
from .fill.pipeline import fill
from .guide import GuideResult, TooManyCells, coarse_divisions, smooth_guide
from .layout.alone import divisible
from .layout.arc_sizes import arc_sizes
from .layout.face_tmesh import trace_face
from .layout.glue import glue
from .layout.quantize import Indivisible
from .layout.separable import parts_of_arcs
from .layout.together import divisible_together
from .options import MeshOptions
from .records import AlignedField, FaceMesh, FaceTMesh, Float, Guide, Int, Model, QuadMesh, TMesh
from .watch import Watch

__all__ = ["StagesResult", "Watch", "block_mesh", "face_fields"]

T = TypeVar("T")

GUIDE_QUADS = 700
PART_QUADS = 100  # at least, of every part of an assembly
BLOCKS = 12
CROWDED = 0.5
MANY_ARCS = 3_500
GOOD_QUALITY = 0.02
GOOD_FIT = 0.3
MOST_WORK = 30_000
MOST_WORK_CURVED = 20_000
ARC_WORK = 3  # of an arc in the quantization of a shell, in smoothed quads


class Attempt(NamedTuple):
    """Factors on the edge length of the background and of blocks, whether short curves cap the divisions of chords, and what is
    done with a given field (see `field_of_face`)."""

    background: float = 1.0
    blocks: float = 1.0
    capped: bool = True
    rule: Rule = "keep"
    pinned: bool = True


# in the order in which they are tried until the mesh is good
ATTEMPTS = (
    Attempt(),
    Attempt(blocks=0.4),
    Attempt(capped=False),
    Attempt(blocks=0.15),
    Attempt(background=0.7),
    Attempt(rule="divisible"),
)
GIVEN_ATTEMPTS = (
    Attempt(),
    Attempt(rule="divisible"),
    Attempt(rule="divisible", pinned=False),
    Attempt(rule="divisible", blocks=0.4),
    Attempt(rule="divisible", capped=False),
    Attempt(rule="divisible", background=0.7),
    Attempt(rule="divisible", background=0.7, pinned=False),
)


@dataclass(frozen=True)
class StagesResult:
    """What every stage made.

    Attributes
    ----------
    model : Model
    meshes : tuple of FaceMesh
    fields : tuple of AlignedField
    tmesh : TMesh
    coarse : (a,) int64
        Coarse divisions of the arcs.
    guide : Guide
    fine : (c,) int64
        Final edges per guide edge, per guide chord (numbered as by `fill.numbering.guide_chords`).
    mesh : QuadMesh
    notes : tuple of str
        Fall-backs that were taken.
    timings : dict of str -> float
        Seconds per stage.
    """

    model: Model
    meshes: tuple[FaceMesh, ...]
    fields: tuple[AlignedField, ...]
    tmesh: TMesh
    coarse: Int
    guide: Guide
    fine: Int
    mesh: QuadMesh
    notes: tuple[str, ...]
    timings: dict[str, float]


@dataclass(frozen=True)
class _Faces:
    """Background mesh, aligned field and T-mesh of every face."""

    meshes: tuple[FaceMesh, ...]
    fields: tuple[AlignedField, ...]
    tmeshes: tuple[FaceTMesh, ...]
    notes: tuple[str, ...]

    def free(self) -> _Faces:
        """The same without places that singularities must keep."""
        meshes = tuple(replace(mesh, seed=np.full(len(mesh.points), -1, np.int64)) for mesh in self.meshes)
        return replace(self, meshes=meshes, notes=(*self.notes, "singular points may have moved a little in the mesh"))

    def together(self, model: Model, error: Indivisible) -> _Faces | None:
        """The same with pairs of singularities added so that the layouts have divisions together; None if they may have them."""
        found = divisible_together(model, self.meshes, self.fields, self.tmeshes, error.cuts)
        if found is None:
            return None
        notes = list(self.notes)
        for f, pairs in sorted(found.pairs.items()):
            what = "a pair of singularities was" if pairs == 1 else f"{pairs} pairs of singularities were"
            notes.append(f"{what} added in surface {model.faces[f].tag}, since the faces could not be divided together")
        return replace(self, fields=found.fields, tmeshes=found.tmeshes, notes=tuple(notes))


def block_mesh(options: MeshOptions, watch: Watch | None = None) -> StagesResult:
    """Mesh the current Gmsh model; returns records only.

    Where faces that were joined cannot be meshed, every CAD curve is followed instead, and a note says so.

    Parameters
    ----------
    options : MeshOptions
    watch : Watch, optional

    Raises
    ------
    CrossQuadError
        A stage failed; the message says where and what to do.
    """
    watch = watch or Watch()
    try:
        return _block_mesh(options, watch)
    except (LayoutError, MeshError) as error:
        if not options.feature_angle:
            raise
        note = f"all curves were followed, since with joined faces: {error.what}"
        made = _block_mesh(replace(options, feature_angle=None), watch)
    mesh = replace(made.mesh, notes=(note, *made.mesh.notes))
    return replace(made, mesh=mesh, notes=mesh.notes)


def _block_mesh(options: MeshOptions, watch: Watch) -> StagesResult:
    """What `block_mesh` does with these options, and no others."""
    notes: list[str] = []
    with watch.stage("read"):
        model = read_model(options)
        validate(model)
        wanted = wishes(model, options)
    notes += model.notes
    faces: dict[tuple[float, Rule], _Faces] = {}
    hopeless: set[tuple[float, Rule]] = set()
    failed: set[tuple[float, Rule]] = set()
    seen: set[tuple[object, ...]] = set()
    failure: CrossQuadError | None = None
    best: tuple[tuple[bool, bool, float], StagesResult] | None = None
    before = watch.work
    shell = any(face.curved for face in model.faces)
    for attempt in _attempts(wanted, options):
        if 2 * watch.work - before > (
            MOST_WORK_CURVED if shell else MOST_WORK
        ):  # as much again as the last attempt took would be too much
            break
        before = watch.work
        key = attempt.background, attempt.rule
        if key in failed:
            continue
        try:
            if key not in faces:
                failed.add(key)
                finer = replace(options, background=options.background * attempt.background)
                faces[key] = _faces(model, finer, wanted, attempt.rule, watch, notes)
                failed.remove(key)
            if key in hopeless:  # other sizes of blocks change nothing
                continue
            found = faces[key] if attempt.pinned else faces[key].free()
            tried = replace(options, block_size=options.block_size * attempt.blocks)
            try:
                made = _mesh(model, found, tried, attempt, watch, seen)
            except Indivisible as error:
                if wanted.given and attempt.rule != "divisible":  # first each face alone
                    raise
                try:
                    with watch.stage("repair"):
                        repaired = faces[key].together(model, error)
                except Indivisible:
                    hopeless.add(key)
                    raise
                if repaired is None:
                    raise
                faces[key] = repaired
                found = faces[key] if attempt.pinned else faces[key].free()
                made = _mesh(model, found, tried, attempt, watch, seen)
            if made is None:  # the layout of an earlier attempt
                continue
            tmesh, coarse, result, mesh = made
        except (LayoutError, MeshError) as error:
            if isinstance(failure, TooManyCells) and isinstance(error, TooManyCells):
                break
            failure = failure or error
            if key in failed and isinstance(error, MeshError):  # Gmsh has no background triangles
                break
            notes.append(f"another layout was tried, since: {error.what}")
            continue
        fit = curve_fit(mesh)
        score = (result.quality > GOOD_QUALITY, fit < GOOD_FIT, result.quality)
        if best is None or score > best[0]:
            doubts = [] if score[0] else [f"some cells are poor (scaled Jacobian {result.quality:.2g})"]
            doubts += [] if score[1] else ["some edges on curves are much longer than those beside them"]
            mesh = replace(mesh, notes=(*notes, *found.notes, *result.notes, *mesh.notes, *doubts))
            best = (
                score,
                StagesResult(
                    model, found.meshes, found.fields, tmesh, coarse, result.guide, result.fine, mesh, mesh.notes, watch.seconds
                ),
            )
        if score[0] and score[1]:
            break
    if best is not None:
        return best[1]
    assert failure is not None
    raise failure


def _mesh(
    model: Model, faces: _Faces, options: MeshOptions, attempt: Attempt, watch: Watch, seen: set[tuple[object, ...]]
) -> tuple[TMesh, Int, GuideResult, QuadMesh] | None:
    """Layout, guide grid and final mesh from the faces' T-meshes; None if `seen` has the same layout."""
    which = attempt.background, attempt.rule, attempt.pinned, attempt.capped
    surfaces = cad_surfaces(model, faces.meshes)
    with watch.stage("sizes"):
        sizes = target_sizes(model, faces.meshes, options)
    with watch.stage("glue"):
        tmesh = glue(model, faces.meshes, faces.tmeshes)
        size, user_size = arc_sizes(model, tmesh, sizes)
    extent, guide_size, arcs = _parts(tmesh, np.array([_area(m) for m in faces.meshes]))
    if surfaces.curved.any():
        watch.work += ARC_WORK * len(tmesh.length)
    with watch.stage("quantize"):
        block = np.maximum(options.block_size * user_size, extent * attempt.blocks / BLOCKS)
        # the program is much harder where most arcs are shorter than a block
        block = np.where(arcs > MANY_ARCS, np.maximum(0.25 * block, user_size), block)
        wanted = np.where(size < CROWDED * user_size, size, block)
        if _known((*which, "sizes", wanted.tobytes()), seen):
            return None
        coarse = coarse_divisions(model, tmesh, wanted)
        if _known((*which, "divisions", coarse.tobytes()), seen):
            return None
    evaluate, vertices = CurvePlaces.find(model, surfaces), vertex_points(model)
    result = smooth_guide(model, surfaces, tmesh, coarse, user_size, guide_size, evaluate, vertices, watch, attempt.capped)
    with watch.stage("fill"):
        mesh = fill(model, surfaces, result.guide, result.fine, evaluate, vertices)
        if isinstance(surfaces, JoinedSurfaces):
            mesh = surfaces.owned(mesh)
    return tmesh, coarse, result, mesh


def _parts(tmesh: TMesh, area: Float) -> tuple[Float, Float, Int]:
    """For every arc, of the connected part of the model that it is in: a length, the guide edge, and the number of arcs.

    A part of an assembly gets the blocks that it has alone, and its share of the guide cells, but not too few.
    """
    part = parts_of_arcs(tmesh)
    in_part = np.zeros(len(area), np.int64)
    for patch, sides in enumerate(tmesh.patches):
        in_part[tmesh.patch_face[patch]] = part[sides[0][0][0]]
    own = np.bincount(in_part, area)
    quads = np.maximum(GUIDE_QUADS * (own / own.sum()), PART_QUADS)
    return np.sqrt(own)[part], np.sqrt(own / quads)[part], np.bincount(part)[part]


def _known(key: tuple[object, ...], seen: set[tuple[object, ...]]) -> bool:
    """Whether `seen` has the key, which it has afterwards."""
    known = key in seen
    seen.add(key)
    return known


def _area(mesh: FaceMesh) -> float:
    return float(surface_of(mesh).area.sum())


def _attempts(wanted: Wishes, options: MeshOptions) -> tuple[Attempt, ...]:
    """What is tried, in order."""
    if not wanted.given:
        return ATTEMPTS
    if options.relax:
        return (*(a._replace(rule="relaxed") for a in ATTEMPTS), Attempt(rule="divisible"))
    return tuple(a for a in GIVEN_ATTEMPTS if a.pinned or (options.relax is None and wanted.pinned))


def face_fields(options: MeshOptions, watch: Watch | None = None) -> tuple[Model, list[FaceMesh], list[AlignedField], list[str]]:
    """The aligned cross field of every face of the current Gmsh model: the first stages alone.

    Returns
    -------
    Model, list of FaceMesh, list of AlignedField, list of str
        The last one are notes.

    Raises
    ------
    CrossQuadError
    """
    watch = watch or Watch()
    with watch.stage("read"):
        model = read_model(options)
        validate(model)
        wanted = wishes(model, options)
    notes = list(model.notes)

    def work(mesh: FaceMesh) -> tuple[FaceMesh, AlignedField, list[str]]:
        with watch.stage("field"):
            return mesh, *field_of_face(model, mesh, wanted, "relaxed" if options.relax else "keep", split=False)

    parts = _on_all_faces(model, options, wanted, watch, notes, work)
    return model, [p[0] for p in parts], [p[1] for p in parts], notes + [note for p in parts for note in p[2]]


def _faces(model: Model, options: MeshOptions, wanted: Wishes, rule: Rule, watch: Watch, notes: list[str]) -> _Faces:
    """Background mesh, aligned field and T-mesh of every face."""

    def work(mesh: FaceMesh) -> tuple[FaceMesh, AlignedField, FaceTMesh, list[str]]:
        with watch.stage("field"):
            aligned, changes = field_of_face(model, mesh, wanted, "harmonic" if rule == "divisible" else rule)
        with watch.stage("trace"):
            tmesh = trace_face(mesh, aligned)
        if rule == "divisible":
            with watch.stage("repair"):
                other, tmesh = divisible(model, mesh, aligned, tmesh, np.zeros(0, np.int64), move=options.relax is None)
            changes = list(dict.fromkeys([*changes, *changes_of(model, mesh, aligned.index, other)]))
            aligned = other
        return mesh, aligned, tmesh, changes

    parts = _on_all_faces(model, options, wanted, watch, notes, work)
    changed = tuple(note for p in parts for note in p[3])
    return _Faces(tuple(p[0] for p in parts), tuple(p[1] for p in parts), tuple(p[2] for p in parts), changed)


def _on_all_faces(
    model: Model, options: MeshOptions, wanted: Wishes, watch: Watch, notes: list[str], work: Callable[[FaceMesh], T]
) -> list[T]:
    """What `work` makes of the background mesh of every face; faces where it fails are tried again on a finer background."""
    done: dict[int, T] = {}
    failure: LayoutError | None = None
    n = len(model.faces)
    for factor in (1.0, 0.7, 0.5):
        todo = [f for f in range(n) if f not in done]
        if not todo:
            break
        if failure is not None:
            notes.append(f"{len(todo)} of {n} faces were done again on a finer background mesh")
        with watch.stage("background"):
            meshes = background_meshes(model, replace(options, background=options.background * factor), wanted.seeds)
        for f in todo:
            try:
                done[f] = work(meshes[f])
            except LayoutError as error:
                failure = located(model, f, error)
    if len(done) < n:
        assert failure is not None
        raise failure
    return [done[f] for f in range(n)]
