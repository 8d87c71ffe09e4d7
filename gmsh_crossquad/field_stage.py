"""The field stage of all faces: what the user wants of the cross field, and the errors with the model's own names.

A face's field comes from its source; singular points that the user set inside a face (an embedded Physical Point with
``index=``) are a source of their own, or join a formula.  The indices of boundary points are those that the user set, else those
of the opening angles.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, TypeVar

import numpy as np

from .cad.bending import edge_bending
from .cad.indices import prescribed_indices
from .cad.seeds import face_seeds
from .errors import FieldError, GeometryError, LayoutError, MeshError
from .field.compatibility import Incompatible, Misfit, quarter_text
from .field.corners import boundary_indices
from .field.edge_frames import EdgeFrames
from .field.pipeline import aligned_field
from .field.surface_mesh import surface_of
from .options import MeshOptions
from .records import AlignedField, Bool, CrossField, FaceMesh, Float, Int, Model
from .source.base import FieldSource
from .source.formula import Singularities
from .source.per_face import PerFace
from .source.smooth import Smooth

__all__ = ["Rule", "Wishes", "changes_of", "edge_frames", "field_of_face", "located", "wishes"]

Rule = Literal["keep", "harmonic", "relaxed", "divisible"]
Located = TypeVar("Located", LayoutError, GeometryError, MeshError)

MOST_LISTED = 12


@dataclass(frozen=True)
class Wishes:
    """What the user wants of the cross field.

    Attributes
    ----------
    sources : tuple of FieldSource
        One per face.
    indices : dict of (face row, vertex row) -> int
        Prescribed indices of boundary vertices in quarter turns.
    seeds : tuple of (k, 2) or (k, 3) float64
        Singular points of every face that must be vertices of its background mesh; local coordinates.
    fix : bool
        Change indices that do not fit together.
    """

    sources: tuple[FieldSource, ...]
    indices: dict[tuple[int, int], int] = field(default_factory=dict)
    seeds: tuple[Float, ...] = ()
    fix: bool = False

    @property
    def pinned(self) -> bool:
        """Whether any singular point must keep its place."""
        return any(len(points) for points in self.seeds)

    @property
    def given(self) -> bool:
        """Whether any face has another field than the default."""
        return any(not isinstance(source, Smooth) for source in self.sources)


def wishes(model: Model, options: MeshOptions) -> Wishes:
    """What the options and the model's names say about the field.

    Raises
    ------
    InputError, FieldError
        For an index that is none, a point that is not there, a source that does not go with singular points.
    """
    indices = prescribed_indices(model, options.boundary_index)
    whole = options.field or Smooth()
    for tag in whole.sources if isinstance(whole, PerFace) else ():
        if tag not in {face.tag for face in model.faces}:
            raise FieldError(f"a field is given for surface {tag}, which is not meshed", remedy="check its tag")
    sources: list[FieldSource] = []
    boundary: dict[tuple[int, int], int] = {}
    for row, face in enumerate(model.faces):
        source = whole.of(face.tag) if isinstance(whole, PerFace) else whole
        inside = {v: q for (f, v), q in indices.items() if f == row and v in face.embedded_points}
        boundary |= {(f, v): q for (f, v), q in indices.items() if f == row and v not in inside}
        if inside:
            places = model.origin + model.scale * model.vertices[list(inside)]
            own = Singularities(places, np.array(list(inside.values()), np.int64))
            if isinstance(source, Singularities):
                positions = np.concatenate([source.positions, own.positions])
                source = Singularities(positions, np.concatenate([source.quarters, own.quarters]))
            elif isinstance(source, Smooth):
                source = own
            else:
                tag = int(model.vertex_tags[next(iter(inside))])
                remedy = "take its index away, or use the field 'smooth' or 'singularities'"
                raise FieldError("a singular point is set in a face whose field has its own", entity=(0, tag), remedy=remedy)
        sources.append(source)
    return Wishes(tuple(sources), boundary, _seeds(model, whole), options.fix_indices)


def _seeds(model: Model, whole: FieldSource) -> tuple[Float, ...]:
    """The singular points of the sources in every face; those in the model's names are CAD vertices already."""
    out = [np.zeros((0, len(face.axes))) for face in model.faces]
    rows: dict[int, list[int]] = {}
    source = {}
    for row, face in enumerate(model.faces):
        own = whole.of(face.tag) if isinstance(whole, PerFace) else whole
        rows.setdefault(id(own), []).append(row)
        source[id(own)] = own
    for key, mine in rows.items():
        points = source[key].points()
        if len(points):
            found = face_seeds(model, points, mine, strict=isinstance(source[key], Singularities))
            for row in mine:
                out[row] = found[row]
    return tuple(out)


def edge_frames(model: Model, mesh: FaceMesh) -> EdgeFrames:
    """Where the sources are asked for the field of a face."""
    face = model.faces[mesh.face]
    surface = surface_of(mesh)
    own = surface.edge_normal if face.curved else None
    normal = np.broadcast_to(face.normal, (len(surface.edges), 3)) if own is None else own
    points = model.origin + model.scale * face.world(mesh.points)
    marked = (mesh.seed >= 0) | ((mesh.vertex >= 0) & ~surface.boundary_vertex)
    return EdgeFrames(face.tag, surface, points, normal, marked, lambda: edge_bending(model, mesh))


def field_of_face(
    model: Model, mesh: FaceMesh, wanted: Wishes, rule: Rule = "keep", split: bool = True
) -> tuple[AlignedField, list[str]]:
    """The aligned field of one face, and notes on what was changed.

    Parameters
    ----------
    model : Model
    mesh : FaceMesh
    wanted : Wishes
    rule : {"keep", "harmonic", "relaxed", "divisible"}
        What is done with a given field: it is rotated as little as possible; replaced by the harmonic field with the same
        singularities; and these are moved, too, so that the flux around holes vanishes.  "divisible" is "harmonic" here, and
        changed later where it has no layout.
    split : bool
        Share indices of 1/2 and more among several points, as a mesh needs it.

    Raises
    ------
    FieldError
        If the source has no usable field there, or its singularities do not fit the boundary indices.
    GeometryError, LayoutError
    """
    source = wanted.sources[mesh.face]
    index, chosen = _boundary(model, mesh, wanted)
    given: CrossField | None = None
    epsilon = None
    if isinstance(source, Smooth):
        epsilon = None if source.epsilon is None else source.epsilon / model.scale
    else:
        given = source.on(edge_frames(model, mesh))
    try:
        aligned = aligned_field(
            mesh,
            given,
            index,
            keep=rule == "keep",
            relax=rule == "relaxed",
            split=split,
            fix=wanted.fix,
            prescribed=chosen,
            epsilon=epsilon,
        )
    except Incompatible as error:
        raise _named(model, mesh, error.misfit) from None
    except GeometryError as error:
        raise located(model, mesh.face, error) from None
    notes = changes_of(model, mesh, index, aligned)
    if rule != "keep" and not isinstance(source, (Smooth, Singularities)):  # those are harmonic
        notes.append(f"the given field of surface {model.faces[mesh.face].tag} was smoothed, its singularities kept")
    return aligned, notes


def _boundary(model: Model, mesh: FaceMesh, wanted: Wishes) -> tuple[Int, Bool]:
    """Wanted indices (n,) of a face's boundary vertices, and which of them the user chose."""
    index = boundary_indices(mesh)
    chosen = np.zeros(len(index), bool)
    for (face, vertex), quarters in wanted.indices.items():
        if face != mesh.face:
            continue
        here = np.flatnonzero(mesh.vertex == vertex)
        if len(here) != 1:
            raise FieldError(
                f"an index is set at a point where the surface has {len(here)} sectors",
                entity=(0, int(model.vertex_tags[vertex])),
                location=_place(model, mesh, here[0]) if len(here) else None,
                remedy="set it at a point with one sector",
            )
        if quarters > 1:
            raise FieldError(
                f"index {quarter_text(quarters)} at a boundary point leaves no room for a block",
                entity=(0, int(model.vertex_tags[vertex])),
                location=_place(model, mesh, here[0]),
                remedy="a sector of n blocks has index (2 - n)/4: use +1/4 or less",
            )
        index[here], chosen[here] = quarters, True
    return index, chosen


def _place(model: Model, mesh: FaceMesh, vertex: int) -> tuple[float, ...]:
    """A background vertex in the user's coordinates."""
    local = mesh.points[vertex : vertex + 1]
    return tuple((model.origin + model.scale * model.faces[mesh.face].world(local)[0]).tolist())


def _name(model: Model, mesh: FaceMesh, vertex: int) -> str:
    """``point 7`` or ``(0.1, 0.2, 0)``."""
    tag = int(model.vertex_tags[mesh.vertex[vertex]]) if mesh.vertex[vertex] >= 0 else -1
    place = ", ".join(f"{x:.4g}" for x in _place(model, mesh, vertex))
    return f"point {tag}" if tag >= 0 else f"({place})"


def _named(model: Model, mesh: FaceMesh, misfit: Misfit) -> FieldError:
    """The error of indices that do not add up, with all of them and the nearest repairs."""
    missing = misfit.needed - misfit.found
    lists = []
    for what, entries in (("inside", misfit.interior), ("boundary", misfit.boundary)):
        shown = [f"{quarter_text(q)} at {_name(model, mesh, v)}" for v, q in entries[:MOST_LISTED]]
        more = [f"{len(entries) - MOST_LISTED} more"] if len(entries) > MOST_LISTED else []
        lists.append(f"{what}: {', '.join(shown + more) or 'none'}")
    one = quarter_text(1 if missing > 0 else -1)
    repairs = [f"add {'one' if abs(missing) == 1 else abs(missing)} interior {one}"]
    opposite = [v for v, q in misfit.interior if q == -missing]
    if opposite:
        repairs.append(f"remove the {quarter_text(-missing)} at {_name(model, mesh, opposite[0])}")
    if misfit.corner is not None:
        vertex, quarters = misfit.corner
        repairs.append(f"set {_name(model, mesh, vertex)} to index {quarter_text(quarters).lstrip('+')}")
    return FieldError(
        f"the indices add up to {quarter_text(misfit.found)} where chi = {misfit.euler} is needed ({'; '.join(lists)})",
        entity=(2, model.faces[mesh.face].tag),
        remedy=", or ".join(repairs) + " (the option fix_indices makes the least change)",
    )


def changes_of(model: Model, mesh: FaceMesh, index: Int, aligned: AlignedField) -> list[str]:
    """Notes on indices that were changed."""
    on = surface_of(mesh).boundary_vertex
    notes = []
    for v in np.flatnonzero(on & (aligned.index != index)).tolist():
        old, new = quarter_text(int(index[v])), quarter_text(int(aligned.index[v]))
        notes.append(f"the index of {_name(model, mesh, v)} was changed from {old} to {new}")
    for v in aligned.added:
        notes.append(f"a singularity of {quarter_text(int(aligned.index[v]))} was added at {_name(model, mesh, v)}")
    for v in dict.fromkeys(v for v, _ in aligned.split):
        parts = sum(w == v for w, _ in aligned.split)
        what = f"the singularity of {quarter_text(parts)} at {_name(model, mesh, v)} was split into {parts} of +1/4"
        notes.append(f"{what}: fewer than three blocks around a point cannot be convex")
    if aligned.moved:
        start, end = (mesh.points[list(rows)] for rows in zip(*aligned.moved))
        far = model.scale * float(np.linalg.norm(end - start, axis=1).max())
        notes.append(f"{len(start)} singularities of surface {model.faces[mesh.face].tag} were moved, by up to {far:.3g}")
    return notes


def located(model: Model, face: int, error: Located) -> Located:
    """The error of a face's stage with the face's tag and the place in the user's coordinates; of the same class."""
    place, record = error.location, model.faces[face]
    if place is not None and len(place) == len(record.axes):  # in local coordinates
        place = tuple((model.origin + model.scale * record.world(np.array([place]))[0]).tolist())
    return type(error)(error.what, entity=error.entity or (2, record.tag), location=place, remedy=error.remedy)
