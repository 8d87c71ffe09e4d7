"""How far a point of a face is from the boundary, and how far a singularity should be.

A singularity close to the boundary makes a strip of thin blocks along it.  It should keep the distance
``min(0.4 rho, 0.6 R)``: rho is the radius of the largest disc inside the face that (widened by half) still reaches the point,
R the perimeter over 2 pi of the hole beside it, so that a small hole gets a ring of its own size.  On curved faces distances are
straight and discs are balls, and every loop counts as a hole: in the plane the outer loop never decides, as rho is at most its R.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np

from ..records import Float, Int
from ..spatial import cKDTree
from .surface_mesh import SurfaceMesh
from .tangents import length

__all__ = ["Clearance"]


class Clearance:
    """Distances to the boundary of a mesh.

    Parameters
    ----------
    mesh : SurfaceMesh
        Plane or curved; without boundary all distances to it are infinite.
    holes : list of (k,) int64
        The boundary loops that are holes, as vertices in order.
    """

    def __init__(self, mesh: SurfaceMesh, holes: list[Int]) -> None:
        self.mesh = mesh
        self.holes = holes

    @cached_property
    def extent(self) -> float:
        """Greatest side of the box around the mesh."""
        return float(np.ptp(self.mesh.points, axis=0).max())

    @cached_property
    def _samples(self) -> Float:
        """(5 b, d) points of every boundary edge at 0, 1/4, 1/2 and 3/4."""
        mesh = self.mesh
        a, b = mesh.points[mesh.edges[mesh.boundary_edge]].transpose(1, 0, 2)
        return np.concatenate([a, 0.75 * a + 0.25 * b, 0.5 * (a + b), 0.25 * a + 0.75 * b, b])

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self._samples)

    @cached_property
    def _size(self) -> Float:
        """(5 b,) radius of the hole that a boundary sample is on, infinite on outer loops."""
        mesh = self.mesh
        radius = np.full(len(mesh.points), np.inf)
        for hole in self.holes:
            p = mesh.points[hole]
            step = np.roll(p, -1, axis=0) - p
            radius[hole] = length(step).sum() / (2 * np.pi)
        return np.tile(radius[mesh.edges[mesh.boundary_edge, 0]], 5)

    @cached_property
    def _depth(self) -> tuple[Float, Float]:
        """Interior vertices (k, d) and their distances (k,) from the boundary."""
        inside = self.mesh.points[~self.mesh.boundary_vertex]
        return inside, np.asarray(self._tree.query(inside)[0])

    @cached_property
    def closed(self) -> bool:
        """Whether there is no boundary."""
        return len(self._samples) == 0

    def distance(self, points: Float) -> tuple[Float, Float]:
        """(k,) distances from the boundary and (k, d) unit vectors away from it."""
        if self.closed:
            return np.full(len(points), np.inf), np.zeros_like(points)
        d, i = map(np.asarray, self._tree.query(points))
        away = points - self._samples[i]
        return d, away / np.maximum(d, np.finfo(float).tiny)[:, None]

    def wanted(self, points: Float) -> Float:
        """(k,) distances that singularities at these points should keep from the boundary."""
        if self.closed:
            return np.full(len(points), np.inf)
        inside, depth = self._depth
        square = sum(x * x for x in (points[:, None] - inside[None]).transpose(2, 0, 1))
        rho = np.where(square > (1.5 * depth) ** 2, 0.0, depth).max(axis=1)
        return np.minimum(0.4 * rho, 0.6 * self._size[self._tree.query(points)[1]])

    def room(self, points: Float) -> Float:
        """(k,) distances to the boundary or half way to the next of the points, whichever is less.

        Without boundary at most the radius of a disc of the surface's area.
        """
        apart = length(points[:, None] - points[None])
        np.fill_diagonal(apart, np.inf)
        most = np.sqrt(self.mesh.area.sum() / np.pi) if self.closed else np.inf
        return np.minimum(np.minimum(self.distance(points)[0], most), 0.5 * apart.min(axis=1, initial=np.inf))

    def free_length(self, origin: Float, direction: Float, spread: float, start: float) -> float:
        """Length from a boundary vertex over which a sector of a plane mesh is free of other boundary.

        Parameters
        ----------
        origin, direction : (2,) float64
            The vertex and the unit vector of the sector's bisector.
        spread : float
            Sine of half the opening angle, 1 from 180 degrees on.
        start : float
            A length that is free, e.g. that of an edge.
        """

        def place(t: Float) -> Float:
            return origin + t[:, None] * direction

        return self.free_along(place, spread, start)

    def free_along(self, place: Callable[[Float], Float], spread: float, start: float) -> float:
        """The same along a line that has the point `place` (k, d) at arc lengths (k,)."""
        ratio = 1.0 + 0.4 * spread
        count = int(np.log(max(2.0 * self.extent / start, 2.0)) / np.log(ratio)) + 1
        t = (start * ratio ** np.arange(count)).astype(np.float64)
        d = self._tree.query(place(t))[0]
        bad = np.flatnonzero(d < 0.8 * spread * t)
        return float(t[max(int(bad[0]) - 1, 0)] if len(bad) else t[-1])
