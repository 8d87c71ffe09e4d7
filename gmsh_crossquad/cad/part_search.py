"""Which of its parts a point of a face that is made of several is nearest to.

The nearest background triangle, of those around the nearest points, tells, except close to a joint: its edges are chords of the
CAD curve.  There the curve itself decides.  Let c be its point nearest to x, and d1, d2 the directions from c into the two
faces, across the curve.  Where (x - c) . d is positive for one of them only, that one is nearest; for both (a groove), the one of
the triangle; for none (a ridge), the nearest point is c.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import gmsh
import numpy as np

from ..records import Bool, Float, Int, Parts
from .charts import runs
from .facets import closest
from .session import gmsh_errors

__all__ = ["PartSearch"]

RINGS = 2  # of points around a joint at which the nearest point alone does not tell
CLOSE = 3.0  # times the height of the arcs over their chords
NEAREST = 4  # edges that are tried
AROUND = 4  # nearest points whose triangles are tried; those on joints are there twice
ROUNDS = 8
PRECISION = 1e-9  # of an edge


class _Edges(NamedTuple):
    """Edges on joints, for each of their two parts once."""

    ends: Float
    curve: Int
    at: Float  # parameters of the ends
    height: Float  # of the arc over its chord
    part: Int
    other: Int
    run: Int  # 1 where the triangle of the part runs with the curve, -1 where against it
    beside: Int  # the same of the other part


@dataclass(frozen=True)
class PartSearch:
    """The parts of one face.

    Parameters
    ----------
    parts : Parts
    origin : (3,) float64; scale : float
        Of the scaled coordinates.
    normals : callable (part (n,), points (n, 3)) -> (n, 3)
        Unit normals on the side of each part's own triangles.
    """

    parts: Parts
    origin: Float
    scale: float
    normals: Callable[[Int, Float], Float]

    def find(self, points: Float) -> tuple[Int, Bool, Float]:
        """Nearest parts of points.

        Parameters
        ----------
        points : (n, 3) float64, scaled

        Returns
        -------
        part : (n,) int64
        on_joint : (n,) bool
            Whether the nearest point is on a joint.
        place : (n, 3) float64
            That point, scaled; only where `on_joint`.
        """
        part, unsure, foot = self.about(points)
        on_joint, place = np.zeros(len(points), bool), np.zeros_like(points)
        if len(unsure):
            away = np.linalg.norm(foot - points[unsure], axis=1)
            edge, distance = self._nearest_edge(foot, part[unsure])
            close = distance < CLOSE * (away + self._edges.height[edge]) + 1e-12
            self._decide(points, unsure[close], edge[close], part, on_joint, place)
        return part, on_joint, place

    def about(self, points: Float) -> tuple[Int, Int, Float]:
        """Parts (n,) of the nearest triangles, the rows (k,) of the points near joints and their feet (k, 3) on the triangles."""
        tree, owner, doubtful = self._points
        near = np.asarray(tree.query(points)[1], np.int64).reshape(-1)
        part = owner[near]
        unsure = np.flatnonzero(doubtful[near])
        corners, triangle_part, start, around = self._triangles
        x = points[unsure]
        beside = np.asarray(tree.query(x, k=AROUND)[1], np.int64).reshape(-1)
        count = start[beside + 1] - start[beside]
        first = np.cumsum(count) - count
        tried = around[np.arange(count.sum()) + np.repeat(start[beside] - first, count)]
        row = np.repeat(np.repeat(np.arange(len(x)), AROUND), count)
        feet = np.einsum("nk,nkc->nc", closest(x[row], corners[tried]), corners[tried])
        order = np.lexsort((np.linalg.norm(feet - x[row], axis=1), row))
        best = order[np.searchsorted(row[order], np.arange(len(x)))]
        part[unsure] = triangle_part[tried[best]]
        return part, unsure, feet[best]

    @cached_property
    def _points(self) -> tuple[Any, Int, Bool]:
        """Tree of the points, their parts, and whether they are close to a joint."""
        from ..spatial import cKDTree

        near = []
        for points, triangles, edges in zip(self.parts.points, self.parts.triangles, self.parts.edges, strict=True):
            own = np.zeros(len(points), bool)
            own[edges] = True
            for _ in range(RINGS):
                own[triangles[own[triangles].any(axis=1)]] = True
            near.append(own)
        owner = np.repeat(np.arange(len(near)), [len(n) for n in near])
        return cKDTree(np.concatenate(self.parts.points)), owner, np.concatenate(near)

    @cached_property
    def _triangles(self) -> tuple[Float, Int, Int, Int]:
        """Corners of all triangles, their parts, and those around every point, one point after the other: starts and rows."""
        first = np.cumsum([0, *map(len, self.parts.points)])
        triangles = np.concatenate([t + s for t, s in zip(self.parts.triangles, first)])
        owner = np.repeat(np.arange(len(self.parts.triangles)), [len(t) for t in self.parts.triangles])
        start = np.concatenate([[0], np.cumsum(np.bincount(triangles.ravel(), minlength=first[-1]))])
        around = np.argsort(triangles.ravel(), kind="stable") // 3
        return np.concatenate(self.parts.points)[triangles], owner, start, around

    @cached_property
    def _edges(self) -> _Edges:
        parts = self.parts
        ends = np.concatenate([p[e] for p, e in zip(parts.points, parts.edges, strict=True)])
        curve, at, other = np.concatenate(parts.curve), np.concatenate(parts.at), np.concatenate(parts.other)
        part = np.repeat(np.arange(len(parts.edges), dtype=np.int64), [len(e) for e in parts.edges])
        along = []
        for triangles, edges, points in zip(parts.triangles, parts.edges, parts.points, strict=True):
            half = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2).reshape(-1, 2)
            forward = np.isin(edges[:, 0] * len(points) + edges[:, 1], half[:, 0] * len(points) + half[:, 1])
            along.append(np.where(forward, 1, -1).astype(np.int64))
        middle, _ = self._curve_points(curve, at.mean(axis=1))
        height = np.linalg.norm(middle - ends.mean(axis=1), axis=1)
        run = np.concatenate(along)
        # every edge is there once for each of its parts
        order = np.lexsort((part, at[:, 0], curve))
        beside = np.empty(len(run), np.int64)
        beside[order] = run[order].reshape(-1, 2)[:, ::-1].ravel()
        return _Edges(ends, curve, at, height, part, other, run, beside)

    @cached_property
    def _trees(self) -> list[tuple[Any, Int]]:
        """Trees of the middles of the edges of every part, and their rows."""
        from ..spatial import cKDTree

        own = self._edges
        rows = [np.flatnonzero(own.part == p) for p in range(len(self.parts.points))]
        return [(cKDTree(own.ends[mine].mean(axis=1)), mine) for mine in rows]

    def _nearest_edge(self, points: Float, part: Int) -> tuple[Int, Float]:
        """The nearest edge of the joints of each point's part, and its distance."""
        ends = self._edges.ends
        edge, distance = np.zeros(len(points), np.int64), np.full(len(points), np.inf)
        for p in np.unique(part).tolist():
            tree, mine = self._trees[p]
            rows, k = np.flatnonzero(part == p), min(NEAREST, len(mine))
            near = mine[tree.query(points[rows], k=k)[1].reshape(len(rows), k)]
            a, side = ends[near, 0], ends[near, 1] - ends[near, 0]
            offset = points[rows][:, None] - a
            t = np.clip(np.einsum("nkc,nkc->nk", offset, side) / np.einsum("nkc,nkc->nk", side, side), 0.0, 1.0)
            away = np.linalg.norm(offset - t[..., None] * side, axis=2)
            best = away.argmin(axis=1)
            edge[rows], distance[rows] = near[np.arange(len(rows)), best], away[np.arange(len(rows)), best]
        return edge, distance

    def _decide(self, points: Float, rows: Int, edge: Int, part: Int, on_joint: Bool, place: Float) -> None:
        """Set what the curves say about the points `rows`, each beside the joint of an edge."""
        if not len(rows):
            return
        e = self._edges
        ends, curve, at, owner, other, run = e.ends[edge], e.curve[edge], e.at[edge], e.part[edge], e.other[edge], e.run[edge]
        x = points[rows]
        side = ends[:, 1] - ends[:, 0]
        share = np.clip(np.einsum("nc,nc->n", x - ends[:, 0], side) / np.einsum("nc,nc->n", side, side), 0.0, 1.0)
        t, width = at[:, 0] + share * (at[:, 1] - at[:, 0]), at[:, 1] - at[:, 0]
        low, high = self._ranges(curve)
        low, high = np.maximum(low, at[:, 0] - width), np.minimum(high, at[:, 1] + width)
        foot, slope = self._curve_points(curve, t)
        for _ in range(ROUNDS):
            step = np.einsum("nc,nc->n", x - foot, slope) / np.maximum(np.einsum("nc,nc->n", slope, slope), 1e-300)
            before, t = t, np.clip(t + step, low, high)
            foot, slope = self._curve_points(curve, t)
            if np.all(np.abs(t - before) <= PRECISION * width):
                break
        slope /= np.maximum(np.linalg.norm(slope, axis=1), 1e-300)[:, None]
        inner = []
        for p, sign in ((owner, run), (other, e.beside[edge])):
            inward = np.cross(self._sorted_normals(p, foot), slope) * sign[:, None]
            inner.append(np.einsum("nc,nc->n", x - foot, inward) > 0)
        here, there = inner
        part[rows] = np.where(there & ~here, other, owner)
        ridge = ~here & ~there
        on_joint[rows], place[rows] = ridge, foot

    def _sorted_normals(self, part: Int, points: Float) -> Float:
        out = np.empty_like(points)
        order = np.argsort(part, kind="stable")
        out[order] = self.normals(part[order], points[order])
        return out

    def _ranges(self, curve: Int) -> tuple[Float, Float]:
        """Bounds of the parameters of curves."""
        low, high = np.empty(len(curve)), np.empty(len(curve))
        for tag in np.unique(curve).tolist():
            a, b = gmsh.model.getParametrizationBounds(1, tag)
            low[curve == tag], high[curve == tag] = a[0], b[0]
        return low, high

    def _curve_points(self, curve: Int, t: Float) -> tuple[Float, Float]:
        """Scaled points (n, 3) and derivatives (n, 3) of curves."""
        points, slopes = np.empty((len(t), 3)), np.empty((len(t), 3))
        order = np.argsort(curve, kind="stable")
        for tag, span in runs(curve[order]):
            rows = order[span]
            with gmsh_errors("evaluating", entity=(1, tag)):
                points[rows] = gmsh.model.getValue(1, tag, t[rows]).reshape(-1, 3)
                slopes[rows] = gmsh.model.getDerivative(1, tag, t[rows]).reshape(-1, 3)
        return (points - self.origin) / self.scale, slopes / self.scale
