"""What the stages after the layout need to know of the faces: nearest points and normals.

Everything is in scaled coordinates and for many points at once; ``face[i]`` is the row of the face of point i.  The CAD's own
faces are in `cad.surfaces`; `Planes` are those of a model without curved faces.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from .records import Bool, Float, Int, Model

__all__ = ["Planes", "Surfaces", "quad_normals"]


class Surfaces(Protocol):
    """The faces of a model."""

    @property
    def curved(self) -> Bool:
        """(f,) True where a face is not plane."""

    def feet(self, face: Int, points: Float) -> Float:
        """Nearest points (n, 3) on the faces `face` (n,) to `points` (n, 3), which are near them."""

    def normals(self, face: Int, points: Float) -> Float:
        """Unit normals (n, 3) of the faces, on the side of the CAD normal (that of Gmsh's triangles), at points near them."""


@dataclass(frozen=True)
class Planes:
    """The faces of a model that are all plane.

    Parameters
    ----------
    model : Model
    """

    model: Model

    @cached_property
    def curved(self) -> Bool:
        """(f,) True where a face is not plane."""
        return np.array([face.curved for face in self.model.faces], bool)

    @cached_property
    def _planes(self) -> tuple[Float, Float]:
        faces = self.model.faces
        origin = np.array([f.origin for f in faces]).reshape(-1, 3)
        normal = np.array([np.full(3, np.nan) if f.curved else f.normal for f in faces]).reshape(-1, 3)
        return origin, normal

    def feet(self, face: Int, points: Float) -> Float:
        """Nearest points (n, 3) on the planes; NaN on curved faces."""
        origin, normal = (a[face] for a in self._planes)
        return points - np.einsum("nc,nc->n", points - origin, normal)[:, None] * normal

    def normals(self, face: Int, points: Float) -> Float:
        """Unit normals (n, 3) of the planes; NaN on curved faces."""
        return self._planes[1][face]


def quad_normals(surfaces: Surfaces, points: Float, quads: Int, face: Int) -> Float:
    """Unit normals (q, 3) against which quads are judged.

    In a plane face its normal; on a curved one the direction of the quad's own area vector, on the side of the surface's normal
    at the quad's middle: a quad that is turned over has a negative scaled Jacobian.

    Parameters
    ----------
    surfaces : Surfaces
    points : (n, 3) float64, scaled
    quads : (q, 4) int64
    face : (q,) int64
    """
    corner = points[quads]
    out = surfaces.normals(face, corner.mean(axis=1))
    own = np.flatnonzero(surfaces.curved[face])
    if len(own):
        area = np.cross(corner[own, 2] - corner[own, 0], corner[own, 3] - corner[own, 1])
        side = np.einsum("qc,qc->q", area, out[own])
        length = np.linalg.norm(area, axis=1)
        good = length > 0
        out = out.copy()
        out[own[good]] = area[good] * (np.where(side < 0, -1.0, 1.0) / np.where(good, length, 1.0))[good, None]
    return out
