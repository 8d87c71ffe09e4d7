"""Structured grids between four given sides: transfinite interpolation (Coons).

    S(i, j) = (1 - v_j) bottom_i + v_j top_i + (1 - u_i) left_j + u_i right_j - bilinear(u_i, v_j)

with u_i the mean of the relative arc lengths at node i of bottom and top, weighted by their lengths, and v_j likewise: the
rule of Gmsh's transfinite mesher, to rounding.  Grids of equal size are done together.
"""

from __future__ import annotations

import numpy as np

from ..records import Bool, Float, Int

__all__ = ["coons", "grid_quads", "grid_quality", "surface_quality"]


def coons(bottom: Float, right: Float, top: Float, left: Float) -> Float:
    """Fill grids from their sides.

    Parameters
    ----------
    bottom, top : (d, m, ku + 1) float64
        d coordinates of m grids; both run with u.
    right, left : (d, m, kv + 1) float64
        Both run with v.

    Returns
    -------
    (d, m, ku + 1, kv + 1) float64
        The sides included.
    """
    u, v = _relative_length(bottom, top), _relative_length(left, right)
    line0 = left[..., :1] + v * (left[..., -1:] - left[..., :1])
    line1 = right[..., :1] + v * (right[..., -1:] - right[..., :1])
    bulge = left - line0
    change = right - line1 - bulge
    out = v[:, None, :] * (top - bottom)[..., :, None]
    out += bottom[..., :, None]
    out += bulge[..., None, :]
    out += u[:, :, None] * change[..., None, :]
    # the formula meets the sides up to rounding; they are given, so they are exact
    out[..., 0] = bottom
    out[..., -1] = top
    out[..., 0, :] = left
    out[..., -1, :] = right
    return out


def _relative_length(a: Float, b: Float) -> Float:
    """(m, k + 1) relative arc length of two opposite sides (d, m, k + 1), averaged."""
    out = np.zeros((a.shape[1], a.shape[2]))
    step = np.sqrt((np.diff(a) ** 2).sum(axis=0)) + np.sqrt((np.diff(b) ** 2).sum(axis=0))
    np.cumsum(step, axis=1, out=out[:, 1:])
    total = out[:, -1:].copy()
    # a cell without extent keeps equal steps; its quality is 0 and is reported as such
    flat = total[:, 0] == 0
    out[flat] = np.arange(out.shape[1])
    total[flat] = out.shape[1] - 1
    out /= total
    return out


def grid_quality(grid: Float, cusps: Bool | None = None) -> Float:
    """Least scaled Jacobian of planar grids.

    Parameters
    ----------
    grid : (2, m, ku + 1, kv + 1) float64
    cusps : (m, 4) bool, optional
        Corners of the grids that lie in a cusp: there a sine counts only where it is not positive.

    Returns
    -------
    (m,) float64
        Minimum over all quads and corners of the sine of the corner angle, signed.
    """
    du, dv = grid[:, :, 1:] - grid[:, :, :-1], grid[:, :, :, 1:] - grid[:, :, :, :-1]
    tiny = np.finfo(float).tiny
    for d in (du, dv):
        length = np.sqrt(d[0] * d[0] + d[1] * d[1])
        d /= np.maximum(length, tiny, out=length)
    worst = np.ones(grid.shape[1])
    for k, (a, b) in enumerate((a, b) for a in (du[..., :-1], du[..., 1:]) for b in (dv[:, :, :-1], dv[:, :, 1:])):
        sine = a[0] * b[1]
        sine -= a[1] * b[0]
        _forgive(sine, k, cusps)
        np.minimum(worst, sine.min(axis=(1, 2)), out=worst)
    return worst


def surface_quality(grid: Float, normals: Float, cusps: Bool | None = None) -> Float:
    """Least scaled Jacobian of grids on curved faces, every quad against its own area vector on the side of the surface's normal.

    Parameters
    ----------
    grid : (3, m, ku + 1, kv + 1) float64
    normals : (3, m, ku, kv) float64
        Of the surface at every quad.
    cusps : (m, 4) bool, optional
        As for `grid_quality`.

    Returns
    -------
    (m,) float64
        Minimum over all quads and corners of the sine of the corner angle, signed.
    """
    tiny = np.finfo(float).tiny
    area = _cross(grid[:, :, 1:, 1:] - grid[:, :, :-1, :-1], grid[:, :, :-1, 1:] - grid[:, :, 1:, :-1])
    side = area[0] * normals[0] + area[1] * normals[1] + area[2] * normals[2]
    length = np.sqrt(area[0] * area[0] + area[1] * area[1] + area[2] * area[2])
    area *= np.where(side < 0, -1.0, 1.0) / np.maximum(length, tiny)
    du, dv = grid[:, :, 1:] - grid[:, :, :-1], grid[:, :, :, 1:] - grid[:, :, :, :-1]
    for d in (du, dv):
        d /= np.maximum(np.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]), tiny)
    worst = np.ones(grid.shape[1])
    for k, (a, b) in enumerate((a, b) for a in (du[..., :-1], du[..., 1:]) for b in (dv[:, :, :-1], dv[:, :, 1:])):
        corner = _cross(a, b)
        corner *= area
        sine = corner.sum(axis=0)
        _forgive(sine, k, cusps)
        np.minimum(worst, sine.min(axis=(1, 2)), out=worst)
    return worst


def _forgive(sine: Float, corner: int, cusps: Bool | None) -> None:
    """Let positive sines (m, ku, kv) in cusps count as 1; `corner` is 0 to 3 for (u, v) = (0, 0), (1, 0), (0, 1), (1, 1)."""
    if cusps is not None:
        here = sine[:, -(corner % 2), -(corner // 2)]
        here[cusps[:, (0, 1, 3, 2)[corner]] & (here > 0.0)] = 1.0


def _cross(a: Float, b: Float) -> Float:
    """Cross products of vectors (3, ...)."""
    return np.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def grid_quads(nodes: Int) -> Int:
    """Quads (m, ku kv, 4) of grids of nodes (m, ku + 1, kv + 1), u major, counter-clockwise as (u, v)."""
    m, i, j = nodes.shape
    out = np.empty((m, i - 1, j - 1, 4), np.int64)
    out[..., 0] = nodes[:, :-1, :-1]
    out[..., 1] = nodes[:, 1:, :-1]
    out[..., 2] = nodes[:, 1:, 1:]
    out[..., 3] = nodes[:, :-1, 1:]
    return out.reshape(m, -1, 4)
