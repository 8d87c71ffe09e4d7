"""How the new nodes of some edges and quads move: along their curves, in the tangent planes of their faces.

A node of a curve has one number, the step of its parameter over the way to the next node; one inside a face has two, over the
shortest edge of the quads around it.  Nodes inside quads follow those of their edges by Coons' rule, with an addition of their
own unless the elements have none there.  So displacements are linear in these numbers, but only `apply` says where nodes come
to be: at a parameter of their curve, or at the foot on their face.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..records import Float, Int
from .elements import Elements

__all__ = ["Moves"]

FARTHEST = 0.4  # greatest number: nodes of a curve keep their order


@dataclass(frozen=True)
class Moves:
    """Displacements of nodes as functions of numbers.

    Attributes
    ----------
    work : Elements
    edges : (k,) int64
        Those that move.
    quads : (m,) int64
        All that have one of them.
    rows : (m, (p + 1)^2) int64
        Row of every node of the quads among the nodes that move; 0 for one that stays.
    coons : ((p + 1)^2, (p + 1)^2) float64
        From the displacements of nodes around, and the additions inside, to all displacements.
    basis : (r, 2, 3) float64
        Displacements by the two numbers of every node; zero where a number means nothing.
    """

    work: Elements
    edges: Int
    quads: Int
    rows: Int
    coons: Float
    basis: Float

    @classmethod
    def of(cls, work: Elements, edges: Int, quads: Int) -> Moves:
        """From where the nodes are now."""
        n, inner = work.order + 1, work.order - 1
        of_edges = 1 + np.arange(len(edges) * inner).reshape(-1, inner)
        of_quads = 1 + of_edges.size + np.arange(len(quads) * inner**2 * work.inner).reshape(-1, inner, inner)
        everywhere = np.zeros((len(work.edges), inner), np.int64)
        everywhere[edges] = of_edges
        grid = np.zeros((len(quads), n, n), np.int64)
        sides = work.around(quads, everywhere[work.quad_edges[quads]])
        grid[:, 1:-1, 0], grid[:, -1, 1:-1], grid[:, 1:-1, -1], grid[:, 0, 1:-1] = sides
        if work.inner:
            grid[:, 1:-1, 1:-1] = of_quads
        rows = grid.reshape(-1, n * n)
        short = np.full(1 + of_edges.size + of_quads.size, np.inf)
        np.minimum.at(short, rows, work.length[work.quad_edges[quads]].min(axis=1)[:, None])
        basis = np.zeros((len(short), 2, 3))
        on = work.curve[edges] >= 0
        basis[of_edges[on], 0] = work.tangents(edges[on])
        free = edges[~on]
        x = [(work.straight[free] + work.bulge[free]).reshape(-1, 3)]
        face, node = [np.repeat(work.edge_face[free], inner)], [of_edges[~on].ravel()]
        if work.inner:
            x.append(work.grids(quads)[:, 1:-1, 1:-1].reshape(-1, 3))
            face.append(np.repeat(work.mesh.quad_face[quads], inner**2))
            node.append(of_quads.ravel())
        at = np.concatenate(node)
        if len(at):
            normal = work.surfaces.normals(np.concatenate(face), np.concatenate(x))
            first = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal), axis=1)])
            first /= np.linalg.norm(first, axis=1, keepdims=True)
            basis[at] = np.stack([first, np.cross(normal, first)], axis=1) * short[at, None, None]
        return cls(work, edges, quads, rows, _coons(work.order), basis)

    @property
    def size(self) -> int:
        """How many numbers there are."""
        return 2 * len(self.basis)

    @property
    def bounds(self) -> list[tuple[float, float]]:
        """The least and the greatest value of every number."""
        return [(-FARTHEST, FARTHEST)] * self.size

    def displacements(self, numbers: Float) -> Float:
        """Displacements (m, (p + 1)^2, 3) of the nodes of the quads."""
        own = np.einsum("rk,rkc->rc", numbers.reshape(-1, 2), self.basis)
        return np.einsum("kl,mlc->mkc", self.coons, own[self.rows])

    def gradient(self, by_nodes: Float) -> Float:
        """Derivatives by the numbers from those by `displacements`."""
        own = np.einsum("kl,mkc->mlc", self.coons, by_nodes)
        total = [np.bincount(self.rows.ravel(), own[..., c].ravel(), len(self.basis)) for c in range(3)]
        return np.einsum("cr,rkc->rk", np.array(total), self.basis).ravel()

    def apply(self, numbers: Float) -> None:
        """Move the nodes, and put them on curves and faces."""
        work, inner = self.work, self.work.order - 1
        numbers = numbers.reshape(-1, 2)
        own = np.einsum("rk,rkc->rc", numbers, self.basis)
        last = 1 + len(self.edges) * inner
        on = work.curve[self.edges] >= 0
        work.slide(self.edges[on], numbers[1:last, 0].reshape(-1, inner)[on])
        free = self.edges[~on]
        work.bulge[free] += own[1:last].reshape(-1, inner, 3)[~on]
        work.put_edges(free)
        if work.inner:
            work.inside[self.quads] += own[last:].reshape(-1, inner, inner, 3)
            work.put_inside(self.quads)


def _coons(p: int) -> Float:
    """Matrix from nodes around, and what is added inside, to all nodes."""
    n = p + 1
    out = np.eye(n * n)
    row = np.arange(n * n).reshape(n, n)
    for i in range(1, p):
        for j in range(1, p):
            u, v = i / p, j / p
            to = out[row[i, j]]
            for at, share in ((row[i, 0], 1 - v), (row[i, p], v), (row[0, j], 1 - u), (row[p, j], u)):
                to[at] += share
            to[[row[0, 0], row[p, 0], row[p, p], row[0, p]]] -= np.array([(1 - u) * (1 - v), u * (1 - v), u * v, (1 - u) * v])
    return out
