"""Nodes of order 2 and 3: on the CAD curves, on the curved faces, and between them where a face is plane.

Edges on a curve get nodes of the curve at equal chord lengths.  Edges inside a curved face get the points of the face next to
the chord's, and the inside of a quad those next to Coons' rule.  Where that turns an element over, the nodes are placed
otherwise (`mend`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..errors import InputError, MeshError
from ..quad_edges import edges_of_quads
from ..records import Bool, Float, Int, Model, QuadMesh
from ..surfaces import Surfaces
from .elements import Elements
from .mend import mend

__all__ = ["HighOrder", "high_order", "turned_over"]

SAMPLES = 8  # pieces of an edge on a curve by which its length is measured

# places of Gmsh's nodes in the grid of an element: corners, edges around, inside
GRID = {
    2: ((0, 0), (2, 0), (2, 2), (0, 2), (1, 0), (2, 1), (1, 2), (0, 1), (1, 1)),
    3: (
        *((0, 0), (3, 0), (3, 3), (0, 3)),
        *((1, 0), (2, 0), (3, 1), (3, 2), (2, 3), (1, 3), (0, 2), (0, 1)),
        *((1, 1), (2, 1), (2, 2), (1, 2)),
    ),
}


@dataclass(frozen=True)
class HighOrder:
    """The elements of order p of a mesh, with the nodes that it lacks.

    Attributes
    ----------
    points : (m, 3) float64
        New nodes, in the user's coordinates; numbered from ``len(mesh.points)``: curve by curve, then face by face.
    curve_nodes : tuple of (k (p - 1),) int64; curve_parameters : tuple of (k (p - 1),) float64
        The new nodes of every curve in order, and their CAD parameters.
    face_nodes : tuple of (j,) int64
        The new nodes inside every face.
    lines : tuple of (k, p + 1) int64
        Elements of every curve: both ends, then the inside.
    quads : (q, (p + 1)^2) int64
        In the order of `QuadMesh.quads`: corners, edges around, inside, as Gmsh has them.
    notes : tuple of str
    """

    points: Float
    curve_nodes: tuple[Int, ...]
    curve_parameters: tuple[Float, ...]
    face_nodes: tuple[Int, ...]
    lines: tuple[Int, ...]
    quads: Int
    notes: tuple[str, ...]


def high_order(
    model: Model,
    surfaces: Surfaces,
    mesh: QuadMesh,
    order: int,
    evaluate: Callable[[int, Float], Float],
    *,
    incomplete: bool = False,
) -> HighOrder:
    """Elements of order 2 or 3 on the CAD.

    Parameters
    ----------
    model : Model
    surfaces : Surfaces
    mesh : QuadMesh
    order : {2, 3}
    evaluate : callable (curve row, parameters (m,)) -> (m, 3)
        Exact points of a CAD curve, in the user's coordinates.
    incomplete : bool
        Nodes inside quads follow from those around them (Coons' rule), so that the quads may do without.

    Raises
    ------
    InputError
        Another order.
    MeshError
        The mesh is not conforming.
    """
    if order not in GRID:
        raise InputError(f"elements of order {order} cannot be made", remedy="use order 1, 2 or 3")
    edges, quad_edges = edges_of_quads(mesh.quads)
    work = Elements.start(model, surfaces, mesh, order, edges, quad_edges, evaluate, inner=not incomplete)
    rows = []
    for row, chain in enumerate(mesh.curve_nodes):
        e, forward = _chain(edges, chain, len(mesh.points))
        work.put_on_curve(row, e, forward, mesh.curve_parameters[row], _places(evaluate, row, mesh.curve_parameters[row], order))
        rows.append((e, forward))
    on_curve = work.curve >= 0
    uses = np.bincount(quad_edges.ravel(), minlength=len(edges))
    if np.any(uses[~on_curve] != 2):
        raise MeshError("an edge inside a face has not two quads", remedy="report this model")
    work.put_on_faces()
    count, straighter = mend(work)
    notes: tuple[str, ...] = ()
    if count:
        notes = (
            f"{count} elements of order {order} would have been turned over: {np.count_nonzero(straighter)} of their edges "
            f"({np.count_nonzero(straighter & on_curve)} on curves) are straighter than the model",
        )
    return _record(model, mesh, work, rows, notes)


def turned_over(order: int) -> list[int]:
    """Gmsh's numbering of the nodes of a quad, seen from its other side: corner 0 stays, corners 1 and 3 change places."""
    place = {p: k for k, p in enumerate(GRID[order])}
    return [place[j, i] for i, j in GRID[order]]


def _chain(edges: Int, chain: Int, n: int) -> tuple[Int, Bool]:
    """Rows of the edges of a curve, and whether they run with it (lower node first)."""
    a, b = chain[:-1], chain[1:]
    want = np.minimum(a, b) * n + np.maximum(a, b)
    e = np.minimum(np.searchsorted(edges[:, 0] * n + edges[:, 1], want), len(edges) - 1)
    if np.any(edges[e, 0] * n + edges[e, 1] != want):
        raise MeshError("the mesh has a gap on a curve", remedy="report this model")
    return e.astype(np.int64), a < b


def _places(evaluate: Callable[[int, Float], Float], row: int, t: Float, order: int) -> Float:
    """Parameters (k, order - 1) that cut every edge of a curve into pieces of equal length."""
    u = np.linspace(0.0, 1.0, SAMPLES + 1)
    some = t[:-1, None] + u * np.diff(t)[:, None]
    x = evaluate(row, some.ravel()).reshape(*some.shape, 3)
    s = np.concatenate([np.zeros((len(some), 1)), np.cumsum(np.linalg.norm(np.diff(x, axis=1), axis=2), axis=1)], axis=1)
    want = np.arange(1, order) / order * s[:, -1:]
    k = np.minimum((s[:, None, 1:-1] <= want[:, :, None]).sum(axis=2), SAMPLES - 1)
    low, high = np.take_along_axis(s, k, axis=1), np.take_along_axis(s, k + 1, axis=1)
    share = np.divide(want - low, high - low, out=np.full(want.shape, 0.5), where=high > low)
    out: Float = np.take_along_axis(some, k, axis=1) * (1 - share) + np.take_along_axis(some, k + 1, axis=1) * share
    return out


def _record(
    model: Model,
    mesh: QuadMesh,
    work: Elements,
    rows: list[tuple[Int, Bool]],
    notes: tuple[str, ...],
) -> HighOrder:
    """Number the new nodes and write the elements."""
    inner = work.order - 1
    first = np.zeros(len(work.edges), np.int64)  # first new node of every edge
    top = len(mesh.points)
    curve_nodes, parameters, lines = [], [], []
    new = [np.zeros((0, 3))]
    for (e, forward), chain in zip(rows, mesh.curve_nodes, strict=True):
        first[e] = top + inner * np.arange(len(e))
        nodes = first[e][:, None] + np.arange(inner)
        x = (work.straight[e] + work.bulge[e]) * model.scale + model.origin
        x = np.where(np.isnan(work.exact[e]), x, work.exact[e])
        new.append(np.where(forward[:, None, None], x, x[:, ::-1]).reshape(-1, 3))
        parameters.append(np.where(forward[:, None], work.t[e], work.t[e, ::-1]).ravel())
        lines.append(np.column_stack([chain[:-1], chain[1:], nodes]))
        curve_nodes.append(nodes.ravel())
        top += nodes.size
    step = np.ones(len(work.edges), np.int64)
    for e, forward in rows:
        step[e[~forward]] = -1
        first[e[~forward]] += inner - 1
    edge_face = np.where(work.curve >= 0, -1, work.edge_face)
    inside_first = np.zeros(len(mesh.quads), np.int64)
    face_nodes = []
    for f in range(len(model.faces)):
        e, q = np.flatnonzero(edge_face == f), np.flatnonzero(mesh.quad_face == f)
        start = top
        first[e] = top + inner * np.arange(len(e))
        top += inner * len(e)
        inside_first[q] = top + inner**2 * np.arange(len(q))
        top += inner**2 * len(q)
        parts = (work.straight[e] + work.bulge[e]).reshape(-1, 3), work.grids(q)[:, 1:-1, 1:-1].reshape(-1, 3)
        new.append(np.concatenate(parts) * model.scale + model.origin)
        face_nodes.append(np.arange(start, top))
    edge_nodes = first[:, None] + step[:, None] * np.arange(inner)
    grid = np.empty((len(mesh.quads), inner + 2, inner + 2), np.int64)
    grid[:, 0, 0], grid[:, -1, 0], grid[:, -1, -1], grid[:, 0, -1] = mesh.quads.T
    sides = work.around(np.arange(len(mesh.quads)), edge_nodes[work.quad_edges])
    grid[:, 1:-1, 0], grid[:, -1, 1:-1], grid[:, 1:-1, -1], grid[:, 0, 1:-1] = sides
    grid[:, 1:-1, 1:-1] = inside_first[:, None, None] + np.arange(inner**2).reshape(inner, inner)
    i, j = np.array(GRID[work.order]).T
    points = np.concatenate(new)
    return HighOrder(points, tuple(curve_nodes), tuple(parameters), tuple(face_nodes), tuple(lines), grid[:, i, j], notes)
