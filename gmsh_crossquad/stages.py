"""The pipeline: from the current Gmsh model to a block-structured quad mesh, stage by stage.

    read -> background -> field -> trace -> glue -> quantize -> guide -> smooth -> fill

The stages of single faces are in `faces_stage`, those of the whole model in `layout_stage`; here they are run until the mesh is
good.  Nothing here touches the user's mesh; `cad.put.put_mesh` does, at the end, when everything has been checked.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from .attempts import Attempt, attempts
from .cad.read import read_model
from .cad.validate import validate
from .errors import CrossQuadError, LayoutError, MeshError
from .faces_stage import Faces, faces_of_model
from .field_stage import Rule, Wishes, wishes
from .fill.curve_fit import curve_fit
from .guide import TooManyCells
from .layout.quantize import Indivisible
from .layout_stage import Laid, lay_out
from .options import MeshOptions
from .records import AlignedField, FaceMesh, Guide, Int, Model, QuadMesh, TMesh
from .watch import Watch

__all__ = ["StagesResult", "block_mesh"]

GOOD_QUALITY = 0.02  # least scaled Jacobian above which no other layout is tried
TOLD_QUALITY = 0.1  # below which the user is told
GOOD_FIT = 0.3
MOST_WORK = 30_000
MOST_WORK_CURVED = 20_000
_Key = tuple[float, Rule]


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
    with watch.stage("read"):
        model = read_model(options)
        validate(model)
        wanted = wishes(model, options)
    return _Search(model, wanted, options, watch).run()


class _Search:
    """Attempts at a mesh of a model, the best one so far, and what need not be tried again.

    Parameters
    ----------
    model : Model
    wanted : Wishes
    options : MeshOptions
    watch : Watch
    """

    def __init__(self, model: Model, wanted: Wishes, options: MeshOptions, watch: Watch) -> None:
        self._model, self._wanted, self._options, self._watch = model, wanted, options, watch
        self._notes = list(model.notes)
        self._faces: dict[_Key, Faces] = {}
        self._failed: set[_Key] = set()  # no faces
        self._hopeless: set[_Key] = set()  # faces without divisions, whatever the sizes of blocks
        self._seen: set[tuple[object, ...]] = set()
        self._best: tuple[tuple[bool, bool, float], StagesResult] | None = None
        self._failure: CrossQuadError | None = None

    def run(self) -> StagesResult:
        """The first good mesh, else the best one.

        Raises
        ------
        CrossQuadError
            The first failure, if there is no mesh at all.
        """
        most = MOST_WORK_CURVED if any(face.curved for face in self._model.faces) else MOST_WORK
        before = self._watch.work
        for attempt in attempts(self._wanted, self._options):
            if 2 * self._watch.work - before > most:  # as much again as the last attempt took would be too much
                break
            before = self._watch.work
            if self._ends(attempt):
                break
        if self._best is not None:
            return self._best[1]
        assert self._failure is not None
        raise self._failure

    def _ends(self, attempt: Attempt) -> bool:
        """Make an attempt; whether no other one is needed, or worth while."""
        key = attempt.background, attempt.rule
        if key in self._failed or key in self._hopeless:
            return False
        try:
            found, laid = self._try(attempt)
        except (LayoutError, MeshError) as error:
            again = isinstance(self._failure, TooManyCells) and isinstance(error, TooManyCells)
            self._failure = self._failure or error
            if again or (key in self._failed and isinstance(error, MeshError)):  # Gmsh has no background triangles
                return True
            self._notes.append(f"another layout was tried, since: {error.what}")
            return False
        return laid is not None and self._keep(found, laid)

    def _try(self, attempt: Attempt) -> tuple[Faces, Laid | None]:
        """Faces and layout of an attempt; no layout where it is that of an earlier one."""
        key = attempt.background, attempt.rule
        faces = self._faces_of(attempt)
        options = replace(self._options, block_size=self._options.block_size * attempt.blocks)
        found = faces if attempt.pinned else faces.free()
        try:
            return found, lay_out(self._model, found, options, attempt, self._watch, self._seen)
        except Indivisible as error:
            if self._wanted.given and attempt.rule != "divisible":  # first each face alone
                raise
            try:
                with self._watch.stage("repair"):
                    repaired = faces.together(self._model, error)
            except Indivisible:
                self._hopeless.add(key)
                raise
            if repaired is None:
                raise
        self._faces[key] = repaired
        found = repaired if attempt.pinned else repaired.free()
        return found, lay_out(self._model, found, options, attempt, self._watch, self._seen)

    def _faces_of(self, attempt: Attempt) -> Faces:
        """Faces with the background and the fields of an attempt."""
        key = attempt.background, attempt.rule
        if key not in self._faces:
            self._failed.add(key)
            finer = replace(self._options, background=self._options.background * attempt.background)
            self._faces[key] = faces_of_model(self._model, finer, self._wanted, attempt.rule, self._watch, self._notes)
            self._failed.remove(key)
        return self._faces[key]

    def _keep(self, faces: Faces, laid: Laid) -> bool:
        """Keep a mesh if it is the best one; whether it is good."""
        result, fit = laid.guide, curve_fit(laid.mesh)
        score = (result.quality > GOOD_QUALITY, fit < GOOD_FIT, result.quality)
        if self._best is None or score > self._best[0]:
            doubts = [] if result.quality >= TOLD_QUALITY else [f"some cells are poor (scaled Jacobian {result.quality:.2g})"]
            doubts += [] if score[1] else ["some edges on curves are much longer than those beside them"]
            notes = (*self._notes, *faces.notes, *result.notes, *laid.mesh.notes, *doubts)
            made = StagesResult(
                self._model,
                faces.meshes,
                faces.fields,
                laid.tmesh,
                laid.coarse,
                result.guide,
                result.fine,
                replace(laid.mesh, notes=notes),
                notes,
                self._watch.seconds,
            )
            self._best = score, made
        return score[0] and score[1]
