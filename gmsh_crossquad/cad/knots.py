"""Curves that cross themselves in a tiny loop.

Digitised outlines end now and then a little past their beginning, and a spline through such points ties a knot that is
far smaller than any element.  A loop shorter than `SHORT` is cut off: the samples go straight to the crossing and
straight on from there, where the parameter jumps; where the CAD vertex of a closed curve is on the loop, they go to the
vertex instead.  The hooks at its ends, within `HOOK` times its extent, go with it: they
would be corners of no meaning.  Longer loops are left for `validate` to report.
"""

from __future__ import annotations

import numpy as np

from ..records import Float
from .intersect import contacts

__all__ = ["untie"]

SHORT = 5e-3  # of the model
HOOK = 3.0  # of the loop's extent
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
        t, u = _share(flat, i, found[0].point), _share(flat, j, found[0].point)
        crossing = points[i] + t * (points[i + 1] - points[i])
        if np.linalg.norm(crossing - points[j] - u * (points[j + 1] - points[j])) > MEET * scale:
            break
        first = float(parameters[i] + t * (parameters[i + 1] - parameters[i]))
        second = float(parameters[j] + u * (parameters[j + 1] - parameters[j]))
        step = np.sqrt((np.diff(flat, axis=0) ** 2).sum(1))
        if step[i : j + 1].sum() <= SHORT:
            parameters, points = _without(parameters, points, (i, j), crossing, (first, second), scale)
        elif closed and step[j:].sum() + step[: i + 1].sum() <= SHORT:
            parameters, points = _through_vertex(parameters, points, (i, j), (first, second), scale)
        else:
            break
    return parameters, points


def _without(
    parameters: Float, points: Float, rows: tuple[int, int], crossing: Float, at: tuple[float, float], scale: float
) -> tuple[Float, Float]:
    """Samples that go from segment ``rows[0]`` to segment ``rows[1]`` over their crossing, where the parameters are `at`."""
    i, j = rows
    away = np.sqrt(((points - crossing) ** 2).sum(1))
    reach = HOOK * away[i + 1 : j + 1].max(initial=0.0)
    while i > 0 and away[i] < reach:
        i -= 1
    while j + 2 < len(points) and away[j + 1] < reach:
        j += 1
    before = [_just_before(points[i], crossing, scale)] if away[i] > JUMP * scale else []
    points = np.array([*points[: i + 1], *before, crossing, *points[j + 1 :]])
    return np.array([*parameters[: i + 1], *[at[0]] * len(before), at[1], *parameters[j + 1 :]]), points


def _through_vertex(
    parameters: Float, points: Float, rows: tuple[int, int], at: tuple[float, float], scale: float
) -> tuple[Float, Float]:
    """Samples of a closed curve whose vertex is on the loop: the curve goes straight to the vertex and straight on."""
    i, j = rows
    away = np.sqrt(((points - points[0]) ** 2).sum(1))
    reach = HOOK * max(away[: i + 1].max(), away[j + 1 :].max())
    while i + 2 < j and away[i + 1] < reach:
        i += 1
    while j > i + 2 and away[j] < reach:
        j -= 1
    ends = [_just_before(points[i + 1], points[0], scale), _just_before(points[j], points[0], scale)]
    points = np.array([points[0], ends[0], *points[i + 1 : j + 1], ends[1], points[-1]])
    return np.array([parameters[0], at[0], *parameters[i + 1 : j + 1], at[1], parameters[-1]]), points


def _just_before(start: Float, end: Float, scale: float) -> Float:
    """The point of the segment that is `JUMP` from its end."""
    out: Float = end + JUMP * scale / np.linalg.norm(start - end) * (start - end)
    return out


def _share(flat: Float, row: int, point: Float) -> float:
    """Where on segment `row` the point is, 0 at its start and 1 at its end."""
    d = flat[row + 1] - flat[row]
    return float(np.clip((point - flat[row]) @ d / (d @ d), 0.0, 1.0))
