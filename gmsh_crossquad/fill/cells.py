"""The guide quads as structured grids: positions inside, quality and fine quads.

Cells of equal size are worked on together, up to `CHUNK` nodes.  Those of plane faces are filled in the plane; those of curved
faces in space: all their inner nodes are put on their surfaces at once, and the fine quads are judged against their own normals
on the side of the surface's.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from ..records import Bool, Float, Guide, Int
from ..surfaces import Surfaces
from .coons import coons, grid_quads, grid_quality, surface_quality
from .cusp_grid import cusp_grid
from .numbering import GuideTopology, Numbering, edge_nodes
from .skeleton import Frames, Skeleton

__all__ = ["Cells"]

CHUNK = 1 << 16  # grid nodes at a time: fewer calls matter more than the innermost cache
LONG = 64  # rows from which a slice is faster than an index array
SAMPLES = 8  # normals of the surface per cell and direction: a guide cell turns by less than a right angle

# corner where each side starts and ends when it runs with u or v
SIDES = ((0, 1), (1, 2), (3, 2), (0, 3))


@dataclass(frozen=True)
class Cells:
    """All cells of a guide grid; `cusps` (q, 4) are their corners in cusps."""

    guide: Guide
    topology: GuideTopology
    numbering: Numbering
    skeleton: Skeleton
    frames: Frames
    surfaces: Surfaces
    cusps: Bool

    @property
    def divisions(self) -> Int:
        """(q, 2) pieces along u (sides 0 and 2) and v (sides 1 and 3)."""
        return self.numbering.divisions[self.topology.quad_edges[:, :2]]

    def reverse(self, q: Int, side: int) -> Bool:
        """(m,) True where the edge of `side` runs against u or v."""
        start = self.guide.quads[q, SIDES[side][0]]
        out: Bool = self.topology.edges[self.topology.quad_edges[q, side], 0] != start
        return out

    def groups(self, which: Int) -> Iterator[tuple[Int, int, int]]:
        """Pieces of `which` with equal divisions: (cells, ku, kv)."""
        k = self.divisions[which]
        kinds, kind = np.unique(k[:, 0] * (k.max(initial=0) + 1) + k[:, 1], return_inverse=True)
        order = np.argsort(kind, kind="stable")
        bounds = np.searchsorted(kind[order], np.arange(len(kinds) + 1))
        for i in range(len(kinds)):
            cells = which[order[bounds[i] : bounds[i + 1]]]
            ku, kv = self.divisions[cells[0]].tolist()
            m = max(1, CHUNK // ((ku + 1) * (kv + 1)))
            for first in range(0, len(cells), m):
                yield cells[first : first + m], ku, kv

    def corner_quality(self) -> Float:
        """(q,) least scaled Jacobian of the guide quads themselves."""
        corners, face = self.skeleton.vertices[self.guide.quads], self.guide.quad_face
        plane, curved = self._kinds(np.arange(len(face)))
        out = np.empty(len(face))
        x = self.frames.local(corners[plane], face[plane])
        out[plane] = grid_quality(x[:, :, [0, 3, 1, 2]].reshape(2, -1, 2, 2), self._cusps(plane))
        if len(curved):
            x = np.moveaxis(corners[curved][:, [0, 3, 1, 2]], -1, 0).reshape(3, -1, 2, 2)
            out[curved] = surface_quality(x, self._normals([(curved, x)])[0], self._cusps(curved))
        return out

    def place(self, which: Int, points: Float) -> Float:
        """Fill the cells `which`, write their inner nodes to `points` and return their least scaled Jacobian (m,)."""
        plane, curved = self._kinds(which)
        worst = np.empty(len(self.guide.quads))
        self._place_plane(plane, points, worst)
        if len(curved):
            self._place_curved(curved, points, worst)
        return worst[which]

    def _cusps(self, which: Int) -> Bool | None:
        """Corners of the cells `which` in cusps, None if there are none."""
        cusps: Bool = self.cusps[which]
        return cusps if cusps.any() else None

    def _kinds(self, which: Int) -> tuple[Int, Int]:
        """The cells of plane and of curved faces among `which`."""
        curved = self.frames.curved[self.guide.quad_face[which]]
        return which[~curved], which[curved]

    def _place_plane(self, which: Int, points: Float, worst: Float) -> None:
        """`place` for cells of plane faces; their quality goes to `worst` (q,)."""
        for q, ku, kv in self.groups(which):
            face = self.guide.quad_face[q]
            grid = self._grid(q, *(self.frames.local(self._side(q, s, (ku, kv)[s % 2]), face) for s in range(4)))
            worst[q] = grid_quality(grid, self._cusps(q))
            if ku > 1 and kv > 1:
                inside = grid[:, :, 1:-1, 1:-1].reshape(2, len(q), -1)
                _put(points, self.numbering.cell_first[q], self.frames.user(inside, face))

    def _place_curved(self, which: Int, points: Float, worst: Float) -> None:
        """`place` for cells of curved faces; their quality goes to `worst` (q,)."""
        parts = [
            (q, self._grid(q, *(np.moveaxis(self._side(q, s, (ku, kv)[s % 2]), -1, 0) for s in range(4))))
            for q, ku, kv in self.groups(which)
        ]
        inside = [grid[:, :, 1:-1, 1:-1] for _, grid in parts]
        for (q, _), part, feet in zip(parts, inside, self._at_once(self.surfaces.feet, parts, inside)):
            part[:] = feet
            rows = np.moveaxis(feet, 0, -1).reshape(len(q), feet.shape[2] * feet.shape[3], 3)
            if rows.shape[1]:
                _put(points, self.numbering.cell_first[q], self.frames.user_of_scaled(rows))
        for (q, grid), normals in zip(parts, self._normals(parts)):
            worst[q] = surface_quality(grid, normals, self._cusps(q))

    def _grid(self, q: Int, bottom: Float, right: Float, top: Float, left: Float) -> Float:
        """Grids (d, m, ku + 1, kv + 1) of the cells `q` between their sides: by Coons' rule, those in cusps by their own."""
        out = coons(bottom, right, top, left)
        if max(out.shape[2:]) > 2:
            for row, corner in np.argwhere(self.cusps[q]).tolist():
                # seen from the cusp: against u at corners 1 and 2, against v at 2 and 3
                u, v = (-1 if corner in (1, 2) else 1), (-1 if corner in (2, 3) else 1)
                across = (bottom, top)[::v], (left, right)[::u]
                near, far, side, other = (x[:, row, ::way] for pair, way in zip(across, (u, v)) for x in pair)
                out[:, row, ::u, ::v] = cusp_grid(near, other, far, side)
        return out

    def _normals(self, parts: list[tuple[Int, Float]]) -> list[Float]:
        """Surface normals (3, m, ku, kv) at the quads of grids, from up to `SAMPLES` quads per direction."""
        middles, rows = [], []
        for _, grid in parts:
            some = [(np.arange(s) * 2 + 1) * k // (2 * s) for k in np.array(grid.shape[2:]) - 1 for s in [min(k, SAMPLES)]]
            i, j = some[0][:, None], some[1]
            middles.append(0.25 * (grid[:, :, i, j] + grid[:, :, i + 1, j] + grid[:, :, i + 1, j + 1] + grid[:, :, i, j + 1]))
            rows.append([np.arange(k - 1) * len(x) // (k - 1) for k, x in zip(grid.shape[2:], some)])
        normals = self._at_once(self.surfaces.normals, parts, middles)
        return [n if n.shape[2:] == (len(u), len(v)) else n[:, :, u[:, None], v] for n, (u, v) in zip(normals, rows)]

    def _at_once(self, what: Callable[[Int, Float], Float], parts: list[tuple[Int, Float]], grids: list[Float]) -> list[Float]:
        """A function of `Surfaces` for the points of all `grids` (3, m, i, j), in one call."""
        face = [np.repeat(self.guide.quad_face[q], g.shape[2] * g.shape[3]) for (q, _), g in zip(parts, grids)]
        points = np.concatenate([g.reshape(3, -1) for g in grids], axis=1).T
        found = what(np.concatenate(face), np.ascontiguousarray(points)).T if len(points) else points.T
        ends = np.cumsum([len(f) for f in face])[:-1]
        return [part.reshape(g.shape) for part, g in zip(np.split(found, ends, axis=1), grids)]

    def _side(self, q: Int, side: int, count: int) -> Float:
        """Positions (m, count + 1, 3) of a side, with u or v."""
        a, b = SIDES[side]
        corners = self.guide.quads[q]
        out = np.empty((len(q), count + 1, 3))
        out[:, 0] = self.skeleton.vertices[corners[:, a]]
        out[:, -1] = self.skeleton.vertices[corners[:, b]]
        if count > 1:
            e = self.topology.quad_edges[q, side]
            out[:, 1:-1] = self.skeleton.inside[self.skeleton.rows(e, self.reverse(q, side), count)]
        return out

    def quads(self) -> Int:
        """(n_quads, 4) fine quads of all cells."""
        out = np.empty((self.numbering.n_quads, 4), np.int64)
        for q, ku, kv in self.groups(self.numbering.cell_order):
            _put(out, self.numbering.quad_first[q], grid_quads(self.nodes(q, ku, kv)))
        return out

    def nodes(self, q: Int, ku: int, kv: int) -> Int:
        """Nodes (m, ku + 1, kv + 1) of cells with equal divisions."""
        g = np.empty((len(q), ku + 1, kv + 1), np.int64)
        corner = self.numbering.vertex_id[self.guide.quads[q]]
        g[:, 0, 0], g[:, -1, 0], g[:, -1, -1], g[:, 0, -1] = corner.T
        e = self.topology.quad_edges[q]
        if ku > 1:
            g[:, 1:-1, 0] = edge_nodes(self.numbering, e[:, 0], self.reverse(q, 0), ku)
            g[:, 1:-1, -1] = edge_nodes(self.numbering, e[:, 2], self.reverse(q, 2), ku)
        if kv > 1:
            g[:, -1, 1:-1] = edge_nodes(self.numbering, e[:, 1], self.reverse(q, 1), kv)
            g[:, 0, 1:-1] = edge_nodes(self.numbering, e[:, 3], self.reverse(q, 3), kv)
        if ku > 1 and kv > 1:
            inside = self.numbering.cell_first[q][:, None] + np.arange((ku - 1) * (kv - 1))
            g[:, 1:-1, 1:-1] = inside.reshape(len(q), ku - 1, kv - 1)
        return g


def _put(target: Float | Int, first: Int, rows: Float | Int) -> None:
    """Write blocks of rows (m, k, d) to `target` at the rows that start at `first` (m,)."""
    k = rows.shape[1]
    if k >= LONG:
        for start, block in zip(first.tolist(), rows):
            target[start : start + k] = block
    else:
        target[first[:, None] + np.arange(k)] = rows
