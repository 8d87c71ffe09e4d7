"""Closed edge paths around the handles of a surface.

On a surface of genus g there are 2 g independent classes of loops that neither bound a disc nor go around boundary loops only.  A
tree of shortest edge paths from a root and a tree of triangles across edges that are not in it (every boundary loop closed by
one more cell) leave 2 g edges; each closes a loop through the root.  The second tree prefers the edges whose loops are long, so
that short loops remain (Erickson, Whittlesey 2005).

Moving a quarter turn of index along such a loop changes no index, but how often the cross turns on the way across the loop.
"""

from __future__ import annotations

import numpy as np

from .surface_mesh import SurfaceMesh

__all__ = ["handle_loops"]


def handle_loops(mesh: SurfaceMesh) -> list[list[int]]:
    """The 2 g loops of all components, each a closed edge path (first vertex repeated)."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import dijkstra, minimum_spanning_tree

    parts = len(mesh.component_euler)
    wanted = 2 * parts - int(mesh.component_euler.sum()) - len(mesh.loops)
    if wanted == 0:
        return []
    n, m, edges = len(mesh.points), len(mesh.triangles), mesh.edges
    a, b = edges.T
    # shortest paths keep off the boundary, where there is no room for a step
    length = mesh.edge_length + mesh.boundary_vertex[edges].any(axis=1) * mesh.edge_length.sum()
    graph = coo_matrix((length, (a, b)), (n, n)).tocsr()
    roots = np.unique(mesh.components, return_index=True)[1]
    distance, before, _ = dijkstra(graph, directed=False, indices=roots, min_only=True, return_predecessors=True)
    in_tree = (before[a] == b) | (before[b] == a)

    cap = np.full(n, -1)
    for row, loop in enumerate(mesh.loops):
        cap[loop] = m + row
    first, second = mesh.edge_half_edges.T
    left, right = first // 3, np.where(second >= 0, second // 3, cap[a])
    cells = m + len(mesh.loops)
    low, high = np.minimum(left, right), np.maximum(left, right)
    around = distance[a] + distance[b] + length
    rows = np.flatnonzero(~in_tree)
    rows = rows[np.argsort(-around[rows], kind="stable")]
    key, unique = np.unique((low * cells + high)[rows], return_index=True)
    dual = coo_matrix((1.0 + unique, (key // cells, key % cells)), (cells, cells)).tocsr()
    used = (minimum_spanning_tree(dual).data - 1.0).astype(np.int64)
    crossed = np.zeros(len(edges), bool)
    crossed[rows[used]] = True
    return [_loop(before.tolist(), *edges[e].tolist()) for e in np.flatnonzero(~in_tree & ~crossed)]


def _loop(before: list[int], a: int, b: int) -> list[int]:
    """From the last common vertex of two tree paths to a, across to b, and back."""
    paths = []
    for v in (a, b):
        path = [v]
        while before[path[-1]] >= 0:
            path.append(before[path[-1]])
        paths.append(path[::-1])
    common = 0
    while common < min(map(len, paths)) and paths[0][common] == paths[1][common]:
        common += 1
    return paths[0][common - 1 :] + paths[1][common - 1 :][::-1]
