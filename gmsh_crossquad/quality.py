"""The numbers of a quad mesh: scaled Jacobians, irregular vertices, conformity.

All of them come from the connectivity (integers) and from `scaled_jacobian`; nothing is measured with a tolerance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .embed.quality import scaled_jacobian
from .records import Bool, Float, Int, QuadMesh

__all__ = ["Quality", "curve_edges", "inner_nodes", "is_conforming", "measure_quality", "twins"]


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


def measure_quality(mesh: QuadMesh, normals: Float) -> Quality:
    """Measure a quad mesh.

    Parameters
    ----------
    mesh : QuadMesh
    normals : (f, 3) float64
        Unit normal of every face.

    Returns
    -------
    Quality
    """
    value = scaled_jacobian(mesh.points, mesh.quads, normals[mesh.quad_face])
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
