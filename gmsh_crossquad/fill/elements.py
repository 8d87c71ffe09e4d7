"""Elements of order p between straight ones and the model: where the new nodes are, and which elements they turn over.

Edges are stored once, their new nodes by how far these are from the straight edge, and those inside quads by how far they are
from Coons' rule between the edges.  Where an element is turned over (a bound on its Jacobian, `jacobians`) both go to nothing by
halves.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..records import Bool, Float, Int, Model, QuadMesh
from ..surfaces import Surfaces
from .jacobians import corner_jacobian, least_jacobian, quad_normals

__all__ = ["Elements"]

ROUNDS = 6  # halvings of bulges of elements that are turned over; afterwards they are straight
ROUNDING = 1e-12  # bulges over lengths of edges that are none
KEEP = 0.05  # part of the straight quad's least Jacobian that an element must have


@dataclass(frozen=True)
class Elements:
    """Elements in the making; all arrays but the topology are filled in place.

    Attributes
    ----------
    points : (n, 3) float64, scaled
    length : (e,) float64
    straight, bulge : (e, p - 1, 3) float64
        Nodes inside the straight edges, from the lower node, and how far the new nodes are from them.
    inside : (q, p - 1, p - 1, 3) float64
        How far the nodes inside quads are from Coons' rule.
    """

    model: Model
    surfaces: Surfaces
    mesh: QuadMesh
    order: int
    points: Float
    edges: Int
    quad_edges: Int
    length: Float
    straight: Float
    bulge: Float
    inside: Float

    @classmethod
    def start(cls, model: Model, surfaces: Surfaces, mesh: QuadMesh, order: int, edges: Int, quad_edges: Int) -> Elements:
        """Straight elements."""
        x = (mesh.points - model.origin) / model.scale
        u = (np.arange(1, order) / order)[None, :, None]
        straight = x[edges[:, :1]] * (1 - u) + x[edges[:, 1:]] * u
        inside = np.zeros((len(mesh.quads), order - 1, order - 1, 3))
        length = np.linalg.norm(x[edges[:, 1]] - x[edges[:, 0]], axis=1)
        return cls(model, surfaces, mesh, order, x, edges, quad_edges, length, straight, np.zeros_like(straight), inside)

    def put_on_faces(self, on_curve: Bool, *, inside: bool = True) -> None:
        """Put the nodes of edges inside curved faces on these, and those inside quads."""
        q = np.flatnonzero(self.surfaces.curved[self.mesh.quad_face])
        if not len(q):
            return
        edge_face = np.full(len(self.edges), -1)
        edge_face[self.quad_edges[q]] = self.mesh.quad_face[q, None]
        e = np.flatnonzero((edge_face >= 0) & ~on_curve)
        self.bulge[e] = self._feet(edge_face[e], self.straight[e]) - self.straight[e]
        if inside:
            x = self.grids(q)[:, 1:-1, 1:-1]
            self.inside[q] = self._feet(self.mesh.quad_face[q], x) - x

    def _feet(self, face: Int, points: Float) -> Float:
        """Points (m, ..., 3) of faces (m,) next to `points`."""
        flat = points.reshape(-1, 3)
        return self.surfaces.feet(np.repeat(face, len(flat) // len(face)), flat).reshape(points.shape) if len(face) else points

    def grids(self, q: Int) -> Float:
        """Nodes (m, p + 1, p + 1, 3) of elements: edges, and Coons' rule with what is added to it inside."""
        p = self.order
        x = np.empty((len(q), p + 1, p + 1, 3))
        corner = self.points[self.mesh.quads[q]]
        x[:, 0, 0], x[:, -1, 0], x[:, -1, -1], x[:, 0, -1] = (corner[:, k] for k in range(4))
        side = self.straight[self.quad_edges[q]] + self.bulge[self.quad_edges[q]]
        x[:, 1:-1, 0], x[:, -1, 1:-1], x[:, 1:-1, -1], x[:, 0, 1:-1] = self.around(q, side)
        u = np.arange(1, p) / p
        u, v = u[:, None, None], u[None, :, None]
        between = (1 - v) * x[:, 1:-1, :1] + v * x[:, 1:-1, -1:] + (1 - u) * x[:, :1, 1:-1] + u * x[:, -1:, 1:-1]
        low = (1 - u) * corner[:, None, None, 0] + u * corner[:, None, None, 1]
        high = (1 - u) * corner[:, None, None, 3] + u * corner[:, None, None, 2]
        x[:, 1:-1, 1:-1] = between - (1 - v) * low - v * high + self.inside[q]
        return x

    def around(self, q: Int, side: Float | Int) -> list[Float | Int]:
        """Values (m, 4, p - 1, ...) on edges, from the lower node, as the four sides of grids: u, v, u, v."""
        quads, edges = self.mesh.quads[q], self.edges[self.quad_edges[q], 0]
        out = []
        for k, (start, run) in enumerate(((0, side[:, 0]), (1, side[:, 1]), (3, side[:, 2]), (0, side[:, 3]))):
            with_grid = (edges[:, k] == quads[:, start]).reshape(-1, *[1] * (run.ndim - 1))
            out.append(np.where(with_grid, run, run[:, ::-1]))
        return out

    def bent(self) -> Bool:
        """(e,) True where an edge bulges by more than rounding."""
        out: Bool = np.abs(self.bulge).max(axis=(1, 2)) > ROUNDING * self.length
        return out

    def mend(self) -> tuple[int, Bool]:
        """Take bulges back where elements are turned over; number of these, and the edges (e,) that became straighter."""
        q = np.flatnonzero(self.bent()[self.quad_edges].any(axis=1) | np.any(self.inside != 0, axis=(1, 2, 3)))
        straightened = np.zeros(len(self.edges), bool)
        count = 0
        for round_ in range(ROUNDS + len(q) + 1):  # from ROUNDS on, every round makes some element straight
            corners = self.points[self.mesh.quads[q]]
            normals = quad_normals(corners)
            least = corner_jacobian(corners, normals)
            open_ = q[least > 0]  # elements that are turned over while straight cannot be mended here
            normals, least = normals[least > 0], KEEP * least[least > 0]
            bad = open_[least_jacobian(self.grids(open_), normals, least) <= least]
            if not len(bad):
                break
            count += len(bad) if not round_ else 0
            share = 0.5 if round_ < ROUNDS else 0.0
            self.inside[bad] *= share
            e = np.unique(self.quad_edges[bad])
            e = e[self.bent()[e]]
            self.bulge[e] *= share
            straightened[e] = True
            changed = np.zeros(len(self.edges), bool)
            changed[self.quad_edges[bad]] = True
            q = q[changed[self.quad_edges[q]].any(axis=1)]
        return count, straightened
