"""Traces that begin on an edge of a finished motorcycle graph, and cut one patch in two.

A branch leaves another trace to its left or right, beside the place where that trace crosses an edge, or the boundary straight
inwards.  It begins at the next place to the crossing, so that no trace can pass between them: it leaves the other trace exactly
there.  It begins on a side of a patch in the direction that is across this side; as no trace of its own family may be crossed,
it ends on the opposite side, and both parts have four sides.
"""

from __future__ import annotations

from math import cos, sin

from .crossing import ONE
from .trace import Growth, Start, Trace
from .trace_mesh import QUARTER

__all__ = ["branch", "branch_inwards"]


def branch(growth: Growth, host: int, crossing: int, left: bool) -> bool:
    """Grow a trace from a crossing of the trace `host` to its left or right.

    Parameters
    ----------
    growth : Growth
        Finished.
    host, crossing : int
        Trace, and which of its crossings: not one inside a triangle, not one at the boundary.
    left : bool

    Returns
    -------
    bool
        False if there is no room beside the crossing, or no way on from there; the traces are as before then.
    """
    mesh, trace = growth.mesh, growth.traces[host]
    q, at = trace.crossings[crossing]
    g = mesh.twin[q]
    side = 1 if left else -1  # the left of a trace is the direction of the half-edge by which it leaves
    if g < 0:
        return False
    place = at + side
    own = next(c for c in growth.chords[q // 3] if c.trace == host and c.segment == crossing)
    here = (own.branch + side) % 4
    there = (here + mesh.shift[q]) % 4
    x, y = mesh.x[q] + place / ONE * mesh.ex[q], mesh.y[q] + place / ONE * mesh.ey[q]
    angle = mesh.constant[q // 3] + mesh.gx[q // 3] * x + mesh.gy[q // 3] * y + here * QUARTER
    entries = [(q, place, here, mesh.gate[g] >> there & 1), (g, ONE - place, there, mesh.gate[q] >> here & 1)]
    if mesh.ux[q] * sin(angle) - mesh.uy[q] * cos(angle) < 0.0:
        entries.reverse()
    entry = next((e for e in entries if e[3]), None)
    if entry is None or not growth.take(q, place):
        return False
    return growth.follow(Trace(trace.seed, -1, start=Start(host, crossing, left, entry[0], entry[1])), entry[2])


def branch_inwards(growth: Growth, half_edge: int, place: int, vertex: int) -> bool:
    """Grow a trace from a place on a boundary half-edge; False if the place is taken, or there is no way on.

    Parameters
    ----------
    growth : Growth
        Finished.
    half_edge, place : int
    vertex : int
        Any background vertex of the same component.
    """
    if not growth.take(half_edge, place):
        return False
    inwards = (growth.mesh.wall[half_edge] + 1) % 4
    return growth.follow(Trace(vertex, -1, start=Start(-1, -1, True, half_edge, place)), inwards)
