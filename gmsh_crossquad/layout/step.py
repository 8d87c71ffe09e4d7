"""One step of a trace: the straight segment through one triangle.

The direction of the cross is linear in the triangle; the segment from the entry has the direction at its own middle (midpoint
rule, second order).  A field that points back out of the entry edge (it may jump there by the error of the Crouzeix–Raviart
element) is turned until it just enters.
"""

from __future__ import annotations

from math import cos, sin

from .trace_mesh import QUARTER, TraceMesh

__all__ = ["CLEAR", "ideal_exit"]

CLEAR = 1e-3
"""Traces keep this fraction of an edge away from its vertices."""

ENTRY = 0.01
"""Least angle, in radians, between a segment and its entry edge."""

ENTRY_COS = cos(ENTRY)


def ideal_exit(mesh: TraceMesh, h: int, s: float, branch: int) -> tuple[int, float]:
    """Where the field leads out of a triangle.

    Parameters
    ----------
    mesh : TraceMesh
    h : int
        Half-edge of entry.
    s : float
        Fraction of it.
    branch : int
        Direction to follow.

    Returns
    -------
    (half-edge, fraction) of the exit, at least `CLEAR` away from the vertices.
    """
    t, k = divmod(h, 3)
    n, p = (h + 1, h - 1) if k == 1 else (h + 1, h + 2) if k == 0 else (h - 2, h - 1)
    x, y, ex, ey = mesh.x, mesh.y, mesh.ex, mesh.ey
    ux, uy = mesh.ux[h], mesh.uy[h]
    c, gx, gy = mesh.constant[t] + branch * QUARTER, mesh.gx[t], mesh.gy[t]
    px = x0 = x[h] + s * ex[h]
    py = y0 = y[h] + s * ey[h]
    wx, wy = x[p] - x0, y[p] - y0
    out, r = n, 0.5
    for _ in (0, 1):
        d = c + gx * px + gy * py
        dx, dy = cos(d), sin(d)
        if ux * dy - uy * dx < ENTRY:
            along = ENTRY_COS if ux * dx + uy * dy > 0.0 else -ENTRY_COS
            dx, dy = along * ux - ENTRY * uy, along * uy + ENTRY * ux
        out = n if dx * wy - dy * wx > 0.0 else p
        fx, fy = ex[out], ey[out]
        r = (dy * (x[out] - x0) - dx * (y[out] - y0)) / (dx * fy - dy * fx)
        px, py = 0.5 * (x0 + x[out] + r * fx), 0.5 * (y0 + y[out] + r * fy)
    return out, CLEAR if r < CLEAR else 1.0 - CLEAR if r > 1.0 - CLEAR else r
