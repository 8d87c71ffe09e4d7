"""The energy of the edges along the CAD curves.

With places s_a < s_b on a curve, the gap g = s_b - s_a, its rest length r, and the angle T by which the curve turns along
the edge,

    ordering  w/2 (g / r + r / g)                            a barrier: vertices on a curve never pass each other,
    turning   w (max(0, T / T0 - 1))^2                       keeps an edge from cutting off a strongly curved part,
    grading   w (max(0, |log(g / g')| - log k))^2            g' the next gap: on the same curve with k = 2, or round a CAD
                                                             vertex on another one with k = 3.

Its Hessian is the Gauss-Newton one, positive semidefinite.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np

from ..records import Bool, Float, Guide, Int, Model
from .curve_table import CurveTable
from .start import chain_arclengths

__all__ = ["ChainEnergy"]

GAP_WEIGHT = 0.5
TURN_WEIGHT = 2000.0
TURN_LIMIT = float(np.radians(50.0))
"""Angle from which the turning costs; with the weight it stays below 60 degrees where the number of edges allows it."""
GRADE_WEIGHT = 50.0
GRADE_LIMIT = float(np.log(2.0))
CORNER_LIMIT = float(np.log(3.0))


class ChainEnergy:
    """Energy of the chain edges as a function of the places of the sliding vertices.

    Parameters
    ----------
    guide : Guide
    model : Model
    rest : tuple of (k,) float64
        Rest lengths of the edges of every chain.
    table : CurveTable
    row : (n,) int64
        Row of every guide vertex among the sliding ones (of vertices on a curve that are not fixed).
    slide : int
        Number of sliding vertices.
    turns : tuple of (k,) float64, optional
        Turning along every edge from which it costs, where less than `TURN_LIMIT`.
    """

    def __init__(
        self,
        guide: Guide,
        model: Model,
        rest: tuple[Float, ...],
        table: CurveTable,
        row: Int,
        slide: int,
        turns: tuple[Float, ...] | None = None,
    ) -> None:
        self.slide = slide
        place, turning = [np.zeros(0)], [np.zeros(0)]
        ends = [np.zeros((0, 2), dtype=np.int64)]
        lengths = [np.zeros(0)]
        pairs = [np.zeros((0, 2), dtype=np.int64)]
        ending: dict[int, list[int]] = {}
        held = edges = 0
        for c, chain in enumerate(guide.chains):
            if len(chain) < 2:
                continue
            fixed = guide.fixed[chain].copy()
            fixed[[0, -1]] = True
            s = chain_arclengths(guide, model, c)[fixed]
            place.append(s)
            turning.append(table.at(np.full(len(s), c), s)[0][:, 3])
            rows = np.where(fixed, slide + held + np.cumsum(fixed) - 1, row[chain])
            ends.append(np.column_stack([rows[:-1], rows[1:]]))
            lengths.append(rest[c])
            edge = edges + np.arange(len(chain) - 1)
            pairs.append(np.column_stack([edge[:-1], edge[1:]]))
            if len(edge) > 1:  # a short curve of one edge must not make its neighbours short
                ending.setdefault(int(chain[0]), []).append(int(edge[0]))
                ending.setdefault(int(chain[-1]), []).append(int(edge[-1]))
            held += len(s)
            edges += len(edge)
        self._place, self._turning = np.concatenate(place), np.concatenate(turning)
        every = np.concatenate(ends)
        # Edges between fixed vertices stay in the list, as neighbours of others, but have no energy of their own.
        moves: Bool = np.any(every < slide, axis=1)
        self._weight = np.where(moves, 1.0, 0.0)
        self._start, self._end = every.T
        self._rest = np.concatenate(lengths)
        limits = [np.zeros(0)] + [turns[c] for c, chain in enumerate(guide.chains) if len(chain) > 1] if turns else []
        self._turn_limit = np.minimum(np.concatenate(limits), TURN_LIMIT) if turns else np.full(len(self._rest), TURN_LIMIT)
        corners = [pair for edges_there in ending.values() for pair in combinations(edges_there, 2)]
        joint = np.concatenate([*pairs, np.array(corners, dtype=np.int64).reshape(-1, 2)])
        limit = np.full(len(joint), GRADE_LIMIT)
        limit[len(joint) - len(corners) :] = CORNER_LIMIT
        kept: Bool = np.any(moves[joint], axis=1)
        self._first, self._second = joint[kept].T
        self._limit = limit[kept]

    @property
    def edges(self) -> Int:
        """Start and end (k, 2) of the edges: rows of sliding vertices; rows from `slide` on are fixed places."""
        return np.column_stack([self._start, self._end])

    @property
    def pairs(self) -> Int:
        """Start and end of two neighbouring edges (p, 4), as in `edges`."""
        return np.concatenate([self.edges[self._first], self.edges[self._second]], axis=1)

    def gaps(self, s: Float) -> Float:
        """Gaps (k,) between neighbours for places `s` (slide,)."""
        every = np.concatenate([s, self._place])
        gap: Float = every[self._end] - every[self._start]
        return gap

    def value(self, s: Float, turning: Float) -> tuple[float, Float, Float]:
        """Energy, and derivatives by place and by turning.

        Parameters
        ----------
        s, turning : (slide,) float64
            Place on the curve, and turning of the curve there.

        Returns
        -------
        energy : float
            inf unless all gaps are positive.
        by_place, by_turning : (slide,) float64
        """
        gap = self.gaps(s)
        if not gap.min(initial=np.inf) > 0.0:
            return np.inf, np.zeros(self.slide), np.zeros(self.slide)
        inverse = self._rest / gap
        energy = 0.5 * GAP_WEIGHT * float(self._weight @ (1.0 / inverse + inverse))
        by_gap = 0.5 * GAP_WEIGHT * self._weight * (1.0 - inverse * inverse) / self._rest
        excess = self._excess(gap)
        energy += GRADE_WEIGHT * float(excess @ excess)
        if excess.any():
            slope = 2.0 * GRADE_WEIGHT * excess
            by_gap = by_gap + np.bincount(self._second, slope / gap[self._second], minlength=len(gap))
            by_gap = by_gap - np.bincount(self._first, slope / gap[self._first], minlength=len(gap))
        over = self._over(turning)
        energy += TURN_WEIGHT * float(over @ over)
        by_turn = self._to_ends(2.0 * TURN_WEIGHT / self._turn_limit * over) if over.any() else np.zeros(self.slide)
        return energy, self._to_ends(by_gap), by_turn

    def hessian(self, s: Float, turning: Float, length: Float, rate: Float) -> tuple[Float, Float]:
        """Positive semidefinite Hessian by coordinates z with ds = length dz and d(turning) = rate ds.

        Parameters
        ----------
        s, turning, length, rate : (slide,) float64

        Returns
        -------
        edges : (2, 2, k) float64
            Rows and columns as in `edges`; columns of fixed places are 0.
        pairs : (4, 4, p) float64
            As in `pairs`.
        """
        gap = self.gaps(s)
        none = np.zeros(len(self._place))
        length, rate = np.concatenate([length, none]), np.concatenate([rate, none])
        by_gap = np.stack([-length[self._start], length[self._end]])
        by_turn = by_gap * np.stack([rate[self._start], rate[self._end]])
        second_gap = GAP_WEIGHT * self._weight * self._rest / gap**3
        second_turn = np.where(self._over(turning) > 0.0, 2.0 * TURN_WEIGHT / self._turn_limit**2, 0.0)
        edges: Float = second_gap * by_gap[:, None] * by_gap + second_turn * by_turn[:, None] * by_turn
        one, two = self._first, self._second
        root = np.where(self._excess(gap) != 0.0, np.sqrt(2.0 * GRADE_WEIGHT), 0.0)
        left, right = -root / gap[one], root / gap[two]
        by_log = np.concatenate([left * by_gap[:, one], right * by_gap[:, two]])
        return edges, by_log[:, None] * by_log

    def _excess(self, gap: Float) -> Float:
        log_gap = np.log(gap)
        step = log_gap[self._second] - log_gap[self._first]
        return step - np.clip(step, -self._limit, self._limit)

    def _over(self, turning: Float) -> Float:
        angle = np.concatenate([turning, self._turning])
        over: Float = np.maximum((angle[self._end] - angle[self._start]) / self._turn_limit - 1.0, 0.0) * self._weight
        return over

    def _to_ends(self, by_difference: Float) -> Float:
        """Gradient at the sliding vertices of a function of the differences (end - start)."""
        total = self.slide + len(self._place)
        end = np.bincount(self._end, by_difference, minlength=total)
        start = np.bincount(self._start, by_difference, minlength=total)
        return np.asarray(end - start, dtype=np.float64)[: self.slide]
