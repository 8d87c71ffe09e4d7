"""Split triangles so that a cross field has room between boundaries.

A field that is fixed on the boundary has no freedom in a triangle whose three vertices are on it, and a trace cannot leave a
corner between two neighbouring boundary edges.  `open_up` splits

- every inner edge that joins two boundary vertices, at its midpoint;
- every triangle whose three edges are boundary, at its centroid;
- the edge opposite a corner in every triangle of its fan, until the fan has one triangle for each `FAN_ANGLE`, and two at least.

Edges are split together, by the template of the number of marked edges of a triangle (1: 2 triangles, 2: 3, 3: 4).
"""

from __future__ import annotations

import numpy as np

from ..records import Bool, Float, Int
from .surface_mesh import SurfaceMesh

__all__ = ["open_up", "split_edges"]

FAN_ANGLE = np.radians(40.0)
FAN_ROUNDS = 3


def split_edges(points: Float, triangles: Int, marked: Bool) -> tuple[Float, Int]:
    """Split the marked edges (rows of `SurfaceMesh.edges`) at their midpoints.

    Parameters
    ----------
    points : (n, d) float64
    triangles : (m, 3) int64
    marked : (e,) bool

    Returns
    -------
    points : (n + k, d) float64
        The k midpoints follow the old points, in the order of the edges.
    triangles : (m', 3) int64
        Same orientation.
    """
    mesh = SurfaceMesh(points, triangles)
    edges = mesh.edges[marked]
    middle = np.full(len(mesh.edges), -1, np.int64)
    middle[marked] = len(points) + np.arange(len(edges))
    new_points = np.concatenate([points, points[edges].mean(axis=1)])
    m = middle[mesh.triangle_edges]  # (m, 3): midpoint on half-edge k or -1
    count = (m >= 0).sum(axis=1)
    out = [triangles[count == 0]]
    # turn every triangle so that its marked edges come first (one: edge 0; two: edges 0 and 1)
    turn = np.where(count == 1, np.argmax(m >= 0, axis=1), (np.argmin(m >= 0, axis=1) + 1) % 3)
    column = (turn[:, None] + np.arange(3)) % 3
    t, m = np.take_along_axis(triangles, column, axis=1), np.take_along_axis(m, column, axis=1)

    one = count == 1
    (a, b, c), p = t[one].T, m[one, 0]
    out += [np.stack([a, p, c], axis=1), np.stack([p, b, c], axis=1)]

    two = count == 2
    (a, b, c), p, q = t[two].T, m[two, 0], m[two, 1]
    out.append(np.stack([p, b, q], axis=1))
    # the remaining quadrangle a p q c by its shorter diagonal
    short = np.linalg.norm(new_points[a] - new_points[q], axis=1) <= np.linalg.norm(new_points[p] - new_points[c], axis=1)
    out.append(np.where(short[:, None], np.stack([a, p, q], axis=1), np.stack([a, p, c], axis=1)))
    out.append(np.where(short[:, None], np.stack([a, q, c], axis=1), np.stack([p, q, c], axis=1)))

    three = count == 3
    (a, b, c), (p, q, r) = t[three].T, m[three].T
    out += [np.stack(s, axis=1) for s in ((a, p, r), (p, b, q), (r, q, c), (p, q, r))]
    return new_points, np.concatenate(out)


def _split_isolated(points: Float, triangles: Int) -> tuple[Float, Int]:
    """Split triangles with three boundary edges at their centroids."""
    mesh = SurfaceMesh(points, triangles)
    alone = mesh.boundary_edge[mesh.triangle_edges].all(axis=1)
    if not alone.any():
        return points, triangles
    a, b, c = triangles[alone].T
    centre = len(points) + np.arange(len(a))
    new = [triangles[~alone]] + [np.stack(s, axis=1) for s in ((a, b, centre), (b, c, centre), (c, a, centre))]
    return np.concatenate([points, points[triangles[alone]].mean(axis=1)]), np.concatenate(new)


def open_up(points: Float, triangles: Int, corner: Bool) -> tuple[Float, Int]:
    """Split as the module describes.

    Parameters
    ----------
    points : (n, d) float64
    triangles : (m, 3) int64
    corner : (n,) bool
        Boundary points whose fans need room.

    Returns
    -------
    points : (n + k, d) float64
        New points follow the old ones; none is on the boundary.
    triangles : (m', 3) int64
    """
    mesh = SurfaceMesh(points, triangles)
    across = mesh.boundary_vertex[mesh.edges].all(axis=1) & ~mesh.boundary_edge
    points, triangles = split_edges(points, triangles, across)
    points, triangles = _split_isolated(points, triangles)
    for _ in range(FAN_ROUNDS):
        mesh = SurfaceMesh(points, triangles)
        is_corner = np.zeros(len(points), bool)
        is_corner[: len(corner)] = corner
        fan = np.bincount(triangles.ravel(), minlength=len(points))
        need = np.maximum(2, np.ceil(mesh.angle_sum / FAN_ANGLE - 1e-9))
        wide = is_corner[triangles] & (mesh.corner_angle > (mesh.angle_sum / need)[triangles] + 1e-9)
        wide &= (fan < need)[triangles]
        opposite = np.roll(mesh.triangle_edges, -1, axis=1)
        marked = np.zeros(len(mesh.edges), bool)
        marked[opposite[wide]] = True
        marked &= ~mesh.boundary_edge
        if not marked.any():
            break
        points, triangles = split_edges(points, triangles, marked)
    return points, triangles
