"""Elements of order p between straight ones and the model: where the new nodes are.

Edges are stored once, their new nodes by how far these are from the straight edge, and those inside quads by how far they are
from Coons' rule between the edges.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ..records import Bool, Float, Int, Model, QuadMesh
from ..surfaces import Surfaces

__all__ = ["Elements"]

STEP = 1e-3  # of the way to the next node, in difference quotients
ROUNDING = 1e-12  # bulges over lengths of edges that are none


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
    inner : bool
        False where that is nothing, for elements without nodes inside.
    edge_face, curve : (e,) int64
        A face that every edge is on, and the row of its curve, or -1.
    ends : (e, 2), t : (e, p - 1) float64
        Parameters on the curve, from the lower node.
    exact : (e, p - 1, 3) float64
        Nodes on curves in the user's coordinates; NaN elsewhere.
    evaluate : callable (curve row, parameters (m,)) -> (m, 3)
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
    inner: bool
    edge_face: Int
    curve: Int
    ends: Float
    t: Float
    exact: Float
    evaluate: Callable[[int, Float], Float]

    @classmethod
    def start(
        cls,
        model: Model,
        surfaces: Surfaces,
        mesh: QuadMesh,
        order: int,
        edges: Int,
        quad_edges: Int,
        evaluate: Callable[[int, Float], Float],
        *,
        inner: bool = True,
    ) -> Elements:
        """Straight elements."""
        x = (mesh.points - model.origin) / model.scale
        u = (np.arange(1, order) / order)[None, :, None]
        straight = x[edges[:, :1]] * (1 - u) + x[edges[:, 1:]] * u
        inside = np.zeros((len(mesh.quads), order - 1, order - 1, 3))
        length = np.linalg.norm(x[edges[:, 1]] - x[edges[:, 0]], axis=1)
        edge_face = np.full(len(edges), -1)
        edge_face[quad_edges] = mesh.quad_face[:, None]
        none = np.full(straight.shape, np.nan)
        curve, ends, t = np.full(len(edges), -1), np.full((len(edges), 2), np.nan), none[..., 0].copy()
        bulge = np.zeros_like(straight)
        shape = model, surfaces, mesh, order, x, edges, quad_edges, length, straight, bulge, inside
        return cls(*shape, inner, edge_face, curve, ends, t, none, evaluate)

    def copy(self) -> Elements:
        """Elements of which nothing changes when these are filled."""
        return replace(self, **{name: getattr(self, name).copy() for name in ("bulge", "inside", "t", "exact")})

    def set_between(self, before: Elements, after: Elements, e: Int, edge_share: Float, q: Int, quad_share: Float) -> None:
        """Put the nodes of edges and quads at a share (k,), (m,) of the way between two states, on their curves and faces."""
        for name, rows, share in (("bulge", e, edge_share), ("t", e, edge_share), ("inside", q, quad_share)):
            low, high = getattr(before, name)[rows], getattr(after, name)[rows]
            w = share.reshape(-1, *[1] * (low.ndim - 1))
            getattr(self, name)[rows] = np.where(w == 1.0, high, low + w * (high - low))
        on = self.curve[e] >= 0
        for row in np.unique(self.curve[e[on]]).tolist():
            self._evaluate(row, e[self.curve[e] == row])
        between_e, between_q = (edge_share > 0) & (edge_share < 1), (quad_share > 0) & (quad_share < 1)
        self.put_edges(e[~on & between_e])
        self.put_inside(q[between_q])

    def put_on_curve(self, row: int, e: Int, forward: Bool, ends: Float, t: Float) -> None:
        """Put the nodes of the edges `e` on a curve, whose nodes have the parameters `ends` (k + 1,), at `t` (k, p - 1)."""
        self.curve[e] = row
        both = np.stack([ends[:-1], ends[1:]], axis=1)
        self.ends[e] = np.where(forward[:, None], both, both[:, ::-1])
        self.t[e] = np.where(forward[:, None], t, t[:, ::-1])
        self._evaluate(row, e)

    def _evaluate(self, row: int, e: Int) -> None:
        self.exact[e] = self.evaluate(row, self.t[e].ravel()).reshape(-1, *self.exact.shape[1:])
        self.bulge[e] = (self.exact[e] - self.model.origin) / self.model.scale - self.straight[e]

    def put_on_faces(self) -> None:
        """Put the nodes of edges inside curved faces on these, and those inside quads."""
        self.put_edges(np.flatnonzero(self.curve < 0))
        self.put_inside(np.arange(len(self.mesh.quads)))

    def put_edges(self, e: Int) -> None:
        """Put the nodes of edges, which are on no curve, on their faces where these are curved."""
        e = e[self.surfaces.curved[self.edge_face[e]]]
        self.bulge[e] = self._feet(self.edge_face[e], self.straight[e] + self.bulge[e]) - self.straight[e]

    def put_inside(self, q: Int) -> None:
        """Put the nodes inside quads on their faces where these are curved."""
        q = q[self.surfaces.curved[self.mesh.quad_face[q]]]
        if self.inner and len(q):
            x = self.grids(q)[:, 1:-1, 1:-1]
            self.inside[q] += self._feet(self.mesh.quad_face[q], x) - x

    def slide(self, e: Int, share: Float) -> None:
        """Slide the nodes of edges on curves by a share (k, p - 1) of the way to the next node, along the edge."""
        self.t[e] += share * self._gaps(e)
        for row in np.unique(self.curve[e]).tolist():
            self._evaluate(row, e[self.curve[e] == row])

    def tangents(self, e: Int) -> Float:
        """Derivatives (k, p - 1, 3) of nodes of edges on curves by the share of `slide`, scaled."""
        out = np.empty((len(e), *self.exact.shape[1:]))
        t, step = self.t[e], STEP * self._gaps(e)
        for row in np.unique(self.curve[e]).tolist():
            own = self.curve[e] == row
            low, high = (self.evaluate(row, (t + s)[own].ravel()) for s in (-step, step))
            out[own] = ((high - low) / (2 * STEP * self.model.scale)).reshape(-1, *out.shape[1:])
        return out

    def _gaps(self, e: Int) -> Float:
        """Parameters (k, p - 1) from nodes on curves to the nearer of both neighbours, signed as along the edge."""
        steps = np.diff(np.concatenate([self.ends[e, :1], self.t[e], self.ends[e, 1:]], axis=1), axis=1)
        out: Float = np.sign(steps[:, 1:]) * np.minimum(np.abs(steps[:, 1:]), np.abs(steps[:, :-1]))
        return out

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

    def nodes(self, q: Int) -> Float:
        """`grids` as (m, (p + 1)^2, 3)."""
        return self.grids(q).reshape(len(q), -1, 3)

    def middles(self, q: Int) -> Float:
        """Jacobians (m,) in the middle of the straight quads."""
        a, b, c, d = np.moveaxis(self.points[self.mesh.quads[q]], 1, 0)
        out: Float = 0.5 * np.linalg.norm(np.cross(c - a, d - b), axis=1)
        return out

    def users(self, edges: Int) -> Int:
        """Rows of the quads that have one of `edges`."""
        wanted = np.zeros(len(self.edges), bool)
        wanted[edges] = True
        return np.flatnonzero(wanted[self.quad_edges].any(axis=1))

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

    def curved_quads(self) -> Bool:
        """(q,) True where a quad is not straight."""
        out: Bool = self.bent()[self.quad_edges].any(axis=1) | np.any(self.inside != 0, axis=(1, 2, 3))
        return out
