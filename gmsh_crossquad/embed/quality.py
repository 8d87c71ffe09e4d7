"""Quality of quadrilaterals: the scaled Jacobian.

At corner k of a quad with edge vectors e (to the next corner) and f (to the previous one) and face normal n

    J_k = n . (e x f) / (|e| |f|)  =  sine of the corner's angle, signed,

and the quality of the quad is the least of the four.  It is 1 for a rectangle, 0 for a degenerate corner, negative where
the corner is turned over.

References
----------
.. [1] P. M. Knupp, "Algebraic mesh quality metrics for unstructured initial meshes", Finite Elements in Analysis and
   Design 39, 2003, 217-241.
"""

from __future__ import annotations

import numpy as np

from ..cusps import cusp_corners
from ..records import Bool, Float, Guide, Int, Model
from ..surfaces import Surfaces, quad_normals

__all__ = ["guide_quality", "scaled_jacobian"]

CHUNK = 1 << 14
"""Quads per pass: keeps the temporaries of a pass in the cache and the memory bounded for millions of quads."""


def scaled_jacobian(points: Float, quads: Int, normals: Float, cusps: Bool | None = None) -> Float:
    """Least signed scaled Jacobian of every quad.

    Parameters
    ----------
    points : (n, 3) float64
    quads : (q, 4) int64
    normals : (q, 3) or (3,) float64
        Unit normal of every quad's face, or one for all.
    cusps : (q, 4) bool, optional
        Corners that count as 1 where they are not turned over.

    Returns
    -------
    (q,) float64
        In [-1, 1]; 0 where an edge has no length.
    """
    out = np.empty(len(quads))
    columns = np.ascontiguousarray(points.T)
    for low in range(0, len(quads), CHUNK):
        part = slice(low, low + CHUNK)
        out[part] = _least_corner(
            columns, quads[part], normals if normals.ndim == 1 else normals[part].T, None if cusps is None else cusps[part]
        )
    return out


def _least_corner(columns: Float, quads: Int, normals: Float, cusps: Bool | None) -> Float:
    """Coordinate by coordinate, corner by corner: `columns` (3, n), `normals` (3,) or (3, q)."""
    corner = np.ascontiguousarray(quads.T)
    edge = np.empty((3, *corner.shape))
    for c in range(3):
        x = columns[c].take(corner)
        np.subtract(x[1:], x[:-1], out=edge[c, :-1])
        np.subtract(x[0], x[-1], out=edge[c, -1])
    length = np.sqrt(edge[0] ** 2 + edge[1] ** 2 + edge[2] ** 2)
    least = np.full(len(quads), np.inf)
    for k in range(4):
        (ax, ay, az), (bx, by, bz) = edge[:, k - 1], edge[:, k]
        sine = normals[0] * (ay * bz - az * by) + normals[1] * (az * bx - ax * bz) + normals[2] * (ax * by - ay * bx)
        scale = length[k - 1] * length[k]
        sine = np.divide(sine, scale, out=np.zeros_like(sine), where=scale > 0.0)
        if cusps is not None:
            sine[cusps[:, k] & (sine > 0.0)] = 1.0
        np.minimum(least, sine, out=least)
    return least


def guide_quality(guide: Guide, surfaces: Surfaces, model: Model) -> Float:
    """Least scaled Jacobian (q,) of every quad of a guide grid, against its face's normal or, on a curved face, its own.

    Corners in cusps count only where they are turned over.
    """
    cusps = cusp_corners(guide, model)
    normals = quad_normals(surfaces, guide.points, guide.quads, guide.quad_face)
    return scaled_jacobian(guide.points, guide.quads, normals, cusps if cusps.any() else None)
