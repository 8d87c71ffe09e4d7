"""The pipeline: from the current Gmsh model to a block-structured quad mesh, stage by stage.

    read -> background -> field -> trace -> glue -> quantize -> guide -> smooth -> fill

Nothing here touches the user's mesh; `cad.put.put_mesh` does, at the end, when everything has been checked.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace

import numpy as np

from .cad.background import background_meshes
from .cad.put import curve_points, vertex_points
from .cad.read import read_model
from .cad.sizes import SizeMap, target_sizes
from .cad.validate import validate
from .embed.place import place
from .embed.smooth import smooth
from .errors import LayoutError, MeshError
from .field.pipeline import aligned_field
from .fill.numbering import guide_chords
from .fill.pipeline import fill, poor_cells
from .layout.chords import Chords, arc_divisions, find_chords
from .layout.divisions import ChordDivisions, chord_divisions
from .layout.face_tmesh import trace_face
from .layout.glue import glue
from .layout.quantize import quantize
from .layout.quotient import Quotient, arc_points, quotient
from .layout.verify import problems
from .options import MeshOptions
from .records import AlignedField, FaceMesh, FaceTMesh, Float, Guide, Int, Model, QuadMesh, TMesh

__all__ = ["StagesResult", "Watch", "block_mesh"]

GUIDE_QUADS = 700
BACKGROUNDS = (1.0, 0.7, 0.5)
ROUNDS = 4
BLOCK_SIZES = 4
OVERLONG = 2.0
SHORT_CURVES = 0.4


@dataclass
class Watch:
    """Seconds per stage, and a listener that is told when a stage starts."""

    listener: Callable[[str], None] | None = None
    seconds: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Time a block of code under `name`."""
        if self.listener is not None:
            self.listener(name)
        start = time.perf_counter()
        try:
            yield
        finally:
            self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - start


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
    meshes, fields, tmeshes = _face_layouts(model, options, watch, notes)
    with watch.stage("sizes"):
        sizes = target_sizes(model, meshes, options)
    with watch.stage("glue"):
        tmesh = glue(model, meshes, tmeshes)
        size = _arc_sizes(model, tmesh, sizes)
    area = sum(float(_area(m)) for m in meshes)
    guide_size = float(np.sqrt(area / GUIDE_QUADS))
    coarse = _quantized(model, tmesh, size, np.maximum(options.block_size * size, np.sqrt(area) / 12), guide_size, watch)
    guide, fine = _smooth_guide(model, tmesh, coarse, size, guide_size, watch, notes)
    with watch.stage("fill"):
        mesh = fill(model, guide, fine, _evaluator(model), vertex_points(model))
    mesh = replace(mesh, notes=(*notes, *mesh.notes))
    return StagesResult(model, meshes, fields, tmesh, coarse, guide, fine, mesh, mesh.notes, dict(watch.seconds))


def _evaluator(model: Model) -> Callable[[int, Float], Float]:
    return lambda curve, parameters: curve_points(model, curve, parameters)


def _area(mesh: FaceMesh) -> float:
    a, b, c = (mesh.points[mesh.triangles[:, k]] for k in range(3))
    u, v = b - a, c - a
    return 0.5 * float(np.sum(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]))


def _face_layouts(
    model: Model, options: MeshOptions, watch: Watch, notes: list[str]
) -> tuple[tuple[FaceMesh, ...], tuple[AlignedField, ...], tuple[FaceTMesh, ...]]:
    """Background mesh, aligned field and T-mesh of every face; faces that fail are tried again on a finer background."""
    n = len(model.faces)
    meshes: list[FaceMesh | None] = [None] * n
    fields: list[AlignedField | None] = [None] * n
    tmeshes: list[FaceTMesh | None] = [None] * n
    error: LayoutError | None = None
    for factor in BACKGROUNDS:
        todo = [f for f in range(n) if tmeshes[f] is None]
        if not todo:
            break
        if error is not None:
            notes.append(f"{len(todo)} of {n} faces were traced again on a finer background mesh")
        with watch.stage("background"):
            tried = background_meshes(model, replace(options, background=options.background * factor))
        for f in todo:
            try:
                with watch.stage("field"):
                    aligned = aligned_field(tried[f])
                with watch.stage("trace"):
                    tmeshes[f] = trace_face(tried[f], aligned)
                meshes[f], fields[f] = tried[f], aligned
            except LayoutError as failure:
                error = failure
    if any(t is None for t in tmeshes):
        assert error is not None
        raise error
    return (
        tuple(m for m in meshes if m is not None),
        tuple(a for a in fields if a is not None),
        tuple(t for t in tmeshes if t is not None),
    )


def _arc_sizes(model: Model, tmesh: TMesh, sizes: SizeMap) -> Float:
    """Target size (a,) along every arc: the mean at its quarter points."""
    if sizes.constant is not None:
        return np.full(len(tmesh.length), sizes.constant)
    out = np.empty(len(tmesh.length))
    quarter = np.array([0.125, 0.375, 0.625, 0.875])
    face_of_arc = np.full(len(tmesh.length), -1, np.int64)
    for patch, face in zip(tmesh.patches, tmesh.patch_face.tolist()):
        for side in patch:
            for arc, _ in side:
                face_of_arc[arc] = face
    for arc in range(len(out)):
        c = int(tmesh.arc_curve[arc])
        if c >= 0:
            out[arc] = float(np.mean(sizes.at_curve(c, tmesh.arc_start[arc] + quarter * tmesh.length[arc])))
        else:
            f = int(face_of_arc[arc])
            line = tmesh.polyline[arc]
            rows = np.unique((quarter * (len(line) - 1)).round().astype(int))
            out[arc] = float(np.mean(sizes.at_face(f, model.faces[f].local(line[rows]))))
    return out


def _quantized(model: Model, tmesh: TMesh, size: Float, block: Float, guide_size: float, watch: Watch) -> Int:
    """Coarse divisions of the arcs: as few blocks as the sizes allow.

    Where short curves keep the chords of large blocks from being divided, smaller blocks leave the short curves alone.
    """
    with watch.stage("quantize"):
        best: tuple[float, Int] | None = None
        usual = float(np.median([curve.length for curve in model.curves]))
        while usual < SHORT_CURVES * block.mean() and (block > size).any():
            block = np.maximum(0.5 * block, size)
        for _ in range(BLOCK_SIZES):
            coarse = quantize(model, tmesh, tmesh.length / block).divisions
            wrong = problems(model, tmesh, quotient(tmesh, 3 * coarse))
            if wrong:
                raise LayoutError(f"the quantized layout is not valid ({wrong[0]})", remedy="another size may help")
            chords = find_chords(tmesh, quotient(tmesh, coarse))
            longest = chord_divisions(model, tmesh, coarse, chords, np.maximum(size, guide_size), guide_size).longest
            if best is None or longest < 0.8 * best[0]:
                best = longest, coarse
            if longest < OVERLONG:
                break
            if (block <= size).all():
                break
            block = np.maximum(0.5 * block, size)
    assert best is not None
    return best[1]


def _smooth_guide(
    model: Model, tmesh: TMesh, coarse: Int, size: Float, guide_size: float, watch: Watch, notes: list[str]
) -> tuple[Guide, Int]:
    """The smoothed guide grid and its final divisions; chords of cells that cannot be filled well get more guide cells."""
    with watch.stage("guide"):
        chords = find_chords(tmesh, quotient(tmesh, coarse))
    finer: Int | None = None
    best: tuple[int, float, Guide, Int] | None = None
    for round_ in range(ROUNDS):
        with watch.stage("guide"):
            divisions = chord_divisions(model, tmesh, coarse, chords, size, guide_size, finer=finer)
            q = quotient(tmesh, arc_divisions(chords, divisions.guide))
            wrong = problems(model, tmesh, q)
            if wrong:
                raise LayoutError(f"the guide grid is not valid ({wrong[0]})", remedy="another size may help")
            start = place(model, tmesh, q, tuple(_curve_fine(chords, divisions, pieces) for pieces in tmesh.pieces))
            coarse_chord = _coarse_chords(tmesh, q, chords, divisions)
            fine = divisions.fine[coarse_chord]
        with watch.stage("smooth"):
            guide, report = smooth(start, model)
        with watch.stage("fill"):
            bad = report.inverted
            if not len(bad):
                bad = poor_cells(model, guide, fine, _evaluator(model), vertex_points(model))
        if best is None or (-len(report.inverted), report.min_scaled_jacobian) > best[:2]:
            best = (-len(report.inverted), report.min_scaled_jacobian, guide, fine)
        if not len(bad):
            break
        if round_ + 1 < ROUNDS:
            notes.append(f"{len(bad)} guide cells could not be filled well; their chords were refined")
        _, quad_edges, chord, _ = guide_chords(guide.quads)
        finer = divisions.guide.copy()
        finer[np.unique(coarse_chord[chord[quad_edges[bad]]])] *= 2
    assert best is not None
    inverted, _, guide, fine = best
    if inverted:
        raise MeshError("the layout cannot be laid into the faces without inverted cells", remedy="a smaller size may help")
    return guide, fine


def _curve_fine(chords: Chords, divisions: ChordDivisions, pieces: tuple[int, ...]) -> Int:
    """Final edges of every guide edge along a curve."""
    segment = np.concatenate([chords.arc_segments[arc] for arc in pieces])
    return np.repeat(divisions.fine[segment], divisions.guide[segment])


def _coarse_chords(tmesh: TMesh, q: Quotient, chords: Chords, divisions: ChordDivisions) -> Int:
    """Coarse chord of every guide chord; every guide chord ends on an arc or crosses one."""
    edges, _, chord, n = guide_chords(q.quads)
    keys = edges[:, 0] * q.n_vertices + edges[:, 1]
    out = np.full(n, -1, np.int64)
    for arc in np.flatnonzero(q.divisions > 0).tolist():
        v = q.vertex[arc_points(tmesh, q.divisions, q.offset, arc)]
        key = np.minimum(v[:-1], v[1:]) * q.n_vertices + np.maximum(v[:-1], v[1:])
        segment = chords.arc_segments[arc]
        out[chord[np.searchsorted(keys, key)]] = np.repeat(segment, divisions.guide[segment])
    return out
