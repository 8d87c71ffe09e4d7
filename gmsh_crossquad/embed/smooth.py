"""Fold-over-free smoothing of the guide grid.

1. The vertices on curves are brought into strict order; rest lengths are made (`rest_lengths`).
2. *Untangling* towards squares of the local area: minimise the regularised energy (power 1) for a sequence of

       eps_k = max(1e-3, sqrt(1e-6 + 0.04 min(D)^2)),

   until every corner has an area above `LEAST_AREA` of its rest area.
3. If that fails, the same from the uniform Laplace start.
4. *Polishing* towards the rest lengths with power 4 and eps = 0: a barrier, so that no corner can turn over.

The candidate with the greatest least scaled Jacobian is kept; above `GOOD` they count as equal, and the most polished one
is kept for its sizes.

References
----------
.. [1] V. Garanzha et al., "Foldover-free maps in 50 lines of code", ACM Transactions on Graphics 40(4), 2021.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ..records import Float, Guide, Int, Model
from .grid_energy import GridEnergy
from .minimise import minimise
from .quality import guide_quality
from .rest_lengths import RestLengths, rest_lengths
from .start import laplace_start, spread_chains

__all__ = ["SmoothReport", "smooth"]

ROUNDS = 12
"""Greatest number of untangling rounds per start."""
POLISHING = (4, 8)
"""Factorisations of the polishing rounds; every round makes new rest lengths from the grid before it."""
LEAST_AREA = 1e-3
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
        "given" or "laplace": the start that led to the result.
    """

    min_scaled_jacobian: float
    inverted: Int
    rounds: int
    start: str


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
    given = spread_chains(guide, model)
    rest = rest_lengths(given, model)
    best, quality, chosen, rounds = given, float(guide_quality(given, model).min()), "given", 0
    for name in ("given", "laplace"):
        start = given if name == "given" else laplace_start(given, model)
        candidate, used, valid = _untangle(start, model, rest)
        rounds += used
        score = float(guide_quality(candidate, model).min())
        if score > quality or valid:
            best, quality, chosen = candidate, score, name
        if valid:
            break
    for effort in POLISHING:
        valid = quality > 0.0
        polished = _polish(best, model, rest_lengths(best, model, actual=True) if valid else rest, effort, barrier=valid)
        score = float(guide_quality(polished, model).min())
        if min(score, GOOD) >= min(quality, GOOD):
            best, quality = polished, score
    final = guide_quality(best, model)
    return best, SmoothReport(float(final.min()), np.flatnonzero(final <= 0.0), rounds, chosen)


def _moved(guide: Guide, grid: GridEnergy, z: Float) -> Guide:
    points, arclength = grid.positions(z)
    return replace(guide, points=points, arclength=arclength)


def _untangle(guide: Guide, model: Model, rest: RestLengths) -> tuple[Guide, int, bool]:
    """Minimise the regularised energy until no corner is turned over: the result, the rounds, and whether it is valid."""
    grid = GridEnergy(guide, model, rest)
    z = np.zeros(grid.size)
    sides = rest.even
    least = float(grid.areas(z, sides).min())
    rounds = 0
    while least <= LEAST_AREA and rounds < ROUNDS and grid.size:
        eps = max(1e-3, float(np.sqrt(1e-6 + 0.04 * least * least)))
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


def _polish(guide: Guide, model: Model, rest: RestLengths, effort: int, barrier: bool) -> Guide:
    """Minimise the energy with the graded rest lengths; inside the barrier if there is none turned over."""
    grid = GridEnergy(guide, model, rest)
    if not grid.size:
        return guide
    eps, power = (0.0, 4) if barrier else (1e-3, 1)
    result = minimise(
        partial(grid.value, sides=rest.sides, eps=eps, power=power),
        partial(grid.factor, sides=rest.sides, eps=eps, power=power),
        np.zeros(grid.size),
        factorisations=effort,
    )
    return _moved(guide, grid, result.z)
