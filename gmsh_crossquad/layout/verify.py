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
    curves_of_face: list[list[int]] = [[] for _ in model.faces]
    for c, use in enumerate(uses):
        for f in use:
            curves_of_face[f].append(c)
    critical: list[list[tuple[int, int]]] = [[] for _ in model.faces]
    for (f, node), value in tmesh.quads_at.items():
        critical[f].append((node, value))
    order = np.argsort(quad_face, kind="stable")
    bounds = np.searchsorted(quad_face[order], np.arange(len(model.faces) + 1)).tolist()
    expected, fans = np.full(n, 4), np.ones(n, np.int64)
    for f, face in enumerate(model.faces):
        quads = q.quads[order[bounds[f] : bounds[f + 1]]]
        where = f"face {face.tag}: "
        if not len(quads):
            out.append(where + "no quads")
            continue
        if (np.diff(np.sort(quads, axis=1), axis=1) == 0).any():
            out.append(where + "a quad with repeated vertices")
            continue
        edges, edge_rows = edges_of_quads(quads)
        count = np.bincount(edge_rows.ravel(), minlength=len(edges))
        if len(np.unique(quads * n + np.roll(quads, -1, axis=1))) != quads.size:
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
        if int(on_curve.sum()) != sum(len(chains[c]) - 1 for c in curves_of_face[f]):
            out.append(where + "an edge of its curves is missing")
        vertices, corner = np.unique(quads, return_inverse=True)
        corner = corner.ravel()
        euler = len(vertices) - len(edges) + len(quads)
        if euler != tmesh.euler[f]:
            out.append(where + f"Euler characteristic {euler} instead of {tmesh.euler[f]}")
        # quads per vertex; what is expected of other vertices than these is put back below
        touched = [vertices]
        for c in curves_of_face[f]:
            inside = chains[c][1:-1]
            expected[inside] = 2 * uses[c][f]
            fans[inside] = uses[c][f]
            touched.append(np.array(inside, np.int64))
        at: dict[int, int] = {}
        for node, value in critical[f]:
            v = int(q.vertex[node])
            if v < 0:
                out.append(where + f"critical node {node} is lost")
                continue
            if v in at:
                out.append(where + f"critical nodes {at[v]} and {node} are merged")
            at[v] = node
            expected[v] = value
        valence = np.bincount(corner, minlength=len(vertices))
        wrong = int((valence != expected[vertices]).sum())
        if wrong:
            out.append(where + f"{wrong} vertices with a wrong number of quads")
        # fans: corners of a vertex connected across interior, uncut edges
        twin_a, twin_b = _corner_links(quads, edge_rows, count, on_curve)
        m = quads.size
        label = connected_components(coo_array((np.ones(len(twin_a)), (twin_a, twin_b)), shape=(m, m)), directed=False)[1]
        pairs = np.unique(corner * m + label)
        n_fans = np.bincount(pairs // m, minlength=len(vertices))
        if (n_fans != fans[vertices])[~is_cad[vertices]].any():
            out.append(where + "a vertex with a wrong number of fans")
        back = np.concatenate([*touched, np.array(list(at), np.int64)])
        expected[back], fans[back] = 4, 1
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
