"""Straight lines on a triangulated surface.

Within a triangle the line is straight; across an edge it goes on as if both triangles lay in one plane (Polthier, Schmies 1998).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..records import Float
from .surface_mesh import SurfaceMesh

__all__ = ["Geodesic", "geodesic"]


class Geodesic(NamedTuple):
    """A line on a surface.

    Attributes
    ----------
    points : (k, d) float64
        Where it starts, crosses edges and ends.
    arclength : (k,) float64
        From 0.
    """

    points: Float
    arclength: Float

    def at(self, t: Float) -> Float:
        """Points (n, d) at arc lengths t (n,); the end where the line is shorter."""
        return np.stack([np.interp(t, self.arclength, c) for c in self.points.T], axis=-1)


def geodesic(mesh: SurfaceMesh, vertex: int, angle: float, reach: float) -> Geodesic:
    """The straight line that leaves a vertex, until it is long enough or meets the boundary.

    Parameters
    ----------
    mesh : SurfaceMesh
    vertex : int
    angle : float
        Counter-clockwise from the first half-edge of its star, in [0, angle sum).
    reach : float
        Length of the line.
    """
    t, k, angle = _sector(mesh, vertex, angle)
    points, total = [mesh.points[vertex]], [0.0]
    # in the frame of half-edge k: x along it, the triangle at y > 0
    x, fresh = 0.0, True
    for _ in range(4 * len(mesh.edges)):
        frame = _frame(mesh, t, k)
        apex, base = frame[2], frame[1, 0]
        d = np.array([np.cos(angle), np.sin(angle)])
        to_apex = apex - np.array([x, 0.0])
        left = not fresh and d[0] * to_apex[1] - d[1] * to_apex[0] < 0.0
        a, b = (apex, np.zeros(2)) if left else (np.array([base, 0.0]), apex)
        side = b - a
        across = d[0] * side[1] - d[1] * side[0]
        if across <= 0.0:
            break
        s = float(np.clip((d[1] * (a[0] - x) - d[0] * a[1]) / across, 0.0, 1.0))
        hit = a + s * side
        step = float(np.hypot(hit[0] - x, hit[1]))
        j = (k + 2) % 3 if left else (k + 1) % 3
        p, q = mesh.points[mesh.triangles[t, j]], mesh.points[mesh.triangles[t, (j + 1) % 3]]
        there = p + s * (q - p)
        part = min(1.0, (reach - total[-1]) / step) if step > 0.0 else 1.0
        points.append(points[-1] + part * (there - points[-1]))
        total.append(total[-1] + part * step)
        h = int(mesh.twin[3 * t + j])
        if part < 1.0 or h < 0:
            break
        angle = angle + np.pi - float(np.arctan2(side[1], side[0]))
        t, k = divmod(h, 3)
        x, fresh = (1.0 - s) * float(np.hypot(*side)), False
    return Geodesic(np.array(points), np.array(total))


def _sector(mesh: SurfaceMesh, vertex: int, angle: float) -> tuple[int, int, float]:
    """Triangle and corner of the star that hold a direction, and its angle from the half-edge that leaves there."""
    star = mesh.star(vertex)
    for h in star[:-1]:
        own = float(mesh.corner_angle[h // 3, h % 3])
        if angle < own:
            return h // 3, h % 3, angle
        angle -= own
    return star[-1] // 3, star[-1] % 3, angle


def _frame(mesh: SurfaceMesh, t: int, k: int) -> Float:
    """(3, 2) corners k, k + 1, k + 2 of a triangle, the first at the origin and the second on the x axis."""
    first, last = (float(mesh.edge_length[mesh.triangle_edges[t, j]]) for j in (k, (k + 2) % 3))
    angle = float(mesh.corner_angle[t, k])
    return np.array([[0.0, 0.0], [first, 0.0], [last * np.cos(angle), last * np.sin(angle)]])
