"""Blocks of a quad complex: the patches of its base complex.

Lines leave every irregular vertex (of a face: interior valence other than 4, boundary valence other than 2) and run straight
through regular vertices to the face's boundary or another irregular vertex.  Together with the CAD curves they cut the face
into four-sided blocks.  A ring without irregular vertices gets one cut, from its lowest CAD vertex or vertex.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ..quad_edges import edges_of_quads
from ..records import Bool, Int

__all__ = ["base_complex"]


def base_complex(quads: Int, quad_face: Int, curve_edges: Int, n_vertices: int, corner: Bool) -> tuple[Int, Int]:
    """Block of every quad.

    Parameters
    ----------
    quads : (q, 4) int64
    quad_face : (q,) int64
    curve_edges : (k, 2) int64
        Edges on CAD curves; they separate blocks.
    n_vertices : int
    corner : (n,) bool
        CAD vertices (used only to place the cut of a ring).

    Returns
    -------
    block : (q,) int64
    separators : (s, 2) int64
        Edges between blocks, CAD curves included.
    """
    edges, edge_rows = edges_of_quads(quads)
    keys = edges[:, 0] * n_vertices + edges[:, 1]
    mark = np.zeros(len(edges), bool)
    lo, hi = curve_edges.min(axis=1), curve_edges.max(axis=1)
    mark[np.searchsorted(keys, lo * n_vertices + hi)] = True
    flat = edge_rows.ravel()
    order = np.argsort(flat, kind="stable")
    count = np.bincount(flat, minlength=len(edges))
    first = np.concatenate([[0], np.cumsum(count)[:-1]])
    twin = np.full(4 * len(quads), -1, np.int64)
    two = np.flatnonzero((count == 2) & ~mark)
    a, b = order[first[two]], order[first[two] + 1]
    twin[a], twin[b] = b, a

    corners = np.arange(4 * len(quads)).reshape(-1, 4)
    following = np.roll(corners, -1, axis=1).ravel()
    previous = np.roll(corners, 1, axis=1).ravel()
    origin = quads.ravel()
    on_curve = np.zeros(n_vertices, bool)
    on_curve[curve_edges.ravel()] = True
    # fans of corners around a vertex, separated by CAD curves: a regular fan has 4 corners inside, 2 at a curve
    spokes = np.flatnonzero(twin >= 0)
    m = 4 * len(quads)
    links = coo_array((np.ones(len(spokes)), (spokes, following[twin[spokes]])), shape=(m, m))
    fan = connected_components(links, directed=False)[1].astype(np.int64)
    fan_size = np.bincount(fan)
    irregular_fan = fan_size != np.where(on_curve[_first_origin(fan, origin)], 2, 4)

    _mark_lines(twin, following, previous, fan, irregular_fan, flat, mark)
    while True:
        inner = np.flatnonzero((twin >= 0) & ~mark[flat])
        neighbours = coo_array((np.ones(len(inner)), (inner // 4, twin[inner] // 4)), shape=(len(quads), len(quads)))
        block = connected_components(neighbours, directed=False)[1].astype(np.int64)
        ring = _ring(block, quads, flat, mark, twin, following, corner)
        if ring < 0:
            break
        _line(ring, twin, following, mark, flat, None)
    return block, edges[mark]


def _first_origin(fan: Int, origin: Int) -> Int:
    out = np.zeros(int(fan.max()) + 1, np.int64)
    out[fan] = origin
    return out


def _mark_lines(twin: Int, following: Int, previous: Int, fan: Int, irregular_fan: Bool, flat: Int, mark: Bool) -> None:
    """Mark the straight lines that leave irregular fans."""
    for h in np.flatnonzero(irregular_fan[fan]).tolist():
        for start in (h, int(twin[previous[h]])):
            if start >= 0 and not mark[flat[start]]:
                _line(start, twin, following, mark, flat, irregular_fan[fan])


def _line(h: int, twin: Int, following: Int, mark: Bool, flat: Int, stop: Bool | None) -> None:
    """Mark edges straight on from half-edge `h` until a curve, a marked edge or a corner where `stop` holds."""
    while h >= 0 and not mark[flat[h]]:
        mark[flat[h]] = True
        corner = following[h]
        if stop is not None and stop[corner]:
            return
        across = twin[corner]
        h = int(following[across]) if across >= 0 else -1


def _ring(block: Int, quads: Int, flat: Int, mark: Bool, twin: Int, following: Int, corner: Bool) -> int:
    """A half-edge at which to cut a block that is not four-sided, or -1."""
    side = mark[flat] | (twin < 0)
    turns = side & side[np.roll(np.arange(len(flat)).reshape(-1, 4), 1, axis=1).ravel()]
    n_corners = np.bincount(block, turns.reshape(-1, 4).sum(axis=1), minlength=int(block.max()) + 1)
    bad = np.flatnonzero(n_corners != 4)
    if not len(bad):
        return -1
    rows = np.flatnonzero(block == bad[0])
    half = (4 * rows[:, None] + np.arange(4)).ravel()
    half = half[~side[half]]
    if not len(half):
        return -1
    origin = quads.ravel()[half]
    on_side = np.zeros(int(quads.max()) + 1, bool)
    side_half = (4 * rows[:, None] + np.arange(4)).ravel()
    side_half = side_half[side[side_half]]
    on_side[quads.ravel()[side_half]] = True
    on_side[quads.ravel()[following[side_half]]] = True
    rank = np.where(corner[origin], 0, np.where(on_side[origin], 1, 2)) * (len(on_side) + 1) + origin
    return int(half[np.argmin(rank)])
