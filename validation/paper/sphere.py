"""A part of the unit sphere in the plane: stereographic projection, which keeps angles.

A cross field on the sphere is one on its image; its separatrices, singular points and indices are those of the image.  So the
formulas and the tracer of plane domains serve on the sphere, too.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from separatrices import Complex
from study import Study

Float = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Chart:
    """Stereographic projection to the tangent plane at `centre`, from the point opposite; seen from outside.

    Parameters
    ----------
    centre, right : (3,) float64
        Unit vectors, perpendicular; `right` is the direction of the real axis.
    """

    centre: Float
    right: Float

    @property
    def axes(self) -> Float:
        """(3, 3) rows: directions of the real and of the imaginary axis, and the centre."""
        return np.stack([self.right, np.cross(self.centre, self.right), self.centre])

    def flat(self, points: Float) -> Complex:
        """Images (n,) of points (n, 3), which are moved onto the sphere along its radius."""
        x, y, up = self.axes @ (points / np.linalg.norm(points, axis=1)[:, None]).T
        return 2 * (x + 1j * y) / (1 + up)

    def lift(self, z: Complex) -> Float:
        """Points (n, 3) of the sphere."""
        w, n = z / 2, 1 + np.abs(z / 2) ** 2
        return np.stack([2 * w.real / n, 2 * w.imag / n, (2 - n) / n], axis=1) @ self.axes

    def arms(self, points: Float, directions: Float) -> Complex:
        """Images (n,) of unit length of directions (n, 3), which are projected on the tangent planes."""
        p = points / np.linalg.norm(points, axis=1)[:, None]
        x, y, up = self.axes @ p.T
        a, b, rise = self.axes @ (directions - np.sum(directions * p, axis=1)[:, None] * p).T
        out = (a + 1j * b) * (1 + up) - (x + 1j * y) * rise
        return out / np.abs(out)

    def directions(self, z: Complex, arms: Complex) -> Float:
        """Unit vectors (n, 3) on the sphere whose images at z (n,) are `arms` (n,): the inverse of `arms`."""
        w, n = z / 2, 1 + np.abs(z / 2) ** 2
        grow = 2 * (np.conj(w) * arms).real
        along = arms * n - w * grow
        out = np.stack([along.real, along.imag, -grow], axis=1) @ self.axes
        return out / np.linalg.norm(out, axis=1)[:, None]


@dataclass
class SphereStudy(Study):
    """A mesh of a part of the unit sphere, read off in its chart."""

    chart: Chart

    def flat(self, points: Float) -> Complex:
        return self.chart.flat(points)

    def arms(self, points: Float, directions: Float) -> Complex:
        return self.chart.arms(points, directions)

    def lift(self, z: Complex) -> Float:
        return self.chart.lift(z)


def on_sphere(study: Study, chart: Chart) -> SphereStudy:
    """A study in a chart."""
    return SphereStudy(study.path, study.result, study.faults, chart)
