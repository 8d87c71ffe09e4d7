"""Curves that cross themselves in a tiny loop.

Digitised outlines end now and then a little past their beginning, and a spline through such points ties a knot that is
far smaller than any element.  A loop shorter than `SHORT` is cut off: the samples go straight on at the crossing and
the parameter jumps.  Longer loops are left for `validate` to report.
"""

from __future__ import annotations

import numpy as np

from ..records import Float
from .intersect import contacts

__all__ = ["untie"]

SHORT = 5e-3  # of the model
JUMP = 1e-7  # of the model: length over which the parameter jumps
MEET = 1e-6  # of the model
MAX_KNOTS = 8


def untie(parameters: Float, points: Float, scale: float) -> tuple[Float, Float]:
    """Cut tiny loops off the samples of a curve.

    Parameters
    ----------
    parameters : (n,) float64; points : (n, 3) float64
        A plane curve.
    scale : float
        Size of the model.

    Returns
    -------
    parameters : (m,) float64; points : (m, 3) float64
    """
    for _ in range(MAX_KNOTS):
        centred = (points - points[0]) / scale
        flat = centred @ np.linalg.svd(centred, full_matrices=False)[2][:2].T
        closed = bool((points[0] == points[-1]).all())
        found = contacts([flat], [(0, 0) if closed else (0, 1)])
        if not found:
            break
        i, j = sorted(found[0].segments)
        loop = np.sqrt((np.diff(flat[i : j + 2], axis=0) ** 2).sum(1)).sum()
        if loop > SHORT:
            break
        t, u = _share(flat, i, found[0].point), _share(flat, j, found[0].point)
        crossing = points[i] + t * (points[i + 1] - points[i])
        if np.linalg.norm(crossing - points[j] - u * (points[j + 1] - points[j])) > MEET * scale:
            break
        first = parameters[i] + t * (parameters[i + 1] - parameters[i])
        second = parameters[j] + u * (parameters[j + 1] - parameters[j])
        step = float(np.linalg.norm(crossing - points[i])) / scale
        before = [points[i] + (1 - JUMP / step) * (crossing - points[i])] if step > JUMP else []
        points = np.array([*points[: i + 1], *before, crossing, *points[j + 1 :]])
        parameters = np.array([*parameters[: i + 1], *[first] * len(before), second, *parameters[j + 1 :]])
    return parameters, points


def _share(flat: Float, row: int, point: Float) -> float:
    """Where on segment `row` the point is, 0 at its start and 1 at its end."""
    d = flat[row + 1] - flat[row]
    return float(np.clip((point - flat[row]) @ d / (d @ d), 0.0, 1.0))
