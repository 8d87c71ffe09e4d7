"""Crosses as complex numbers: the 4-symmetric power representation.

In a tangent frame an arm of angle a stands for exp(4 i a), whichever of the four arms it is.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ..records import Bool, Float, Int

__all__ = ["CANCELLED", "ZERO", "Complex", "averaged", "tangent_axes", "unit_power"]

Complex = npt.NDArray[np.complex128]

#: a direction shorter than this over the longest one is none
ZERO = 1e-12
#: an angle to the normal with a smaller sine is none to the face
_NORMAL = 1e-9
#: two arms at 45 degrees, whose powers add up to less, make no cross
_OPPOSED = 1e-6
#: a mean of unit powers that is shorter has cancelled out
CANCELLED = 1e-9


def tangent_axes(normal: Float) -> tuple[Float, Float]:
    """Unit vectors (n, 3) that make right-handed frames with unit normals (n, 3); zero where the normal is zero."""
    least = np.argmin(np.abs(normal), axis=1)
    x = np.eye(3)[least]
    x -= np.sum(x * normal, axis=1)[:, None] * normal
    x /= np.linalg.norm(x, axis=1)[:, None]
    y = np.cross(normal, x)
    return x, y


def unit_power(arms: Float, x: Float, y: Float, largest: float) -> tuple[Complex, Bool]:
    """Fourth powers (...,) of unit length of arms (..., a, 3) in tangent axes (..., 3), and which of them are defined."""
    p = np.sum(arms * x[..., None, :], axis=-1) + 1j * np.sum(arms * y[..., None, :], axis=-1)
    length, flat = np.linalg.norm(arms, axis=-1), np.abs(p)
    good = (length > ZERO * largest) & (flat > _NORMAL * length)
    power = np.where(good, (p / np.where(good, flat, 1.0)) ** 4, 0.0).sum(axis=-1)
    size = np.abs(power)
    defined = size > _OPPOSED
    return np.where(defined, power / np.where(defined, size, 1.0), 0.0), defined


def averaged(values: Float, triangles: Int, points: Float) -> Float:
    """Values (n, ...) on points from those of their triangles (m, ...), weighted by area.

    Parameters
    ----------
    values : (m, a, 3) arms, or (m, 3, 3) symmetric tensors
    triangles : (m, 3) int64
    points : (n, 3) float64

    Returns
    -------
    (n, 1, 3) arms of unit length, zero where they cancel out; or (n, 3, 3) tensors
    """
    corner = points[triangles]
    vector = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    area = np.linalg.norm(vector, axis=1)
    weight = np.bincount(triangles.ravel(), np.repeat(area, 3), len(points))
    weight = np.where(weight > 0.0, weight, 1.0)
    if values.shape[1:] == (3, 3):
        return _gathered(area[:, None, None] * values, triangles, len(points)) / weight[:, None, None]
    normal = _gathered(vector, triangles, len(points))
    length = np.linalg.norm(normal, axis=1)[:, None]
    x, y = tangent_axes(normal / np.where(length > 0.0, length, 1.0))
    total, largest = np.zeros(len(points), np.complex128), float(np.abs(values).max())
    for v in triangles.T:
        power, _ = unit_power(values, x[v], y[v], largest)
        np.add.at(total, v, area * power)
    angle = 0.25 * np.angle(total)[:, None]
    good = np.abs(total) > CANCELLED * weight
    return np.where(good[:, None], np.cos(angle) * x + np.sin(angle) * y, 0.0)[:, None]


def _gathered(values: Float, triangles: Int, count: int) -> Float:
    """Sums (count, ...) of the values (m, ...) of the triangles around every point."""
    out = np.zeros((count, *values.shape[1:]))
    for v in triangles.T:
        np.add.at(out, v, values)
    return out
