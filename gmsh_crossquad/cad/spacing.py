"""Nodes of the background mesh on the curves."""

from __future__ import annotations

import numpy as np

from ..options import MeshOptions
from ..records import Float, Model

__all__ = ["curve_spacing", "face_sizes"]


def face_sizes(model: Model, options: MeshOptions) -> Float:
    """Greatest triangle size (f,) of every face, scaled."""
    diameter = []
    for face in model.faces:
        p = np.concatenate([model.curves[c].points for loop in face.loops for c, _ in loop])
        diameter.append(np.linalg.norm(np.ptp(p, axis=0)))
    return np.array(diameter) / 40 * options.background


def curve_spacing(model: Model, options: MeshOptions) -> tuple[Float, ...]:
    """Arc lengths of the background nodes of every curve, 0 and the length included."""
    h = face_sizes(model, options).min()
    return tuple(np.linspace(0, c.length, max(12 if c.closed else 4, int(np.ceil(c.length / h))) + 1) for c in model.curves)
