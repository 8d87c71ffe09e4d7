"""Topology and intrinsic geometry of a triangulated, oriented surface with boundary.

Half-edge ``k`` of triangle ``t`` runs from ``triangles[t, k]`` to ``triangles[t, k + 1]``; the surface is on its left.  An edge
runs from its lower to its higher vertex.  Everything is intrinsic (lengths and angles), so that planar and curved
surfaces are one case.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..records import Bool, FaceMesh, Float, Int

__all__ = ["SurfaceMesh", "surface_of"]


@dataclass(frozen=True)
class SurfaceMesh:
    """A triangle mesh and its lazily derived topology.

    Parameters
    ----------
    points : (n, 2) or (n, 3) float64
    triangles : (m, 3) int64
        Consistently oriented, manifold; every point is used.
    """

    points: Float
    triangles: Int

    @cached_property
    def half_edges(self) -> Int:
        """(3 m, 2) start and end of every half-edge, row ``3 t + k``."""
        t = self.triangles
        return np.stack([t, np.roll(t, -1, axis=1)], axis=2).reshape(-1, 2)

    @cached_property
    def _edges(self) -> tuple[Int, Int]:
        lo, hi = self.half_edges.min(axis=1), self.half_edges.max(axis=1)
        key, inverse = np.unique(lo * len(self.points) + hi, return_inverse=True)
        return np.stack([key // len(self.points), key % len(self.points)], axis=1), inverse.reshape(-1, 3)

    @cached_property
    def edges(self) -> Int:
        """(e, 2) vertices of every edge, lower first."""
        return self._edges[0]

    @cached_property
    def triangle_edges(self) -> Int:
        """(m, 3) edge of half-edge k of every triangle."""
        return self._edges[1]

    @cached_property
    def edge_sign(self) -> Int:
        """(m, 3) +1 where half-edge k runs like its edge, else -1."""
        return np.where(self.half_edges[:, 0] < self.half_edges[:, 1], 1, -1).reshape(-1, 3)

    @cached_property
    def edge_half_edges(self) -> Int:
        """(e, 2) the half-edges (``3 t + k``) of every edge; the second is -1 on the boundary."""
        flat = self.triangle_edges.ravel()
        order = np.argsort(flat, kind="stable")
        first = np.searchsorted(flat[order], np.arange(len(self.edges)))
        count = np.bincount(flat, minlength=len(self.edges))
        out = np.full((len(self.edges), 2), -1, np.int64)
        out[:, 0] = order[first]
        two = count == 2
        out[two, 1] = order[first[two] + 1]
        return out

    @cached_property
    def twin(self) -> Int:
        """(3 m,) opposite half-edge, -1 on the boundary."""
        out = np.full(3 * len(self.triangles), -1, np.int64)
        a, b = self.edge_half_edges.T
        inner = b >= 0
        out[a[inner]] = b[inner]
        out[b[inner]] = a[inner]
        return out

    @cached_property
    def boundary_edge(self) -> Bool:
        """(e,) True on the boundary."""
        return self.edge_half_edges[:, 1] < 0

    @cached_property
    def boundary_vertex(self) -> Bool:
        """(n,) True on the boundary."""
        out = np.zeros(len(self.points), bool)
        out[self.edges[self.boundary_edge].ravel()] = True
        return out

    @cached_property
    def edge_length(self) -> Float:
        """(e,) lengths."""
        return np.linalg.norm(self.points[self.edges[:, 1]] - self.points[self.edges[:, 0]], axis=1)

    @cached_property
    def corner_angle(self) -> Float:
        """(m, 3) angle of every triangle at its vertex k."""
        length = self.edge_length[self.triangle_edges]
        a, b, c = length, np.roll(length, 1, axis=1), np.roll(length, -1, axis=1)
        # half-angle form: accurate for needles, where the law of cosines cancels
        s = 0.5 * (a + b + c)
        top = np.maximum((s - a) * (s - b), 0.0)
        bottom = np.maximum(s * (s - c), 0.0)
        return 2.0 * np.arctan2(np.sqrt(top), np.sqrt(bottom))

    @cached_property
    def area(self) -> Float:
        """(m,) triangle areas."""
        length = self.edge_length[self.triangle_edges]
        return 0.5 * length[:, 0] * length[:, 2] * np.sin(self.corner_angle[:, 0])

    @cached_property
    def layout(self) -> Float:
        """(m, 3, 2) every triangle laid into the plane: vertex 0 at the origin, half-edge 0 along x."""
        length = self.edge_length[self.triangle_edges]
        out = np.zeros((len(self.triangles), 3, 2))
        out[:, 1, 0] = length[:, 0]
        out[:, 2, 0] = length[:, 2] * np.cos(self.corner_angle[:, 0])
        out[:, 2, 1] = length[:, 2] * np.sin(self.corner_angle[:, 0])
        return out

    @cached_property
    def triangle_normal(self) -> Float | None:
        """(m, 3) unit normals of the triangles; None in the plane."""
        if self.points.shape[1] == 2:
            return None
        p = self.points[self.triangles]
        normal = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
        return normal / np.linalg.norm(normal, axis=1)[:, None]

    @cached_property
    def vertex_normal(self) -> Float | None:
        """(n, 3) unit means of the triangles' normals, weighted by their angles; None in the plane."""
        if self.triangle_normal is None:
            return None
        weighted = self.corner_angle.ravel()[:, None] * np.repeat(self.triangle_normal, 3, axis=0)
        sums = [np.bincount(self.triangles.ravel(), w, len(self.points)) for w in weighted.T]
        normal = np.stack(sums, axis=1)
        return normal / np.linalg.norm(normal, axis=1)[:, None]

    @cached_property
    def edge_normal(self) -> Float | None:
        """(e, 3) unit normals half-way between those of the triangles at every edge; None in the plane."""
        if self.triangle_normal is None:
            return None
        first, second = self.edge_half_edges.T // 3
        normal = self.triangle_normal[first] + np.where(second < 0, 0.0, 1.0)[:, None] * self.triangle_normal[second]
        return normal / np.linalg.norm(normal, axis=1)[:, None]

    @cached_property
    def half_edge_direction(self) -> Float:
        """(m, 3) angle of every half-edge in its triangle's layout."""
        a = self.corner_angle
        out = np.zeros_like(a)
        out[:, 1] = np.pi - a[:, 1]
        out[:, 2] = np.pi + a[:, 0]
        return np.where(out > np.pi, out - 2 * np.pi, out)

    @cached_property
    def edge_direction(self) -> Float:
        """(m, 3) angle of the *edge* of half-edge k in the triangle's layout."""
        return self.half_edge_direction + np.where(self.edge_sign < 0, np.pi, 0.0)

    @cached_property
    def angle_sum(self) -> Float:
        """(n,) sum of the triangle angles at every vertex."""
        return np.bincount(self.triangles.ravel(), self.corner_angle.ravel(), len(self.points)).astype(np.float64)

    @cached_property
    def curvature(self) -> Float:
        """(n,) 2 pi minus the angle sum at interior vertices, pi minus it at boundary vertices."""
        return np.where(self.boundary_vertex, np.pi, 2 * np.pi) - self.angle_sum

    @cached_property
    def loops(self) -> tuple[Int, ...]:
        """Boundary loops as vertex arrays, the surface on the left; by decreasing enclosed area (in the plane) or length."""
        h = self.edge_half_edges[self.boundary_edge, 0]
        start, end = self.half_edges[h].T
        following = dict(zip(start.tolist(), end.tolist(), strict=True))
        loops, seen = [], set()
        for first in sorted(following):
            loop, v = [], first
            while v not in seen:
                seen.add(v)
                loop.append(v)
                v = following[v]
            if loop:
                loops.append(np.array(loop))

        def extent(loop: Int) -> float:
            p = self.points[loop]
            q = np.roll(p, -1, axis=0)
            if p.shape[1] == 2:
                return 0.5 * float(np.sum(p[:, 0] * q[:, 1] - q[:, 0] * p[:, 1]))
            return float(np.linalg.norm(q - p, axis=1).sum())

        return tuple(sorted(loops, key=extent, reverse=True))

    @cached_property
    def outgoing_boundary(self) -> Int:
        """(n,) boundary half-edge (``3 t + k``) that starts at every boundary vertex, -1 elsewhere."""
        out = np.full(len(self.points), -1, np.int64)
        h = self.edge_half_edges[self.boundary_edge, 0]
        out[self.half_edges[h, 0]] = h
        return out

    @cached_property
    def some_half_edge(self) -> Int:
        """(n,) a half-edge that starts at every vertex; on the boundary the outgoing boundary half-edge."""
        out = np.full(len(self.points), -1, np.int64)
        out[self.half_edges[:, 0]] = np.arange(len(self.half_edges))
        boundary = self.outgoing_boundary >= 0
        out[boundary] = self.outgoing_boundary[boundary]
        return out

    def star(self, vertex: int) -> list[int]:
        """Half-edges (``3 t + k``) that start at `vertex`, counter-clockwise, one per triangle around it."""
        first = h = int(self.some_half_edge[vertex])
        out: list[int] = []
        while True:
            out.append(h)
            t, k = divmod(h, 3)
            h = int(self.twin[3 * t + (k + 2) % 3])
            if h < 0 or h == first:
                return out

    def neighbours(self, vertex: int) -> list[int]:
        """Vertices around `vertex`, counter-clockwise, from its `some_half_edge` on."""
        star = self.star(vertex)
        out = [int(self.triangles[h // 3, (h % 3 + 1) % 3]) for h in star]
        if self.boundary_vertex[vertex]:
            out.append(int(self.triangles[star[-1] // 3, (star[-1] % 3 + 2) % 3]))
        return out

    def half_edge_between(self, start: int, end: int) -> int:
        """The half-edge from `start` to `end`, -1 if no triangle has it."""
        for h in self.star(start):
            if self.triangles[h // 3, (h % 3 + 1) % 3] == end:
                return h
        return -1

    @cached_property
    def components(self) -> Int:
        """(n,) connected component of every vertex, numbered by lowest vertex."""
        from scipy.sparse import coo_matrix
        from scipy.sparse.csgraph import connected_components

        n = len(self.points)
        graph = coo_matrix((np.ones(len(self.edges)), (self.edges[:, 0], self.edges[:, 1])), (n, n))
        label = connected_components(graph, directed=False)[1]
        first = np.unique(label, return_index=True)[1]
        return np.argsort(np.argsort(first))[label].astype(np.int64)

    @cached_property
    def component_euler(self) -> Int:
        """(c,) Euler characteristic of every component."""
        label = self.components
        count = int(label.max()) + 1
        vertices = np.bincount(label, minlength=count)
        edges = np.bincount(label[self.edges[:, 0]], minlength=count)
        return vertices - edges + np.bincount(label[self.triangles[:, 0]], minlength=count)

    @cached_property
    def component_closed(self) -> Bool:
        """(c,) True for components without boundary."""
        label = self.components
        return np.bincount(label[self.edges[:, 0]], self.boundary_edge, int(label.max()) + 1) == 0

    @cached_property
    def euler(self) -> int:
        """Euler characteristic."""
        return len(self.points) - len(self.edges) + len(self.triangles)


def surface_of(mesh: FaceMesh) -> SurfaceMesh:
    """The surface of a background mesh: made once, kept with the record, so that every stage uses the same topology."""
    known: SurfaceMesh | None = vars(mesh).get("_surface")
    if known is None:
        known = SurfaceMesh(mesh.points, mesh.triangles)
        vars(mesh)["_surface"] = known  # as `cached_property` does in a frozen record
    return known
