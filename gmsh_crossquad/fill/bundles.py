"""Bent sides of the cells beside a bulging CAD curve.

An edge on a curve may bulge by more than the height of the cell beside it: with a straight side opposite, that cell folds however
good its four corners are.  Then the sides across a *bundle* of cells bend too, less and less, as in a transfinite interpolation
of them all.  The bundle starts at the edge on the curve and goes from cell to opposite cell to the next curve, or until it is
`ROOM` times as high as the bulge.  With the heights H_i of the sides over the first one and the offsets d of an edge's nodes from
even steps along its chord,

    d_i = (1 - H_i / H) d_first + (H_i / H) d_last,

where d_last is that of the curve at the other end, or 0 at a side that stays straight.  Two curves do not cross, so neither do
the sides between them, whatever the number of cells and however narrow the gap.
"""

from __future__ import annotations

import numpy as np

from ..records import Bool, Float, Int
from .numbering import GuideTopology
from .skeleton import Skeleton

__all__ = ["bundle_offsets"]

BULGE = 0.2
"""Bulge of an edge on a curve, over the height of the cell beside it, from which a bundle is bent."""
ROOM = 4.0
LONGEST = 256
"""Greatest number of cells in a bundle."""


def bundle_offsets(skeleton: Skeleton, topology: GuideTopology, quads: Int, bad: Bool) -> tuple[Float, Bool, Bool]:
    """Offsets of the nodes of the edges across bundles.

    Parameters
    ----------
    skeleton : Skeleton
        With the nodes on all curves.
    topology : GuideTopology
    quads : (q, 4) int64
        Of the guide.
    bad : (q,) bool
        Guide quads that need it.

    Returns
    -------
    offsets : (n, 3) float64
        From even steps along the chord, per node of ``skeleton.inside``; 0 on edges in no bundle.
    bent : (e,) bool
        Edges in bundles.
    needed : (e,) bool
        Those in bundles that start at a bad quad.
    """
    quad_edges = topology.quad_edges
    offsets = np.zeros_like(skeleton.inside)
    bent, needed = np.zeros((2, len(topology.edges)), bool)
    bulge, length = skeleton.bulges(topology.edges)
    height = 0.5 * (np.roll(length[quad_edges], 1, axis=1) + np.roll(length[quad_edges], -1, axis=1))
    starts = np.argwhere(topology.on_curve[quad_edges] & (bulge[quad_edges] > BULGE * height))
    if not len(starts):
        return offsets, bent, needed
    around = _quads_of_edges(quad_edges)
    for q, k in starts[np.argsort(~bad[starts[:, 0]], kind="stable")].tolist():
        if not _bulges_inwards(skeleton, topology, quads, q, k):
            continue
        for edge, own in _bundle(skeleton, topology, quads, around, q, k):
            if not bent[edge]:
                first = skeleton.first[edge]
                offsets[first : first + len(own)] = own
                bent[edge], needed[edge] = True, bad[q]
    return offsets, bent, needed


def _quads_of_edges(quad_edges: Int) -> dict[int, list[int]]:
    """Guide quads beside every edge."""
    out: dict[int, list[int]] = {}
    for q, row in enumerate(quad_edges.tolist()):
        for e in row:
            out.setdefault(e, []).append(q)
    return out


def _line(skeleton: Skeleton, topology: GuideTopology, edge: int, start: int) -> Float:
    """Nodes (n, 3) of an edge from its end `start`."""
    ends = skeleton.vertices[topology.edges[edge]]
    line = np.concatenate([ends[:1], skeleton.edge(edge), ends[1:]])
    return line if topology.edges[edge, 0] == start else line[::-1]


def _off_chord(line: Float) -> Float:
    """Offsets (n, 3) of a line of nodes from even steps along its chord."""
    share = np.linspace(0.0, 1.0, len(line))[:, None]
    out: Float = line - ((1.0 - share) * line[0] + share * line[-1])
    return out


def _bulges_inwards(skeleton: Skeleton, topology: GuideTopology, quads: Int, q: int, k: int) -> bool:
    """Whether side `k` of quad `q` bulges towards the opposite one."""
    corner = skeleton.vertices[np.roll(quads[q], -k)]
    line = _line(skeleton, topology, int(topology.quad_edges[q, k]), int(quads[q, k]))
    chord = line[-1] - line[0]
    across = corner[2] + corner[3] - corner[0] - corner[1]
    across = across - (across @ chord) / max(float(chord @ chord), np.finfo(float).tiny) * chord
    off = (line - line[0]) @ across
    return bool(off.max() > -off.min())


def _height(chord: Float, sides: Float) -> float:
    """Mean height over a chord of two sides, whose sum is given."""
    along = (sides @ chord) / max(float(chord @ chord), np.finfo(float).tiny)
    return 0.5 * float(np.linalg.norm(sides - along * chord))


def _bundle(
    skeleton: Skeleton, topology: GuideTopology, quads: Int, around: dict[int, list[int]], q: int, k: int
) -> list[tuple[int, Float]]:
    """The edges across the bundle from side `k` of quad `q`, and the offsets of the nodes inside each, from its lower vertex."""
    v = skeleton.vertices
    a, b = int(quads[q, k]), int(quads[q, (k + 1) % 4])
    edge = int(topology.quad_edges[q, k])
    first = _off_chord(_line(skeleton, topology, edge, a))
    last = np.zeros_like(first)
    bulge = float(np.linalg.norm(first, axis=1).max())
    length = float(np.linalg.norm(v[b] - v[a]))
    found: list[tuple[int, bool, float, float]] = []
    total = 0.0
    for _ in range(LONGEST):
        side = topology.quad_edges[q].tolist().index(edge)
        corner = np.roll(quads[q], -side).tolist()
        c, d = (corner[3], corner[2]) if corner[0] == a else (corner[2], corner[3])
        edge = int(topology.quad_edges[q, (side + 2) % 4])
        total += _height(v[b] - v[a], v[c] + v[d] - v[a] - v[b])
        a, b = c, d
        ratio = float(np.linalg.norm(v[b] - v[a])) / length
        if topology.on_curve[edge]:
            last = _off_chord(_line(skeleton, topology, edge, a)) / max(ratio, 1.0)
            break
        if total > ROOM * bulge:
            break
        found.append((edge, bool(topology.edges[edge, 0] == a), total, min(ratio, 1.0)))
        others = [other for other in around[edge] if other != q]
        if len(others) != 1:
            break
        q = others[0]
    out = []
    for edge, forward, height, ratio in found:
        share = height / max(total, np.finfo(float).tiny)
        offset = ratio * ((1.0 - share) * first + share * last)
        out.append((edge, (offset if forward else offset[::-1])[1:-1]))
    return out
