"""Elements that are turned over: their new nodes slide on the CAD, or go back towards the straight quad where that does not help.

The Bernstein coefficients of the Jacobian on a whole element bound it from below; the least of them, over the Jacobian in the
middle of the straight quad, is what Gmsh calls "minSJ" (they agree to rounding).  Where it is a small part of the straight quad's
least Jacobian, the nodes slide (`slide`), and go back as far as that stays good: between its nodes an edge follows its curve
best where they are evenly spaced.  What is turned over still gets back the nodes that it had, and has its edges' bulges, and what
the inside adds to Coons' rule, halved, at last to nothing.  That is decided by the sharper bound on parts of the element, so that
none leaves the CAD that need not.

Measured: of 18 elements of order 2 and 3 of seven models that had a bound below what is kept here (most are quads with two sides
on a smooth curve and nearly no angle between them) none had to leave the CAD; the edges of the poor quads alone were enough.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ..records import Bool, Float, Int
from .elements import Elements
from .jacobians import corner_jacobian, least_jacobian, quad_normals
from .slide import slide

__all__ = ["mend"]

ROUNDS = 6  # halvings of bulges of elements that are turned over; afterwards they are straight
KEEP = 0.05  # part of the straight quad's least Jacobian that an element must have
POOR = 0.1  # part of it below which nodes slide
SHARES = (0.0625, 0.125, 0.25, 0.5, 0.75)  # of the way to where they slide, of which the least is taken that is enough


def mend(work: Elements) -> tuple[int, Bool]:
    """Mend elements that are turned over.

    Parameters
    ----------
    work : Elements
        With all new nodes on the CAD; changed in place.

    Returns
    -------
    count : int
        Elements that had to become straighter than the model.
    straighter : (e,) bool
        Their edges that did.
    """
    straighter = np.zeros(len(work.edges), bool)
    q = np.flatnonzero(work.curved_quads())
    corners = work.points[work.mesh.quads[q]]
    normals = quad_normals(corners)
    least = corner_jacobian(corners, normals)
    bound = least_jacobian(work.grids(q), normals, np.full(len(q), -np.inf))
    poor = q[(least > 0) & (bound <= POOR * least)]  # what is turned over while straight cannot be mended here
    if not len(poor):
        return 0, straighter
    corners = work.points[work.mesh.quads]
    normals = quad_normals(corners)
    least = corner_jacobian(corners, normals)
    touched = _slide(work, poor, normals, least)
    return _straighten(work, np.union1d(poor, touched), normals, KEEP * least, straighter), straighter


def _slide(work: Elements, poor: Int, normals: Float, least: Float) -> Int:
    """Slide nodes as far as needed, and not where an element is turned over still; the quads concerned."""
    before = work.copy()
    part = np.where(least > 0, least, np.nan) / work.middles(np.arange(len(least)))
    edges, quads = slide(work, poor, KEEP * part, POOR * part)
    after = work.copy()
    moved = np.zeros(len(work.edges), bool)
    moved[edges] = True
    pair = np.flatnonzero(moved[work.quad_edges[quads]])
    links = len(moved) + quads[pair // 4], work.quad_edges[quads].ravel()[pair]
    graph = coo_array((np.ones(len(pair)), links), shape=(len(moved) + len(least),) * 2)
    component = connected_components(graph, directed=False)[1]  # of edges that moved and quads that have them
    of_edge, of_quad = component[edges], component[len(moved) + quads]
    # what cannot be as good as wanted goes all the way if that is good enough, else not at all
    bound = least_jacobian(work.grids(quads), normals[quads], KEEP * least[quads])
    share = np.ones(component.max() + 1)
    share[of_quad[bound <= KEEP * least[quads]]] = 0.0
    settled = share == 0.0
    for trial in SHARES:
        share[~settled] = trial
        work.set_between(before, after, edges, share[of_edge], quads, share[of_quad])
        bound = least_jacobian(work.grids(quads), normals[quads], np.full(len(quads), -np.inf))
        failed = np.zeros(len(share), bool)
        failed[of_quad[bound <= POOR * least[quads]]] = True
        settled |= ~failed
    share[~settled] = 1.0
    work.set_between(before, after, edges, share[of_edge], quads, share[of_quad])
    return quads


def _straighten(work: Elements, q: Int, normals: Float, wanted: Float, straighter: Bool) -> int:
    """Halve bulges where elements `q` are turned over, and their neighbours afterwards; the number of the former."""
    count = 0
    for round_ in range(ROUNDS + len(normals) + 1):  # from ROUNDS on, every round makes some element straight
        q = q[wanted[q] > 0]
        bad = q[least_jacobian(work.grids(q), normals[q], wanted[q]) <= wanted[q]]
        if not len(bad):
            break
        count += len(bad) if not round_ else 0
        share = 0.5 if round_ < ROUNDS else 0.0
        work.inside[bad] *= share
        e = np.unique(work.quad_edges[bad])
        e = e[work.bent()[e]]
        work.bulge[e] *= share
        straighter[e] = True
        changed = np.zeros(len(straighter), bool)
        changed[work.quad_edges[bad]] = True
        q = np.flatnonzero(changed[work.quad_edges].any(axis=1) & work.curved_quads())
    work.exact[straighter] = np.nan
    return count
