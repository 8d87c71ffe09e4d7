"""Fold-over-free smoothing of the guide grid.

1. The vertices on curves are brought into strict order; rest lengths are made (`rest_lengths`).
2. *Untangling*: minimise the regularised energy (power 1) for a sequence of

       eps_k = max(1e-4, min(eps_(k-1) / 2, sqrt(1e-6 + 0.04 min(D)^2))),

   until every corner has an area above `LEAST_AREA` of its rest area.  The rest lengths of the first attempt, "placed", are
   those of the given grid as it is: most of it is good, thin gaps, fans and bundles included, and what is wrong is mended
   near where it lies.  Measured on a wing of 526 edges, 1/250 of the domain: 2 rounds leave no inverted cell, while
   squares of the local area ("even") leave 200 to 1,000 of 7,388 after 12.  A grid with more than `TRUSTED` of its quads
   inverted starts with "even", and where the first attempt ends below `DOUBTFUL`, the other one is tried too.
3. *Polishing* towards the rest lengths with power 4 and eps = 0: a barrier, so that no corner can turn over.
4. *Sharpening*: the same with power 12, which cares for the worst corners only, if these are still poor.
5. If no attempt is valid, all this from the uniform Laplace start.

The attempt with the greatest least scaled Jacobian is kept.  Within an attempt the most polished grid is kept that has `KEPT`
of the best one's; above `GOOD` they count as equal.

References
----------
.. [1] V. Garanzha et al., "Foldover-free maps in 50 lines of code", ACM Transactions on Graphics 40(4), 2021.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ..records import Float, Guide, Int, Model
from .curve_table import CurveTable
from .grid_energy import GridEnergy
from .minimise import minimise
from .quality import guide_quality
from .rest_lengths import RestLengths, rest_lengths
from .start import laplace_start, spread_chains

__all__ = ["SmoothReport", "smooth"]

ROUNDS = 12
"""Greatest number of untangling rounds per start."""
POLISHING = ((4, 4), (4, 8))
"""Power and factorisations of the polishing rounds; every round makes new rest lengths from the grid before it."""
SHARPENING = (12, 6)
"""The same for the worst corners, which a high power puts first; only where the result is below `WANTED`."""
WANTED = 0.85
POOR = 0.15
WORTH = 4.0
"""A sharpened grid is taken if the least scaled Jacobian was below `POOR`, or rises by `WORTH` times what the mean one falls:
where the worst corners cannot become good (one block at a straight angle), a high power spoils all others for them."""
LEAST_AREA = 1e-3
LEAST_EPS = 1e-4
FEW_ROUNDS = 4
"""Greatest number of untangling rounds where another start has led to a valid grid."""
DOUBTFUL = 0.05
"""Least scaled Jacobian up to which another start is tried."""
TRUSTED = 0.15
"""Share of inverted quads up to which the given lengths are worth keeping."""
KEPT = 0.9
"""Part of the least scaled Jacobian that a polishing round must keep."""
VALID = 1e-6
"""Scaled Jacobian from which a grid is inside the barrier beyond doubt."""
GOOD = 0.7


@dataclass(frozen=True)
class SmoothReport:
    """What the smoother did.

    Attributes
    ----------
    min_scaled_jacobian : float
    inverted : (k,) int64
        Rows of the quads whose scaled Jacobian is not positive.
    rounds : int
        Untangling rounds.
    start : str
        "placed", "even" or "laplace": the start that led to the result.
    starts : int
        Starts that were tried.
    """

    min_scaled_jacobian: float
    inverted: Int
    rounds: int
    start: str
    starts: int


def smooth(guide: Guide, model: Model) -> tuple[Guide, SmoothReport]:
    """Untangle and polish a guide grid.

    Parameters
    ----------
    guide : Guide
        May have inverted quads, edges without length, ties and wrong orders on the curves.
    model : Model

    Returns
    -------
    guide : Guide
        With new `points` and `arclength`; fixed vertices have not moved, vertices on curves are in strict order.
    report : SmoothReport

    Raises
    ------
    MeshError
        Where prescribed nodes are not in order along a curve.
    """
    table = CurveTable(model.curves)
    given = spread_chains(guide, model, table)
    rest = rest_lengths(given, model, table)
    placed = rest_lengths(given, model, table, actual=1.0, graded=False)
    tangled = float(np.mean(guide_quality(given, model) <= 0.0))
    order = ("placed", "even", "laplace") if tangled <= TRUSTED else ("even", "placed", "laplace")
    best, quality, chosen, rounds = given, -np.inf, order[0], 0
    starts = 0
    for name in order:
        starts += 1
        start = laplace_start(given, model, table) if name == "laplace" else given
        own, sides = (placed, placed.sides) if name == "placed" else (rest, rest.even)
        candidate, used, valid = _untangle(start, model, table, own, sides, ROUNDS if quality <= 0.0 else FEW_ROUNDS)
        rounds += used
        candidate, score = _polish_all(candidate, model, table, rest)
        if score > quality or (valid and quality <= 0.0):
            best, quality, chosen = candidate, score, name
        if quality > (DOUBTFUL if name == order[0] else 0.0):
            break
    final = guide_quality(best, model)
    return best, SmoothReport(float(final.min()), np.flatnonzero(final <= 0.0), rounds, chosen, starts)


def _polish_all(guide: Guide, model: Model, table: CurveTable, rest: RestLengths) -> tuple[Guide, float]:
    """The most polished grid that is as good as those before it, and its least scaled Jacobian."""
    best, latest = guide, guide
    quality = now = float(guide_quality(guide, model).min())
    for power, effort in POLISHING:
        latest = _polish(latest, model, table, rest, power, effort, barrier=now > VALID)
        now = float(guide_quality(latest, model).min())
        if min(now, GOOD) >= KEPT * min(quality, GOOD):
            best, quality = latest, now
    if VALID < quality < WANTED:
        sharp = _polish(best, model, table, rest, *SHARPENING, barrier=True)
        before, after = guide_quality(best, model), guide_quality(sharp, model)
        score = float(after.min())
        if score > quality and (quality < POOR or score - quality > WORTH * (before.mean() - after.mean())):
            best, quality = sharp, score
    return best, quality


def _moved(guide: Guide, grid: GridEnergy, z: Float) -> Guide:
    points, arclength = grid.positions(z)
    return replace(guide, points=points, arclength=arclength)


def _untangle(
    guide: Guide, model: Model, table: CurveTable, rest: RestLengths, sides: Float, most: int
) -> tuple[Guide, int, bool]:
    """Minimise the regularised energy until no corner is turned over: the result, the rounds, and whether it is valid."""
    grid = GridEnergy(guide, model, table, rest)
    z = np.zeros(grid.size)
    least = float(grid.areas(z, sides).min())
    rounds, eps = 0, np.inf
    while least <= LEAST_AREA and rounds < most and grid.size:
        eps = max(LEAST_EPS, min(0.5 * eps, float(np.sqrt(1e-6 + 0.04 * least * least))))
        z = minimise(
            partial(grid.value, sides=sides, eps=eps, power=1),
            partial(grid.factor, sides=sides, eps=eps, power=1),
            z,
            factorisations=4,
            tolerance=1e-3,
            done=lambda y: float(grid.areas(y, sides).min()) > 0.05,
        ).z
        rounds += 1
        before, least = least, float(grid.areas(z, sides).min())
        if rounds > 6 and least <= 0.0 and abs(least - before) < 1e-6 * abs(before):
            break
    return _moved(guide, grid, z), rounds, least > 0.0


def _polish(guide: Guide, model: Model, table: CurveTable, rest: RestLengths, power: int, effort: int, barrier: bool) -> Guide:
    """Minimise the energy with graded rest lengths, inside the barrier; from a tangled grid with eps > 0 and power 1."""
    if barrier:
        rest = rest_lengths(guide, model, table, actual=0.5)
    grid = GridEnergy(guide, model, table, rest)
    if not grid.size:
        return guide
    eps, power = (0.0, power) if barrier else (1e-3, 1)
    result = minimise(
        partial(grid.value, sides=rest.sides, eps=eps, power=power),
        partial(grid.factor, sides=rest.sides, eps=eps, power=power),
        np.zeros(grid.size),
        factorisations=effort,
    )
    return _moved(guide, grid, result.z)
