"""What every stage takes for granted of a face's triangles: an oriented surface, manifold with boundary."""

from __future__ import annotations

import numpy as np

from ..errors import GeometryError
from .surface_mesh import SurfaceMesh

__all__ = ["check_oriented"]


def check_oriented(mesh: SurfaceMesh) -> None:
    """Raise GeometryError unless every edge has two triangles at most, in opposite directions, and every vertex one fan."""
    count = np.bincount(mesh.triangle_edges.ravel())
    turn = np.bincount(mesh.triangle_edges.ravel(), mesh.edge_sign.ravel())
    wrong = np.flatnonzero((count > 2) | ((count == 2) & (turn != 0)))
    if len(wrong):
        several = bool(np.any(count > 2))
        raise GeometryError(
            "more than two triangles of a face share an edge"
            if several
            else "a face has one side only, its triangles are turned over",
            location=mesh.points[mesh.edges[wrong[0]]].mean(axis=0),
            remedy="split the face along a curve",
        )
    corners = np.bincount(mesh.triangles.ravel(), minlength=len(mesh.points))
    fans = np.bincount(mesh.half_edges[mesh.edge_half_edges[mesh.boundary_edge, 0], 0], minlength=len(mesh.points))
    pinched = np.flatnonzero((fans > 1) | (corners == 0))
    if len(pinched):
        raise GeometryError(
            "the boundary of a face touches itself at a point",
            location=mesh.points[pinched[0]],
            remedy="split the face there",
        )
