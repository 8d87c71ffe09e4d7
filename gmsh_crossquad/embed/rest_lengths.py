"""Rest lengths of the guide grid: one per edge, graded over the mesh.

The T-mesh gives every quad the lengths of its sides, constant per patch, with jumps between patches.  Here an edge gets
one length l, in three steps on u = log l:

1. the mean over the quads at the edge; once the grid is untangled, the mean of that and the log of the actual length,
   since the layout does not know how wide a patch will become; an edge between two fixed vertices of a curve keeps its
   true length; where a curve turns along an edge by T > `TURN`, the edge is shortened by T / TURN, and where the bulge
   l T / 8 over the edge is more than `SAGITTA` of the height of the quad beside it, to the length that has this bulge;
2. diffusion between neighbours, anchored at step 1:  u <- (ANCHOR u0 + sum u_n) / (ANCHOR + number), where the
   neighbours are the opposite edges in the quads (across) and the continuing edges at the vertices (along);
3. where two neighbours still differ by more than `LEAST_RATIO`, both move half of the excess.

Between 1 and 2 the edges of quads in cusps get lengths of their own (`kites`), which they keep.

Last, on every curve the lengths between two fixed vertices are scaled so that their sum is the arc length there, and in
every face so that the quads fill its area.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..cusps import find_cusps
from ..errors import MeshError
from ..quad_edges import edges_of_quads
from ..records import Bool, Float, Guide, Int, Model
from ..surfaces import Surfaces, quad_normals
from .curve_table import CurveTable
from .kites import kites
from .start import chain_arclengths

__all__ = ["RestLengths", "rest_lengths"]

ANCHOR = 1.0
SWEEPS = 12
"""Jacobi sweeps of the diffusion, and of the limiter."""
TURN = float(np.radians(40.0))
"""Wanted greatest turning of a curve along one edge."""
SHORTEST = 1e-4
"""Present lengths count as at least this part of `quad_size`."""
SAGITTA = 0.3
"""Wanted greatest bulge of a curve over an edge, of the height of the quad beside it."""
FARTHEST = 2.0
"""Rest lengths differ from present ones, where these count, by no more than this factor."""
LEAST_RATIO = 2.0
"""Rest lengths of neighbours differ by no more than this factor, where they are free."""


@dataclass(frozen=True)
class RestLengths:
    """Rest lengths of a guide grid.

    Attributes
    ----------
    sides : (4, q) float64
        Length of the edge from corner k to corner k + 1 of every quad, filling the area of the face.
    even : (4, q) float64
        The same for squares of the same area: the geometric mean of the sides.
    chains : tuple of (k,) float64
        Lengths of the edges along every curve, adding up to the arc length between its fixed vertices.
    turns : tuple of (k,) float64
        Turning of the curve along every edge at which it bulges by `SAGITTA`; inf where it bulges by less now.
    vertices : (n,) float64
        Mean length at every vertex.
    """

    sides: Float
    even: Float
    chains: tuple[Float, ...]
    turns: tuple[Float, ...]
    vertices: Float


def rest_lengths(
    guide: Guide, model: Model, surfaces: Surfaces, table: CurveTable, *, actual: float = 0.0, graded: bool = True
) -> RestLengths:
    """Make the sizes of a guide grid consistent.

    Parameters
    ----------
    guide : Guide
    model : Model
    surfaces : Surfaces
    table : CurveTable
        Of the model's curves.
    actual : float
        Weight of the present lengths of the edges in the geometric mean with `quad_size`.
    graded : bool
        False leaves out the diffusion.

    Returns
    -------
    RestLengths

    Raises
    ------
    MeshError
        Where neighbours on a curve are not joined by an edge.
    """
    edges, edge_rows = edges_of_quads(guide.quads)
    count = np.bincount(edge_rows.ravel(), minlength=len(edges))
    sides = np.log(guide.quad_size[:, [0, 1, 0, 1]])
    own = np.bincount(edge_rows.ravel(), sides.ravel(), minlength=len(edges)) / count
    chain_edges = _chain_edges(guide, model, edges)
    low, tight = np.full((2, len(edges)), np.inf)
    turns = tuple(np.full(len(rows), np.inf) for rows in chain_edges)
    if actual > 0.0:
        vector = guide.points[edges[:, 1]] - guide.points[edges[:, 0]]
        present = 0.5 * np.log(np.maximum(np.einsum("ec,ec->e", vector, vector), np.finfo(float).tiny))
        present = np.maximum(present, own + np.log(SHORTEST))
        for k in range(4):
            height = 0.5 * np.exp(present[edge_rows[:, k - 1]]) + 0.5 * np.exp(present[edge_rows[:, (k + 1) % 4]])
            np.minimum.at(low, edge_rows[:, k], height)
        own = (1.0 - actual) * own + actual * present
    held = np.zeros(len(edges), dtype=bool)
    cusps = find_cusps(guide, model)
    for row, rows in enumerate(chain_edges):
        fixed = guide.fixed[guide.chains[row]].copy()
        if len(fixed):
            fixed[[0, -1]] = True
        single: Bool = np.logical_and(fixed[:-1], fixed[1:])
        held[rows[single]] = True
        if len(rows):
            places = chain_arclengths(guide, model, row)
            own[rows[single]] = np.log(np.diff(places)[single])
            turning = np.diff(table.at(np.full(len(places), row), places)[0][:, 3])
            own[rows[~single]] -= np.log(np.maximum(turning[~single] / TURN, 1.0))
            if actual > 0.0:
                gap = np.diff(places)
                bulge = np.divide(gap * turning / 8.0, SAGITTA * low[rows], out=np.zeros(len(gap)), where=low[rows] > 0.0)
                most = np.log(gap) - 0.5 * np.log(np.maximum(bulge, 1.0))
                tight[rows[~single]] = np.where(bulge > 1.0, most, np.inf)[~single]
                turns[row][~single] = np.where(bulge > 1.0, turning / np.sqrt(np.maximum(bulge, 1.0)), np.inf)[~single]
    own = np.minimum(own, tight)
    if graded:
        pairs = _neighbours(guide, chain_edges, edges, edge_rows, cusps.quad)
        kept = held
        if len(cusps.quad):
            own, kept = kites(own, held, cusps, edge_rows, chain_edges, model, table)
        own = _limit(_diffuse(own, pairs, kept), pairs, kept)
        if actual > 0.0:
            own = present + np.clip(own - present, -np.log(FARTHEST), np.log(FARTHEST))
            own = np.minimum(own, tight)
    length = np.exp(own)
    chains = tuple(
        _fill_chain(length[rows], guide, model, row) if len(rows) else np.zeros(0) for row, rows in enumerate(chain_edges)
    )
    for rows, chain in zip(chain_edges, chains):
        length[rows] = chain
    per_quad = length[edge_rows].T
    target = 0.25 * (per_quad[0] + per_quad[2]) * (per_quad[1] + per_quad[3])
    faces = len(model.faces)
    wanted = np.bincount(guide.quad_face, target, minlength=faces)
    area = np.abs(np.bincount(guide.quad_face, _signed_areas(guide, surfaces), minlength=faces))
    scale = np.sqrt(np.divide(area, wanted, out=np.ones(faces), where=(wanted > 0.0) & (area > 0.0)))[guide.quad_face]
    ends = edges.ravel()
    at_vertex = np.bincount(ends, np.repeat(np.log(length), 2), minlength=len(guide.points))
    degree = np.bincount(ends, minlength=len(guide.points))
    return RestLengths(
        sides=per_quad * scale,
        even=np.tile(np.sqrt(target) * scale, (4, 1)),
        chains=chains,
        turns=turns,
        vertices=np.exp(at_vertex / np.maximum(degree, 1)),
    )


def _chain_edges(guide: Guide, model: Model, edges: Int) -> list[Int]:
    """Row of `edges` of every edge of every chain."""
    base = len(guide.points)
    keys = edges[:, 0] * base + edges[:, 1]
    rows = []
    for row, chain in enumerate(guide.chains):
        ends = np.sort(np.column_stack([chain[:-1], chain[1:]]), axis=1)
        wanted = ends[:, 0] * base + ends[:, 1]
        found = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
        if (keys[found] != wanted).any():
            raise MeshError(
                "neighbours on a curve are not joined by an edge of the guide grid",
                entity=(1, model.curves[row].tag),
                remedy="another size may help",
            )
        rows.append(found)
    return rows


def _neighbours(guide: Guide, chain_edges: list[Int], edges: Int, quad_edges: Int, kites: Int) -> Int:
    """Pairs of edges that should have similar lengths (p, 2): opposite in a quad, or continuing at a vertex.

    Opposite edges of quads in cusps (`kites`) have nothing to do with each other.

    Two edges continue each other at a vertex if it is regular and they share no quad there; on a curve if they follow
    each other along it.  Both are found from the quads alone: at an interior vertex of valence 4 every edge meets the
    other two edges of its two quads once, so its continuation is the sum of all four edges less these and itself.
    """
    across = np.concatenate([quad_edges[:, [0, 2]], quad_edges[:, [1, 3]]])
    if len(kites):
        across = np.delete(across, np.concatenate([kites, kites + len(quad_edges)]), axis=0)
    n = len(guide.points)
    corner = guide.quads.ravel()
    out = quad_edges.ravel()
    back = np.roll(quad_edges, 1, axis=1).ravel()
    regular = (np.bincount(corner, minlength=n) == 4) & (guide.cad_vertex < 0)
    keep = regular[corner]
    # At (vertex, edge) half-edges: total of the edges around the vertex, and of the edges met through a quad.
    vertex, one, two = corner[keep], out[keep], back[keep]
    total = np.bincount(vertex, one, minlength=n)
    half = np.concatenate([vertex * len(edges) + one, vertex * len(edges) + two])
    met = np.concatenate([two, one])
    keys, inverse, times = np.unique(half, return_inverse=True, return_counts=True)
    at, edge = keys // len(edges), keys % len(edges)
    other = np.rint(total[at] - np.bincount(inverse, met.astype(float)) - edge).astype(np.int64)
    good = (times == 2) & (other > edge) & (other < len(edges))
    along = np.column_stack([edge[good], other[good]])
    on_curves = [np.column_stack([rows[:-1], rows[1:]]) for rows in chain_edges]
    return np.concatenate([across, along, *on_curves])


def _diffuse(own: Float, pairs: Int, held: Bool) -> Float:
    n = len(own)
    i, j = np.concatenate([pairs, pairs[:, ::-1]]).T
    weight = ANCHOR + np.bincount(i, minlength=n)
    u = own.copy()
    for _ in range(SWEEPS):
        u = np.where(held, own, (ANCHOR * own + np.bincount(i, u[j], minlength=n)) / weight)
    return u


def _limit(u: Float, pairs: Int, held: Bool) -> Float:
    free = pairs[~held[pairs].any(axis=1)]
    i, j = np.concatenate([free, free[:, ::-1]]).T
    share = 1.0 / (1.0 + np.bincount(i, minlength=len(u)))
    bound = float(np.log(LEAST_RATIO))
    for _ in range(SWEEPS):
        step = u[j] - u[i]
        excess = step - np.clip(step, -bound, bound)
        if not excess.any():
            break
        u = u + np.bincount(i, excess, minlength=len(u)) * share
    return u


def _fill_chain(length: Float, guide: Guide, model: Model, row: int) -> Float:
    """Scale the lengths along a curve to the arc length between its fixed vertices."""
    fixed = guide.fixed[guide.chains[row]].copy()
    fixed[[0, -1]] = True
    at = np.flatnonzero(fixed)
    span = np.diff(chain_arclengths(guide, model, row)[at])
    return length * np.repeat(span / np.add.reduceat(length, at[:-1]), np.diff(at))


def _signed_areas(guide: Guide, surfaces: Surfaces) -> Float:
    corners = guide.points[guide.quads]
    normals = quad_normals(surfaces, guide.points, guide.quads, guide.quad_face)
    diagonals = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    area: Float = 0.5 * np.einsum("qc,qc->q", diagonals, normals)
    return area
