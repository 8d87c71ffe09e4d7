"""The pipeline: from the current Gmsh model to a block-structured quad mesh, stage by stage.

    read -> background -> field -> trace -> glue -> quantize -> guide -> smooth -> fill

Nothing here touches the user's mesh; `cad.put.put_mesh` does, at the end, when everything has been checked.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from .cad.background import background_meshes
from .cad.put import curve_points, vertex_points
from .cad.read import read_model
from .cad.sizes import target_sizes
from .cad.validate import validate
from .errors import CrossQuadError, LayoutError, MeshError
from .field.pipeline import aligned_field
from .fill.curve_fit import curve_fit
from .fill.pipeline import fill
from .guide import GuideResult, coarse_divisions, smooth_guide
from .layout.arc_sizes import arc_sizes
from .layout.face_tmesh import trace_face
from .layout.glue import glue
from .options import MeshOptions
from .records import AlignedField, FaceMesh, FaceTMesh, Float, Guide, Int, Model, QuadMesh, TMesh
from .watch import Watch

__all__ = ["StagesResult", "Watch", "block_mesh"]

GUIDE_QUADS = 700
BLOCKS = 12
CROWDED = 0.5
MANY_ARCS = 3_500
# factors on the background's and on the blocks' edge length, and whether short curves cap the divisions of chords: in the order
# in which they are tried until the mesh is good
ATTEMPTS = ((1.0, 1.0, True), (1.0, 0.4, True), (1.0, 1.0, False), (1.0, 0.15, True), (0.7, 1.0, True))
GOOD_QUALITY = 0.02
GOOD_FIT = 0.3
MOST_WORK = 20_000


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


def block_mesh(options: MeshOptions, watch: Watch | None = None) -> StagesResult:
    """Mesh the current Gmsh model; returns records only.

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
    notes: list[str] = []
    with watch.stage("read"):
        model = read_model(options)
        validate(model)
    notes += model.notes
    faces: dict[float, _Faces] = {}
    failure: CrossQuadError | None = None
    best: tuple[tuple[bool, bool, float], StagesResult] | None = None
    before = watch.work
    for background, blocks, capped in ATTEMPTS:
        if 2 * watch.work - before > MOST_WORK:  # as much again as the last attempt took would be too much
            break
        before = watch.work
        try:
            if background not in faces:
                faces[background] = _faces(model, replace(options, background=options.background * background), watch, notes)
            found = faces[background]
            tried = replace(options, block_size=options.block_size * blocks)
            tmesh, coarse, result, mesh = _mesh(model, found, tried, BLOCKS / blocks, capped, watch)
        except (LayoutError, MeshError) as error:
            failure = failure or error
            notes.append(f"another layout was tried, since: {error.what}")
            continue
        fit = curve_fit(mesh)
        score = (result.quality > GOOD_QUALITY, fit < GOOD_FIT, result.quality)
        if best is None or score > best[0]:
            doubts = [] if score[0] else [f"some cells are poor (scaled Jacobian {result.quality:.2g})"]
            doubts += [] if score[1] else ["some edges on curves are much longer than those beside them"]
            mesh = replace(mesh, notes=(*notes, *result.notes, *mesh.notes, *doubts))
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
    model: Model, faces: _Faces, options: MeshOptions, blocks: float, capped: bool, watch: Watch
) -> tuple[TMesh, Int, GuideResult, QuadMesh]:
    """Layout, guide grid and final mesh from the faces' T-meshes; `blocks` is the least number across the model."""
    with watch.stage("sizes"):
        sizes = target_sizes(model, faces.meshes, options)
    with watch.stage("glue"):
        tmesh = glue(model, faces.meshes, faces.tmeshes)
        size, user_size = arc_sizes(model, tmesh, sizes)
    area = sum(_area(m) for m in faces.meshes)
    guide_size = float(np.sqrt(area / GUIDE_QUADS))
    with watch.stage("quantize"):
        block = np.maximum(options.block_size * user_size, np.sqrt(area) / blocks)
        if len(block) > MANY_ARCS:
            block = np.maximum(0.25 * block, user_size)  # the program is much harder where most arcs are shorter than a block
        coarse = coarse_divisions(model, tmesh, np.where(size < CROWDED * user_size, size, block))
    evaluate, vertices = _evaluator(model), vertex_points(model)
    result = smooth_guide(model, tmesh, coarse, user_size, guide_size, evaluate, vertices, watch, capped)
    with watch.stage("fill"):
        mesh = fill(model, result.guide, result.fine, evaluate, vertices)
    return tmesh, coarse, result, mesh


def _evaluator(model: Model) -> Callable[[int, Float], Float]:
    return lambda curve, parameters: curve_points(model, curve, parameters)


def _area(mesh: FaceMesh) -> float:
    a, b, c = (mesh.points[mesh.triangles[:, k]] for k in range(3))
    u, v = b - a, c - a
    return 0.5 * float(np.sum(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]))


def _faces(model: Model, options: MeshOptions, watch: Watch, notes: list[str]) -> _Faces:
    """Background mesh, aligned field and T-mesh of every face; faces that fail are tried again on a finer background."""
    n = len(model.faces)
    done: list[tuple[FaceMesh, AlignedField, FaceTMesh] | None] = [None] * n
    failure: LayoutError | None = None
    for factor in (1.0, 0.7, 0.5):
        todo = [f for f in range(n) if done[f] is None]
        if not todo:
            break
        if failure is not None:
            notes.append(f"{len(todo)} of {n} faces were traced again on a finer background mesh")
        with watch.stage("background"):
            meshes = background_meshes(model, replace(options, background=options.background * factor))
        for f in todo:
            try:
                with watch.stage("field"):
                    aligned = aligned_field(meshes[f])
                with watch.stage("trace"):
                    tmesh = trace_face(meshes[f], aligned)
                done[f] = (meshes[f], aligned, tmesh)
            except LayoutError as error:
                failure = _located(model, f, error)
    parts = [d for d in done if d is not None]
    if len(parts) < n:
        assert failure is not None
        raise failure
    return _Faces(tuple(p[0] for p in parts), tuple(p[1] for p in parts), tuple(p[2] for p in parts))


def _located(model: Model, face: int, error: LayoutError) -> LayoutError:
    """The error of a face's stage with the face's tag and the place in the user's coordinates."""
    place = error.location
    if place is not None and len(place) == 2:
        place = tuple((model.origin + model.scale * model.faces[face].world(np.array([place]))[0]).tolist())
    return LayoutError(error.what, entity=error.entity or (2, model.faces[face].tag), location=place, remedy=error.remedy)
