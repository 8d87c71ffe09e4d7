"""Quasi-Newton minimisation with a factorised Hessian that is renewed now and then.

Between two factorisations the L-BFGS two-loop recursion uses the factor as its initial inverse Hessian, so the cheap
steps (one energy and two sparse triangular solves) correct the matrix of the costly one.  Steps satisfy the Armijo
condition; a step into a barrier (energy inf) is shortened.

References
----------
.. [1] J. Nocedal, S. J. Wright, "Numerical Optimization", 2nd edition, 2006, algorithms 3.1 and 7.4.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..records import Float

__all__ = ["Minimum", "minimise"]

ARMIJO = 1e-4
SHORTENINGS = 25


@dataclass(frozen=True)
class Minimum:
    """Result of `minimise`: the point (n,), its energy and that of the start, the number of steps and of factorisations."""

    z: Float
    energy: float
    first: float
    steps: int
    factorisations: int


def minimise(
    value: Callable[[Float], tuple[float, Float]],
    factor: Callable[[Float], Callable[[Float], Float]],
    z: Float,
    *,
    factorisations: int,
    steps: int = 8,
    tolerance: float = 1e-5,
    done: Callable[[Float], bool] | None = None,
) -> Minimum:
    """Minimise a function.

    Parameters
    ----------
    value : callable
        z -> (energy, gradient).
    factor : callable
        z -> solver with a positive definite approximation of the Hessian.
    z : (n,) float64
        Start, with finite energy.
    factorisations : int
        Greatest number of factorisations.
    steps : int
        Steps between two of them.
    tolerance : float
        Stop where the energy sinks by less than this part of it between two factorisations, or is predicted to.
    done : callable, optional
        z -> True to stop early; asked after every step.

    Returns
    -------
    Minimum
    """
    energy, gradient = value(z)
    first = energy
    taken = renewed = 0
    for _ in range(factorisations):
        solve = factor(z)
        renewed += 1
        before = energy
        moves: list[tuple[Float, Float, float]] = []
        for _ in range(steps):
            direction = _direction(gradient, moves, solve)
            slope = float(gradient @ direction)
            if not slope < 0.0 or -slope < tolerance * abs(energy):
                break
            step = _search(value, z, energy, direction, slope)
            if step is None:
                break
            length, new_energy, new_gradient = step
            move, change = length * direction, new_gradient - gradient
            z, energy, gradient = z + move, new_energy, new_gradient
            taken += 1
            curvature = float(move @ change)
            if curvature > 1e-12 * float(np.sqrt((move @ move) * (change @ change))):
                moves.append((move, change, 1.0 / curvature))
            if done is not None and done(z):
                return Minimum(z, energy, first, taken, renewed)
        if before - energy <= tolerance * abs(before):
            break
    return Minimum(z, energy, first, taken, renewed)


def _direction(gradient: Float, moves: list[tuple[Float, Float, float]], solve: Callable[[Float], Float]) -> Float:
    """Two-loop recursion."""
    q = -gradient
    alphas = []
    for move, change, rho in reversed(moves):
        alpha = rho * float(move @ q)
        alphas.append(alpha)
        q = q - alpha * change
    q = solve(q)
    for (move, change, rho), alpha in zip(moves, reversed(alphas)):
        q = q + (alpha - rho * float(change @ q)) * move
    return q


def _search(
    value: Callable[[Float], tuple[float, Float]], z: Float, energy: float, direction: Float, slope: float
) -> tuple[float, float, Float] | None:
    """Step length that satisfies the Armijo condition, with energy and gradient there; None if there is none."""
    length = 1.0
    for _ in range(SHORTENINGS):
        new_energy, gradient = value(z + length * direction)
        if new_energy <= energy + ARMIJO * length * slope:
            return length, new_energy, gradient
        if np.isfinite(new_energy):
            least = -0.5 * slope * length * length / (new_energy - energy - slope * length)
            length = float(min(max(least, 0.1 * length), 0.5 * length))
        else:
            length *= 0.5
    return None
