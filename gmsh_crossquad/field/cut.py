"""Cut a triangle mesh open along edges.

The corners of the triangles are glued across every edge that is neither cut nor on the boundary; each class of glued corners is
one point of the cut mesh.  Points therefore split into as many copies as they have sectors: the tip of a cut that ends
inside stays one point (its fan still closes around it), a point inside a cut becomes two, a meeting of n cuts becomes n, and a
point where the boundary touches itself becomes one per fan.
"""

from __future__ import annotations

import numpy as np

from ..records import Int

__all__ = ["cut_open"]


def cut_open(triangles: Int, n_points: int, cut_edges: Int) -> tuple[Int, Int]:
    """Duplicate points so that both sides of the cut edges become boundary.

    Parameters
    ----------
    triangles : (m, 3) int64
        Consistently oriented.
    n_points : int
    cut_edges : (c, 2) int64
        Point pairs in any order; pairs that are no inner edge have no effect.

    Returns
    -------
    triangles : (m, 3) int64
        The same triangles over the new points.
    source : (k,) int64
        Original point of every new point; sorted, so an original without copies keeps its place in the order.  Points
        that no triangle uses vanish.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    flat = triangles.ravel()
    corner = np.arange(len(flat))
    following = corner - corner % 3 + (corner + 1) % 3
    start, end = flat, flat[following]
    key = np.minimum(start, end) * n_points + np.maximum(start, end)
    cut = np.sort(np.asarray(cut_edges, np.int64).reshape(-1, 2), axis=1)
    glued = ~np.isin(key, cut[:, 0] * n_points + cut[:, 1])
    order = np.argsort(key, kind="stable")
    a, b = order[:-1], order[1:]
    pair = (key[a] == key[b]) & glued[a]
    a, b = a[pair], b[pair]
    # half-edge a runs against half-edge b: the start of one is the end of the other
    rows = np.concatenate([a, following[a]])
    columns = np.concatenate([following[b], b])
    graph = coo_array((np.ones(len(rows), np.int8), (rows, columns)), shape=(len(flat), len(flat)))
    _, label = connected_components(graph, directed=False)
    _, first = np.unique(label, return_index=True)
    # new points in the order of their original point, then of their first corner
    rank = np.argsort(np.lexsort((first, flat[first])), kind="stable")
    source = np.sort(flat[first], kind="stable")
    return rank[label].reshape(-1, 3), source
