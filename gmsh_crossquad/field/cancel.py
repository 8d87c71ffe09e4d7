"""Cancel opposite singularities that the smoothness of the field does not need, at any distance.

Diffusion from a start with spurious zeros leaves pairs of opposite singularities that are too far apart to meet, e.g. in
wide rings and empty far fields.  Moving n_j quarter turns from singularity j to a root along an edge path adds the integer
cocycle ``sum n_j r_j`` to the rotation F of the harmonic field; the field that is harmonic again is

    F + sum n_j R_j + (pi/2) sum m_i grad a_i,    R_j = r_j + difference(x_j),  x_j = 0 on the boundary,

with the harmonic functions a_i and free integers m_i of the holes (see `align`).  R_j and grad a_i are orthogonal to every
difference that vanishes on the boundary, so the energy is a quadratic form in (n, m) whose entries are sums over the paths,

    <R_i, R_j> = <r_i, R_j>,   <R_i, grad a_j> = <r_i, grad a_j>,   <F, R_i> = <F, r_i>,

and one back-substitution per singularity gives the energies of all combinations.  On a surface with handles loops around them
join the paths, with free integers like those of the holes (see `handles`): a field keeps its homotopy class for as long as
singularities stay, but which class is best depends on them.  The pair whose cancellation gives the least energy is cancelled,
with the best integers, as long as the energy rises by at most `_PAIR` each time: singularities cost blocks, and their own energy
depends on the size of the triangles at their cores.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sp

from ..records import CrossField, Float, Int
from .align import Aligner, closest
from .handles import handle_loops
from .singularities import QUARTER, move_index, singular_vertices

__all__ = ["cancel_pairs"]

#: A pair is kept if the energy without it is greater by this much; it gains pi/8 for every factor e in its distance over the size
#: of its cores.  Measured on eccentric rings, airfoils and sections: with pi/8 some rings keep one of two pairs, which makes
#: spirals; with 1 the layouts of 15 of 17 faces had fewer blocks than with all pairs.
_PAIR = 1.0
#: partners that are tried for each singularity of the rarer sign, and pairs in all
_PARTNERS = 3
_PAIRS = 60


class _Energies:
    """Energies of a harmonic field after moving indices from vertices to a root.

    Parameters
    ----------
    aligner : Aligner
    field : CrossField
        Aligned and harmonic.
    paths : list of list of int
        Edge paths through interior vertices; all end at the root.
    handles : list of list of int
        Loops around handles.
    """

    def __init__(self, aligner: Aligner, field: CrossField, paths: list[list[int]], handles: list[list[int]]) -> None:
        self.count = len(paths)
        paths = paths + handles
        operators = aligner.operators
        cocycles = np.zeros((len(paths), *field.rotation.shape))
        for cocycle, path in zip(cocycles, paths):
            move_index(aligner.mesh, cocycle, path, 1)
        x = operators.solve(np.zeros((len(aligner.mesh.edges), len(paths))), cocycles)
        # only the corners that some path turns are read
        rows = np.flatnonzero(cocycles.any(axis=0))
        triangle, corner = np.divmod(rows, 3)
        first = aligner.mesh.triangle_edges[triangle, corner]
        second = aligner.mesh.triangle_edges[triangle, (corner + 1) % 3]
        moved = cocycles.reshape(len(paths), -1)[:, rows]
        weighted = moved * operators.weight.ravel()[rows]
        slope = weighted @ field.rotation.ravel()[rows]
        form = weighted @ (moved.T + x[second] - x[first])
        if aligner.holes:
            basis, energy = aligner.harmonic()
            mixed = QUARTER * weighted @ (basis[second] - basis[first])
            slope = np.concatenate([slope, QUARTER * aligner.flux(field.rotation)[aligner.holes]])
            form = np.block([[form, mixed], [mixed.T, QUARTER**2 * energy]])
        self.slope, self.form = slope, form

    def best(self, amount: Int) -> tuple[float, Int]:
        """Energy that moving `amount` (k,) quarter turns along the paths adds, and the best integers of handles and holes."""
        k, n = self.count, amount.astype(float)
        rise = float(n @ self.slope[:k] + 0.5 * n @ self.form[:k, :k] @ n)
        if len(self.slope) == k:
            return rise, np.zeros(0, np.int64)
        pull, energy = self.slope[k:] + n @ self.form[:k, k:], self.form[k:, k:]
        m = closest(energy, -pull)
        return rise + float(pull @ m + 0.5 * m @ energy @ m), m


def cancel_pairs(aligner: Aligner, field: CrossField) -> CrossField:
    """Cancel pairs of opposite singularities that save little energy.

    Parameters
    ----------
    aligner : Aligner
    field : CrossField
        Aligned and harmonic, without singular triangles.

    Returns
    -------
    CrossField
        Aligned and harmonic; its singularities are a part of those of `field`.
    """
    mesh = aligner.mesh
    vertices, index = singular_vertices(mesh, field.rotation)
    handles = handle_loops(mesh)
    if not handles and not (np.any(index > 0) and np.any(index < 0)):
        return field
    from scipy.sparse.csgraph import connected_components

    a, b = mesh.edges[~mesh.boundary_vertex[mesh.edges].any(axis=1)].T
    length = np.linalg.norm(mesh.points[b] - mesh.points[a], axis=1)
    graph = sp.coo_matrix((length, (a, b)), (len(mesh.points), len(mesh.points))).tocsr()
    part = connected_components(graph, directed=False)[1]
    rotation = field.rotation.copy()
    moved = False
    for label in np.unique(np.concatenate([part[vertices], part[[loop[0] for loop in handles]]])):
        here = part[vertices] == label
        around = [loop for loop in handles if part[loop[0]] == label]
        if not around and not (np.any(index[here] > 0) and np.any(index[here] < 0)):
            continue
        for path, amount in _moves(aligner, field, graph, vertices[here], index[here], around):
            move_index(mesh, rotation, path, amount)
            moved = True
    return aligner.rotate(replace(field, rotation=rotation)).field if moved else field


def _moves(
    aligner: Aligner, field: CrossField, graph: sp.csr_matrix, vertices: Int, index: Int, handles: list[list[int]]
) -> list[tuple[list[int], int]]:
    """Edge paths among singularities of one part of the face and around its handles, and the quarter turns to move along them."""
    used, pairs = np.unique(_candidates(aligner.mesh.points[vertices], index), return_inverse=True)
    pairs = pairs.reshape(-1, 2)
    paths = _paths(graph, vertices[used])
    energies = _Energies(aligner, field, paths, handles)
    start = index[used]
    amount = np.zeros_like(start)
    added, turns = energies.best(amount)
    for _ in range(int(np.abs(start).sum())):
        best: tuple[float, Int, Int] | None = None
        for plus, minus in pairs.tolist():
            if start[plus] > amount[plus] and start[minus] < amount[minus]:
                trial = amount.copy()
                trial[plus] += 1
                trial[minus] -= 1
                energy, free = energies.best(trial)
                if best is None or energy < best[0]:
                    best = energy, trial, free
        if best is None or best[0] > added + _PAIR:
            break
        added, amount, turns = best
    moves = zip(paths + handles, np.concatenate([amount, turns[: len(handles)]]), strict=True)
    return [(path, int(n)) for path, n in moves if n]


def _candidates(p: Float, index: Int) -> Int:
    """(k, 2) rows of opposite singularities, the positive first: the nearest partners of each of the rarer sign."""
    plus, minus = np.flatnonzero(index > 0), np.flatnonzero(index < 0)
    apart = np.linalg.norm(p[plus, None] - p[None, minus], axis=2)
    swap = len(plus) > len(minus)
    rank = np.argsort(apart.T if swap else apart, axis=1, kind="stable")[:, :_PARTNERS]
    rare = np.repeat(np.arange(len(rank)), rank.shape[1])
    i, j = (rank.ravel(), rare) if swap else (rare, rank.ravel())
    nearest = np.argsort(apart[i, j], kind="stable")[:_PAIRS]
    return np.stack([plus[i[nearest]], minus[j[nearest]]], axis=1)


def _paths(graph: sp.csr_matrix, vertices: Int) -> list[list[int]]:
    """Shortest edge paths from vertices to the first of them."""
    from scipy.sparse.csgraph import dijkstra

    if not len(vertices):
        return []
    before = dijkstra(graph, directed=False, indices=vertices[:1], return_predecessors=True)[1][0]
    out = []
    for v in vertices.tolist():
        path = [v]
        while before[path[-1]] >= 0:
            path.append(int(before[path[-1]]))
        out.append(path)
    return out
