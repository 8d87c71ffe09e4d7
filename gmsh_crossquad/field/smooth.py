"""The default cross field: smooth, of unit length, aligned with the boundary.

A cross of angle a is the unit complex number ``z = exp(4 i a)``.  The Ginzburg–Landau energy
``1/2 int |grad z|^2 + (|z|^2 - 1)^2 / (4 eps^2)`` with z given on the boundary is minimised by diffusion-generated motion
(Merriman, Bence, Osher 1992; for cross fields Viertel, Osting 2019): diffuse for a time tau, bring every z back to unit
length, and repeat with a smaller tau,

    (M + tau K) z_new = M z + tau f,    z <- z_new / |z_new|.

The unknowns are the edge midpoints (Crouzeix–Raviart), so that a corner has both its directions.  In the plane z is taken in
the global frame: one real matrix with the real and imaginary part as two right-hand sides.  On a curved surface every z is in
the frame of its edge, and K is the connection Laplacian (`connection`).

It starts from the harmonic z.  In a component without boundary that is 0: there it starts from a mode of least energy, found by
inverse iteration of ``K + M / area`` from the projections of the three axes, ``sum over axes a of (x_a + i y_a)^4`` for an edge
along x and y to the left of it.  On a sphere that is a mode, one of nine, and its zeros are the eight corners of a cube.  A bit
of noise keeps the iteration from a mode of higher energy where the axes are orthogonal to the lowest.

Diffusion has no core size.  With a given epsilon it is the start for a minimisation of the energy itself (`ginzburg_landau`).
"""

from __future__ import annotations

import numpy as np

from ..records import CrossField, Float
from .connection import ConnectionOperators
from .ginzburg_landau import minimise_energy
from .operators import FieldOperators
from .singularities import QUARTER
from .surface_mesh import SurfaceMesh

__all__ = ["edge_angle", "from_angles", "smooth_field", "wrap"]

#: diffusion times over (diameter of the domain)^2, each with its greatest number of steps
_TIMES = ((0.01, 4), (0.001, 6))
#: inverse iterations for a component without boundary
_ITERATIONS = 12
_NOISE = 1e-3


def wrap(angle: Float) -> Float:
    """Angles modulo a quarter turn, in [-pi/4, pi/4]."""
    return angle - QUARTER * np.rint(angle / QUARTER)


def edge_angle(mesh: SurfaceMesh) -> Float:
    """(e,) angle of every edge, from its lower to its higher vertex, against the x axis (plane meshes)."""
    d = mesh.points[mesh.edges[:, 1]] - mesh.points[mesh.edges[:, 0]]
    return np.arctan2(d[:, 1], d[:, 0])


def from_angles(mesh: SurfaceMesh, theta: Float) -> CrossField:
    """The cross field with angles `theta` (e,) from the edges, each turning by at most 45 degrees from edge to edge."""
    angle = theta[mesh.triangle_edges] + mesh.edge_direction
    return CrossField(wrap(theta), wrap(np.roll(angle, -1, axis=1) - angle))


def smooth_field(mesh: SurfaceMesh, operators: FieldOperators, epsilon: float | None = None) -> CrossField:
    """The smooth boundary-aligned cross field of a surface.

    Parameters
    ----------
    mesh : SurfaceMesh
        Plane where its points are (n, 2).
    operators : FieldOperators
        Of the same mesh.
    epsilon : float, optional
        Core size of singularities, in the units of the mesh: the energy with this epsilon is minimised, starting from the
        field of the diffusion.

    Returns
    -------
    CrossField
        Aligned with every boundary edge; where the boundary turns it chooses its own indices.
    """
    mass = np.bincount(mesh.triangle_edges.ravel(), np.repeat(mesh.area / 3, 3), len(mesh.edges)).astype(np.float64)
    along: ConnectionOperators | FieldOperators
    if mesh.points.shape[1] == 2:
        along, direction = operators, edge_angle(mesh)
        frame = np.stack([np.cos(4 * direction), np.sin(4 * direction)], axis=1)
        z = operators.solve(frame)
    else:
        along, direction = ConnectionOperators(operators), np.zeros(len(mesh.edges))
        frame = np.tile([1.0, 0.0], (len(mesh.edges), 1))
        z = _start(mesh, along, frame, mass)
    free = along.free
    load = along.load(frame)
    inner = _unit(z[free])
    area = np.bincount(mesh.components[mesh.triangles[:, 0]], mesh.area).max()
    for time, steps in _TIMES:
        tau = time * area
        lu = along.shifted(mass[free], tau)
        for _ in range(steps):
            new = _unit(lu.solve(mass[free][:, None] * inner + tau * load))
            change = np.abs(new - inner).max()
            inner = new
            if change < 0.02:
                break
    z[free] = inner
    if epsilon is not None:
        z, _ = minimise_energy(mesh, along, z, epsilon)
    theta = 0.25 * np.arctan2(z[:, 1], z[:, 0]) - direction
    theta[operators.fixed] = 0.0
    return from_angles(mesh, theta)


def _start(mesh: SurfaceMesh, along: ConnectionOperators, frame: Float, mass: Float) -> Float:
    """(e, 2) harmonic z with the values `frame` (e, 2) on the boundary; a mode of least energy where there is none."""
    part = mesh.components[mesh.edges[along.free, 0]]
    closed = mesh.component_closed[part]
    area = np.bincount(mesh.components[mesh.triangles[:, 0]], mesh.area)
    lu = along.shifted(np.where(closed, mass[along.free] / area[part], 0.0))
    load = along.load(frame)
    z = frame.copy()
    z[along.free] = lu.solve(load)
    if np.any(closed):
        inner = _axes(mesh)[along.free] + _NOISE * np.random.default_rng(0).standard_normal((len(closed), 2))
        for _ in range(_ITERATIONS):
            inner = lu.solve(np.where(closed[:, None], mass[along.free][:, None] * inner / np.abs(inner[closed]).max(), load))
        z[along.free] = inner
    return z


def _axes(mesh: SurfaceMesh) -> Float:
    """(e, 2) sum of the fourth powers of the axes' projections, in the frame of every edge."""
    assert mesh.edge_normal is not None
    x = (mesh.points[mesh.edges[:, 1]] - mesh.points[mesh.edges[:, 0]]) / mesh.edge_length[:, None]
    y = np.cross(mesh.edge_normal, x)
    z = ((x + 1j * y) ** 4).sum(axis=1)
    return np.stack([z.real, z.imag], axis=1)


def _unit(z: Float) -> Float:
    """Rows of `z` (k, 2) at unit length; an exact zero becomes the first axis."""
    length = np.hypot(z[:, 0], z[:, 1])
    zero = length == 0.0
    return np.where(zero[:, None], np.array([1.0, 0.0]), z / np.where(zero, 1.0, length)[:, None])
