"""Nearest points on parametrized surfaces by Newton's method, for many points of many faces at once.

The foot S(u, v) of a point x has ``(x - S) . S_u = 0 = (x - S) . S_v``.  From a sample of the surface near x, whose first and
second derivatives are known, Newton's steps

    [S_i . S_j - (x - S) . S_ij] d = (x - S) . S_i

are made with the second derivatives of the sample, renewed where six rounds did not suffice.  The first step costs no evaluation
and leaves an error of third order, the others converge linearly with the ratio (distance x curvature x distance of the sample),
and quadratically on the surface; three evaluations are usual.  Where the matrix is not safely positive the second term is left
out (Gauss-Newton); a ridge carries it over poles and apexes, where S_u vanishes.  A step that leads farther away from x
is made shorter.  What is returned is always the surface's own value at its parameters.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..records import Bool, Float, Int
from .charts import Charts

__all__ = ["Start", "newton"]

ROUNDS = 40
RENEWED = 6  # rounds after which second derivatives are taken anew
PRECISION = 1e-14  # of the model
NOISE = 1e-7  # of the distance: error of difference quotients in the built-in kernel
RIDGE = 1e-24
PARALLEL = 1e-12  # squared sine of the angle between S_u and S_v
LONGEST = 0.25  # of the range of parameters
SHORTEST = 1e-6  # factor on a step that does not come nearer


@dataclass(frozen=True)
class Start:
    """Samples of surfaces where the search starts.

    Attributes
    ----------
    uv : (n, 2) float64
    point : (n, 3), first : (n, 2, 3), second : (n, 3, 3) float64
        Values and derivatives, in the user's coordinates.
    """

    uv: Float
    point: Float
    first: Float
    second: Float

    def __getitem__(self, rows: Int | slice) -> Start:
        return Start(self.uv[rows], self.point[rows], self.first[rows], self.second[rows])


def newton(charts: Charts, face: Int, x: Float, start: Start, size: float, most: int = ROUNDS) -> tuple[Float, Float, Bool]:
    """Feet of points on their faces.

    Parameters
    ----------
    charts : Charts
    face : (n,) int64
        Sorted rows of `charts`.
    x : (n, 3) float64
        Points in the user's coordinates.
    start : Start
        One sample for each point.
    size : float
        Diagonal of the model.
    most : int
        Greatest number of rounds.

    Returns
    -------
    uv : (n, 2) float64
    points : (n, 3) float64
        On the surfaces, never farther away than the start.
    converged : (n,) bool
    """
    tolerance = max(PRECISION * size, 4 * np.finfo(float).eps * float(np.abs(x).max(initial=0.0)))
    uv_out, point_out, converged = start.uv.copy(), start.point.copy(), np.zeros(len(x), bool)
    run = np.arange(len(x))  # the points that are still under way; all other arrays hold these alone
    uv, point, first, second = uv_out.copy(), point_out.copy(), start.first.copy(), start.second
    last, shrink = np.full(len(x), np.inf), np.ones(len(x))
    for rounds in range(most):
        if not len(run):
            break
        r = x - point
        away = _length(r)
        wanted = _direction(charts, face, uv, r, first, second) * shrink[:, None]
        trial, step = charts.moved(face, uv, wanted)
        length = _length(step[:, :1] * first[:, 0] + step[:, 1:] * first[:, 1])
        whole = shrink == 1.0
        ratio = np.where(last < np.inf, np.minimum(length / last, 1.0), 1.0)
        done = (length <= tolerance) | (whole & (length <= NOISE * away) & (ratio > 0.5))
        value = charts.values(face, trial)
        nearer = _length(x - value) <= away + tolerance
        uv[nearer], point[nearer] = trial[nearer], value[nearer]
        # a step that was cut says nothing about the next one
        done |= nearer & whole & (length * ratio <= tolerance) & (step == wanted).all(axis=1)
        shrink = np.where(nearer, 1.0, 0.25 * shrink)
        last = np.where(nearer, np.maximum(length, 1e-300), last)
        gone = done | (shrink < SHORTEST)
        if gone.any():
            rows, keep = run[gone], ~gone
            uv_out[rows], point_out[rows], converged[rows] = uv[gone], point[gone], done[gone]
            run, face, x, uv, point = run[keep], face[keep], x[keep], uv[keep], point[keep]
            first, second, last, shrink, nearer = first[keep], second[keep], last[keep], shrink[keep], nearer[keep]
        if nearer.all():
            first = charts.derivatives(face, uv)
        else:
            first[nearer] = charts.derivatives(face[nearer], uv[nearer])
        if rounds % RENEWED == RENEWED - 1:
            second = charts.second_derivatives(face, uv)
    uv_out[run], point_out[run] = uv, point
    return uv_out, point_out, converged


def _length(vectors: Float) -> Float:
    """Lengths (n,) of vectors (n, 3); faster than `numpy.linalg.norm` along short rows."""
    return np.sqrt(np.einsum("nc,nc->n", vectors, vectors))


def _direction(charts: Charts, face: Int, uv: Float, r: Float, first: Float, second: Float) -> Float:
    """Newton steps (n, 2), not out of bounds and not too long."""
    slope = np.einsum("nkc,nc->nk", first, r)
    a, b, c = (np.einsum("nc,nc->n", first[:, i], first[:, j]) for i, j in ((0, 0), (0, 1), (1, 1)))
    bend = np.einsum("nkc,nc->nk", second, r)
    aa, bb, cc = a - bend[:, 0], b - bend[:, 1], c - bend[:, 2]
    safe = (aa > 0.1 * a) & (cc > 0.1 * c) & (aa * cc - bb * bb > 0.1 * (a * c - b * b))
    ridge = RIDGE * (a + c) + 1e-300
    aa, bb, cc = np.where(safe, aa, a) + ridge, np.where(safe, bb, b), np.where(safe, cc, c) + ridge
    det = np.maximum(aa * cc - bb * bb, PARALLEL * aa * cc)
    out = np.stack([cc * slope[:, 0] - bb * slope[:, 1], aa * slope[:, 1] - bb * slope[:, 0]], axis=1) / det[:, None]
    ends = charts.clamped[face]
    if ends.any():
        low, high = ends & (uv <= 0.0), ends & (uv >= 1.0)
        stuck = (low & ((slope < 0) | (out < 0))) | (high & ((slope > 0) | (out > 0)))
        alone = slope / np.stack([aa, cc], axis=1)
        alone[(low & (alone < 0)) | (high & (alone > 0))] = 0.0
        out = np.where(stuck.any(axis=1)[:, None], np.where(stuck, 0.0, alone), out)
    return out * np.minimum(1.0, LONGEST / np.maximum(np.maximum(np.abs(out[:, 0]), np.abs(out[:, 1])), 1e-300))[:, None]
