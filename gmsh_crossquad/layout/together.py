"""Faces whose layouts have no integer divisions together: add pairs of singularities until they have.

Every face may have divisions alone and the whole none: the equations of all patches and curves can force a sum of positive
numbers to vanish.  What is missing is found by a linear program with a mismatch in every patch,

    min sum_p w_p (|s_p| + |t_p|),   sum of side 0 = sum of side 2 + s_p,   sum of side 1 = sum of side 3 + t_p,

under the lower bounds and the separation cuts that were met.  All its rows but the bounds are homogeneous, so that a mismatch of
0 means that there are integer divisions, too (a multiple of the solution).  Else a patch with a mismatch needs a dislocation: a
pair of singularities of +1/4 and -1/4.  Around the pair the cross field has turned by nothing, but a path around it on the grid
does not close, by a vector that is perpendicular to the line from one to the other: the side towards the +1/4 has more edges
than the opposite one.  So the +1/4 goes towards the longer side.

The weights w_p prefer patches with room.  Faces with a new pair are aligned and traced again; where the layout still has no
divisions but less mismatch the next pairs are added to it, else the patches that were used get a greater weight.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from ..errors import LayoutError
from ..field.repair import with_pairs
from ..records import AlignedField, FaceMesh, FaceTMesh, Float, Model, TMesh
from .conditions import at_least, balance
from .cuts import Cut
from .face_tmesh import trace_face
from .glue import glue
from .integer_program import IntegerProgram
from .quantize import Indivisible, quantize

__all__ = ["Together", "divisible_together", "mismatch"]

MOST_TRIALS = 12
MOST_LISTED = 4
#: factor on the weights of patches where a pair did not help
FAILED = 4.0
#: the same where there is no room for one
FULL = 1e3
#: cost of a division over the least of a mismatch, which makes the solution less arbitrary
SMALL = 1e-6
LEAST = 1e-6
#: half the distance of a pair, over the side of the patch along it, and over the shorter side
REACH = 0.25


@dataclass(frozen=True)
class Together:
    """Faces whose layouts have divisions together.

    Attributes
    ----------
    fields : tuple of AlignedField
    tmeshes : tuple of FaceTMesh
    pairs : dict of face row -> int
        Pairs of singularities that were added.
    """

    fields: tuple[AlignedField, ...]
    tmeshes: tuple[FaceTMesh, ...]
    pairs: dict[int, int]


def mismatch(model: Model, tmesh: TMesh, cuts: Sequence[Cut], weight: Float) -> Float:
    """(p, 2) by how much side 0 must exceed side 2 and side 1 side 3 of every patch, all 0 if there are divisions.

    Parameters
    ----------
    model : Model
    tmesh : TMesh
    cuts : sequence of Cut
        To be kept, disjunctions by their first option where there are divisions without them.
    weight : (p,) float64
        Cost of a mismatch of 1.
    """
    plain = [c for c in cuts if len(c.options) == 1]
    found = _program(tmesh, [*at_least(tmesh, model), *plain], weight)
    return found if np.any(found) or len(plain) == len(cuts) else _program(tmesh, [*at_least(tmesh, model), *cuts], weight)


def _program(tmesh: TMesh, cuts: Sequence[Cut], weight: Float) -> Float:
    sums = balance(tmesh)
    rows, n = sums.shape
    cost = np.concatenate([np.full(n, SMALL * weight.min(initial=1.0)), np.repeat(weight, 4)])
    program = IntegerProgram(np.zeros(0), np.zeros(0))
    program.add_columns(cost, np.full(len(cost), np.inf), integral=False)
    slack = sp.kron(sp.eye_array(rows), np.array([[-1.0, 1.0]]))
    matrix = sp.hstack([sums, slack], format="csr")
    start, column = matrix.indptr[:-1].astype(np.int64), matrix.indices.astype(np.int64)
    program.add_rows(np.zeros(rows), np.zeros(rows), start, column, matrix.data)
    options = [cut.options[0] for cut in cuts]
    terms = [term for expression, _ in options for term in expression]
    start = np.cumsum([0, *(len(expression) for expression, _ in options)])[:-1]
    column, value = (np.array([term[i] for term in terms], np.int64) for i in (0, 1))
    least = np.array([float(bound) for _, bound in options])
    program.add_rows(least, np.full(len(least), np.inf), start, column, value.astype(float))
    found = program.relaxation()
    if found is None:
        raise LayoutError("the divisions of the layout could not be judged", remedy="report the model")
    s = found[0][n::2] - found[0][n + 1 :: 2]
    return np.where(np.abs(s) > LEAST, s, 0.0).reshape(-1, 2)


def divisible_together(
    model: Model,
    meshes: Sequence[FaceMesh],
    fields: Sequence[AlignedField],
    tmeshes: Sequence[FaceTMesh],
    cuts: Sequence[Cut] | None = None,
) -> Together | None:
    """Fields with pairs of singularities added whose layouts have integer divisions together, and those layouts.

    Parameters
    ----------
    model : Model
    meshes, fields, tmeshes : one per face
        The layouts have no divisions.
    cuts : sequence of Cut, optional
        Separation cuts of the quantization that found none; by default those of one with few divisions.

    Returns
    -------
    Together or None
        None where other target lengths may give divisions without any change.

    Raises
    ------
    Indivisible
        Nothing that was tried has divisions.
    """
    now = Together(tuple(fields), tuple(tmeshes), {})
    glued = glue(model, meshes, tmeshes)
    met = _cuts(model, glued) if cuts is None else tuple(cuts)
    if met is None:
        return None
    weight, known = _weights(glued), met
    missing = mismatch(model, glued, known, weight)
    if not np.any(missing):
        return None
    proved = bool(np.any(mismatch(model, glued, [c for c in known if len(c.options) == 1], weight)))
    tried: set[bytes] = set()
    for _ in range(MOST_TRIALS):
        key = np.sign(missing).tobytes()
        if key in tried:  # nothing else is left
            break
        tried.add(key)
        following = _with_pairs(model, meshes, now, glued, missing)
        if following is not None:
            other = glue(model, meshes, following.tmeshes)
            more = _cuts(model, other)
            if more is None:
                return following
            left = mismatch(model, other, more, _weights(other))
            if 0 < np.abs(left).sum() < np.abs(missing).sum() - LEAST:
                now, glued, known, missing, weight = following, other, more, left, _weights(other)
                tried.clear()
                continue
        weight = np.where(np.any(missing, axis=1), (FULL if following is None else FAILED) * weight, weight)
        missing = mismatch(model, glued, known, weight)
    if not proved:
        return None
    tags = sorted({model.faces[f].tag for f in glued.patch_face[np.any(missing, axis=1)].tolist()})
    raise Indivisible(
        f"no divisions of the layout ({len(glued.patches)} patches) keep all corners and singularities apart",
        entity=(2, tags[0]),
        remedy=f"change the singularities or boundary indices of surface {' or '.join(map(str, tags[:MOST_LISTED]))}",
    )


def _cuts(model: Model, tmesh: TMesh) -> tuple[Cut, ...] | None:
    """None if there are divisions, else the separation cuts that were met before there were none."""
    try:
        # lengths do not matter for this; few divisions make it fast
        quantize(model, tmesh, np.maximum(tmesh.length / (0.25 * tmesh.length.max()), 0.5))
    except Indivisible as error:
        return error.cuts
    return None


def _sides(tmesh: TMesh, patch: int) -> list[Float]:
    """The four sides of a patch as lines (k, 3), counter-clockwise."""
    return [np.concatenate([tmesh.polyline[arc][::way] for arc, way in side]) for side in tmesh.patches[patch]]


def _weights(tmesh: TMesh) -> Float:
    """(p,) inverse of the shorter mean length of opposite sides, the greatest of which is 1."""
    length = np.array([[sum(tmesh.length[arc] for arc, _ in side) for side in sides] for sides in tmesh.patches])
    room = (0.5 * (length[:, :2] + length[:, 2:])).min(axis=1)
    out: Float = room.max() / np.maximum(room, 1e-6 * room.max())
    return out


def _with_pairs(model: Model, meshes: Sequence[FaceMesh], now: Together, tmesh: TMesh, missing: Float) -> Together | None:
    """A pair more in every patch with a mismatch; None where it does not fit in or the face cannot be traced."""
    fields, tmeshes, pairs = list(now.fields), list(now.tmeshes), dict(now.pairs)
    patches = np.flatnonzero(np.any(missing, axis=1))
    for f in np.unique(tmesh.patch_face[patches]).tolist():
        here = patches[tmesh.patch_face[patches] == f].tolist()
        places = np.stack([_places(_sides(tmesh, p), missing[p]) for p in here])
        local = model.faces[f].local(places.reshape(-1, 3)).reshape(len(here), 2, -1)
        try:
            field = with_pairs(meshes[f], fields[f], local)
            if field is None:
                return None
            tmeshes[f] = trace_face(meshes[f], field)
        except LayoutError:
            return None
        fields[f] = field
        pairs[f] = pairs.get(f, 0) + len(here)
    return replace(now, fields=tuple(fields), tmeshes=tuple(tmeshes), pairs=pairs)


def _places(sides: list[Float], missing: Float) -> Float:
    """(2, 3) places of the +1/4 and the -1/4 in a patch for the mismatch (2,) of its sides."""
    mean = [0.5 * (_length(sides[i]) + _length(sides[i + 2])) for i in (0, 1)]
    step = np.array([missing[1], -missing[0]]) / np.abs(missing).max()
    step *= np.minimum(REACH, REACH * min(mean) / np.array(mean))
    return np.stack([_coons(sides, *(0.5 + step)), _coons(sides, *(0.5 - step))])


def _length(line: Float) -> float:
    return float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())


def _at(line: Float, t: float) -> Float:
    """The point (3,) at the part t of a line's length."""
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    return np.array([np.interp(t * s[-1], s, x) for x in line.T])


def _coons(sides: list[Float], u: float, v: float) -> Float:
    """The point (3,) at (u, v) of the Coons patch; side 0 runs along u at v = 0, side 1 along v at u = 1."""
    low, right, high, left = _at(sides[0], u), _at(sides[1], v), _at(sides[2], 1 - u), _at(sides[3], 1 - v)
    a, b, c, d = (side[0] for side in sides)
    corners = (1 - u) * (1 - v) * a + u * (1 - v) * b + u * v * c + (1 - u) * v * d
    out: Float = (1 - v) * low + v * high + (1 - u) * left + u * right - corners
    return out
