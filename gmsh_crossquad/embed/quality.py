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

from ..records import Float, Guide, Int, Model

__all__ = ["guide_quality", "scaled_jacobian"]

CHUNK = 1 << 16
"""Quads per pass: keeps the temporaries of a pass in the cache and the memory bounded for millions of quads."""


def scaled_jacobian(points: Float, quads: Int, normals: Float) -> Float:
    """Least signed scaled Jacobian of every quad.

    Parameters
    ----------
    points : (n, 3) float64
    quads : (q, 4) int64
    normals : (q, 3) or (3,) float64
        Unit normal of every quad's face, or one for all.

    Returns
    -------
    (q,) float64
        In [-1, 1]; 0 where an edge has no length.
    """
    out = np.empty(len(quads))
    for low in range(0, len(quads), CHUNK):
        part = slice(low, low + CHUNK)
        out[part] = _least_corner(points, quads[part], normals if normals.ndim == 1 else normals[part])
    return out


def _least_corner(points: Float, quads: Int, normals: Float) -> Float:
    corners = points[quads]
    edge = np.roll(corners, -1, axis=1) - corners
    length = np.sqrt(np.einsum("qkc,qkc->qk", edge, edge))
    back = -np.roll(edge, 1, axis=1)
    cross = np.cross(edge, back)
    subscripts = "qkc,c->qk" if normals.ndim == 1 else "qkc,qc->qk"
    sine = np.einsum(subscripts, cross, normals)
    scale = length * np.roll(length, 1, axis=1)
    ratio = np.divide(sine, scale, out=np.zeros_like(sine), where=scale > 0.0)
    least: Float = ratio.min(axis=1)
    return least


def guide_quality(guide: Guide, model: Model) -> Float:
    """Least scaled Jacobian (q,) of every quad of a guide grid, against its face's normal."""
    normals = np.array([np.cross(*face.axes) for face in model.faces])
    return scaled_jacobian(guide.points, guide.quads, normals[guide.quad_face])
