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

On curved faces the energy is that in tangent planes (`grid_energy`), which are frozen during a round; after it the vertices
are put back on their surfaces.  So there are more and shorter rounds, and one that starts outside the barrier of its new
frames has eps > 0.  Long steps in the tangent planes are good, though they leave the surface far: of 183 random tangles on
spheres, tori, pipes and bends, displaced by up to 1.5 edge lengths, 15 are not undone, but 60 where steps are limited to 3
lengths.  New rest lengths in every polishing round bring the least scaled Jacobian to within .002 of the best one in 6
rounds of 2 factorisations; with the same lengths over 4 factorisations up to .08 are missing.

The attempt with the greatest least scaled Jacobian is kept.  Within an attempt the most polished grid is kept that has `KEPT`
of the best one's; above `GOOD` they count as equal.

References
----------
.. [1] V. Garanzha et al., "Foldover-free maps in 50 lines of code", ACM Transactions on Graphics 40(4), 2021.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np

from ..records import Float, Guide, Int, Model
from ..surfaces import Surfaces
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
SHARPENING = ((12, 6),)
"""The same for the worst corners, which a high power puts first; only where the result is below `WANTED`."""
EFFORT = 4
"""Factorisations of an untangling round."""
# The same where there are curved faces.
POLISHING_CURVED = ((4, 2),) * 6
SHARPENING_CURVED = ((12, 2),) * 3
EFFORT_CURVED = 3
SETTLED = 3e-4
"""Relative gain of energy in a round, inside the barrier, after which no other round follows."""
WANTED = 0.85
POOR = 0.15
WORTH = 4.0
"""A sharpened grid is taken if the least scaled Jacobian was below `POOR`, or rises by `WORTH` times what the mean one falls:
where the worst corners cannot become good (one block at a straight angle), a high power spoils all others for them."""
LEAST_AREA = 1e-3
LEAST_EPS = 1e-4
HOPELESS_ROUNDS, HOPELESS = 5, 0.1
"""On curved faces a start is given up if after so many rounds more than this share of the quads is still turned over."""
FEW_ROUNDS = 4
"""Greatest number of untangling rounds where another start has led to a valid grid."""
MOST_STARTED = 25_000
"""Quads of all starts together beyond which no other start is made: each takes 30 seconds for 20,000 quads of a shell."""
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


class _Ground(NamedTuple):
    """What the guide lies on."""

    model: Model
    surfaces: Surfaces
    table: CurveTable

    @property
    def bent(self) -> bool:
        return bool(self.surfaces.curved.any())

    def quality(self, guide: Guide) -> Float:
        return guide_quality(guide, self.surfaces, self.model)

    def rest(self, guide: Guide, actual: float = 0.0, graded: bool = True) -> RestLengths:
        return rest_lengths(guide, self.model, self.surfaces, self.table, actual=actual, graded=graded)

    def energy(self, guide: Guide, rest: RestLengths) -> GridEnergy:
        return GridEnergy(guide, self.model, self.surfaces, self.table, rest)


def smooth(guide: Guide, model: Model, surfaces: Surfaces) -> tuple[Guide, SmoothReport]:
    """Untangle and polish a guide grid.

    Parameters
    ----------
    guide : Guide
        May have inverted quads, edges without length, ties and wrong orders on the curves.
    model : Model
    surfaces : Surfaces

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
    ground = _Ground(model, surfaces, CurveTable(model.curves))
    given = spread_chains(guide, model, ground.table)
    rest = ground.rest(given)
    placed = ground.rest(given, actual=1.0, graded=False)
    tangled = float(np.mean(ground.quality(given) <= 0.0))
    order = ("placed", "even", "laplace") if tangled <= TRUSTED else ("even", "placed", "laplace")
    best, quality, chosen, rounds = given, -np.inf, order[0], 0
    starts = 0
    for name in order:
        if starts and (starts + 1) * len(guide.quads) > MOST_STARTED:
            break
        starts += 1
        start = laplace_start(given, *ground) if name == "laplace" else given
        own, sides = (placed, placed.sides) if name == "placed" else (rest, rest.even)
        candidate, used, valid = _untangle(start, ground, own, sides, ROUNDS if quality <= 0.0 else FEW_ROUNDS)
        rounds += used
        if valid or not ground.bent:
            candidate, score = _polish_all(candidate, ground, rest)
        else:
            score = float(ground.quality(candidate).min())
        if score > quality or (valid and quality <= 0.0):
            best, quality, chosen = candidate, score, name
        if quality > (DOUBTFUL if name == order[0] else 0.0):
            break
    final = ground.quality(best)
    return best, SmoothReport(float(final.min()), np.flatnonzero(final <= 0.0), rounds, chosen, starts)


def _polish_all(guide: Guide, ground: _Ground, rest: RestLengths) -> tuple[Guide, float]:
    """The most polished grid that is as good as those before it, and its least scaled Jacobian."""
    best, latest = guide, guide
    quality = now = float(ground.quality(guide).min())
    for power, effort in POLISHING_CURVED if ground.bent else POLISHING:
        latest, gain = _polish(latest, ground, rest, power, effort, barrier=now > VALID)
        now = float(ground.quality(latest).min())
        if min(now, GOOD) >= KEPT * min(quality, GOOD):
            best, quality = latest, now
        if ground.bent and gain < SETTLED:
            break
    if VALID < quality < WANTED:
        sharp = best
        for power, effort in SHARPENING_CURVED if ground.bent else SHARPENING:
            sharp, _ = _polish(sharp, ground, rest, power, effort, barrier=True)
        before, after = ground.quality(best), ground.quality(sharp)
        score = float(after.min())
        if score > quality and (quality < POOR or score - quality > WORTH * (before.mean() - after.mean())):
            best, quality = sharp, score
    return best, quality


def _moved(guide: Guide, grid: GridEnergy, z: Float) -> Guide:
    points, arclength = grid.positions(z)
    return replace(guide, points=points, arclength=arclength)


def _untangle(guide: Guide, ground: _Ground, rest: RestLengths, sides: Float, most: int) -> tuple[Guide, int, bool]:
    """Minimise the regularised energy until no corner is turned over: the result, the rounds, and whether it is valid."""
    grid = ground.energy(guide, rest)
    z = np.zeros(grid.size)
    least = float(grid.areas(z, sides).min())
    rounds, eps = 0, np.inf
    bent = ground.bent
    while least <= LEAST_AREA and rounds < most and grid.size:
        eps = max(LEAST_EPS, min(0.5 * eps, float(np.sqrt(1e-6 + 0.04 * least * least))))
        z = minimise(
            partial(grid.value, sides=sides, eps=eps, power=1),
            partial(grid.factor, sides=sides, eps=eps, power=1),
            z,
            factorisations=EFFORT_CURVED if bent else EFFORT,
            tolerance=1e-3,
            done=partial(_done, grid, sides),
        ).z
        if bent:  # the frames have changed
            guide = _moved(guide, grid, z)
            grid, z = ground.energy(guide, rest), np.zeros(grid.size)
        rounds += 1
        if bent and rounds == HOPELESS_ROUNDS and np.mean(ground.quality(guide) <= 0.0) > HOPELESS:
            break
        before, least = least, float(grid.areas(z, sides).min())
        if rounds > 6 and least <= 0.0 and abs(least - before) < 1e-6 * abs(before):
            break
    return _moved(guide, grid, z), rounds, least > 0.0


def _done(grid: GridEnergy, sides: Float, z: Float) -> bool:
    return float(grid.areas(z, sides).min()) > 0.05


def _polish(guide: Guide, ground: _Ground, rest: RestLengths, power: int, effort: int, barrier: bool) -> tuple[Guide, float]:
    """Minimise the energy with graded rest lengths, inside the barrier; from a tangled grid with eps > 0 and power 1.

    Returns the grid and the part of the energy that it has lost (inf outside the barrier).
    """
    if barrier:
        rest = ground.rest(guide, actual=0.5)
    grid = ground.energy(guide, rest)
    if not grid.size:
        return guide, 0.0
    z = np.zeros(grid.size)
    if ground.bent and barrier:  # the frames of the energy are not those of the quality
        barrier = float(grid.areas(z, rest.sides).min()) > 0.0
    eps, power = (0.0, power) if barrier else (1e-3, 1)
    result = minimise(
        partial(grid.value, sides=rest.sides, eps=eps, power=power),
        partial(grid.factor, sides=rest.sides, eps=eps, power=power),
        z,
        factorisations=effort,
    )
    gain = (result.first - result.energy) / result.first if barrier else np.inf
    return _moved(guide, grid, result.z), gain
