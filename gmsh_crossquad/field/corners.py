"""Boundary indices from opening angles.

A sector of opening angle b gets the whole number of quads that is nearest to ``b / (pi/2)``, at least one; in quarter turns
its index is

    q_b = 2 - max(1, round(b / (pi/2))).

Half-way cases (135, 225 and 315 degrees, within 1e-6 quarter turns) get the larger number of quads: two quads of 67.5 degrees
are better shaped than one of 135, and a regular octagon is meshed like a disc.  The angle is the CAD's, never the background
mesh's, whose polygons are no measure of a corner where the curve turns fast.
"""

from __future__ import annotations

import numpy as np

from ..records import FaceMesh, Float, Int

__all__ = ["boundary_indices", "default_index"]


def default_index(opening_angle: Float) -> Int:
    """Index in quarter turns of sectors with these opening angles in (0, 2 pi]."""
    quads = np.floor(np.asarray(opening_angle) / (0.5 * np.pi) + 0.5 + 1e-6).astype(np.int64)
    return 2 - np.maximum(1, quads)


def boundary_indices(mesh: FaceMesh) -> Int:
    """(n,) wanted index of every vertex: by opening angle at CAD vertices on the boundary, 0 elsewhere."""
    out = np.zeros(len(mesh.points), np.int64)
    corner = np.isfinite(mesh.opening_angle)
    out[corner] = default_index(mesh.opening_angle[corner])
    return out
