"""A cross field against the frame of the vector heat method.

A tangent vector at one vertex, along the x axis there, is transported over the whole face by the vector heat method [1]_: the
global frame of section 4 of "Quadrilateral mesh of non-simply connected domain and non-planar surfaces from a given
cross-field".  The cross has a given angle to it: 0, a number, or a function of the place.

Such a frame may have zeros, which no angle can mend: where the index of its directions around a triangle or a vertex, a whole
number, is not 0.  That is an error here; the frame of `frame`, from which angles are measured without this source, has none.

The library potpourri3d is needed: ``pip install gmsh-crossquad[heat]``.

References
----------
.. [1] N. Sharp, Y. Soliman, K. Crane, "The vector heat method", ACM Transactions on Graphics 38(3), 2019.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import FieldError, InputError
from ..field.smooth import from_angles
from ..field.surface_mesh import SurfaceMesh
from ..records import CrossField, Float, Int
from .checks import check_turns

if TYPE_CHECKING:
    from ..field.edge_frames import EdgeFrames

__all__ = ["HeatFrame"]

#: a projected axis shorter than this has no direction
_SHORT = 0.05


@dataclass(frozen=True)
class HeatFrame:
    """The field at an angle to the frame of the vector heat method.

    Parameters
    ----------
    angle : float or callable
        Radians, counter-clockwise about the face's normal; a function gets all places (n, 3) and gives (n,) angles.

    Raises
    ------
    InputError
        For a number that is not finite.
    """

    angle: float | Callable[[Float], Any] = 0.0

    def __post_init__(self) -> None:
        if not callable(self.angle) and not math.isfinite(self.angle):
            raise InputError(f"the angle of a heat frame is {self.angle!r}", remedy="give a number or a function")

    def points(self) -> Float:
        """None: (0, 3)."""
        return np.zeros((0, 3))

    def on(self, frames: EdgeFrames) -> CrossField:
        """The field at the edge midpoints of a face.

        Raises
        ------
        FieldError
            Without potpourri3d; if the frame has zeros, or the function fails or its values cannot be used.
        """
        from .function import function_values

        mesh = frames.surface
        theta = _directions(frames)
        _check_zeros(frames, theta)
        if callable(self.angle):
            values = function_values(self.angle, frames)
            if values.ndim != 1:
                what, remedy = "a function against a heat frame gives directions", "let it give angles (n,)"
                raise FieldError(what, entity=(2, frames.face), remedy=remedy)
            theta = theta + values
        else:
            theta = theta + self.angle
        return check_turns(frames, from_angles(mesh, theta))


def _directions(frames: EdgeFrames) -> Float:
    """Angles (e,) of the transported direction from the edges."""
    try:
        from potpourri3d import MeshVectorHeatSolver
    except ImportError:
        what, remedy = "the field 'heat-frame' needs the package potpourri3d", "pip install gmsh-crossquad[heat]"
        raise FieldError(what, remedy=remedy) from None
    mesh = frames.surface
    vectors = np.zeros(frames.points.shape)
    for c in range(len(mesh.component_euler)):
        rows = np.flatnonzero(mesh.components == c)
        triangles = np.searchsorted(rows, mesh.triangles[mesh.components[mesh.triangles[:, 0]] == c])
        place = frames.points[rows]
        solver = MeshVectorHeatSolver(place, triangles)
        x, y, _ = (np.asarray(a) for a in solver.get_tangent_frames())
        source, direction = _source(place, triangles, x, y)
        found = np.asarray(solver.transport_tangent_vector(source, direction))
        vectors[rows] = found[:, :1] * x + found[:, 1:] * y
    if not np.isfinite(vectors).all():
        raise FieldError("the vector heat method failed", entity=(2, frames.face), remedy="use another cross field")
    a, b = mesh.edges.T
    return frames.angles(vectors[a] + vectors[b])


def _source(place: Float, triangles: Int, x: Float, y: Float) -> tuple[int, list[float]]:
    """The vertex nearest to the middle that is not on the boundary, and the components of the x axis there (else y, else z)."""
    mesh = SurfaceMesh(place, triangles)
    away = np.linalg.norm(place - place.mean(axis=0), axis=1) + np.where(mesh.boundary_vertex, np.inf, 0.0)
    v = int(np.argmin(away))
    components = np.stack([x[v], y[v]])
    axis = next(k for k in range(3) if np.linalg.norm(components[:, k]) > _SHORT)
    return v, (components[:, axis] / np.linalg.norm(components[:, axis])).tolist()


def _check_zeros(frames: EdgeFrames, theta: Float) -> None:
    """Raise FieldError where directions turn by whole turns around triangles or interior vertices."""
    mesh = frames.surface
    angle = theta[mesh.triangle_edges] + mesh.edge_direction
    step = np.roll(angle, -1, axis=1) - angle
    step -= 2 * np.pi * np.rint(step / (2 * np.pi))
    in_triangle = np.rint(step.sum(axis=1) / (2 * np.pi))
    passed = np.bincount(mesh.triangles.ravel(), np.roll(step, 1, axis=1).ravel(), len(mesh.points))
    at_vertex = np.where(mesh.boundary_vertex, 0.0, np.rint((mesh.curvature - passed) / (2 * np.pi)))
    places = [frames.points[mesh.triangles[in_triangle != 0]].mean(axis=1), frames.points[at_vertex != 0]]
    zeros = np.concatenate(places)
    if len(zeros):
        raise FieldError(
            f"the frame of the vector heat method has {len(zeros)} zeros",
            entity=(2, frames.face),
            location=zeros[0].tolist(),
            remedy="use a function of directions, or of angles without 'heat-frame'",
        )
