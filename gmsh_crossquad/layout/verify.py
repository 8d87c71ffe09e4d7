"""Exact check of a quad complex against the T-mesh it was made from.

Per face: every edge is used once or twice with opposite directions, every vertex has as many quads and as many fans of quads
as its sectors demand, Euler characteristic and number of components are those of the face.  Per model: CAD vertices are
distinct, CAD curves are simple chains that do not touch, and are used by exactly their faces.
"""

from __future__ import annotations

import itertools
from collections import Counter

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ..quad_edges import edges_of_quads
from ..records import Int, Model, TMesh
from .quotient import Quotient, curve_chain

__all__ = ["problems"]


def problems(model: Model, tmesh: TMesh, q: Quotient) -> list[str]:
    """What is wrong with the complex; empty when it is a valid conforming quad mesh of the model."""
    out: list[str] = []
    if not len(q.quads):
        return ["the complex is empty"]
    n = q.n_vertices
    chains = [curve_chain(tmesh, q, c) for c in range(len(model.curves))]
    uses: list[Counter[int]] = [Counter() for _ in model.curves]
    for f, face in enumerate(model.faces):
        for loop in face.loops:
            for c, _ in loop:
                uses[c][f] += 1
        for c in face.embedded_curves:
            uses[c][f] += 2
    # every curve edge, keyed, with the number of sides in every face
    curve_edge: dict[int, int] = {}
    owner = np.full(n, -1, np.int64)
    is_cad = np.zeros(n, bool)
    used_vertices = q.vertex[: len(model.vertices)]
    if (used_vertices < 0).any() or len(np.unique(used_vertices)) != len(used_vertices):
        out.append("CAD vertices are merged or lost")
    is_cad[used_vertices[used_vertices >= 0]] = True
    for c, chain in enumerate(chains):
        closed = model.curves[c].closed
        if len(chain) < 2 or len(set(chain)) != len(chain) - closed:
            out.append(f"curve {model.curves[c].tag} is no simple chain")
            continue
        for v in chain[1:-1]:
            if owner[v] >= 0 or is_cad[v]:
                out.append(f"curve {model.curves[c].tag} touches another curve")
                break
            owner[v] = c
        for a, b in itertools.pairwise(chain):
            curve_edge[min(a, b) * n + max(a, b)] = c
    quad_face = tmesh.patch_face[q.quad_patch]
    curve_keys = np.array(sorted(curve_edge), np.int64)
    curve_of_key = np.array([curve_edge[k] for k in curve_keys.tolist()], np.int64)
    for f, face in enumerate(model.faces):
        quads = q.quads[quad_face == f]
        where = f"face {face.tag}: "
        if not len(quads):
            out.append(where + "no quads")
            continue
        if any(len(set(x)) < 4 for x in quads.tolist()):
            out.append(where + "a quad with repeated vertices")
            continue
        edges, edge_rows = edges_of_quads(quads)
        count = np.bincount(edge_rows.ravel(), minlength=len(edges))
        a, b = quads.ravel(), np.roll(quads, -1, axis=1).ravel()
        if len(np.unique(a * n + b)) != len(a):
            out.append(where + "quads are not oriented alike")
        if (count > 2).any():
            out.append(where + "an edge with more than two quads")
            continue
        keys = edges[:, 0] * n + edges[:, 1]
        row = np.searchsorted(curve_keys, keys)
        row[row == len(curve_keys)] = 0
        on_curve = (curve_keys[row] == keys) if len(curve_keys) else np.zeros(len(keys), bool)
        wanted = np.full(len(edges), 2)
        wanted[on_curve] = [uses[c][f] for c in curve_of_key[row[on_curve]].tolist()]
        if (wanted != count).any():
            out.append(where + "an edge on a curve is not used by its faces, or a free edge is on no curve")
        if int(on_curve.sum()) != sum(len(chains[c]) - 1 for c in range(len(chains)) if uses[c][f]):
            out.append(where + "an edge of its curves is missing")
        vertices = np.unique(quads)
        euler = len(vertices) - len(edges) + len(quads)
        if euler != tmesh.euler[f]:
            out.append(where + f"Euler characteristic {euler} instead of {tmesh.euler[f]}")
        # quads per vertex
        expected = np.full(n, 4)
        fans = np.ones(n, np.int64)
        for c, chain in enumerate(chains):
            if uses[c][f]:
                expected[chain[1:-1]] = 2 * uses[c][f]
                fans[chain[1:-1]] = uses[c][f]
        at: dict[int, int] = {}
        for (g, node), value in tmesh.quads_at.items():
            if g == f:
                v = int(q.vertex[node])
                if v < 0:
                    out.append(where + f"critical node {node} is lost")
                    continue
                if v in at:
                    out.append(where + f"critical nodes {at[v]} and {node} are merged")
                at[v] = node
                expected[v] = value
        valence = np.bincount(quads.ravel(), minlength=n)
        wrong = vertices[valence[vertices] != expected[vertices]]
        if len(wrong):
            out.append(where + f"{len(wrong)} vertices with a wrong number of quads")
        # fans: corners of a vertex connected across interior, uncut edges
        twin_a, twin_b = _corner_links(quads, edge_rows, count, on_curve)
        m = quads.size
        label = connected_components(coo_array((np.ones(len(twin_a)), (twin_a, twin_b)), shape=(m, m)), directed=False)[1]
        pairs = np.unique(np.stack([quads.ravel(), label], axis=1), axis=0)
        n_fans = np.bincount(pairs[:, 0], minlength=n)
        inner = vertices[~is_cad[vertices]]
        if (n_fans[inner] != fans[inner]).any():
            out.append(where + "a vertex with a wrong number of fans")
    return out


def _corner_links(quads: Int, edge_rows: Int, count: Int, cut: np.ndarray) -> tuple[Int, Int]:
    """Pairs of corners (4 q + k) of neighbouring quads at the same vertex, across edges that are not cut."""
    flat = edge_rows.ravel()
    order = np.argsort(flat, kind="stable")
    first = np.searchsorted(flat[order], np.arange(len(count)))
    two = np.flatnonzero((count == 2) & ~cut)
    h, g = order[first[two]], order[first[two] + 1]

    def ends(half: Int) -> tuple[Int, Int]:
        quad, k = half // 4, half % 4
        return half, 4 * quad + (k + 1) % 4

    (h0, h1), (g0, g1) = ends(h), ends(g)
    return np.concatenate([h0, h1]), np.concatenate([g1, g0])
