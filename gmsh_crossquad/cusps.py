"""Cusps: corners of a face in which two curves touch and part slowly.

One quad lies in such a corner.  Its angle there is as small as the curves make it, whatever its shape, and goes to 0 with its
size; so the corner says nothing about the quality of a grid, and a grid that tries to open it gets one side much longer than
the other and folds beside it.  A good quad in a cusp is a kite: both sides along the curves equally long, the far corner a
little beyond the middle between their ends, and angles of 120 degrees in all corners but the cusp.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .records import Bool, Curve, Float, Guide, Int, Model

__all__ = ["SHARP", "Cusps", "cusp_corners", "find_cusps"]

SHARP = float(np.radians(6.0))
"""Opening angle below which a corner counts as a cusp."""


class Cusps(NamedTuple):
    """Corners of guide quads that lie in a cusp.

    Attributes
    ----------
    quad, corner : (c,) int64
        Corner k of a quad.
    curve : (c, 2) int64
        Curves along side k and side k - 1.
    end : (c, 2) int64
        0 where the cusp is the curve's start, 1 where it is its end.
    """

    quad: Int
    corner: Int
    curve: Int
    end: Int


def find_cusps(guide: Guide, model: Model) -> Cusps:
    """Find the corners of guide quads at a CAD vertex between two curves that leave it less than `SHARP` apart.

    Parameters
    ----------
    guide : Guide
    model : Model

    Returns
    -------
    Cusps
    """
    n = len(guide.points)
    rows = [row for row, chain in enumerate(guide.chains) if len(chain) > 1]
    keys = np.array([int(c[a]) * n + int(c[b]) for c in (guide.chains[r] for r in rows) for a, b in ((0, 1), (-1, -2))], np.int64)
    away = np.concatenate([np.zeros((0, 3)), *(_leaving(model.curves[r]) for r in rows)])
    order = np.argsort(keys, kind="stable")
    known = keys[order]
    at = np.flatnonzero((guide.cad_vertex[guide.quads] >= 0).ravel()) if len(keys) else np.zeros(0, np.int64)
    q, k = np.divmod(at, 4)
    key = guide.quads[q, k][:, None] * n + guide.quads[q[:, None], (k[:, None] + [1, 3]) % 4]
    place = np.minimum(np.searchsorted(known, key), len(known) - 1)
    on = (known[place] == key).all(axis=1) if len(at) else np.zeros(0, bool)
    place = order[place[on]]
    sharp = np.einsum("nc,nc->n", away[place[:, 0]], away[place[:, 1]]) > np.cos(SHARP)
    place = place[sharp]
    return Cusps(q[on][sharp], k[on][sharp], np.array(rows, np.int64)[place // 2], place % 2)


def cusp_corners(guide: Guide, model: Model) -> Bool:
    """(q, 4) The corners of guide quads in cusps, from `find_cusps`."""
    out = np.zeros(guide.quads.shape, bool)
    cusps = find_cusps(guide, model)
    out[cusps.quad, cusps.corner] = True
    return out


def _leaving(curve: Curve) -> Float:
    """Unit directions (2, 3) in which a curve leaves its start and its end."""
    if curve.tangents is not None:
        return curve.tangents
    steps = np.stack([curve.points[1] - curve.points[0], curve.points[-2] - curve.points[-1]])
    out: Float = steps / np.maximum(np.linalg.norm(steps, axis=1, keepdims=True), np.finfo(float).tiny)
    return out
