"""Lower bounds of the Jacobian of quads of order p, seen along one direction.

With the normal n of the straight quad, J = n . (x_u times x_v) is a polynomial of degree 2 p - 1 in both coordinates.  Its
Bernstein coefficients bound it from below, and so do those on parts of the quad, the closer the smaller the parts.

References
----------
.. [1] A. Johnen, J.-F. Remacle, C. Geuzaine, "Geometrical validity of curvilinear finite elements", Journal of Computational
   Physics 233, 2013, 359-372.
"""

from __future__ import annotations

from functools import cache
from math import comb

import numpy as np

from ..records import Float

__all__ = ["corner_jacobian", "jacobian_matrices", "least_jacobian", "quad_normals"]

CHUNK = 1 << 14
PARTS = 4  # per direction, for quads that the bound on the whole leaves open


def quad_normals(corners: Float) -> Float:
    """Unit area vectors (q, 3) of quads with `corners` (q, 4, 3); zero where there is no area."""
    area = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    length = np.linalg.norm(area, axis=1, keepdims=True)
    out: Float = np.divide(area, length, out=np.zeros_like(area), where=length > 0.0)
    return out


def corner_jacobian(corners: Float, normals: Float) -> Float:
    """Least Jacobian (q,) of bilinear quads with `corners` (q, 4, 3): that of a corner, as it is linear along every side."""
    side = np.roll(corners, -1, axis=1) - corners
    out: Float = np.einsum("qkc,qc->qk", np.cross(np.roll(side, 1, axis=1), side), normals).min(axis=1)
    return out


def least_jacobian(grids: Float, normals: Float, enough: Float) -> Float:
    """Lower bound of the Jacobian of quads.

    Parameters
    ----------
    grids : (q, p + 1, p + 1, 3) float64
        Nodes, the first index along u.
    normals : (q, 3) float64
    enough : (q,) float64
        A bound above that need not be sharp.

    Returns
    -------
    (q,) float64
    """
    out = np.empty(len(grids))
    for low in range(0, len(grids), CHUNK):
        part = slice(low, low + CHUNK)
        out[part] = _bound(grids[part], normals[part], 1)
    open_ = np.flatnonzero(out <= enough)
    for low in range(0, len(open_), CHUNK):
        rows = open_[low : low + CHUNK]
        out[rows] = _bound(grids[rows], normals[rows], PARTS)
    return out


def _bound(grids: Float, normals: Float, parts: int) -> Float:
    """Least Bernstein coefficient on `parts` x `parts` parts of every quad."""
    n = len(grids)
    x = grids.reshape(n, -1, 3) - grids[:, :1, 0]
    # J is that of the projection along the normal
    first = grids[:, -1, 0] - grids[:, 0, 0]
    first -= np.einsum("qc,qc->q", first, normals)[:, None] * normals
    length = np.linalg.norm(first, axis=1)
    first /= np.where(length > 0, length, 1.0)[:, None]
    second = np.cross(normals, first)
    a, b = np.einsum("qnc,qc->qn", x, first), np.einsum("qnc,qc->qn", x, second)
    out = np.full(n, np.inf)
    for along, across, coefficients in jacobian_matrices(grids.shape[1] - 1, parts):
        value = (a @ along) * (b @ across)
        value -= (a @ across) * (b @ along)
        np.minimum(out, (value @ coefficients).min(axis=1), out=out)
    # a quad whose first side has no length along the plane has a corner without Jacobian
    return np.where(length > 0, out, np.minimum(out, 0.0))


@cache
def jacobian_matrices(p: int, parts: int) -> tuple[tuple[Float, Float, Float], ...]:
    """Matrices to Bernstein coefficients of the Jacobian on `parts` x `parts` parts of an element of order p.

    Returns
    -------
    tuple of (along, across, coefficients)
        For every part, from nodes ((p + 1)^2, s) to derivatives along u and v at s = (2 p)^2 places, and from Jacobians there
        (s, s) to Bernstein coefficients.
    """
    nodes = np.arange(p + 1) / p
    local = np.arange(2 * p) / (2 * p - 1)
    lagrange = np.linalg.inv(np.vander(nodes, increasing=True))
    degree, powers = 2 * p - 1, np.arange(1, p + 1)
    bernstein = np.array([[comb(degree, k) * t**k * (1 - t) ** (degree - k) for k in range(degree + 1)] for t in local])
    inverse = np.linalg.inv(bernstein)
    lines = []
    for part in range(parts):
        t = (part + local) / parts
        lines.append((np.vander(t, p + 1, increasing=True) @ lagrange, (powers * t[:, None] ** (powers - 1)) @ lagrange[1:]))

    def product(u: Float, v: Float) -> Float:
        out: Float = np.einsum("si,tj->ijst", u, v).reshape(u.shape[1] * v.shape[1], -1)
        return out

    coefficients = product(inverse, inverse)
    return tuple((product(du, v), product(u, dv), coefficients) for u, du in lines for v, dv in lines)
