"""First positions of the guide grid, from the geometry of the T-mesh.

Arc points lie on their arc by arc length; a vertex of the complex that stands for several elements takes the place of the
most important one (CAD vertex, CAD curve, singularity, else their mean), and what lies between such places on an arc follows
their shifts; the inside of every patch is filled by Coons' rule.  On curved faces the points of arcs, which lie on background
triangles, are put on the surface, and patches are filled in steps (`bent_patches`).  Measured: of the 7,388 quads around a
wing of 1/250 of the domain 42 are inverted at the start, 686 where the arcs do not follow.
"""

from __future__ import annotations

import numpy as np

from ..layout.blocks import base_complex
from ..layout.quotient import Quotient, arc_points, curve_chain
from ..records import Bool, Float, Guide, Int, Model, TMesh
from ..surfaces import Surfaces
from .bent_patches import fill_bent

__all__ = ["coons", "place"]

SMALLEST_STEP = 0.1


def coons(grid: Float) -> Float:
    """Fill the inside of a grid (a + 1, b + 1, d) from its sides by blended transfinite interpolation (Coons).

    Lines between the two long sides; what the short sides deviate from such lines is added, weighted by (1 - u)^p with u the
    way along from that side and p the aspect ratio: it fades out over one width, so that a strip that narrows stays inside.
    """
    a, b = grid.shape[0] - 1, grid.shape[1] - 1
    if a < 2 or b < 2:
        return grid.copy()
    length = [0.5 * (_length(g[:, 0]) + _length(g[:, -1])) for g in (grid, grid.swapaxes(0, 1))]
    if length[0] < length[1]:
        return _ruled(grid.swapaxes(0, 1), length[1] / max(length[0], np.finfo(float).tiny)).swapaxes(0, 1)
    return _ruled(grid, length[0] / max(length[1], np.finfo(float).tiny))


def _ruled(grid: Float, power: float) -> Float:
    out = grid.copy()
    a, b = grid.shape[0] - 1, grid.shape[1] - 1
    u = (np.arange(1, a) / a)[:, None, None]
    v = (np.arange(1, b) / b)[None, :, None]
    lines = (1 - v) * grid[:, :1] + v * grid[:, -1:]
    left, right = grid[:1, 1:-1] - lines[:1], grid[-1:, 1:-1] - lines[-1:]
    out[1:-1, 1:-1] = lines[1:-1] + (1 - u) ** power * left + u**power * right
    return out


def _length(line: Float) -> float:
    return float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())


def place(model: Model, surfaces: Surfaces, tmesh: TMesh, q: Quotient, fine: tuple[Int, ...] | None = None) -> Guide:
    """The unsmoothed guide grid.

    Parameters
    ----------
    model, surfaces, tmesh, q
        `q` is the quotient with the guide's divisions.
    fine : tuple of (k,) int64, optional
        For every curve the final edges of every guide edge; needed where the curve prescribes its nodes.

    Returns
    -------
    Guide
    """
    n_nodes = len(tmesh.position)
    element = np.full((len(q.vertex), 3), np.nan)
    element[:n_nodes] = tmesh.position
    on = np.full(len(q.vertex), -1, np.int64)
    at = np.zeros(len(q.vertex))
    on[:n_nodes], at[:n_nodes] = tmesh.curve, tmesh.curve_arclength
    for arc in np.flatnonzero(q.divisions > 1).tolist():
        k = int(q.divisions[arc])
        rows = int(q.offset[arc]) + np.arange(k - 1)
        line = tmesh.polyline[arc]
        s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
        t = np.arange(1, k) / k
        element[rows] = np.stack([np.interp(t * s[-1], s, line[:, c]) for c in range(3)], axis=1)
        if tmesh.arc_curve[arc] >= 0:
            on[rows] = tmesh.arc_curve[arc]
            at[rows] = tmesh.arc_start[arc] + t * tmesh.length[arc]

    chains = tuple(np.array(curve_chain(tmesh, q, c), np.int64) for c in range(len(model.curves)))
    n = q.n_vertices
    points = np.zeros((n, 3))
    curve = np.full(n, -1, np.int64)
    arclength = np.zeros(n)
    cad_vertex = np.full(n, -1, np.int64)
    cad_vertex[q.vertex[: len(model.vertices)]] = np.arange(len(model.vertices))

    joinable = np.flatnonzero(q.vertex[: q.n_joinable] >= 0)
    vertex = q.vertex[joinable]
    points = _mean(vertex, element[joinable], n, points)
    singular = joinable[(joinable < n_nodes)]
    singular = singular[tmesh.critical[singular] & (tmesh.curve[singular] < 0)]
    points[q.vertex[singular]] = element[singular]
    for c, chain in enumerate(chains):
        curve[chain[1:-1]] = c
    mine = joinable[(on[joinable] >= 0) & (on[joinable] == curve[q.vertex[joinable]])]
    arclength = _mean(q.vertex[mine], at[mine][:, None], n, arclength[:, None])[:, 0]
    held = curve >= 0
    held[q.vertex[joinable[joinable < n_nodes]]] = True
    fixed = cad_vertex >= 0
    for c, chain in enumerate(chains):
        spacing = model.curves[c].spacing
        if spacing is not None and fine is not None:
            s = spacing[np.concatenate([[0], np.cumsum(fine[c])])]
            fixed[chain[1:-1]] = True
        else:
            s = _spread(np.concatenate([[0.0], arclength[chain[1:-1]], [model.curves[c].length]]))
        arclength[chain[1:-1]] = s[1:-1]
        points[chain[1:-1]] = model.curves[c].at(s[1:-1])
    fixed[q.vertex[np.flatnonzero(tmesh.pinned)]] = True
    points[fixed & (cad_vertex >= 0)] = model.vertices[cad_vertex[cad_vertex >= 0]]
    points = _carry(tmesh, q, element, points, held)

    quad_face = tmesh.patch_face[q.quad_patch]
    face = np.full(n, -1, np.int64)
    face[q.quads] = quad_face[:, None]
    inside = np.unique(vertex)
    inside = inside[(curve[inside] < 0) & (cad_vertex[inside] < 0)]
    inside = inside[surfaces.curved[face[inside]]]
    if len(inside):
        points[inside] = surfaces.feet(face[inside], points[inside])

    quad_size = np.empty((len(q.quads), 2))
    row = 0
    curved: list[tuple[Int, int]] = []
    for p, grid in q.grids:
        ids = q.vertex[grid]
        if surfaces.curved[tmesh.patch_face[p]]:
            curved.append((ids, int(tmesh.patch_face[p])))
        else:
            points[ids] = coons(points[ids])
        a, b = grid.shape[0] - 1, grid.shape[1] - 1
        side = [sum(float(tmesh.length[arc]) for arc, _ in s) for s in tmesh.patches[p]]
        quad_size[row : row + a * b] = 0.5 * (side[0] + side[2]) / a, 0.5 * (side[1] + side[3]) / b
        row += a * b
    points = fill_bent(points, curved, surfaces)
    curve_edges = np.concatenate([np.zeros((0, 2), np.int64), *(np.stack([c[:-1], c[1:]], axis=1) for c in chains)])
    block, _ = base_complex(q.quads, quad_face, curve_edges, n, fixed)
    return Guide(
        points=points,
        curve=curve,
        arclength=arclength,
        fixed=fixed,
        cad_vertex=cad_vertex,
        quads=q.quads,
        quad_face=quad_face,
        quad_block=block,
        quad_size=quad_size,
        chains=chains,
    )


def _carry(tmesh: TMesh, q: Quotient, element: Float, points: Float, held: Bool) -> Float:
    """Let the vertices inside arcs follow the shifts of the nodes and curve vertices (`held`) on and at the ends of their arcs.

    Joined nodes and spread vertices on curves lie elsewhere than the T-mesh has them; along an arc the shift is interpolated
    linearly between them.  A vertex on several arcs takes the mean.
    """
    total, count = np.zeros_like(points), np.zeros(len(points))
    for arc in np.flatnonzero((q.divisions > 1) & (tmesh.arc_curve < 0)).tolist():
        rows = np.array(arc_points(tmesh, q.divisions, q.offset, arc))
        v = q.vertex[rows]
        known = held[v]
        known[[0, -1]] = True
        shift = points[v] - element[rows]
        t = np.arange(len(rows))
        at = np.flatnonzero(known)
        shift = np.stack([np.interp(t, at, shift[at, c]) for c in range(3)], axis=1)
        free = np.flatnonzero(~known)
        np.add.at(total, v[free], (element[rows] + shift)[free])
        np.add.at(count, v[free], 1)
    some = count > 0
    points[some] = total[some] / count[some, None]
    return points


def _mean(group: Int, values: Float, n: int, out: Float) -> Float:
    """Mean of the rows of `values` per group; groups without rows keep `out`."""
    count = np.bincount(group, minlength=n)
    some = count > 0
    result = out.copy()
    for k in range(values.shape[1]):
        result[some, k] = np.bincount(group, values[:, k], minlength=n)[some] / count[some]
    return result


def _spread(s: Float) -> Float:
    """Move places towards even spacing, as little as needed for steps of a tenth of the even one, in order."""
    even = np.linspace(s[0], s[-1], len(s))
    unit = even[1] - even[0]
    step = np.diff(s)
    low = step < SMALLEST_STEP * unit
    if not low.any():
        return s
    share = float(((SMALLEST_STEP * unit - step[low]) / (unit - step[low])).max())
    return (1 - share) * s + share * even


def curve_mask(guide: Guide) -> Bool:
    """Guide vertices on CAD curves or vertices."""
    out = guide.curve >= 0
    for chain in guide.chains:
        out[chain] = True
    return out
