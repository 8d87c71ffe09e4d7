"""The energy of a whole guide grid as a function of its free coordinates.

The coordinates z are relative to the local rest length l, so that small features weigh as much as large ones:

    interior vertex    x = x0 + l (z_1 b_1 + z_2 b_2)        b: axes of its plane face, or of the tangent plane of a curved one,
    vertex on a curve  s = s0 + l z,   x = C(s)              in all its faces at once.

The energy is that of the corners (`energy`), but those in cusps, and of the edges on curves (`chain_energy`).  A quad's
corners are seen in a frame (o, a): that of its plane face, or on a curved face the tangent plane of the surface at the quad's
middle.  A vertex seen in a frame is a *node*, with the plane coordinates y = a (x - o) and, on a curved face, dy/dz = l a b^T.
All frames are frozen; `positions` puts the vertices back on their surfaces.  The Hessian is positive definite: it drops the
curvature of curves and surfaces, and what the two modules drop.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..cusps import cusp_corners
from ..errors import MeshError
from ..records import Float, Guide, Int, Model
from ..surfaces import Surfaces
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
    surfaces : Surfaces
    table : CurveTable
        Of the model's curves.
    rest : RestLengths
        Its `vertices` (the local lengths) and `chains`; the rest lengths of the quads come with every call.
    """

    def __init__(self, guide: Guide, model: Model, surfaces: Surfaces, table: CurveTable, rest: RestLengths) -> None:
        self.guide = guide
        self._surfaces = surfaces
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
        # Frames: one per face (unused where it is curved), then one per quad on a curved face.
        bent = surfaces.curved[guide.quad_face]
        self._bent = np.flatnonzero(bent)
        cusps = cusp_corners(guide, model)
        self._without = cusps.T.copy() if cusps.any() else None
        frame = np.where(bent, len(model.faces) + np.cumsum(bent) - 1, guide.quad_face)
        origins, frames = self._frames(model)
        # Nodes: those of interior vertices of plane faces come first, then those of curved faces, of sliding vertices and of
        # fixed ones.
        total = len(frames) * n
        kind = np.where(guide.fixed, 3, np.where(guide.curve < 0, 0, 2))[guide.quads]
        kind = np.where((kind == 0) & bent[:, None], 1, kind)
        keys, nodes = np.unique((kind * total + frame[:, None] * n + guide.quads).T, return_inverse=True)
        first, middle, last = np.searchsorted(keys, total * np.arange(1, 4)).tolist()
        keys = keys % total
        self._nodes = nodes.reshape(4, -1)
        vertex = keys % n
        origin, axes = origins[keys // n], frames[keys // n]
        self._plane = np.einsum("nc,nac->an", guide.points[vertex] - origin, axes)
        self._node_range = (first, middle, last)
        self._inner_row = row[vertex[:first]]
        self._inner_frame = (origin[:first], axes[:first])
        self._slide_row = row[vertex[middle:last]]
        self._slide_axes = axes[middle:last]
        self._slide_shift = np.einsum("nc,nac->an", origin[middle:last], self._slide_axes)
        # Degree of freedom of both coordinates of every node (on curved faces: both tangents); `size` stands for none.
        self._freedom = np.full((2, len(keys)), self.size)
        self._freedom[:, :middle] = 2 * row[vertex[:middle]] + np.array([[0], [1]])
        self._freedom[:, middle:last] = 2 * inner + self._slide_row
        self._inner_freedom = self._freedom[:, :first]
        self._set_bent(row[vertex[first:middle]], axes[first:middle])
        self._set_pattern()

    def _frames(self, model: Model) -> tuple[Float, Float]:
        """Origins (f, 3) and axes (f, 2, 3) of the frames."""
        origin = np.array([f.origin for f in model.faces])
        axes = np.array([f.axes[:2] for f in model.faces])
        if not len(self._bent):
            return origin, axes
        centre = self.guide.points[self.guide.quads[self._bent]].mean(axis=1)
        normal = self._surfaces.normals(self.guide.quad_face[self._bent], centre)
        return np.concatenate([origin, centre]), np.concatenate([axes, tangents_of(normal)])

    def _set_bent(self, row: Int, axes: Float) -> None:
        """Tangents at the interior vertices of curved faces, and the derivatives of their nodes (rows `row`, frames `axes`)."""
        face = np.zeros(len(self.guide.points), np.int64)
        face[self.guide.quads[self._bent]] = self.guide.quad_face[self._bent, None]
        self._bent_rows = np.unique(row)
        vertex = self._inner[self._bent_rows]
        self._bent_face = face[vertex]
        self._tangent = np.zeros((len(self._inner), 2, 3))
        if len(vertex):
            normals = self._surfaces.normals(self._bent_face, self.guide.points[vertex])
            self._tangent[self._bent_rows] = tangents_of(normals)
        first, middle, _ = self._node_range
        self._bent_row = row
        self._slope = np.einsum("nac,nbc->abn", axes, self._tangent[row]) * self._inner_length[2 * row]
        slope = np.zeros((2, 2, self._plane.shape[1]))
        slope[0, 0] = slope[1, 1] = 1.0
        slope[:, :, first:middle] = self._slope
        self._turned = slope[:, :, self._nodes[:, self._bent]].transpose(2, 0, 1, 3)

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
        first, middle, last = self._node_range
        plane = self._plane.copy()
        plane[:, :first] += (z[: 2 * len(self._inner)] * self._inner_length)[self._inner_freedom]
        if first < middle:
            plane[:, first:middle] += (self._slope * z[self._freedom[:, first:middle]]).sum(axis=1)
        plane[:, middle:last] = np.einsum("nc,nac->an", world[self._slide_row, :3], self._slide_axes) - self._slide_shift
        return plane[0].take(self._nodes), plane[1].take(self._nodes)

    def _tangents(self, derivative: Float) -> Float:
        """Derivatives (2, k) of the plane positions of the sliding nodes."""
        return np.einsum("nc,nac->an", derivative[self._slide_row, :3], self._slide_axes)

    def areas(self, z: Float, sides: Float) -> Float:
        """Signed corner areas (4, q) over those at rest; 1 in cusps."""
        x, y = self._corners(z, self._places(z)[1])
        areas = corner_areas(x, y, sides)
        return areas if self._without is None else np.where(self._without, 1.0, areas)

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
        corners, gx, gy = corner_energy(*self._corners(z, world), sides, eps, power, self._without)
        energy += corners
        if energy == np.inf:
            return energy, gradient
        count, (first, middle, last) = self._plane.shape[1], self._node_range
        nodes = self._nodes.ravel()
        plane = np.stack([np.bincount(nodes, g.ravel(), minlength=count) for g in (gx, gy)])
        gradient[self._inner_freedom] = plane[:, :first]
        inner = len(self._inner)
        gradient[: 2 * inner] *= self._inner_length
        if first < middle:
            by_tangent = (self._slope * plane[:, None, first:middle]).sum(axis=0)
            for k in (0, 1):
                gradient[k : 2 * inner : 2] += np.bincount(self._bent_row, by_tangent[k], minlength=inner)
        if len(s):
            along = (self._tangents(derivative) * plane[:, middle:last]).sum(axis=0)
            by_s = np.bincount(self._slide_row, along, minlength=len(s)) + by_place + by_turning * derivative[:, 3]
            gradient[2 * inner :] = by_s * self._slide_length
        return energy, gradient

    def factor(self, z: Float, sides: Float, eps: float, power: int) -> Callable[[Float], Float]:
        """Factorise the Hessian at `z`; the result maps a right-hand side (size,) to the solution."""
        from scipy.sparse import csc_array
        from scipy.sparse.linalg import splu

        s, world, derivative = self._places(z)
        blocks = corner_hessian(*self._corners(z, world), sides, eps, power, self._without)
        first, middle, last = self._node_range
        scale = np.zeros_like(self._plane)
        scale[:, :first] = self._inner_length[self._inner_freedom]
        scale[:, first:middle] = 1.0
        scale[:, middle:last] = self._tangents(derivative) * self._slide_length[self._slide_row]
        corner = scale[:, self._nodes].swapaxes(0, 1)
        blocks *= corner[:, :, None, None]
        blocks *= corner
        if len(self._bent):
            blocks[..., self._bent] = _turned(blocks[..., self._bent], self._turned)
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
        """Points (n, 3) and arc lengths (n,) of the guide's vertices; interior vertices lie on their face."""
        points, arclength = self.guide.points.copy(), self.guide.arclength.copy()
        first = self._node_range[0]
        step = z[: 2 * len(self._inner)] * self._inner_length
        plane = self._plane[:, :first] + step[self._inner_freedom]
        origin, axes = self._inner_frame
        points[self._inner[self._inner_row]] = origin + np.einsum("an,nac->nc", plane, axes)
        if len(self._bent_rows):
            rows = self._bent_rows
            moved = points[self._inner[rows]] + np.einsum("na,nac->nc", step.reshape(-1, 2)[rows], self._tangent[rows])
            points[self._inner[rows]] = self._surfaces.feet(self._bent_face, moved)
        s, world, _ = self._places(z)
        arclength[self._slide] = s
        points[self._slide] = world[:, :3]
        return points, arclength


def tangents_of(normal: Float) -> Float:
    """Orthonormal frames (n, 2, 3) perpendicular to unit normals (n, 3), which are the cross product of their axes."""
    least = np.eye(3)[np.argmin(np.abs(normal), axis=1)]
    one = np.cross(least, normal)
    one /= np.linalg.norm(one, axis=1)[:, None]
    return np.stack([one, np.cross(normal, one)], axis=1)


def _turned(blocks: Float, slope: Float) -> Float:
    """Blocks (4, 2, 4, 2, q) by the corners' coordinates as blocks by other variables.

    `slope` (4, 2, 2, q) are the derivatives of the two coordinates of every corner by them.
    """
    half = blocks[:, :, :, 0, None] * slope[:, 0] + blocks[:, :, :, 1, None] * slope[:, 1]
    first, second = slope[:, 0, :, None, None], slope[:, 1, :, None, None]
    out: Float = half[:, 0, None] * first + half[:, 1, None] * second
    return out
