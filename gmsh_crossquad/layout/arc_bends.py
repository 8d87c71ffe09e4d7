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
    arcs = sorted({arc for patch in curved for side in patch for arc, _ in side if tmesh.arc_curve[arc] < 0})
    if not arcs:
        return {}
    lines = [tmesh.polyline[arc] for arc in arcs]
    chords = np.clip(np.array([len(line) for line in lines]) // CROSSINGS, 2, MOST_CHORDS)
    samples, first = resampled(lines, chords)
    angle = turning(samples, first)
    start, end = first[:-1], first[1:] - 1
    angle[start], angle[end] = angle[start + 1], angle[end - 1]  # the first and the last chord turn like their neighbours
    grown = np.concatenate([[0.0], np.cumsum(0.5 * (angle[1:] + angle[:-1]))])
    return {arc: grown[a:b] - grown[a] for arc, a, b in zip(arcs, first[:-1].tolist(), first[1:].tolist())}
