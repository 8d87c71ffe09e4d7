"""The stages that look at one face at a time: background mesh, cross field, T-mesh."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from .cad.background import background_meshes
from .cad.read import read_model
from .cad.validate import validate
from .errors import LayoutError
from .field_stage import Rule, Wishes, changes_of, field_of_face, located, wishes
from .layout.alone import divisible
from .layout.face_tmesh import trace_face
from .layout.quantize import Indivisible
from .layout.together import divisible_together
from .options import MeshOptions
from .records import AlignedField, FaceMesh, FaceTMesh, Model
from .watch import Watch

__all__ = ["Faces", "face_fields", "faces_of_model"]

T = TypeVar("T")
FINER = (1.0, 0.7, 0.5)
"""Factors on the background's edge length for faces that failed with the one before."""


@dataclass(frozen=True)
class Faces:
    """Background mesh, aligned field and T-mesh of every face.

    Attributes
    ----------
    meshes : tuple of FaceMesh
    fields : tuple of AlignedField
    tmeshes : tuple of FaceTMesh
    notes : tuple of str
        What was changed in the fields.
    """

    meshes: tuple[FaceMesh, ...]
    fields: tuple[AlignedField, ...]
    tmeshes: tuple[FaceTMesh, ...]
    notes: tuple[str, ...]

    def free(self) -> Faces:
        """The same without places that singularities must keep."""
        meshes = tuple(replace(mesh, seed=np.full(len(mesh.points), -1, np.int64)) for mesh in self.meshes)
        return replace(self, meshes=meshes, notes=(*self.notes, "singular points may have moved a little in the mesh"))

    def together(self, model: Model, error: Indivisible) -> Faces | None:
        """The same with pairs of singularities added so that the layouts have divisions together; None if they may have them."""
        found = divisible_together(model, self.meshes, self.fields, self.tmeshes, error.cuts)
        if found is None:
            return None
        notes = list(self.notes)
        for f, pairs in sorted(found.pairs.items()):
            what = "a pair of singularities was" if pairs == 1 else f"{pairs} pairs of singularities were"
            notes.append(f"{what} added in surface {model.faces[f].tag}, since the faces could not be divided together")
        return replace(self, fields=found.fields, tmeshes=found.tmeshes, notes=tuple(notes))


def faces_of_model(model: Model, options: MeshOptions, wanted: Wishes, rule: Rule, watch: Watch, notes: list[str]) -> Faces:
    """Background mesh, aligned field and T-mesh of every face; `notes` is told where something was done again.

    Raises
    ------
    CrossQuadError
        A face cannot be meshed.
    """

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
    return Faces(tuple(p[0] for p in parts), tuple(p[1] for p in parts), tuple(p[2] for p in parts), changed)


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


def _on_all_faces(
    model: Model, options: MeshOptions, wanted: Wishes, watch: Watch, notes: list[str], work: Callable[[FaceMesh], T]
) -> list[T]:
    """What `work` makes of the background mesh of every face; faces where it fails are tried again on a finer background."""
    done: dict[int, T] = {}
    failure: LayoutError | None = None
    n = len(model.faces)
    for factor in FINER:
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
