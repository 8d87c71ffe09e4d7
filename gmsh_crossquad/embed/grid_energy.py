"""The energy of a whole guide grid as a function of its free coordinates.

The coordinates z are relative to the local rest length l, so that small features weigh as much as large ones:

    interior vertex    x = x0 + l (z_1 a_1 + z_2 a_2)        in the frame a of its face,
    vertex on a curve  s = s0 + l z,   x = C(s)              in all its faces at once.

The energy is that of the corners (`energy`) and of the edges on curves (`chain_energy`).  The Hessian is positive
definite: it drops the curvature of the curves, and what the two modules drop.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..errors import MeshError
from ..records import Float, Guide, Model
from .chain_energy import ChainEnergy
from .curve_table import CurveTable
from .energy import corner_areas, corner_energy, corner_hessian
from .rest_lengths import RestLengths

__all__ = ["GridEnergy"]


class GridEnergy:
    """Energy, gradient and Hessian of a guide grid.

    Parameters
    ----------
    guide : Guide
        Fixes the topology and the origin z = 0.
    model : Model
    table : CurveTable
        Of the model's curves.
    rest : RestLengths
        Its `vertices` (the local lengths) and `chains`; the rest lengths of the quads come with every call.
    """

    def __init__(self, guide: Guide, model: Model, table: CurveTable, rest: RestLengths) -> None:
        self.guide = guide
        n = len(guide.points)
        used = np.zeros(n, dtype=bool)
        used[guide.quads] = True
        self._inner = np.flatnonzero(used & (guide.curve < 0) & ~guide.fixed)
        self._slide = np.flatnonzero(used & (guide.curve >= 0) & ~guide.fixed)
        inner, slide = len(self._inner), len(self._slide)
        self.size = 2 * inner + slide
        self._table = table
        self._curve, self._s0 = guide.curve[self._slide], guide.arclength[self._slide]
        self._inner_length = np.repeat(rest.vertices[self._inner], 2)
        self._slide_length = rest.vertices[self._slide]
        row = np.full(n, -1)
        row[self._inner] = np.arange(inner)
        row[self._slide] = np.arange(slide)
        self._chains = ChainEnergy(guide, model, rest.chains, self._table, row, slide, rest.turns)
        # A vertex has one plane position, a node, in every face that it belongs to; a node of an interior vertex comes
        # first, then those of sliding vertices, then the fixed ones.
        key = guide.quad_face[:, None] * n + guide.quads
        kind = np.where(guide.fixed, 2, np.where(guide.curve < 0, 0, 1))
        keys, nodes = np.unique((kind[guide.quads] * len(model.faces) * n + key).T, return_inverse=True)
        keys = keys % (len(model.faces) * n)
        self._nodes = nodes.reshape(4, -1)
        face, vertex = keys // n, keys % n
        origin = np.array([f.origin for f in model.faces])[face]
        axes = np.array([f.axes for f in model.faces])[face]
        self._plane = np.einsum("nc,nac->an", guide.points[vertex] - origin, axes)
        moving = kind[vertex]
        first, last = inner, inner + int((moving == 1).sum())
        self._node_range = (first, last)
        self._inner_row = row[vertex[:first]]
        self._inner_frame = (origin[:first], axes[:first])
        self._slide_row = row[vertex[first:last]]
        self._slide_axes = axes[first:last]
        self._slide_shift = np.einsum("nc,nac->an", origin[first:last], self._slide_axes)
        # Degree of freedom of both coordinates of every node; `size` stands for none.
        self._freedom = np.full((2, len(keys)), self.size)
        self._freedom[:, :first] = 2 * self._inner_row + np.array([[0], [1]])
        self._freedom[:, first:last] = 2 * inner + self._slide_row
        self._inner_freedom = self._freedom[:, :first]
        self._set_pattern()

    def _set_pattern(self) -> None:
        """Column-compressed pattern of the Hessian and where its contributions go."""
        size, slide = self.size, len(self._slide)
        edges, pairs = (np.where(t < slide, t + 2 * len(self._inner), size).T for t in (self._chains.edges, self._chains.pairs))
        rows, cols = [], []
        for block in (self._freedom[:, self._nodes].swapaxes(0, 1).reshape(8, -1), edges, pairs):
            shape = (len(block), len(block), block.shape[1])
            rows.append(np.broadcast_to(block[:, None], shape).ravel())
            cols.append(np.broadcast_to(block[None], shape).ravel())
        row, col = np.concatenate(rows), np.concatenate(cols)
        self._kept = np.flatnonzero((row < size) & (col < size))
        key, self._target = np.unique(col[self._kept] * size + row[self._kept], return_inverse=True)
        self._indices = (key % max(size, 1)).astype(np.int32)
        self._indptr = np.searchsorted(key, np.arange(size + 1) * size).astype(np.int32)
        self._diagonal = np.searchsorted(key, np.arange(size) * (size + 1))

    def _places(self, z: Float) -> tuple[Float, Float, Float]:
        """Arc lengths of the sliding vertices (k,), position and turning there and their derivatives (k, 4)."""
        s = self._s0 + self._slide_length * z[2 * len(self._inner) :]
        value, derivative = self._table.at(self._curve, s) if len(s) else (np.zeros((0, 4)), np.zeros((0, 4)))
        return s, value, derivative

    def _corners(self, z: Float, world: Float) -> tuple[Float, Float]:
        """Corner coordinates x, y (4, q)."""
        first, last = self._node_range
        plane = self._plane.copy()
        plane[:, :first] += (z[: 2 * first] * self._inner_length)[self._inner_freedom]
        plane[:, first:last] = np.einsum("nc,nac->an", world[self._slide_row, :3], self._slide_axes) - self._slide_shift
        return plane[0].take(self._nodes), plane[1].take(self._nodes)

    def _tangents(self, derivative: Float) -> Float:
        """Derivatives (2, k) of the plane positions of the sliding nodes."""
        return np.einsum("nc,nac->an", derivative[self._slide_row, :3], self._slide_axes)

    def areas(self, z: Float, sides: Float) -> Float:
        """Signed corner areas (4, q) over those at rest."""
        x, y = self._corners(z, self._places(z)[1])
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
        s, world, derivative = self._places(z)
        gradient = np.zeros(self.size)
        energy, by_place, by_turning = self._chains.value(s, world[:, 3])
        if energy == np.inf:
            return energy, gradient
        corners, gx, gy = corner_energy(*self._corners(z, world), sides, eps, power)
        energy += corners
        if energy == np.inf:
            return energy, gradient
        count, (first, last) = self._plane.shape[1], self._node_range
        nodes = self._nodes.ravel()
        plane = np.stack([np.bincount(nodes, g.ravel(), minlength=count) for g in (gx, gy)])
        gradient[self._inner_freedom] = plane[:, :first]
        gradient[: 2 * first] *= self._inner_length
        if len(s):
            along = (self._tangents(derivative) * plane[:, first:last]).sum(axis=0)
            by_s = np.bincount(self._slide_row, along, minlength=len(s)) + by_place + by_turning * derivative[:, 3]
            gradient[2 * first :] = by_s * self._slide_length
        return energy, gradient

    def factor(self, z: Float, sides: Float, eps: float, power: int) -> Callable[[Float], Float]:
        """Factorise the Hessian at `z`; the result maps a right-hand side (size,) to the solution."""
        from scipy.sparse import csc_array
        from scipy.sparse.linalg import splu

        s, world, derivative = self._places(z)
        blocks = corner_hessian(*self._corners(z, world), sides, eps, power)
        first, last = self._node_range
        scale = np.zeros_like(self._plane)
        scale[:, :first] = self._inner_length[self._inner_freedom]
        scale[:, first:last] = self._tangents(derivative) * self._slide_length[self._slide_row]
        corner = scale[:, self._nodes].swapaxes(0, 1)
        blocks *= corner[:, :, None, None]
        blocks *= corner
        edges, pairs = self._chains.hessian(s, world[:, 3], self._slide_length, derivative[:, 3])
        values = np.concatenate([blocks.ravel(), edges.ravel(), pairs.ravel()])
        data = np.asarray(np.bincount(self._target, values[self._kept], minlength=len(self._indices)), dtype=np.float64)
        data[self._diagonal] *= 1.0 + 1e-9
        matrix = csc_array((data, self._indices, self._indptr), shape=(self.size, self.size))
        try:
            lu = splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
        except RuntimeError as failure:
            raise MeshError("the guide grid is degenerate, its Hessian is singular", remedy="another size may help") from failure
        solve: Callable[[Float], Float] = lu.solve
        return solve

    def positions(self, z: Float) -> tuple[Float, Float]:
        """Points (n, 3) and arc lengths (n,) of the guide's vertices; interior vertices lie in the plane of their face."""
        points, arclength = self.guide.points.copy(), self.guide.arclength.copy()
        first, _ = self._node_range
        plane = self._plane[:, :first] + (z[: 2 * first] * self._inner_length)[self._inner_freedom]
        origin, axes = self._inner_frame
        points[self._inner[self._inner_row]] = origin + np.einsum("an,nac->nc", plane, axes)
        s, world, _ = self._places(z)
        arclength[self._slide] = s
        points[self._slide] = world[:, :3]
        return points, arclength
