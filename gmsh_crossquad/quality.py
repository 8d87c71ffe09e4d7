"""The numbers of a quad mesh: scaled Jacobians, irregular vertices, conformity.

All of them come from the connectivity (integers) and from `scaled_jacobian`; nothing is measured with a tolerance.  A quad of a
plane face is judged against the face's normal, one of a curved face against its own: there a quad is turned over where it lies
against its neighbours (`turned_over`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .embed.quality import scaled_jacobian
from .records import Bool, Float, Int, QuadMesh

__all__ = [
    "Quality",
    "curve_edges",
    "inner_nodes",
    "is_conforming",
    "measure_quality",
    "quad_quality",
    "turned_over",
    "twins",
]

_AGAINST = np.cos(np.radians(100.0))  # neighbours whose normals turn by more lie against each other


@dataclass(frozen=True)
class Quality:
    """Numbers of a quad mesh.

    Attributes
    ----------
    nodes, quads, blocks : int
    irregular : int
        Nodes off all CAD curves whose valence is not 4.
    min_scaled_jacobian, p5_scaled_jacobian, mean_scaled_jacobian : float
        Least, 5 % quantile and mean over the quads; 1 is a rectangle.
    inverted : int
        Quads whose scaled Jacobian is not positive.
    conforming : bool
        Every edge has its two quads of one face, or lies on a CAD curve.
    """

    nodes: int
    quads: int
    blocks: int
    irregular: int
    min_scaled_jacobian: float
    p5_scaled_jacobian: float
    mean_scaled_jacobian: float
    inverted: int
    conforming: bool


def twins(quads: Int) -> Int:
    """Opposite half-edge (4 q,) of half-edge ``4 q + i`` (corner i to i + 1): -1 where alone, -2 where more than two meet."""
    start = quads.ravel()
    end = np.roll(quads, -1, axis=1).ravel()
    key = np.minimum(start, end) * (int(quads.max(initial=0)) + 1) + np.maximum(start, end)
    order = np.argsort(key, kind="stable")
    ordered = key[order]
    first = np.flatnonzero(np.concatenate([[True], ordered[1:] != ordered[:-1]])) if len(key) else np.zeros(0, np.int64)
    count = np.diff(np.append(first, len(key)))
    twin = np.full(len(key), -1, np.int64)
    two = first[count == 2]
    twin[order[two]] = order[two + 1]
    twin[order[two + 1]] = order[two]
    twin[order[np.repeat(count > 2, count)]] = -2
    return twin


def curve_edges(mesh: QuadMesh) -> Int:
    """Row of `curve_nodes` that half-edge ``4 q + i`` (4 q,) of the mesh lies on, -1 elsewhere."""
    n = len(mesh.points)
    out = np.full(mesh.quads.size, -1, np.int64)
    chains = mesh.curve_nodes
    if not chains or not len(out):
        return out
    a = np.concatenate([c[:-1] for c in chains])
    b = np.concatenate([c[1:] for c in chains])
    row = np.repeat(np.arange(len(chains)), [max(len(c) - 1, 0) for c in chains])
    key = np.minimum(a, b) * n + np.maximum(a, b)
    order = np.argsort(key, kind="stable")
    key, row = key[order], row[order]
    if not len(key):
        return out
    on_curve = np.zeros(n, bool)
    on_curve[a] = on_curve[b] = True
    corner = on_curve[mesh.quads]
    candidates = np.flatnonzero(corner & np.roll(corner, -1, axis=1))
    q, i = np.divmod(candidates, 4)
    start, end = mesh.quads[q, i], mesh.quads[q, (i + 1) % 4]
    wanted = np.minimum(start, end) * n + np.maximum(start, end)
    place = np.minimum(np.searchsorted(key, wanted), len(key) - 1)
    hit = key[place] == wanted
    out[candidates[hit]] = row[place[hit]]
    return out


def is_conforming(mesh: QuadMesh, on_curve: Bool) -> bool:
    """Whether every edge off the CAD curves has exactly two quads, of one face and oriented alike.

    Then each edge is run once in either direction: the sorted keys (face, lower node, higher node) of the half-edges that run
    upwards and of those that run downwards are the same, and none occurs twice.
    """
    start, end = mesh.quads, np.roll(mesh.quads, -1, axis=1)
    n = len(mesh.points)
    several = bool(len(mesh.quad_face)) and bool((mesh.quad_face != mesh.quad_face[0]).any())
    inner = ~on_curve.reshape(-1, 4)
    keys = []
    for low, high in ((start, end), (end, start)):
        use = low < high
        use &= inner
        key = low[use] * n
        key += high[use]
        if several:
            key += np.repeat(mesh.quad_face * n * n, np.count_nonzero(use, axis=1))
        key.sort()
        keys.append(key)
    upwards, downwards = keys
    return bool(np.array_equal(upwards, downwards) and (upwards[1:] > upwards[:-1]).all())


def inner_nodes(mesh: QuadMesh) -> Bool:
    """(n,) nodes on no CAD curve (embedded points are among them)."""
    out = np.ones(len(mesh.points), bool)
    for chain in mesh.curve_nodes:
        out[chain] = False
    return out


def turned_over(points: Float, quads: Int, face: Int, lines: Bool) -> Bool:
    """Quads of curved faces that lie against their neighbours: the normal turns by more than 100 degrees across an edge.

    Of the two quads at such an edge it is the one with more of these edges, or both.

    Parameters
    ----------
    points : (n, 3) float64
    quads : (q, 4) int64
    face : (q,) int64
    lines : (4 q,) bool
        Half-edges ``4 q + i`` on curves, where a surface may have a crease.

    Returns
    -------
    (q,) bool
    """
    corner = points[quads]
    area = np.cross(corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1])
    length = np.linalg.norm(area, axis=1)
    twin = twins(quads)
    half = np.flatnonzero((twin > np.arange(len(twin))) & ~lines)
    a, b = half // 4, twin[half] // 4
    same = (face[a] == face[b]) & (quads.ravel()[half] != quads.ravel()[twin[half]])  # oriented alike
    a, b = a[same], b[same]
    against = np.einsum("ec,ec->e", area[a], area[b]) < _AGAINST * length[a] * length[b]
    a, b = a[against], b[against]
    count = np.bincount(np.concatenate([a, b]), minlength=len(quads))
    out = np.zeros(len(quads), bool)
    out[a[count[a] >= count[b]]] = True
    out[b[count[b] >= count[a]]] = True
    return out


def quad_quality(mesh: QuadMesh, normals: Float) -> Float:
    """Scaled Jacobian (q,) of every quad; negative where it is turned over.

    Parameters
    ----------
    mesh : QuadMesh
    normals : (f, 3) float64
        As for `measure_quality`.
    """
    direction = normals[mesh.quad_face]
    curved = np.flatnonzero(np.isnan(direction[:, 0]))
    if not len(curved):
        return scaled_jacobian(mesh.points, mesh.quads, direction)
    corner = mesh.points[mesh.quads[curved]]
    area = np.cross(corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1])
    length = np.linalg.norm(area, axis=1, keepdims=True)
    direction[curved] = np.divide(area, length, out=np.zeros_like(area), where=length > 0.0)
    value = scaled_jacobian(mesh.points, mesh.quads, direction)
    lines = (curve_edges(mesh) >= 0).reshape(-1, 4)[curved].ravel()
    against = curved[turned_over(mesh.points, mesh.quads[curved], mesh.quad_face[curved], lines)]
    value[against] = -np.abs(value[against])
    return value


def measure_quality(mesh: QuadMesh, normals: Float) -> Quality:
    """Measure a quad mesh.

    Parameters
    ----------
    mesh : QuadMesh
    normals : (f, 3) float64
        Unit normal of every plane face, NaN for curved ones.

    Returns
    -------
    Quality
    """
    value = quad_quality(mesh, normals)
    inner = inner_nodes(mesh)
    valence = np.bincount(mesh.quads.ravel(), minlength=len(mesh.points))
    return Quality(
        nodes=len(mesh.points),
        quads=len(mesh.quads),
        blocks=int(np.count_nonzero(np.bincount(mesh.quad_block))),
        irregular=int((inner & (valence != 4) & (valence > 0)).sum()),
        min_scaled_jacobian=float(value.min(initial=np.inf)),
        p5_scaled_jacobian=float(np.quantile(value, 0.05)),
        mean_scaled_jacobian=float(value.mean()),
        inverted=int((value <= 0.0).sum()),
        conforming=is_conforming(mesh, curve_edges(mesh) >= 0),
    )
