"""The force that the smooth part of a cross field exerts on its singularities.

The harmonic field of singularities at a_i has, up to a constant per core, the energy ``E(a) = 1/2 int |grad theta|^2``.  Its
negative gradient is the configurational force (Eshelby 1951), a contour integral of ``W n - grad theta (grad theta . n)``
around a_i with ``W = |grad theta|^2 / 2``, taken here as the area integral

    f_i = int (grad theta (grad theta . grad eta) - W grad eta) dA,    eta = 1 near a_i and 0 beyond its clearance,

which never looks at the core and is one sum over the vertices.
"""

from __future__ import annotations

import numpy as np

from ..records import Float
from .surface_mesh import SurfaceMesh

__all__ = ["forces", "gradient"]


def gradient(mesh: SurfaceMesh, rotation: Float) -> Float:
    """(m, 2) gradient of the cross angle in every triangle of a plane mesh; triangle indices must be 0."""
    p = mesh.points[mesh.triangles]
    d = np.roll(p, -1, axis=1) - p
    inward = np.stack([-d[..., 1], d[..., 0]], axis=2)
    value = np.concatenate([np.zeros((len(p), 1)), np.cumsum(rotation[:, :2], axis=1)], axis=1)
    # the basis function of edge k is 1 - 2 * (barycentric coordinate of the opposite vertex)
    return -np.einsum("tk,tkc->tc", value, inward) / mesh.area[:, None]


def forces(mesh: SurfaceMesh, rotation: Float, positions: Float, reach: Float) -> Float:
    """Forces on singularities.

    Parameters
    ----------
    rotation : (m, 3) float64
        Of a harmonic field.
    positions : (k, 2) float64
    reach : (k,) float64
        No other singularity and no boundary may be within this distance.

    Returns
    -------
    (k, 2) float64
        Minus the derivative of the Dirichlet energy by the position.
    """
    g = gradient(mesh, rotation)
    p = mesh.points[mesh.triangles]
    d = np.roll(p, -1, axis=1) - p
    # area times the gradient of the barycentric coordinate of vertex k + 2, which is opposite of edge k
    slope = 0.5 * np.stack([-d[..., 1], d[..., 0]], axis=2)
    density = 0.5 * np.sum(g * g, axis=1)
    part = np.sum(slope * g[:, None], axis=2)[..., None] * g[:, None] - density[:, None, None] * slope
    opposite = np.roll(mesh.triangles, -2, axis=1).ravel()
    nodal = [np.bincount(opposite, part[..., c].ravel(), len(mesh.points)) for c in range(2)]
    force = np.stack(nodal, axis=1)
    out = np.zeros((len(positions), 2))
    for k, radius in enumerate(reach.tolist()):
        x, y = (mesh.points - positions[k]).T
        square = x * x + y * y
        near = np.flatnonzero(square < radius * radius)
        out[k] = np.minimum((radius - np.sqrt(square[near])) / (0.7 * radius), 1.0) @ force[near]
    return out
