"""Other fields for a face whose layout has no integer divisions.

An aligned field with flux around holes need not allow a layout.  In this order, each a little farther from the given field:

1. a pair of opposite singularities is added, up to three times; the given ones stay where they are (`pair`);
2. singularities that may move go half, three quarters and all of the way to where the flux vanishes (`flux`).

Measured on 400 random faces with random boundary indices and singularities: 34 had no layout, all of them with holes; either way
alone gave all of these one (30 with one pair, 3 with two, 1 with three; 13 half way, 8 three quarters, 13 all of the way).  The
meshes with pairs were better: their least scaled Jacobian had a median of .72 against .64, that of the other faces .71 (in the
mesh the singularities were free to move).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ..records import AlignedField, CrossField, FaceMesh, Float, Int
from .align import Aligner, with_parts
from .clearance import Clearance
from .flux import vanish_flux
from .operators import FieldOperators
from .pair import add_pair
from .singularities import move_index, shortest_path, singular_vertices
from .surface_mesh import SurfaceMesh, surface_of
from .tangents import length

__all__ = ["alternatives", "with_pairs"]

_PAIRS = 3
_PARTS = (0.5, 0.25, 0.0)
#: edges between two partners of a pair that is put at given places, at least
_APART = 2


def alternatives(mesh: FaceMesh, aligned: AlignedField, held: Int, *, move: bool = True) -> Iterator[AlignedField]:
    """Fields with other fluxes around the holes, made when they are asked for.

    Parameters
    ----------
    mesh : FaceMesh
    aligned : AlignedField
        Of that mesh.
    held : (k,) int64
        Singular vertices that must not move.
    move : bool
        Whether the others may, when all else fails.

    Yields
    ------
    AlignedField
        Harmonic, with the changes in its `added` and `moved`.  None at all for a face without holes.
    """
    surface = surface_of(mesh)
    aligner, clearance = _tools(surface, aligned)
    if not aligner.holes:
        return
    harmonic = aligner.rotate(aligned.field).field
    vertices, _ = singular_vertices(surface, harmonic.rotation)
    field = harmonic
    for _ in range(_PAIRS):
        pair = add_pair(aligner, clearance, field, vertices.tolist(), mesh.port)
        if pair is None:
            break
        field = pair.field
        yield _finished(aligner, field, aligned, added=np.setdiff1d(pair.end, vertices))
    if move and not np.all(np.isin(vertices, held)):
        for part in _PARTS:
            found = vanish_flux(aligner, clearance, harmonic, held.tolist(), mesh.port, part)
            steps = np.stack([found.start, found.end], axis=1)
            yield _finished(aligner, found.field, aligned, moved=steps[steps[:, 0] != steps[:, 1]])


def with_pairs(mesh: FaceMesh, aligned: AlignedField, places: Float) -> AlignedField | None:
    """The field with pairs of opposite singularities at given places, otherwise rotated by as little as possible.

    Parameters
    ----------
    mesh : FaceMesh
    aligned : AlignedField
        Of that mesh.
    places : (k, 2, d) float64
        Where the +1/4 and the -1/4 of every pair should be; they go to the nearest regular vertices.

    Returns
    -------
    AlignedField or None
        Checked, with the new vertices in its `added`; None where there is no room for the pairs.
    """
    surface = surface_of(mesh)
    aligner = Aligner(surface, FieldOperators(surface), aligned.index)
    free = ~(surface.boundary_vertex | mesh.port)
    free[singular_vertices(surface, aligned.field.rotation)[0]] = False
    rotation = aligned.field.rotation.copy()
    added: list[int] = []
    for plus, minus in places:
        ends = []
        for place in (plus, minus):
            inside = np.flatnonzero(free)
            if not len(inside):
                return None
            ends.append(int(inside[np.argmin(length(mesh.points[inside] - place))]))
            free[ends[-1]] = False
        target = np.zeros(len(mesh.points), bool)
        target[ends[0]] = True
        path = shortest_path(surface, ends[1:], target, free | target, len(mesh.points))
        if len(path) < _APART + 1:
            return None
        move_index(surface, rotation, path, 1)
        added += ends
    field = aligner.rotate(replace(aligned.field, rotation=rotation), aligned.field.rotation).field
    return _finished(aligner, field, aligned, added=np.array(added))


def _tools(surface: SurfaceMesh, aligned: AlignedField) -> tuple[Aligner, Clearance]:
    aligner = Aligner(surface, FieldOperators(surface), aligned.index)
    return aligner, Clearance(surface, aligner.rims)


def _finished(
    aligner: Aligner, field: CrossField, before: AlignedField, added: Int | None = None, moved: Int | None = None
) -> AlignedField:
    """The checked field, and what turned the field that was given at first."""
    aligned = with_parts(aligner.operators, aligner.finish(aligner.rotate(field), field), before.given)
    return replace(
        aligned,
        split=before.split,
        added=before.added if added is None else (*before.added, *added.tolist()),
        moved=before.moved if moved is None else (*before.moved, *map(tuple, moved.tolist())),
    )
