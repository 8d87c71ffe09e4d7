"""The force that the smooth part of a cross field exerts on its singularities.

The harmonic field of singularities at a_i has, up to a constant per core, the energy ``E(a) = 1/2 int |grad theta|^2``.  Its
negative gradient is the configurational force (Eshelby 1951), a contour integral of ``W n - grad theta (grad theta . n)``
around a_i with ``W = |grad theta|^2 / 2``, taken here as the area integral

    f_i = int (grad theta (grad theta . grad eta) - W grad eta) dA,    eta = 1 near a_i and 0 beyond its clearance,

which never looks at the core and is one sum over the vertices.  On a curved surface the vectors are taken in space and the result
is not quite tangential; eta also vanishes where the surface has turned by more than a right angle.
"""

from __future__ import annotations

import numpy as np

from ..records import Float
from .surface_mesh import SurfaceMesh
from .tangents import quarter_turn

__all__ = ["forces", "gradient"]


def gradient(mesh: SurfaceMesh, rotation: Float) -> Float:
    """(m, d) gradient of the cross angle in every triangle; triangle indices must be 0."""
    inward = _inward(mesh)
    p = mesh.points[mesh.triangles]
    value = np.concatenate([np.zeros((len(p), 1)), np.cumsum(rotation[:, :2], axis=1)], axis=1)
    # the basis function of edge k is 1 - 2 * (barycentric coordinate of the opposite vertex)
    return -np.einsum("tk,tkc->tc", value, inward) / mesh.area[:, None]


def forces(mesh: SurfaceMesh, rotation: Float, positions: Float, reach: Float) -> Float:
    """Forces on singularities.

    Parameters
    ----------
    rotation : (m, 3) float64
        Of a harmonic field.
    positions : (k, d) float64
    reach : (k,) float64
        No other singularity and no boundary may be within this distance.

    Returns
    -------
    (k, d) float64
        Minus the derivative of the Dirichlet energy by the position.
    """
    g = gradient(mesh, rotation)
    # area times the gradient of the barycentric coordinate of vertex k + 2, which is opposite of edge k
    slope = 0.5 * _inward(mesh)
    density = 0.5 * np.sum(g * g, axis=1)
    part = np.sum(slope * g[:, None], axis=2)[..., None] * g[:, None] - density[:, None, None] * slope
    opposite = np.roll(mesh.triangles, -2, axis=1).ravel()
    nodal = [np.bincount(opposite, part[..., c].ravel(), len(mesh.points)) for c in range(part.shape[2])]
    force = np.stack(nodal, axis=1)
    out = np.zeros_like(positions)
    for k, radius in enumerate(reach.tolist()):
        square = sum(x * x for x in (mesh.points - positions[k]).T)
        near = np.flatnonzero(square < radius * radius)
        eta = np.minimum((radius - np.sqrt(square[near])) / (0.7 * radius), 1.0)
        if mesh.vertex_normal is not None:
            # what lies behind, on the other side of a thin part, is not near
            facing = mesh.vertex_normal[near] @ mesh.vertex_normal[np.argmin(square)]
            eta = np.minimum(eta, np.maximum(2.0 * facing, 0.0))
        out[k] = eta @ force[near]
    return out


def _inward(mesh: SurfaceMesh) -> Float:
    """(m, 3, d) half-edges turned into their triangle."""
    p = mesh.points[mesh.triangles]
    normal = mesh.triangle_normal
    return quarter_turn(np.roll(p, -1, axis=1) - p, None if normal is None else normal[:, None])
