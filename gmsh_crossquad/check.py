"""Judging a surface mesh from a file, by itself and against the model that it is a mesh of.

By itself: cells, scaled Jacobians against the mean normal of each flat surface (a cell folded over shows as negative) and against
the cell's own on others (there one that lies against its neighbours counts as negative), irregular vertices (valence not 4, off
the free boundary and off all line elements), and conformity: an edge with a single cell must not have nodes of other single-cell
edges in its inside (a hanging node), nor lie on another such edge (a crack), unless both are on curves of the model that bound
one surface: that crack was drawn.

`compare` goes on with the model; `judge` is the command.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from .embed.quality import scaled_jacobian
from .quality import turned_over, twins
from .records import Float, Int

if TYPE_CHECKING:
    from .cad.files import MeshArrays

__all__ = ["TOUCH", "Report", "check_mesh", "format_report", "free_edges"]

TOUCH = 1e-6
"""Distance over the mesh's diagonal below which two places are the same."""


@dataclass(frozen=True)
class Report:
    """The numbers of a mesh.

    Attributes
    ----------
    nodes, quads, triangles : int
    min_scaled_jacobian, mean_scaled_jacobian : float
    inverted : int
        Cells whose scaled Jacobian is not positive.
    irregular : int
        Inner vertices, off all curves, whose number of quads is not 4.
    hanging : int
        Edges with a single cell where there should be two, as far as the mesh alone (or with the model) can tell.
    groups : tuple of str
        Names of the physical groups.
    faults : tuple of str
        What is wrong, in words; empty for a good mesh.
    """

    nodes: int
    quads: int
    triangles: int
    min_scaled_jacobian: float
    mean_scaled_jacobian: float
    inverted: int
    irregular: int
    hanging: int
    groups: tuple[str, ...]
    faults: tuple[str, ...] = field(default=())


def _jacobians(points: Float, cells: Int, entity: Int, lines: Int) -> Float:
    """Scaled Jacobian of every cell against the mean normal of its surface where that is flat, else against its own, negative
    where it lies against its neighbours; these may meet in creases along `lines` (l, 2)."""
    area = 0.5 * np.cross(points[cells[:, 2]] - points[cells[:, 0]], points[cells[:, -1]] - points[cells[:, 1]])
    if cells.shape[1] == 3:
        area = 0.5 * np.cross(points[cells[:, 1]] - points[cells[:, 0]], points[cells[:, 2]] - points[cells[:, 0]])
    _, row = np.unique(entity, return_inverse=True)
    total: Float = np.stack([np.bincount(row, area[:, c]) for c in range(3)], axis=1).astype(np.float64)
    size = np.linalg.norm(area, axis=1)
    normal = _unit(total)[row]
    length = np.linalg.norm(total, axis=1)[row]
    # all normals parallel (or opposite, where folded): their cross products with the mean vanish
    turned = np.bincount(row, np.linalg.norm(np.cross(area, normal), axis=1)) > 1e-6 * np.bincount(row, size)
    curved = turned[row] | (length == 0.0)
    normal[curved] = _unit(area[curved])
    if cells.shape[1] == 4:
        value = scaled_jacobian(points, cells, normal)
        bent = np.flatnonzero(curved)
        if len(bent):
            half = _keys(cells[bent].ravel(), np.roll(cells[bent], -1, axis=1).ravel(), len(points))
            on_line = np.isin(half, _keys(lines[:, 0], lines[:, 1], len(points)))
            against = bent[turned_over(points, cells[bent], entity[bent], on_line)]
            value[against] = -np.abs(value[against])
        return value
    side = np.roll(points[cells], -1, axis=1) - points[cells]
    scale = np.linalg.norm(side, axis=2)
    product = (scale * np.roll(scale, 1, axis=1)).max(axis=1)
    value = 2.0 * np.einsum("tc,tc->t", area, normal) * (2.0 / np.sqrt(3.0))
    return np.divide(value, product, out=np.zeros(len(cells)), where=product > 0.0)


def _keys(start: Int, end: Int, n: int) -> Int:
    """One number for each edge, in whatever direction it runs."""
    out: Int = np.minimum(start, end) * n + np.maximum(start, end)
    return out


def _unit(vectors: Float) -> Float:
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.divide(vectors, length, out=np.zeros_like(vectors), where=length > 0.0)


def free_edges(mesh: MeshArrays) -> Int:
    """Edges (k, 2) with a single cell."""
    cells = np.concatenate(
        [mesh.quads, np.column_stack([mesh.triangles, mesh.triangles[:, 0]])]
    )  # a triangle: one edge of no length
    half = np.stack([cells.ravel(), np.roll(cells, -1, axis=1).ravel()], axis=1)
    real = half[:, 0] != half[:, 1]
    half = np.sort(half[real], axis=1)
    n = len(mesh.points)
    key, count = np.unique(half[:, 0] * n + half[:, 1], return_counts=True)
    alone = key[count == 1]
    return np.stack([alone // n, alone % n], axis=1)


def _lip_surface(mesh: MeshArrays, edges: Int) -> Int:
    """Surface (k,) of the free edges that are line elements of a curve, -1 for other edges."""
    out = np.full(len(edges), -1)
    if not len(mesh.quads):
        return out
    n = len(mesh.points)
    half = np.sort(np.stack([mesh.quads.ravel(), np.roll(mesh.quads, -1, axis=1).ravel()], axis=1), axis=1)
    key, first = np.unique(half[:, 0] * n + half[:, 1], return_index=True)
    wanted, line = edges[:, 0] * n + edges[:, 1], np.sort(mesh.lines, axis=1)
    drawn = np.isin(wanted, line[:, 0] * n + line[:, 1]) & np.isin(wanted, key)
    out[drawn] = mesh.quad_entity[first[np.searchsorted(key, wanted[drawn])] // 4]
    return out


def _hanging(points: Float, edges: Int, surface: Int, touch: float) -> int:
    """Free edges that another free edge's node lies on, or that coincide with another one over duplicate nodes.

    Not counted are contacts of lips: edges and nodes with the same `surface` (k,), not -1.
    """
    from .spatial import cKDTree

    if not len(edges):
        return 0
    a, b = points[edges[:, 0]], points[edges[:, 1]]
    length = np.linalg.norm(b - a, axis=1)
    nodes = np.unique(edges)
    near = cKDTree(points[nodes]).query_ball_point(0.5 * (a + b), 0.5 * length + touch)
    count = np.array([len(x) for x in near])
    edge = np.repeat(np.arange(len(edges)), count)
    node = nodes[np.concatenate([np.asarray(x, np.int64) for x in near])] if len(edge) else np.zeros(0, np.int64)
    other = (node != edges[edge, 0]) & (node != edges[edge, 1])
    edge, node = edge[other], node[other]
    direction = (b - a)[edge] / np.maximum(length[edge], touch)[:, None]
    offset = points[node] - a[edge]
    along = np.einsum("kc,kc->k", offset, direction)
    aside = np.linalg.norm(offset - along[:, None] * direction, axis=1)
    low, high = np.full(len(points), np.iinfo(np.int64).max), np.full(len(points), -1)
    np.minimum.at(low, edges, surface[:, None])
    np.maximum.at(high, edges, surface[:, None])
    drawn = (surface[edge] >= 0) & (surface[edge] == low[node]) & (low[node] == high[node])
    on = ~drawn & (aside < np.maximum(touch, 1e-3 * length[edge])) & (along > 0.01 * length[edge]) & (along < 0.99 * length[edge])
    hanging = np.zeros(len(edges), bool)
    hanging[edge[on]] = True
    mid = cKDTree(0.5 * (a + b))
    for i, j in sorted(mid.query_pairs(touch)):
        if surface[i] < 0 or surface[i] != surface[j]:
            hanging[[i, j]] = True
    return int(hanging.sum())


def check_mesh(mesh: MeshArrays) -> Report:
    """Judge a mesh by itself.

    Parameters
    ----------
    mesh : MeshArrays

    Returns
    -------
    Report
    """
    quality = np.concatenate(
        [
            _jacobians(mesh.points, cells, entity, mesh.lines)
            for cells, entity in ((mesh.quads, mesh.quad_entity), (mesh.triangles, mesh.triangle_entity))
            if len(cells)
        ]
        or [np.zeros(0)]
    )
    used = np.unique(np.concatenate([mesh.quads.ravel(), mesh.triangles.ravel()]))
    free = free_edges(mesh)
    inner = np.ones(len(mesh.points), bool)
    inner[free.ravel()] = False
    inner[mesh.lines.ravel()] = False
    valence = np.bincount(mesh.quads.ravel(), minlength=len(mesh.points))
    has_quads = valence > 0
    diagonal = float(np.linalg.norm(np.ptp(mesh.points[used], axis=0))) if len(used) else 0.0
    hanging = _hanging(mesh.points, free, _lip_surface(mesh, free), TOUCH * diagonal)
    faults = []
    if not len(mesh.quads):
        faults.append("no quads")
    if len(mesh.triangles):
        faults.append(f"{len(mesh.triangles)} triangles")
    inverted = int((quality <= 0.0).sum())
    if inverted:
        faults.append(f"{inverted} inverted cells")
    if mesh.folded:
        faults.append(f"{mesh.folded} elements of order 2 or 3 are turned over")
    if hanging:
        faults.append(f"not conforming at {hanging} edges")
    if _turned_over(mesh):
        faults.append("neighbouring cells of one surface are oriented differently")
    return Report(
        nodes=len(used),
        quads=len(mesh.quads),
        triangles=len(mesh.triangles),
        min_scaled_jacobian=float(quality.min(initial=np.inf)) if len(quality) else float("nan"),
        mean_scaled_jacobian=float(quality.mean()) if len(quality) else float("nan"),
        inverted=inverted,
        irregular=int((inner & has_quads & (valence != 4)).sum()),
        hanging=hanging,
        groups=tuple(name for _, name in sorted(mesh.groups)),
        faults=tuple(faults),
    )


def _turned_over(mesh: MeshArrays) -> bool:
    """Whether two quads of one surface run their common edge the same way."""
    twin = twins(mesh.quads)
    paired = np.flatnonzero(twin >= 0)
    start, entity = mesh.quads.ravel(), np.repeat(mesh.quad_entity, 4)
    other = twin[paired]
    return bool(((start[paired] == start[other]) & (entity[paired] == entity[other])).any())


def format_report(report: Report, name: str) -> str:
    """The report as a plain table."""
    rows = [
        ("nodes", f"{report.nodes}"),
        ("quads", f"{report.quads}"),
        ("triangles", f"{report.triangles}"),
        ("scaled Jacobian, min", f"{report.min_scaled_jacobian:.3f}"),
        ("scaled Jacobian, mean", f"{report.mean_scaled_jacobian:.3f}"),
        ("inverted cells", f"{report.inverted}"),
        ("irregular vertices", f"{report.irregular}"),
        ("conforming", "no" if report.hanging else "yes"),
        ("physical groups", ", ".join(report.groups) or "none"),
    ]
    lines = [name, *(f"  {label:<22} {value}" for label, value in rows)]
    lines.append("ok" if not report.faults else "fails: " + "; ".join(report.faults))
    return "\n".join(lines)
