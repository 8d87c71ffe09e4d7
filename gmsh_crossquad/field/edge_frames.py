"""Tangent frames at the edge midpoints of a background mesh: where a cross field from outside meets the Crouzeix–Raviart form.

Angles are measured from the edge's own direction (lower to higher vertex) about the normal, so planar and curved faces are one
case and no global frame is needed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..records import Bool, CrossField, Float
from .smooth import from_angles
from .surface_mesh import SurfaceMesh

__all__ = ["EdgeFrames"]


@dataclass(frozen=True)
class EdgeFrames:
    """The places of one face at which a cross field is wanted.

    Parameters
    ----------
    face : int
        Gmsh tag.
    surface : SurfaceMesh
        Background triangles, in scaled coordinates.
    points : (n, 3) float64
        Its vertices in the user's coordinates.
    normal : (e, 3) float64
        Unit normal of the face at every edge midpoint.
    marked : (n,) bool, optional
        Vertices that were made for singular points of the user; where it is left out, any inside may be one.
    bending : callable, optional
        Gives how the face bends at every edge midpoint, from the CAD: (e, 3) float64, the components xx, yy and xy in the frame
        of the edge of the tensor that takes a tangent vector to the derivative of the unit normal, times the face's extent; NaN
        where the CAD has none.
    """

    face: int
    surface: SurfaceMesh
    points: Float
    normal: Float
    marked: Bool | None = None
    bending: Callable[[], Float] | None = None

    @property
    def curved(self) -> bool:
        """Whether the face is not known to be plane."""
        return self.surface.points.shape[1] == 3

    @cached_property
    def places(self) -> Float:
        """(e, 3) edge midpoints in the user's coordinates."""
        out: Float = self.points[self.surface.edges].mean(axis=1)
        return out

    @cached_property
    def x(self) -> Float:
        """(e, 3) unit vectors along the edges, from the lower to the higher vertex, in the tangent plane."""
        a, b = self.points[self.surface.edges[:, 0]], self.points[self.surface.edges[:, 1]]
        d = b - a
        d = d - np.sum(d * self.normal, axis=1)[:, None] * self.normal
        out: Float = d / np.linalg.norm(d, axis=1)[:, None]
        return out

    @cached_property
    def y(self) -> Float:
        """(e, 3) unit tangent vectors a quarter turn counter-clockwise of `x`."""
        return np.cross(self.normal, self.x)

    def angles(self, directions: Float) -> Float:
        """(e,) angles of directions (e, 3), projected on the tangent planes, from the edges."""
        return np.arctan2(np.sum(directions * self.y, axis=1), np.sum(directions * self.x, axis=1))

    def field(self, directions: Float) -> CrossField:
        """The cross field with an arm along `directions` (e, 3), turning by at most 45 degrees from edge to edge."""
        return from_angles(self.surface, self.angles(directions))
