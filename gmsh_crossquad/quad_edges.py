"""The edges of a quad mesh."""

from __future__ import annotations

import numpy as np

from .records import Int

__all__ = ["edges_of_quads"]


def edges_of_quads(quads: Int) -> tuple[Int, Int]:
    """Unique edges of a quad mesh.

    Parameters
    ----------
    quads : (q, 4) int64

    Returns
    -------
    edges : (e, 2) int64
        Lower vertex first, in lexicographic order.
    rows : (q, 4) int64
        Row of the edge from corner k to corner k + 1 of every quad.
    """
    start, end = quads.ravel(), np.roll(quads, -1, axis=1).ravel()
    n = max(int(quads.max(initial=-1)) + 1, 1)
    key, inverse = np.unique(np.minimum(start, end) * n + np.maximum(start, end), return_inverse=True)
    return np.stack([key // n, key % n], axis=1), inverse.reshape(-1, 4).astype(np.int64)
