"""The plane of a face, for the sources that need one frame for the whole face.

The axes do not depend on how the model is turned about its own normal: the first is the global x axis projected on the plane (the
y axis where the plane is perpendicular to x), the second a quarter turn counter-clockwise of it about the CAD normal.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ..errors import FieldError
from ..records import Float

if TYPE_CHECKING:
    from ..field.edge_frames import EdgeFrames

__all__ = ["Plane", "angle_arms", "extent", "plane_axes", "plane_of"]

#: greatest deviation of a plane face: of its unit normals, and of its points over its extent
_FLAT = 1e-6


def extent(points: Float) -> float:
    """Diagonal of the bounding box of points (n, d)."""
    return float(np.linalg.norm(np.ptp(points, axis=0)))


def plane_axes(normal: Float) -> Float:
    """(2, 3) orthonormal axes of the plane with this unit normal (3,), right-handed about it."""
    axis = np.zeros(3)
    axis[0 if abs(normal[0]) < 1.0 - 1e-9 else 1] = 1.0
    x = axis - np.dot(axis, normal) * normal
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(normal, x)])


@dataclass(frozen=True)
class Plane:
    """A plane with orthonormal axes; points of it are complex numbers.

    Parameters
    ----------
    origin : (3,) float64, the user's coordinates
    normal : (3,) float64
        The face's unit normal.
    """

    origin: Float
    normal: Float

    @cached_property
    def axes(self) -> Float:
        """(2, 3) orthonormal axes, right-handed about the normal."""
        return plane_axes(self.normal)

    @cached_property
    def upright(self) -> bool:
        """True if the last of the normal's coordinates that is not 0 is positive."""
        last = np.flatnonzero(np.abs(self.normal) > 1e-9)[-1]
        return bool(self.normal[last] > 0.0)

    def complex(self, points: Float) -> np.ndarray[tuple[int], np.dtype[np.complex128]]:
        """(n,) complex coordinates of points (n, 3)."""
        x, y = self.axes @ (points - self.origin).T
        return x + 1j * y

    def height(self, points: Float) -> Float:
        """(n,) distance of points (n, 3) from the plane, along its normal."""
        out: Float = (points - self.origin) @ self.normal
        return out


def plane_of(frames: EdgeFrames, what: str) -> Plane:
    """The plane of a face.

    Raises
    ------
    FieldError
        "`what` needs a planar face" on a curved one.
    """
    normal = frames.normal.mean(axis=0)
    size = float(np.linalg.norm(normal))
    if size > 0.5:
        plane = Plane(frames.points.mean(axis=0), normal / size)
        flat = np.abs(plane.height(frames.points)).max() <= _FLAT * extent(frames.points)
        if flat and np.abs(frames.normal - plane.normal).max() <= _FLAT:
            return plane
    raise FieldError(f"{what} needs a planar face", entity=(2, frames.face), remedy="give directions on curved faces")


def angle_arms(frames: EdgeFrames, angle: Float) -> Float:
    """(n, 3) unit vectors at angles (n,) from the x axis, in the plane of a face.

    On a plane other than xy the angle is measured from the projected x axis, about the normal whose last coordinate is positive.
    """
    plane = plane_of(frames, "a field of angles")
    x, y = plane.axes if plane.upright else plane.axes * [[1.0], [-1.0]]
    return np.cos(angle)[:, None] * x + np.sin(angle)[:, None] * y
