"""The energy of a whole guide grid as a function of its free coordinates.

The coordinates z are relative to the local rest length l, so that small features weigh as much as large ones:

    interior vertex    x = x0 + l (z_1 a_1 + z_2 a_2)        in the frame a of its face,
    vertex on a curve  s = s0 + l z,   x = C(s)              in all faces at once.

Besides the corner energy (see `energy`) the edges of the curves are judged, with gaps g = s_b - s_a:

    ordering  1/2 (g / r + r / g)                            r the rest length: a barrier that keeps the order,
    turning   w (max(0, T / T0 - 1))^2                       T the angle by which the curve turns along the edge,
    grading   w (max(0, |log(g / g')| - log 2))^2            g' the next gap on the same curve.

The Hessian drops the curvature of the curves and, as `energy` does, what may be indefinite.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..records import Float, Guide, Int, Model
from .curve_table import CurveTable
from .energy import corner_areas, corner_energy, corner_hessian
from .rest_lengths import RestLengths
from .start import chain_arclengths

__all__ = ["GridEnergy"]

GAP_WEIGHT = 0.5
TURN_WEIGHT = 20.0
TURN_LIMIT = np.radians(50.0)
"""Angle from which the turning of a curve along one edge costs; with the weight it keeps it below 60 degrees."""
GRADE_WEIGHT = 4.0
GRADE_LIMIT = float(np.log(2.0))

Solver = Callable[[Float], Float]


class GridEnergy:
    """Energy, gradient and Hessian of a guide grid.

    Parameters
    ----------
    guide : Guide
        Fixes the topology and the origin z = 0.
    model : Model
    rest : RestLengths
        Only `vertices` (the local lengths) and `chains` are kept; the rest lengths of the quads come with every call.
    """

    def __init__(self, guide: Guide, model: Model, rest: RestLengths) -> None:
        self.guide = guide
        used = np.zeros(len(guide.points), dtype=bool)
        used[guide.quads] = True
        self._inner = np.flatnonzero(used & (guide.curve < 0) & ~guide.fixed)
        self._slide = np.flatnonzero(used & (guide.curve >= 0) & ~guide.fixed)
        inner, slide = len(self._inner), len(self._slide)
        self.size = 2 * inner + slide
        self._table = CurveTable(model.curves)
        self._curve = guide.curve[self._slide]
        self._s0 = guide.arclength[self._slide]
        # A vertex has one plane position in every face that it belongs to.
        n = len(guide.points)
        keys, nodes = np.unique((guide.quad_face[:, None] * n + guide.quads).T, return_inverse=True)
        self._nodes = nodes.reshape(4, -1)
        face, vertex = keys // n, keys % n
        origin = np.array([f.origin for f in model.faces])[face]
        axes = np.array([f.axes for f in model.faces])[face]
        self._plane = np.einsum("nc,nac->an", guide.points[vertex] - origin, axes)
        row = np.full(n, -1)
        row[self._inner] = np.arange(inner)
        row[self._slide] = np.arange(slide)
        on_slide = (guide.curve[vertex] >= 0) & ~guide.fixed[vertex]
        on_inner = (guide.curve[vertex] < 0) & ~guide.fixed[vertex]
        self._inner_nodes = np.flatnonzero(on_inner)
        self._inner_row = row[vertex[self._inner_nodes]]
        self._inner_axes = axes[self._inner_nodes]
        self._inner_origin = origin[self._inner_nodes]
        self._slide_nodes = np.flatnonzero(on_slide)
        self._slide_row = row[vertex[self._slide_nodes]]
        self._slide_axes = axes[self._slide_nodes]
        self._slide_shift = np.einsum("nc,nac->an", origin[self._slide_nodes], self._slide_axes)
        self._length_inner = rest.vertices[self._inner]
        self._length_slide = rest.vertices[self._slide]
        # Degree of freedom of both coordinates of every node; `size` stands for none.
        self._freedom = np.full((len(keys), 2), self.size)
        self._freedom[self._inner_nodes, 0] = 2 * self._inner_row
        self._freedom[self._inner_nodes, 1] = 2 * self._inner_row + 1
        self._freedom[self._slide_nodes] = (2 * inner + self._slide_row)[:, None]
        self._set_chains(guide, model, rest, row)
        self._set_pattern()

    def _set_chains(self, guide: Guide, model: Model, rest: RestLengths, row: Int) -> None:
        """Edges (a, b) of the chains as rows of (sliding vertices, fixed places), and consecutive pairs of edges."""
        slide = len(self._slide)
        place: list[Float] = []
        turning: list[Float] = []
        ends: list[Int] = []
        lengths: list[Float] = []
        pairs: list[Int] = []
        fixed_total = edge_total = 0
        for c, chain in enumerate(guide.chains):
            if len(chain) < 2:
                continue
            fixed = guide.fixed[chain].copy()
            fixed[[0, -1]] = True
            s = chain_arclengths(guide, model, c)[fixed]
            place.append(s)
            turning.append(self._table.at(np.full(len(s), c), s)[0][:, 3])
            rows = np.where(fixed, slide + fixed_total + np.cumsum(fixed) - 1, row[chain])
            fixed_total += len(s)
            ends.append(np.column_stack([rows[:-1], rows[1:]]))
            lengths.append(rest.chains[c])
            edge = edge_total + np.arange(len(chain) - 1)
            pairs.append(np.column_stack([edge[:-1], edge[1:]]))
            edge_total += len(edge)
        self._fixed_s = np.concatenate(place or [np.zeros(0)])
        self._fixed_turning = np.concatenate(turning or [np.zeros(0)])
        self._ends = np.concatenate(ends or [np.zeros((0, 2), dtype=np.int64)]).astype(np.int64)
        self._gap_rest = np.concatenate(lengths or [np.zeros(0)])
        joint = np.concatenate(pairs or [np.zeros((0, 2), dtype=np.int64)]).astype(np.int64)
        moves = (self._ends < slide).any(axis=1)
        self._pairs = joint[moves[joint].any(axis=1)] if len(joint) else joint

    def _set_pattern(self) -> None:
        """Column-compressed pattern of the Hessian and where its contributions go."""
        size, inner = self.size, len(self._inner)
        corner = self._freedom[self._nodes].transpose(0, 2, 1).reshape(8, -1)
        rows = np.broadcast_to(corner[:, None], (8, 8, corner.shape[1])).ravel()
        cols = np.broadcast_to(corner[None], (8, 8, corner.shape[1])).ravel()
        slide = len(self._slide)
        ends = np.where(self._ends < slide, self._ends + 2 * inner, size)
        triple = (
            np.column_stack([ends[self._pairs[:, 0]], ends[self._pairs[:, 1], 1]]) if len(self._pairs) else ends[:0, [0, 1, 1]]
        )
        self._triple = triple
        for block in (ends, triple):
            k = block.shape[1]
            rows = np.concatenate([rows, np.repeat(block, k, axis=1).ravel()])
            cols = np.concatenate([cols, np.tile(block, (1, k)).ravel()])
        self._kept = (rows < size) & (cols < size)
        key, self._target = np.unique(cols[self._kept] * size + rows[self._kept], return_inverse=True)
        self._indices = (key % max(size, 1)).astype(np.int32)
        self._indptr = np.searchsorted(key, np.arange(size + 1) * size).astype(np.int32)
        self._diagonal = np.searchsorted(key, np.arange(size) * (size + 1))

    def _arclengths(self, z: Float) -> Float:
        return self._s0 + self._length_slide * z[2 * len(self._inner) :]

    def _inner_plane(self, z: Float) -> Float:
        """Plane coordinates (2, k) of the interior nodes."""
        move = z[: 2 * len(self._inner)].reshape(-1, 2) * self._length_inner[:, None]
        place: Float = self._plane[:, self._inner_nodes] + move[self._inner_row].T
        return place

    def _corners(self, z: Float) -> tuple[Float, Float, Float, Float]:
        """Corner coordinates x, y (4, q), arc lengths of the sliding vertices and curve derivatives there."""
        plane = self._plane.copy()
        plane[:, self._inner_nodes] = self._inner_plane(z)
        s = self._arclengths(z)
        value, derivative = self._table.at(self._curve, s) if len(s) else (np.zeros((0, 4)), np.zeros((0, 4)))
        self._turning = value[:, 3]
        world = value[self._slide_row, :3]
        plane[:, self._slide_nodes] = np.einsum("nc,nac->an", world, self._slide_axes) - self._slide_shift
        return plane[0].take(self._nodes), plane[1].take(self._nodes), s, derivative

    def areas(self, z: Float, sides: Float) -> Float:
        """Signed corner areas (4, q) over those at rest."""
        x, y, _, _ = self._corners(z)
        return corner_areas(x, y, sides)

    def value(self, z: Float, sides: Float, eps: float, power: int) -> tuple[float, Float]:
        """Energy and gradient.

        Parameters
        ----------
        z : (size,) float64
        sides : (4, q) float64
            Rest lengths of the quads' edges.
        eps, power
            As in `energy.corner_energy`.

        Returns
        -------
        energy : float
            inf outside the barriers.
        gradient : (size,) float64
        """
        x, y, s, derivative = self._corners(z)
        if len(s) and not self._gaps(s).min() > 0.0:
            return np.inf, np.zeros(self.size)
        energy, gx, gy = corner_energy(x, y, sides, eps, power)
        if energy == np.inf:
            return energy, np.zeros(self.size)
        count = self._plane.shape[1]
        nodes = self._nodes.ravel()
        plane = np.stack(
            [np.bincount(nodes, gx.ravel(), minlength=count), np.bincount(nodes, gy.ravel(), minlength=count)], axis=1
        )
        gradient = np.zeros(self.size)
        inner = len(self._inner)
        if inner:
            part = gradient[: 2 * inner].reshape(-1, 2)
            part[self._inner_row] = plane[self._inner_nodes]
            part *= self._length_inner[:, None]
        if len(s):
            tangent = self._slide_tangents(derivative)
            along = (tangent * plane[self._slide_nodes]).sum(axis=1)
            by_s = np.bincount(self._slide_row, along, minlength=len(s))
            extra, by_gap, by_turn, _, _, _ = self._chain_terms(s, self._turning)
            energy += extra
            by_s += self._to_ends(by_gap) + self._to_ends(by_turn) * derivative[:, 3]
            gradient[2 * inner :] = by_s * self._length_slide
        return energy, gradient

    def _slide_tangents(self, derivative: Float) -> Float:
        """Derivatives (k, 2) of the plane positions of the sliding nodes."""
        return np.einsum("nc,nac->na", derivative[self._slide_row, :3], self._slide_axes)

    def _gaps(self, s: Float) -> Float:
        every = np.concatenate([s, self._fixed_s])
        gap: Float = every[self._ends[:, 1]] - every[self._ends[:, 0]]
        return gap

    def _to_ends(self, by_difference: Float) -> Float:
        """Gradient at the sliding vertices of a function of differences (end - start) along the chain edges."""
        total = len(self._slide) + len(self._fixed_s)
        out: Float = np.bincount(self._ends[:, 1], by_difference, minlength=total)
        out -= np.bincount(self._ends[:, 0], by_difference, minlength=total)
        return out[: len(self._slide)]

    def _chain_terms(self, s: Float, turning: Float) -> tuple[float, Float, Float, Float, Float, Float]:
        """Energy of the chain edges, its derivatives by gap and by turning, and the positive second derivatives.

        The last three are: by gap (k,), by turning (k,), and for the pairs of edges the vector (p, 2) whose outer product
        is the second derivative of the grading by the two gaps.
        """
        gap = self._gaps(s)
        ratio = gap / self._gap_rest
        inverse = 1.0 / ratio
        energy = 0.5 * GAP_WEIGHT * float((ratio + inverse).sum())
        by_gap = 0.5 * GAP_WEIGHT * (1.0 - inverse * inverse) / self._gap_rest
        second_gap = GAP_WEIGHT * inverse**3 / self._gap_rest**2
        angles = np.concatenate([turning, self._fixed_turning])
        over = np.maximum((angles[self._ends[:, 1]] - angles[self._ends[:, 0]]) / TURN_LIMIT - 1.0, 0.0)
        energy += TURN_WEIGHT * float(over @ over)
        by_turn = 2.0 * TURN_WEIGHT / TURN_LIMIT * over
        second_turn = np.where(over > 0.0, 2.0 * TURN_WEIGHT / TURN_LIMIT**2, 0.0)
        log_gap = np.log(gap)
        step = log_gap[self._pairs[:, 1]] - log_gap[self._pairs[:, 0]]
        excess = step - np.clip(step, -GRADE_LIMIT, GRADE_LIMIT)
        energy += GRADE_WEIGHT * float(excess @ excess)
        slope = 2.0 * GRADE_WEIGHT * excess
        first, second = self._pairs[:, 0], self._pairs[:, 1]
        by_gap += np.bincount(second, slope / gap[second], minlength=len(gap)) - np.bincount(
            first, slope / gap[first], minlength=len(gap)
        )
        root = np.where(excess != 0.0, np.sqrt(2.0 * GRADE_WEIGHT), 0.0)
        grade = np.column_stack([-root / gap[first], root / gap[second]])
        return energy, by_gap, by_turn, second_gap, second_turn, grade

    def factor(self, z: Float, sides: Float, eps: float, power: int) -> Solver:
        """Factorise the Hessian at `z`; the result maps a right-hand side (size,) to the solution."""
        from scipy.sparse import csc_array
        from scipy.sparse.linalg import splu

        x, y, s, derivative = self._corners(z)
        blocks = corner_hessian(x, y, sides, eps, power)
        scale = np.zeros((self._plane.shape[1], 2))
        scale[self._inner_nodes] = self._length_inner[self._inner_row][:, None]
        if len(s):
            scale[self._slide_nodes] = self._slide_tangents(derivative) * self._length_slide[self._slide_row][:, None]
        corner = scale[self._nodes].transpose(0, 2, 1)
        blocks *= corner[:, :, None, None]
        blocks *= corner[None, None]
        values = [blocks.ravel()]
        if len(s):
            _, _, _, second_gap, second_turn, grade = self._chain_terms(s, self._turning)
            length = np.concatenate([self._length_slide, np.zeros(len(self._fixed_s))])
            rate = np.concatenate([derivative[:, 3], np.zeros(len(self._fixed_s))])
            a, b = self._ends.T
            by_gap = np.column_stack([-length[a], length[b]])
            by_turn = by_gap * np.column_stack([rate[a], rate[b]])
            edge = second_gap[:, None, None] * by_gap[:, :, None] * by_gap[:, None]
            edge += second_turn[:, None, None] * by_turn[:, :, None] * by_turn[:, None]
            one, two = self._pairs.T
            triple = np.column_stack(
                [
                    grade[:, 0] * by_gap[one, 0],
                    grade[:, 0] * by_gap[one, 1] + grade[:, 1] * by_gap[two, 0],
                    grade[:, 1] * by_gap[two, 1],
                ]
            )
            values += [edge.ravel(), (triple[:, :, None] * triple[:, None]).ravel()]
        else:
            values.append(np.zeros(4 * len(self._ends) + 9 * len(self._pairs)))
        data = np.bincount(self._target, np.concatenate(values)[self._kept], minlength=len(self._indices))
        data[self._diagonal] *= 1.0 + 1e-9
        matrix = csc_array((data, self._indices, self._indptr), shape=(self.size, self.size))
        lu = splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
        return lu.solve

    def positions(self, z: Float) -> tuple[Float, Float]:
        """Points (n, 3) and arc lengths (n,) of the guide's vertices."""
        points, arclength = self.guide.points.copy(), self.guide.arclength.copy()
        if len(self._inner):
            points[self._inner[self._inner_row]] = self._inner_origin + np.einsum(
                "an,nac->nc", self._inner_plane(z), self._inner_axes
            )
        s = self._arclengths(z)
        if len(s):
            arclength[self._slide] = s
            points[self._slide] = self._table.at(self._curve, s)[0][:, :3]
        return points, arclength
