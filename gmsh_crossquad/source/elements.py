"""Quadratic finite elements on triangles, plane or laid into the plane one by one: six nodes each, vertices and edge middles."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..field.surface_mesh import SurfaceMesh
from ..records import Float, Int
from .power import Complex

__all__ = ["QuadraticElements"]


class QuadraticElements:
    """Matrices and gradients of quadratic elements; node v is vertex v, node ``n + e`` the midpoint of edge e.

    Parameters
    ----------
    mesh : SurfaceMesh
        For its topology.
    points : (n, 2) or (m, 3, 2) float64
        Vertices of a plane mesh; or, on a curved surface, the corners of every triangle, each in a plane of its own
        (`SurfaceMesh.layout`): all that counts is lengths and angles.
    """

    def __init__(self, mesh: SurfaceMesh, points: Float) -> None:
        self.mesh = mesh
        self.size = len(mesh.points) + len(mesh.edges)
        self.nodes: Int = np.concatenate([mesh.triangles, len(mesh.points) + mesh.triangle_edges], axis=1)
        p = points[mesh.triangles] if points.ndim == 2 else points
        opposite = np.roll(p, -2, axis=1) - np.roll(p, -1, axis=1)
        self.double_area: Float = opposite[:, 0, 0] * opposite[:, 1, 1] - opposite[:, 0, 1] * opposite[:, 1, 0]
        # gradients of the barycentric coordinates: the opposite edge, turned counter-clockwise, over twice the area
        slope = np.stack([-opposite[:, :, 1], opposite[:, :, 0]], axis=2) / self.double_area[:, None, None]
        # (m, 3, 2, 6): derivatives of the six functions at midpoint k, where the coordinates are 1/2, 1/2, 0 from vertex k on
        self._slopes = np.zeros((len(p), 3, 2, 6))
        for k in range(3):
            a, b, c = k, (k + 1) % 3, (k + 2) % 3
            for node, vertex, factor in ((a, a, 1), (b, b, 1), (c, c, -1), (3 + a, c, -2), (3 + b, c, 2), (3 + c, c, 2)):
                self._slopes[:, k, :, node] = factor * slope[:, vertex]

    def stiffness(self) -> Any:
        """(nodes, nodes) sparse matrix of int grad . grad; the midpoint rule is exact."""
        return self._assembled(np.einsum("tkdi,tkdj,t->tij", self._slopes, self._slopes, self.double_area / 6.0))

    def mass(self) -> Any:
        """(nodes, nodes) sparse matrix of int f g."""
        local = np.zeros((6, 6))
        local[:3, :3] = -1.0 + 7.0 * np.eye(3)
        local[3:, 3:] = 16.0 + 16.0 * np.eye(3)
        for k in range(3):
            local[(k + 2) % 3, 3 + k] = local[3 + k, (k + 2) % 3] = -4.0
        return self._assembled(self.double_area[:, None, None] / 360.0 * local)

    def edge_gradients(self, values: Float) -> Float:
        """(e, 2) gradients at the edge midpoints of a function with these node values; means over the two triangles."""
        own = np.einsum("tkdi,ti->tkd", self._slopes, values[self.nodes]) * self.double_area[:, None, None]
        edge = self.mesh.triangle_edges.ravel()
        total = np.stack([np.bincount(edge, own[:, :, d].ravel()) for d in range(2)], axis=1)
        out: Float = total / np.bincount(edge, np.repeat(self.double_area, 3))[:, None]
        return out

    def edge_slopes(self, values: Float) -> Complex:
        """(e,) the same on a curved surface, each in the frame of its edge as a complex number."""
        own = np.einsum("tkdi,ti->tkd", self._slopes, values[self.nodes]) @ np.array([1.0, 1.0j])
        own = own * np.exp(-1j * self.mesh.edge_direction) * self.double_area[:, None]
        edge = self.mesh.triangle_edges.ravel()
        total = np.bincount(edge, own.real.ravel()) + 1j * np.bincount(edge, own.imag.ravel())
        out: Complex = (total / np.bincount(edge, np.repeat(self.double_area, 3))).astype(np.complex128)
        return out

    def _assembled(self, local: Float) -> Any:
        import scipy.sparse as sp

        i, j = np.repeat(self.nodes, 6, axis=1).ravel(), np.tile(self.nodes, (1, 6)).ravel()
        return sp.coo_matrix((local.ravel(), (i, j)), (self.size, self.size)).tocsr()
