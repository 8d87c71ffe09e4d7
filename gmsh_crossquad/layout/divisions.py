"""Divisions of the chords: of the guide grid, and of the final mesh.

Every chord of the coarse complex gets `guide` cells of the guide grid, and every guide cell `fine` final edges along the chord.
Both follow the local sizes.  Edges on CAD curves turn by less than 40 degrees.  They are shorter than 1.6 sizes and turn by less
than 15 degrees (a circle of 24 edges loses 1.1 % of its area; in the guide grid: 35) unless a short CAD curve, on which the
chord ends too, caps its divisions.  Prescribed (Transfinite) counts are equalities on sums of chords.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import LayoutError
from ..records import Float, Int, Model, TMesh
from .arc_bends import arc_bends
from .chords import Chords

__all__ = ["ChordDivisions", "Segments", "chord_divisions", "segments"]

GUIDE_TURN = np.radians(35.0)
TURN = np.radians(15.0)
STEEPEST = np.radians(40.0)
GUIDE_BEND = np.radians(30.0)
BEND = np.radians(45.0)
LONGEST = 1.6
SHORT = 0.3


@dataclass(frozen=True)
class Segments:
    """Unit segments of all arcs.

    Attributes
    ----------
    chord, arc : (s,) int64
    length : (s,) float64, scaled
    turning : (s,) float64
        Total turning of the CAD curve along the segment, radians; 0 inside faces.
    bend : (s,) float64
        Turning of the segment inside a curved face, radians; 0 elsewhere.
    """

    chord: Int
    arc: Int
    length: Float
    turning: Float
    bend: Float


@dataclass(frozen=True)
class ChordDivisions:
    """Divisions of the chords.

    Attributes
    ----------
    guide, fine : (n,) int64
        Guide cells per chord and final edges per guide cell.
    """

    guide: Int
    fine: Int


def segments(model: Model, tmesh: TMesh, divisions: Int, chords: Chords) -> Segments:
    """The unit segments of every arc with their lengths and turning."""
    chord = np.concatenate(chords.arc_segments) if len(chords.arc_segments) else np.zeros(0, np.int64)
    arc = np.repeat(np.arange(len(divisions)), divisions)
    within = np.concatenate([np.arange(n) for n in divisions.tolist()]) if len(divisions) else np.zeros(0)
    length = tmesh.length[arc] / divisions[arc]
    low = tmesh.arc_start[arc] + within * length
    high = low + length
    turned = np.zeros(len(arc))
    first = np.concatenate([[0], np.cumsum(divisions)])
    for curve, pieces in zip(model.curves, tmesh.pieces):
        # arcs of no divisions are shared by the segments beside them
        mine = np.concatenate([np.arange(first[p], first[p + 1]) for p in pieces])
        if len(mine):
            middle = 0.5 * (high[mine[:-1]] + low[mine[1:]])
            low[mine] = np.concatenate([[0.0], middle])
            high[mine] = np.concatenate([middle, [curve.length]])
            s, total = cumulative_turning(curve.points, curve.arclength)
            turned[mine] = np.interp(high[mine], s, total) - np.interp(low[mine], s, total)
    on_curve = tmesh.arc_curve[arc] >= 0
    return Segments(chord, arc, np.where(on_curve, high - low, length), turned, _bends(model, tmesh, divisions))


def _bends(model: Model, tmesh: TMesh, divisions: Int) -> Float:
    """Turning (s,) of the unit segments inside curved faces."""
    first = np.concatenate([[0], np.cumsum(divisions)])
    out = np.zeros(int(first[-1]))
    for arc, total in arc_bends(model, tmesh).items():
        n = int(divisions[arc])
        at = np.interp(np.arange(n + 1) / max(n, 1), np.arange(len(total)) / (len(total) - 1), total)
        out[first[arc] : first[arc + 1]] = np.diff(at)
    return out


def cumulative_turning(points: Float, arclength: Float) -> tuple[Float, Float]:
    """Arc lengths of the segment middles and the total turning of a polyline up to there."""
    d = np.diff(points, axis=0)
    norm = np.linalg.norm(d, axis=1)
    keep = norm > 0
    d = d[keep] / norm[keep, None]
    middle = 0.5 * (arclength[1:] + arclength[:-1])[keep]
    turn = 2 * np.arcsin(np.clip(0.5 * np.linalg.norm(np.diff(d, axis=0), axis=1), 0, 1))
    return middle, np.concatenate([[0.0], np.cumsum(turn)])


def chord_divisions(
    model: Model,
    tmesh: TMesh,
    divisions: Int,
    chords: Chords,
    size: Float,
    guide_size: Float,
    *,
    finer: Int | None = None,
    capped: bool = True,
) -> ChordDivisions:
    """Divisions of every chord.

    Parameters
    ----------
    divisions : (a,) int64
        Coarse divisions of the arcs.
    size : (a,) float64, scaled
        Target size along every arc.
    guide_size : (a,) float64, scaled
        Smallest useful guide edge along every arc; the guide edge is at least the target size.
    finer : (n,) int64, optional
        Lower bounds on the guide cells per chord.
    capped : bool
        Whether short curves cap the divisions for long edges.

    Raises
    ------
    LayoutError
        Prescribed counts of curves contradict each other.
    """
    seg = segments(model, tmesh, divisions, chords)
    local = size[seg.arc]
    guide, _ = _wanted(model, tmesh, seg, chords.n, np.maximum(local, guide_size[seg.arc]), GUIDE_TURN, GUIDE_BEND, capped)
    if finer is not None:
        guide = np.maximum(guide, finer)
    total, least = _wanted(model, tmesh, seg, chords.n, local, TURN, BEND, capped)
    fine = np.maximum(np.maximum(1, np.round(total / guide)), np.ceil(least / guide - 1e-9)).astype(np.int64)
    prescribed = {c: len(k.spacing) - 1 for c, k in enumerate(model.curves) if k.spacing is not None}
    if prescribed:
        guide, fine = _prescribe(model, tmesh, chords, guide, fine, prescribed)
    return ChordDivisions(guide, fine)


def _largest(seg: Segments, n: int, values: Float) -> Float:
    """Largest value per chord over its segments, rounded up."""
    out = np.zeros(n)
    np.maximum.at(out, seg.chord, values)
    return np.ceil(out - 1e-9)


def _wanted(
    model: Model, tmesh: TMesh, seg: Segments, n: int, size: Float, turn: float, bend: float, capped: bool
) -> tuple[Int, Int]:
    """Divisions per chord for edges of the given size (s,) along the segments, and those that the curves ask for at least.

    The geometric mean over the chord's segments, raised where edges on a curve or in a curved face would turn much, capped by
    the short curves that the chord ends on, and raised again where edges would be long on a curve or hardly follow their shape.
    What is shorter than `SHORT` sizes within a face needs no more than two edges for its bend: in a sliver a trace can turn back,
    and it is one of hundreds of segments of a chord.
    """
    bends = np.where(seg.length < SHORT * size, np.minimum(seg.bend, 2.0 * BEND), seg.bend)
    ratio = np.log(np.maximum(seg.length / size, SHORT))
    mean = np.exp(np.bincount(seg.chord, ratio, minlength=n) / np.maximum(np.bincount(seg.chord, minlength=n), 1))
    long = _largest(seg, n, np.where(tmesh.arc_curve[seg.arc] >= 0, seg.length / (LONGEST * size), 0.0))
    caps = _caps(model, tmesh, seg, n, size)
    least = np.minimum(_largest(seg, n, np.maximum(seg.turning / turn, bends / bend)), caps)
    least = np.maximum(least, _largest(seg, n, np.maximum(seg.turning / STEEPEST, bends / BEND)))
    if not capped:
        least = np.maximum(least, long)
    wanted = np.minimum(np.maximum(1, np.maximum(np.round(mean), long)), caps)
    return np.maximum(wanted, least).astype(np.int64), least.astype(np.int64)


def _caps(model: Model, tmesh: TMesh, seg: Segments, n: int, size: Float) -> Int:
    """Upper bounds from short CAD curves: their edges shall not be much shorter than needed."""
    cap = np.full(n, np.iinfo(np.int64).max)
    curve = tmesh.arc_curve[seg.arc]
    for c in range(len(model.curves)):
        mine = np.flatnonzero(curve == c)
        if len(mine):
            limit = max(1, round(model.curves[c].length / len(mine) / (SHORT * float(size[mine].mean()))))
            np.minimum.at(cap, seg.chord[mine], limit)
    return cap


def _prescribe(model: Model, tmesh: TMesh, chords: Chords, guide: Int, fine: Int, prescribed: dict[int, int]) -> tuple[Int, Int]:
    """Total divisions per chord nearest to the wanted ones whose sums over the prescribed curves are exact."""
    import scipy.sparse as sp
    from scipy.optimize import Bounds, LinearConstraint, milp

    n = chords.n
    want = (guide * fine).astype(float)
    row, col = [], []
    for i, c in enumerate(prescribed):
        for arc in tmesh.pieces[c]:
            row += [i] * len(chords.arc_segments[arc])
            col += chords.arc_segments[arc].tolist()
    sums = sp.csr_array((np.ones(len(row)), (row, col)), shape=(len(prescribed), n))
    counts = np.array(list(prescribed.values()), float)
    eye = sp.eye_array(n, format="csr")
    zero = sp.csr_array((len(prescribed), n))
    result = milp(
        np.concatenate([np.zeros(n), 1.0 / want]),
        constraints=[
            LinearConstraint(sp.hstack([sums, zero]), counts, counts),
            LinearConstraint(sp.hstack([eye, eye]), want, np.inf),
            LinearConstraint(sp.hstack([eye, -eye]), -np.inf, want),
        ],
        integrality=np.concatenate([np.ones(n), np.zeros(n)]),
        bounds=Bounds(np.concatenate([np.ones(n), np.zeros(n)]), np.inf),
        options={"mip_rel_gap": 1e-2, "node_limit": 20_000, "time_limit": 30.0},
    )
    if result.x is None:
        tags = ", ".join(f"curve {model.curves[c].tag} ({k})" for c, k in list(prescribed.items())[:8])
        raise LayoutError(
            f"the prescribed divisions contradict each other in this layout: {tags}",
            remedy="change one of the Transfinite Curve counts or leave it out",
        )
    total = np.round(result.x[:n]).astype(np.int64)
    touched = total != guide * fine
    guide, fine = guide.copy(), fine.copy()
    for i in np.flatnonzero(touched).tolist():
        divisors = [d for d in range(1, total[i] + 1) if total[i] % d == 0]
        best = min(divisors, key=lambda d: (abs(np.log(d / guide[i])), d))
        guide[i], fine[i] = best, total[i] // best
    return guide, fine
