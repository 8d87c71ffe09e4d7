"""Edges and chords of a guide grid, and the numbers of the fine nodes and quads.

A *guide chord* is a class of guide edges connected through opposite sides of quads.  All edges of chord c are cut into
``divisions[c]`` pieces, so every guide quad becomes a structured grid and the mesh is conforming by construction.

Fine nodes are numbered entity by entity, as Gmsh numbers its own meshes: CAD vertices, then each CAD curve from start
to end, then each face (guide vertices, inner edges, cells).  Fine quads are numbered face by face, cell by cell.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import MeshError
from ..quad_edges import edges_of_quads
from ..records import Bool, Guide, Int

__all__ = ["GuideTopology", "Numbering", "edge_nodes", "guide_chords", "guide_topology", "number"]


def guide_chords(quads: Int) -> tuple[Int, Int, Int, int]:
    """Edges of a quad mesh and the chord of every edge.

    Parameters
    ----------
    quads : (q, 4) int64

    Returns
    -------
    edges : (e, 2) int64
        Lower vertex first, in lexicographic order.
    quad_edges : (q, 4) int64
        Edge of side k, between corners k and k + 1.
    chord : (e,) int64
        Chord of every edge; chords are numbered by their first edge.
    n_chords : int
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    edges, rows = edges_of_quads(quads)
    i, j = rows[:, :2].ravel(), rows[:, 2:].ravel()
    graph = coo_array((np.ones(len(i), np.int8), (i, j)), shape=(len(edges), len(edges)))
    count, label = connected_components(graph, directed=False)
    _, first = np.unique(label, return_index=True)
    rank = np.empty(count, np.int64)
    rank[np.argsort(first, kind="stable")] = np.arange(count)
    return edges, rows, rank[label], int(count)


@dataclass(frozen=True)
class GuideTopology:
    """Topology of a guide grid with its CAD curves.

    Attributes
    ----------
    edges : (e, 2) int64; quad_edges : (q, 4) int64
    on_curve : (e,) bool
        True for edges that lie on a CAD curve.
    chain_edges : tuple of (k,) int64
        Edges of every chain in order.
    chain_forward : tuple of (k,) bool
        True where the edge (lower vertex first) runs with the chain.
    vertex_on_curve : (n,) bool
    vertex_face : (n,) int64
        Face of a vertex that is on no curve, else -1.
    edge_face : (e,) int64
        Face of an edge that is on no curve, else one of its faces.
    """

    edges: Int
    quad_edges: Int
    on_curve: Bool
    chain_edges: tuple[Int, ...]
    chain_forward: tuple[Bool, ...]
    vertex_on_curve: Bool
    vertex_face: Int
    edge_face: Int


def guide_topology(guide: Guide, edges: Int, quad_edges: Int) -> GuideTopology:
    """Find the edges of the chains and check that every other edge is inside one face.

    Parameters
    ----------
    guide : Guide
    edges : (e, 2) int64; quad_edges : (q, 4) int64
        From `guide_chords`.

    Raises
    ------
    MeshError
        A chain runs where there is no guide edge, or the guide is not conforming.
    """
    n = len(guide.points)
    key = edges[:, 0] * n + edges[:, 1]
    on_curve = np.zeros(len(edges), bool)
    on_vertex = np.zeros(n, bool)
    chain_edges, chain_forward = [], []
    for row, chain in enumerate(guide.chains):
        a, b = chain[:-1], chain[1:]
        want = np.minimum(a, b) * n + np.maximum(a, b)
        e = np.minimum(np.searchsorted(key, want), len(key) - 1)
        if len(chain) < 2 or np.any(key[e] != want):
            raise MeshError(f"the guide grid has a gap on curve row {row}", remedy="report this model")
        on_curve[e] = True
        on_vertex[chain] = True
        chain_edges.append(e.astype(np.int64))
        chain_forward.append(a < b)
    uses = np.bincount(quad_edges.ravel(), minlength=len(edges))
    face = guide.quad_face[:, None]
    edge_face = np.zeros(len(edges), np.int64)
    edge_face[quad_edges] = face
    if np.any(~on_curve & (uses != 2)) or np.any((edge_face[quad_edges] != face) & ~on_curve[quad_edges]):
        raise MeshError("the guide grid is not conforming", remedy="report this model")
    vertex_face = np.full(n, -1, np.int64)
    vertex_face[guide.quads] = face
    if np.any((vertex_face < 0) & ~on_vertex):
        raise MeshError("the guide grid has a vertex without quads", remedy="report this model")
    vertex_face[on_vertex] = -1
    return GuideTopology(edges, quad_edges, on_curve, tuple(chain_edges), tuple(chain_forward), on_vertex, vertex_face, edge_face)


@dataclass(frozen=True)
class Numbering:
    """Numbers of the fine nodes and quads of a guide grid.

    Attributes
    ----------
    divisions : (e,) int64
        Pieces of every guide edge.
    vertex_id : (n,) int64
        Node of every guide vertex.
    edge_first, edge_step : (e,) int64
        Node j of an edge (1 <= j < divisions, from its lower vertex) is ``edge_first + edge_step (j - 1)``.
    cell_first : (q,) int64
        First of the ``(ku - 1)(kv - 1)`` consecutive nodes inside a cell, u (side 0) major.
    quad_first : (q,) int64
        First of the ``ku kv`` consecutive fine quads of a cell, u major.
    cell_order : (q,) int64
        Guide quads in the order of their fine quads.
    vertex_node, curve_nodes, face_nodes
        As in `QuadMesh`.
    n_nodes, n_quads : int
    """

    divisions: Int
    vertex_id: Int
    edge_first: Int
    edge_step: Int
    cell_first: Int
    quad_first: Int
    cell_order: Int
    vertex_node: Int
    curve_nodes: tuple[Int, ...]
    face_nodes: tuple[Int, ...]
    n_nodes: int
    n_quads: int


def number(guide: Guide, topology: GuideTopology, divisions: Int, n_vertices: int, n_faces: int) -> Numbering:
    """Number the fine nodes and quads.

    Parameters
    ----------
    guide : Guide
    topology : GuideTopology
    divisions : (e,) int64
        Pieces of every guide edge, equal on opposite sides of every quad.
    n_vertices, n_faces : int
        Number of CAD vertices and faces of the model.
    """
    n, n_edges = len(guide.points), len(topology.edges)
    if np.any(divisions < 1):
        raise MeshError("a guide edge has no division", remedy="report this model")
    vertex_id = np.full(n, -1, np.int64)
    edge_first, edge_step = np.zeros(n_edges, np.int64), np.ones(n_edges, np.int64)

    # every curve end is a CAD vertex, so what is left of a chain is its inside
    on_cad = np.flatnonzero(guide.cad_vertex >= 0)
    on_cad = on_cad[np.argsort(guide.cad_vertex[on_cad], kind="stable")]
    vertex_id[on_cad] = np.arange(len(on_cad))
    top = len(on_cad)
    curve_nodes = []
    for chain, e, forward in zip(guide.chains, topology.chain_edges, topology.chain_forward):
        place = np.concatenate([[0], np.cumsum(divisions[e])])
        vertex_id[chain[1:-1]] = top + place[1:-1] - 1
        edge_first[e] = top + np.where(forward, place[:-1], place[1:] - 2)
        edge_step[e] = np.where(forward, 1, -1)
        inside = np.arange(top, top + place[-1] - 1)
        curve_nodes.append(np.concatenate([vertex_id[chain[:1]], inside, vertex_id[chain[-1:]]]))
        top += len(inside)
    if np.any(vertex_id[topology.vertex_face < 0] < 0):
        raise MeshError("a curve of the guide grid does not end at a CAD vertex", remedy="report this model")

    ku, kv = divisions[topology.quad_edges[:, 0]], divisions[topology.quad_edges[:, 1]]
    if np.any(ku != divisions[topology.quad_edges[:, 2]]) or np.any(kv != divisions[topology.quad_edges[:, 3]]):
        raise MeshError("opposite sides of a guide quad have different divisions", remedy="report this model")
    inner_nodes, inner_edge = (ku - 1) * (kv - 1), np.flatnonzero(~topology.on_curve)
    cell_order = np.argsort(guide.quad_face, kind="stable")
    cell_first = np.zeros(len(guide.quads), np.int64)
    face_nodes = []
    for face in range(n_faces):
        first = top
        v = np.flatnonzero((topology.vertex_face == face) & (guide.cad_vertex < 0))
        vertex_id[v] = top + np.arange(len(v))
        top += len(v)
        e = inner_edge[topology.edge_face[inner_edge] == face]
        edge_first[e] = top + _before(divisions[e] - 1)
        top += int(np.sum(divisions[e] - 1))
        q = cell_order[slice(*np.searchsorted(guide.quad_face[cell_order], [face, face + 1]))]
        cell_first[q] = top + _before(inner_nodes[q])
        top += int(np.sum(inner_nodes[q]))
        face_nodes.append(np.arange(first, top))
    quad_first = np.zeros(len(guide.quads), np.int64)
    quad_first[cell_order] = _before((ku * kv)[cell_order])
    vertex_node = np.full(n_vertices, -1, np.int64)
    known = guide.cad_vertex >= 0
    vertex_node[guide.cad_vertex[known]] = vertex_id[known]
    return Numbering(
        divisions,
        vertex_id,
        edge_first,
        edge_step,
        cell_first,
        quad_first,
        cell_order,
        vertex_node,
        tuple(curve_nodes),
        tuple(face_nodes),
        top,
        int(np.sum(ku * kv)),
    )


def edge_nodes(numbering: Numbering, edge: Int, reverse: Bool, count: int) -> Int:
    """Nodes (m, count - 1) inside edges with `count` divisions, from the lower vertex or (`reverse`) from the higher."""
    j = np.arange(1, count)
    place = np.where(reverse[:, None], count - j, j) - 1
    out: Int = numbering.edge_first[edge][:, None] + numbering.edge_step[edge][:, None] * place
    return out


def _before(count: Int) -> Int:
    """Sum of all counts before each entry."""
    out: Int = np.cumsum(count) - count
    return out
