"""Nodes on CAD curves.

Guide vertices have arc lengths on their curve.  The arc length is interpolated over the number of the fine node by a
monotone cubic (PCHIP: Fritsch and Butland, A method for constructing local monotone piecewise cubic interpolants, SIAM J.
Sci. Stat. Comput. 5, 1984), so that sizes grow smoothly along the curve and nodes never change order; closed curves are
periodic.  A second monotone cubic through the curve's samples turns arc length into the CAD parameter, at which the CAD
kernel gives the exact point.
"""

from __future__ import annotations

import numpy as np

from ..errors import MeshError
from ..records import Curve, Float, Int

__all__ = ["curve_parameters", "monotone_cubic"]


def monotone_cubic(x: Float, y: Float, at: Float, *, periodic: bool = False) -> Float:
    """Monotone cubic interpolation (PCHIP).

    Parameters
    ----------
    x : (n,) float64, increasing; y : (n,) float64
        n >= 2.
    at : (m,) float64
        Places in [x[0], x[-1]].
    periodic : bool
        The increments repeat: y grows by ``y[-1] - y[0]`` over every period ``x[-1] - x[0]``.

    Returns
    -------
    (m,) float64
        Exactly ``y`` at ``x``; monotone where ``y`` is.
    """
    h, slope = np.diff(x), np.diff(y) / np.diff(x)
    d = np.empty(len(x))
    if periodic:
        left_h, left = np.concatenate([h[-1:], h]), np.concatenate([slope[-1:], slope])
        right_h, right = np.concatenate([h, h[:1]]), np.concatenate([slope, slope[:1]])
        d[:] = _inner_slope(left_h, right_h, left, right)
    elif len(h) == 1:
        d[:] = slope[0]
    else:
        d[1:-1] = _inner_slope(h[:-1], h[1:], slope[:-1], slope[1:])
        d[0] = _end_slope(h[0], h[1], slope[0], slope[1])
        d[-1] = _end_slope(h[-1], h[-2], slope[-1], slope[-2])
    k = np.minimum(np.searchsorted(x, at, side="right") - 1, len(h) - 1)
    k = np.maximum(k, 0)
    t = at - x[k]
    u = t / h[k]
    c = (3 * slope - 2 * d[:-1] - d[1:])[k]
    b = (d[:-1] + d[1:] - 2 * slope)[k]
    out = y[k] + t * (d[k] + u * (c + u * b))
    out = np.where(at == x[k + 1], y[k + 1], out)
    return out


def _inner_slope(h0: Float, h1: Float, s0: Float, s1: Float) -> Float:
    """Weighted harmonic mean of two neighbouring slopes, 0 at an extremum."""
    same = s0 * s1 > 0
    a, b = np.where(same, s0, 1.0), np.where(same, s1, 1.0)
    w0, w1 = 2 * h1 + h0, h1 + 2 * h0
    return np.where(same, (w0 + w1) / (w0 / a + w1 / b), 0.0)


def _end_slope(h0: float, h1: float, s0: float, s1: float) -> float:
    """Three-point slope at an end, kept monotone."""
    d = ((2 * h0 + h1) * s0 - h0 * s1) / (h0 + h1)
    if d * s0 <= 0:
        return 0.0
    if s0 * s1 <= 0 and abs(d) > 3 * abs(s0):
        return 3 * s0
    return d


def curve_parameters(curve: Curve, arclength: Float, divisions: Int, even: Float | None = None) -> Float:
    """CAD parameters of all nodes of a curve.

    Parameters
    ----------
    curve : Curve
    arclength : (k + 1,) float64
        Arc lengths of the guide vertices, from 0 to the length of the curve.
    divisions : (k,) int64
        Pieces between consecutive guide vertices.
    even : (k,) float64, optional
        How far the nodes between guide vertices go from smooth growth (0, the default) to equal steps (1).

    Returns
    -------
    (sum of divisions + 1,) float64
        Strictly monotone, from the first to the last parameter of the curve.

    Raises
    ------
    MeshError
        Guide vertices are not in order, or their number contradicts a Transfinite Curve command.
    """
    index = np.concatenate([[0], np.cumsum(divisions)]).astype(float)
    nodes = np.arange(int(index[-1]) + 1)
    if curve.spacing is not None:
        if len(curve.spacing) != len(nodes):
            raise MeshError(
                f"the layout puts {len(nodes)} nodes on a curve that prescribes {len(curve.spacing)}",
                entity=(1, curve.tag),
                remedy="change the number of nodes of the Transfinite Curve",
            )
        s = curve.spacing
    else:
        if np.any(np.diff(arclength) <= 0):
            raise MeshError("guide vertices are not in order", entity=(1, curve.tag), remedy="use a smaller size")
        s = arclength
        if len(nodes) > len(arclength):
            s = monotone_cubic(index, arclength, nodes.astype(float), periodic=curve.closed)
            if even is not None and np.any(even > 0):
                weight = np.repeat(even, divisions)
                s[1:] += weight * (np.interp(nodes[1:], index, arclength) - s[1:])
    out = _parameter(curve, s)
    out[0], out[-1] = curve.parameters[0], curve.parameters[-1]
    step = np.diff(out)
    if not (np.all(step > 0) or np.all(step < 0)):
        raise MeshError("nodes on a curve coincide", entity=(1, curve.tag), remedy="use a larger size")
    return out


def _parameter(curve: Curve, s: Float) -> Float:
    """CAD parameters (m,) at arc lengths (m,)."""
    apart = np.flatnonzero(np.diff(curve.arclength) > 0)
    known_s = np.concatenate([curve.arclength[:1], curve.arclength[apart + 1]])
    known_t = np.concatenate([curve.parameters[:1], curve.parameters[apart + 1]])
    slope = np.diff(known_t) / np.diff(known_s)
    if slope.max() - slope.min() <= 1e-12 * abs(slope[0]):  # lines and circles need no cubic
        return known_t[0] + slope[0] * s
    return monotone_cubic(known_s, known_t, np.minimum(s, curve.length))
