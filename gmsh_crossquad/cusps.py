"""Cusps: corners of a face in which two curves touch and part slowly.

One quad lies in such a corner.  Its angle there is as small as the curves make it, whatever its shape, and goes to 0 with its
size; so the corner says nothing about the quality of a grid, and a grid that tries to open it gets one side much longer than
the other and folds beside it.  A good quad in a cusp is a kite: both sides along the curves equally long, the far corner a
little beyond the middle between their ends, and angles of 120 degrees in all corners but the cusp.
"""

from __future__ import annotations

import numpy as np

from .records import Bool, Curve, Float, Guide, Model

__all__ = ["SHARP", "cusp_corners"]

SHARP = float(np.radians(6.0))
"""Opening angle below which a corner counts as a cusp."""


def cusp_corners(guide: Guide, model: Model) -> Bool:
    """Corners of guide quads that lie in a cusp.

    Parameters
    ----------
    guide : Guide
    model : Model

    Returns
    -------
    (q, 4) bool
        The corner is at a CAD vertex, both edges beside it are on curves, and these leave the vertex in directions less than
        `SHARP` apart.
    """
    out = np.zeros(guide.quads.shape, bool)
    n = len(guide.points)
    keys, directions = [], []
    for curve, chain in zip(model.curves, guide.chains):
        if len(chain) > 1:
            keys += [int(chain[0]) * n + int(chain[1]), int(chain[-1]) * n + int(chain[-2])]
            directions.append(_leaving(curve))
    if not keys:
        return out
    order = np.argsort(keys, kind="stable")
    known, away = np.array(keys)[order], np.concatenate(directions)[order]
    corner = guide.quads
    at = np.flatnonzero((guide.cad_vertex[corner] >= 0).ravel())
    q, k = np.divmod(at, 4)
    sides = []
    on: Bool = np.ones(len(at), bool)
    for other in ((k + 1) % 4, (k + 3) % 4):
        key = corner[q, k] * n + corner[q, other]
        row = np.minimum(np.searchsorted(known, key), len(known) - 1)
        on &= known[row] == key
        sides.append(away[row])
    cosine = np.einsum("nc,nc->n", *sides)
    out[q, k] = on & (cosine > np.cos(SHARP))
    return out


def _leaving(curve: Curve) -> Float:
    """Unit directions (2, 3) in which a curve leaves its start and its end."""
    if curve.tangents is not None:
        return curve.tangents
    steps = np.stack([curve.points[1] - curve.points[0], curve.points[-2] - curve.points[-1]])
    out: Float = steps / np.maximum(np.linalg.norm(steps, axis=1, keepdims=True), np.finfo(float).tiny)
    return out
