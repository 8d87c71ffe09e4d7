"""Smooth positions on sampled CAD curves.

L-BFGS and Newton need a position with a continuous derivative.  The samples of all curves are joined by cubic Hermite
segments in the arc length; the tangents at the samples are those of the parabola through three neighbours, except at
kinks, where every side keeps its own chord.  A fourth coordinate holds the *turning*: the total angle, in absolute value,
by which the tangent has turned since the start of the curve.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..records import Bool, Curve, Float, Int

__all__ = ["CurveTable"]

KINK = np.pi / 6
"""Samples where the polyline turns by more are corners of the curve."""


class CurveTable:
    """Hermite tables of several curves, evaluated together.

    Parameters
    ----------
    curves : sequence of Curve
    """

    def __init__(self, curves: Sequence[Curve]) -> None:
        tables = [_hermite(curve) for curve in curves]
        self.length = np.array([curve.length for curve in curves])
        counts = np.array([len(curve.points) - 1 for curve in curves], dtype=np.int64)
        self._first = np.concatenate([[0], np.cumsum(counts)[:-1]]).astype(np.int64) if len(curves) else counts
        self._last = self._first + counts - 1
        # One sorted key for all curves: twice the row of the curve plus the place on it in [0, 1].
        self._key = np.concatenate(
            [2.0 * c + curve.arclength[:-1] / curve.length for c, curve in enumerate(curves)] or [np.zeros(0)]
        )
        self._start = np.concatenate([curve.arclength[:-1] for curve in curves] or [np.zeros(0)])
        self._step = np.concatenate([np.diff(curve.arclength) for curve in curves] or [np.zeros(0)])
        self._value, self._tangent0, self._delta, self._tangent1 = (
            np.concatenate([table[k] for table in tables] or [np.zeros((0, 4))]) for k in range(4)
        )

    def at(self, curve: Int, arclength: Float) -> tuple[Float, Float]:
        """Position and turning, and their derivatives.

        Parameters
        ----------
        curve : (k,) int64
            Rows of curves.
        arclength : (k,) float64
            Places in [0, length]; beyond the ends the end segments are extrapolated.

        Returns
        -------
        value, derivative : (k, 4) float64
            Coordinates and turning; derivatives with respect to the arc length.
        """
        key = 2.0 * curve + arclength / self.length[curve]
        row = np.clip(np.searchsorted(self._key, key, side="right") - 1, self._first[curve], self._last[curve])
        step = self._step[row]
        t = ((arclength - self._start[row]) / step)[:, None]
        step = step[:, None]
        m0, m1, delta = self._tangent0[row], self._tangent1[row], self._delta[row]
        a, b = step * m0, step * m1
        cubic = a + b - 2.0 * delta
        quadratic = 3.0 * delta - 2.0 * a - b
        value: Float = self._value[row] + t * (a + t * (quadratic + t * cubic))
        derivative: Float = (a + t * (2.0 * quadratic + 3.0 * t * cubic)) / step
        return value, derivative


def _hermite(curve: Curve) -> tuple[Float, Float, Float, Float]:
    """Value and tangent at the start of every segment, difference over it, tangent at its end; each (n - 1, 4)."""
    step = np.diff(curve.arclength)
    chord = np.diff(curve.points, axis=0) / step[:, None]
    tangent0, tangent1, kink = _tangents(chord, step, curve.closed)
    if curve.tangents is not None:
        tangent0[0], tangent1[-1] = curve.tangents[0], -curve.tangents[1]
    # A chord is shorter than its arc, never longer: unit tangents keep the speed right between the samples.
    tangent0 /= np.linalg.norm(tangent0, axis=1)[:, None]
    tangent1 /= np.linalg.norm(tangent1, axis=1)[:, None]
    turn = _angle(tangent0, tangent1)
    corner = np.zeros(len(step))
    corner[1:] = np.where(kink[1:-1], _angle(chord[:-1], chord[1:]), 0.0)
    rate = (turn + corner) / step
    rate0, rate1, _ = _tangents(rate[:, None], step, curve.closed)
    turning = np.concatenate([[0.0], np.cumsum(turn + corner)])
    # Monotone where each rate is at most three times the segment's own.
    rate0, rate1 = np.minimum(rate0[:, 0], 3.0 * rate), np.minimum(rate1[:, 0], 3.0 * rate)
    value = np.column_stack([curve.points, turning])
    return (
        value[:-1],
        np.column_stack([tangent0, np.maximum(rate0, 0.0)]),
        np.diff(value, axis=0),
        np.column_stack([tangent1, np.maximum(rate1, 0.0)]),
    )


def _tangents(chord: Float, step: Float, closed: bool) -> tuple[Float, Float, Bool]:
    """Derivatives at both ends of every segment, and the samples (n,) that are kinks."""
    before, after = chord[:-1], chord[1:]
    h0, h1 = step[:-1, None], step[1:, None]
    inner = (h1 * before + h0 * after) / (h0 + h1)
    first, last = 2.0 * chord[0] - inner[0] if len(inner) else chord[0], chord[-1]
    if len(inner):
        last = 2.0 * chord[-1] - inner[-1]
        if closed:
            first = last = (step[0] * chord[-1] + step[-1] * chord[0]) / (step[0] + step[-1])
    node = np.vstack([first, inner, last])
    kink = np.zeros(len(node), dtype=bool)
    tangent0, tangent1 = node[:-1].copy(), node[1:].copy()
    if chord.shape[1] > 1:
        kink[1:-1] = _angle(before, after) > KINK
        if closed:
            kink[[0, -1]] = _angle(chord[-1:], chord[:1]) > KINK
        tangent0[kink[:-1]] = chord[kink[:-1]]
        tangent1[kink[1:]] = chord[kink[1:]]
    return tangent0, tangent1, kink


def _angle(a: Float, b: Float) -> Float:
    """Angles (k,) between the rows of two arrays."""
    cross = np.linalg.norm(np.cross(a, b), axis=1)
    angle: Float = np.arctan2(cross, np.einsum("kc,kc->k", a, b))
    return angle
