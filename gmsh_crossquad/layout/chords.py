"""Chords of the conforming layout and their divisions.

A chord is a strip of quads: all edges connected through opposite sides.  Giving every chord one number of divisions refines
a conforming complex into a conforming one, whatever the numbers are.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..fill.numbering import guide_chords
from ..records import Int, TMesh
from .quotient import Quotient, arc_points

__all__ = ["Chords", "arc_divisions", "find_chords"]


@dataclass(frozen=True)
class Chords:
    """Chords of a quad complex as seen from the T-mesh.

    Attributes
    ----------
    n : int
    arc_segments : tuple of (n_a,) int64
        Chord of every unit segment of every arc, in order.
    """

    n: int
    arc_segments: tuple[Int, ...]


def find_chords(tmesh: TMesh, q: Quotient) -> Chords:
    """Chords of the complex `q`."""
    edges, _, chord, n = guide_chords(q.quads)
    keys = edges[:, 0] * q.n_vertices + edges[:, 1]
    segments = []
    for arc, count in enumerate(q.divisions.tolist()):
        if count == 0:
            segments.append(np.zeros(0, np.int64))
            continue
        v = q.vertex[arc_points(tmesh, q.divisions, q.offset, arc)]
        key = np.minimum(v[:-1], v[1:]) * q.n_vertices + np.maximum(v[:-1], v[1:])
        segments.append(chord[np.searchsorted(keys, key)])
    return Chords(n, tuple(segments))


def arc_divisions(chords: Chords, divisions: Int) -> Int:
    """Divisions (a,) of every arc when every chord gets `divisions` (n,)."""
    return np.array([int(divisions[s].sum()) for s in chords.arc_segments], np.int64)
