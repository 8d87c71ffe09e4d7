"""From the T-mesh of the model to a smoothed guide grid: quantize, divide the chords, place, smooth, check."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .cusps import cusp_corners
from .embed.place import place
from .embed.smooth import smooth
from .errors import LayoutError, MeshError
from .fill.area_loss import followed
from .fill.curve_edges import chords_to_divide, graded
from .fill.filler import Filler
from .fill.numbering import guide_chords
from .layout.alignment import LEAST
from .layout.chords import Chords, arc_divisions, find_chords
from .layout.divisions import ChordDivisions, chord_divisions
from .layout.quantize import Indivisible, quantize
from .layout.quotient import Quotient, arc_points, quotient
from .layout.verify import problems
from .records import Float, Guide, Int, Model, TMesh
from .watch import Watch

__all__ = ["GuideResult", "TooManyCells", "coarse_divisions", "smooth_guide"]

# refinements of a layout: twice as many rounds where only a few folded cells are left, no more cells than this factor allows,
# and only of grids whose scaled Jacobian is worth it
ROUNDS = 3
FEW = 4
GROWTH = 3
WORTH_REFINING = 0.02
SMALL = 1_000  # cells up to which any grid is refined: so few may be too few for two singularities that are close
MOST_QUADS, QUADS_PER_FACE = 25_000, 100
LARGE, HUGE = 6_000, 10_000  # cells of a shell from which it is refined for folded cells only, and not at all


class TooManyCells(LayoutError):
    """The guide grid would be too large."""


@dataclass(frozen=True)
class GuideResult:
    """A guide grid without inverted cells.

    Attributes
    ----------
    guide : Guide
    fine : (c,) int64
        Final edges per guide edge of every guide chord (`fill.numbering.guide_chords`).
    quality : float
        Minimum scaled Jacobian of the guide.
    notes : tuple of str
    """

    guide: Guide
    fine: Int
    quality: float
    notes: tuple[str, ...]


def coarse_divisions(model: Model, tmesh: TMesh, block: Float, shift: float = LEAST) -> Int:
    """Coarse divisions of the arcs for the wanted block edge `block` (a,) along every arc, checked.

    `shift` is what `quantize` takes.

    Raises
    ------
    LayoutError
    """
    coarse = _quantized(model, tmesh, tmesh.length / block, shift)
    wrong = problems(model, tmesh, quotient(tmesh, 3 * coarse))
    if wrong:
        raise LayoutError(f"the quantized layout is not valid ({wrong[0]})", remedy="another size may help")
    return coarse


def _quantized(model: Model, tmesh: TMesh, target: Float, shift: float) -> Int:
    """Divisions of the arcs; blocks on a curve with prescribed nodes are no more than its segments, also where they are large."""
    coarse = quantize(model, tmesh, target, shift=shift).divisions
    most = {c: len(curve.spacing) - 1 for c, curve in enumerate(model.curves) if curve.spacing is not None}
    over = [c for c, n in most.items() if coarse[list(tmesh.pieces[c])].sum() > n]
    if not over:
        return coarse
    try:
        return quantize(model, tmesh, target, at_most=most, shift=shift).divisions
    except Indivisible as error:
        tag, n = model.curves[over[0]].tag, most[over[0]]
        raise LayoutError(
            f"the layout cannot have as few divisions as prescribed (curve {tag}: {n})",
            remedy="raise the Transfinite Curve counts or leave them out",
        ) from error


def smooth_guide(
    tmesh: TMesh,
    coarse: Int,
    size: Float,
    guide_size: Float,
    filler: Filler,
    watch: Watch,
    capped: bool = True,
) -> GuideResult:
    """The smoothed guide grid; chords of cells that cannot be filled well get more guide cells.

    Parameters
    ----------
    coarse : (a,) int64
    size : (a,) float64, scaled
    guide_size : (a,) float64, scaled
    filler : Filler
        Of the model.
    watch : Watch
    capped : bool
        As for `layout.divisions.chord_divisions`.

    Raises
    ------
    LayoutError, MeshError
    """
    model, surfaces = filler.model, filler.surfaces
    with watch.stage("guide"):
        chords = find_chords(tmesh, quotient(tmesh, coarse))
    notes: list[str] = []
    finer: Int | None = None
    best: tuple[tuple[int, int, int, float], Guide, Int] | None = None
    first = 0
    for round_ in range(2 * ROUNDS):
        with watch.stage("guide"):
            divisions = chord_divisions(model, tmesh, coarse, chords, size, guide_size, finer=finer, capped=capped)
            q = quotient(tmesh, arc_divisions(chords, divisions.guide))
            first = first or len(q.quads)
            most = max(MOST_QUADS, QUADS_PER_FACE * len(model.faces))
            if len(q.quads) > max(SMALL, min(GROWTH * first, max(first, most))):
                break
            if best is not None and len(q.quads) > (LARGE if not best[0][0] else HUGE) and surfaces.curved.any():
                break
            if len(q.quads) > most:
                raise TooManyCells(
                    f"the guide grid would have {len(q.quads)} cells, more than {most}",
                    remedy="the model has too many short curves or narrow places for its size",
                )
            wrong = problems(model, tmesh, q)
            if wrong:
                raise LayoutError(f"the guide grid is not valid ({wrong[0]})", remedy="another size may help")
            start = place(model, surfaces, tmesh, q, tuple(_curve_fine(chords, divisions, pieces) for pieces in tmesh.pieces))
            coarse_chord = _coarse_chords(tmesh, q, chords, divisions)
            fine = divisions.fine[coarse_chord]
        with watch.stage("smooth"):
            guide, report = smooth(start, model, surfaces)
        watch.work += report.starts * len(q.quads)
        bad = folded = report.inverted
        steep = np.zeros(0, np.int64)
        if not len(bad):
            with watch.stage("fill"):
                bad, folded = filler.poor_cells(guide, fine)
                more = followed(model, surfaces, guide, fine)
                steep = np.flatnonzero(more != fine)
                only_fine = not len(bad) and (surfaces.curved.any() or cusp_corners(guide, model).any())
                if len(steep) and only_fine and not len(filler.poor_cells(guide, more)[1]):
                    fine, steep = more, steep[:0]
        score = (-len(folded), -len(steep), -len(bad), report.min_scaled_jacobian)
        if best is None or score > best[0]:
            best = score, guide, fine
        elif len(report.inverted) > -best[0][0]:
            break
        if round_ + 1 >= ROUNDS and (len(bad) > FEW or not len(folded)):
            break
        if not (len(bad) or len(steep)) or (report.min_scaled_jacobian < WORTH_REFINING and len(q.quads) > SMALL):
            break
        if round_ + 1 < 2 * ROUNDS:
            what = f"{len(bad)} guide cells could not be filled well" if len(bad) else "curves were not followed well"
            notes.append(f"{what}; chords were refined")
        finer = divisions.guide.copy()
        chosen = chords_to_divide(model, surfaces, guide, bad)
        if not (len(bad) and surfaces.curved.any()):  # there only final edges are added for the area, once no cell is bad
            chosen = np.union1d(chosen, steep)
        finer[np.unique(coarse_chord[chosen])] *= 2
    assert best is not None
    (folds, steeps, _, quality), guide, fine = best
    if folds:
        raise MeshError(
            f"the layout cannot be laid into the faces without inverted cells ({-folds} of {len(guide.quads)})",
            remedy="a smaller size may help",
        )
    with watch.stage("fill"):
        if steeps and surfaces.curved.any():  # left since some cells stayed poor
            more = followed(model, surfaces, guide, fine)
            fine = fine if len(filler.poor_cells(guide, more)[1]) else more
        halved = graded(model, guide, fine)
        if (halved != fine).any() and not len(filler.poor_cells(guide, halved)[1]):
            notes.append("edges on curves beside much shorter ones were divided")
            fine = halved
        fine = filler.unfolded(guide, fine)
    return GuideResult(guide, fine, quality, tuple(notes))


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
