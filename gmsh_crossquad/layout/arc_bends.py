"""How much the arcs inside curved faces turn.

The background is faceted, and a trace on it has a kink at every edge.  Its turning is therefore that of chords that are a few
background triangles long, and is taken as spread evenly between the middles of the chords.
"""

from __future__ import annotations

import numpy as np

from ..records import Float, Model, TMesh
from .bends import resampled, turning

__all__ = ["arc_bends"]

CROSSINGS = 5
MOST_CHORDS = 24


def arc_bends(model: Model, tmesh: TMesh) -> dict[int, Float]:
    """Total turning (k,), in radians, from the start of an arc to places at even arc lengths; for arcs inside curved faces."""
    curved = [p for p, f in zip(tmesh.patches, tmesh.patch_face.tolist()) if model.faces[f].curved]
    arcs = {arc for patch in curved for side in patch for arc, _ in side if tmesh.arc_curve[arc] < 0}
    return {arc: _cumulative(tmesh.polyline[arc]) for arc in sorted(arcs)}


def _cumulative(line: Float) -> Float:
    """Total turning up to the ends of a few chords; the first and the last chord turn like their neighbours."""
    angle = turning(resampled(line, min(max(len(line) // CROSSINGS, 2), MOST_CHORDS)))
    padded = np.concatenate([angle[:1], angle, angle[-1:]])
    out: Float = np.concatenate([[0.0], np.cumsum(0.5 * (padded[1:] + padded[:-1]))])
    return out
