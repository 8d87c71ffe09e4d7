"""Curves divided into cells, all curves of a model at once.

A *track* lays the sampled curves one behind the other on one axis, with a gap of 1 between them.  A cumulative density along it
(increasing on every curve) then places the cells or nodes of all curves by a single interpolation.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..records import Float, Int, Model

__all__ = ["Cells", "Track"]


@dataclass(frozen=True)
class Cells:
    """Pieces of curves.

    Attributes
    ----------
    curve : (n,) int64
        Sorted.
    first : (c + 1,) int64
        First cell of every curve.
    start, end : (n,) float64
        Arc lengths.
    p, q : (n, 3) float64
        End points.
    """

    curve: Int
    first: Int
    start: Float
    end: Float
    p: Float
    q: Float

    @property
    def length(self) -> Float:
        return self.end - self.start

    @property
    def middle(self) -> Float:
        return 0.5 * (self.p + self.q)


class Track:
    """The sampled curves of a model on one axis.

    Attributes
    ----------
    curve : (k,) int64
        Curve of every sample.
    s : (k,) float64
        Its arc length.
    turning : (k,) float64
        Angle by which the curve has turned up to the sample.
    length : (c,) float64
    first, last : (c,) int64
        Samples at the ends of every curve.
    """

    def __init__(self, model: Model) -> None:
        counts = np.array([len(c.points) for c in model.curves])
        self.curve = np.repeat(np.arange(len(counts)), counts)
        self.s = np.concatenate([c.arclength for c in model.curves])
        self._points = np.concatenate([c.points for c in model.curves])
        self.length = np.array([c.length for c in model.curves])
        self.last = np.cumsum(counts) - 1
        self.first = self.last - counts + 1
        self._offset = np.concatenate([[0.0], np.cumsum(self.length + 1.0)[:-1]])
        self._axis = self.s + self._offset[self.curve]
        self.turning = self._turning()

    def _turning(self) -> Float:
        step = np.diff(self._points, axis=0)
        size = np.linalg.norm(step, axis=1)
        step = step / np.where(size > 0, size, 1.0)[:, None]
        turn = np.zeros(len(self.s))
        cosine = np.einsum("ij,ij->i", step[1:], step[:-1])
        turn[1:-1] = np.arctan2(np.linalg.norm(np.cross(step[:-1], step[1:]), axis=1), cosine)
        turn[self.first] = turn[self.last] = 0.0
        # the first and the last segment turn as much as their neighbours
        total = np.cumsum(turn) - 0.5 * turn
        total[self.first] -= 0.5 * turn[self.first + 1]
        total[self.last] += 0.5 * turn[self.last - 1]
        return total

    def divide(self, density: Float, counts: Int, curve: Int, s: Float) -> tuple[Float, Int]:
        """Divide every curve into pieces with equal shares of a density.

        Parameters
        ----------
        density : (k,) float64
            Cumulative, increasing along every curve; only differences count.
        counts : (c,) int64
            Number of pieces.
        curve : (k,) int64; s : (k,) float64
            Place of the values; sorted, with both ends of every curve.

        Returns
        -------
        s : (sum(counts + 1),) float64
            Arc lengths, 0 and the length included.
        curve : the same shape, int64
        """
        last = np.searchsorted(curve, np.arange(len(counts)), side="right") - 1
        first = np.searchsorted(curve, np.arange(len(counts)), side="left")
        share = density[last] - density[first]
        base = np.concatenate([[0.0], np.cumsum(share + 1.0)[:-1]])
        level = density - density[first][curve] + base[curve]
        out_curve = np.repeat(np.arange(len(counts)), counts + 1)
        begin = np.concatenate([[0], np.cumsum(counts + 1)[:-1]])
        k = np.arange(len(out_curve)) - begin[out_curve]
        target = base[out_curve] + share[out_curve] * (k / counts[out_curve])
        out = np.interp(target, level, s + self._offset[curve]) - self._offset[out_curve]
        out[begin] = 0.0
        out[begin + counts] = self.length
        return out, out_curve

    def cells(self, s: Float, curve: Int) -> Cells:
        """Cells between consecutive arc lengths, as `divide` returns them."""
        axis = s + self._offset[curve]
        points = np.stack([np.interp(axis, self._axis, self._points[:, c]) for c in range(3)], axis=1)
        inner = curve[1:] == curve[:-1]
        owner = curve[:-1][inner]
        first = np.searchsorted(owner, np.arange(len(self.length) + 1))
        return Cells(owner, first, s[:-1][inner], s[1:][inner], points[:-1][inner], points[1:][inner])

    def turning_rate(self, cells: Cells) -> Float:
        """Mean curvature (n,) on every cell."""
        a = np.interp(cells.start + self._offset[cells.curve], self._axis, self.turning)
        b = np.interp(cells.end + self._offset[cells.curve], self._axis, self.turning)
        return np.maximum(b - a, 0.0) / cells.length
