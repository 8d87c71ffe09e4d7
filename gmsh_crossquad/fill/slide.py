"""Slide the new nodes of poor elements along their curves and faces.

A thin cell beside a curve that bulges by more than its height needs its other edges bent as well; a quad whose corner lies inside
a smooth curve, which leaves it nearly no angle, needs the nodes of the curve at other places.  Both come out of
a minimum of `ShapeEnergy` over the new nodes of the poor elements' edges, which move along their curves (one parameter) or in
the tangent planes of their faces (two), and over those inside all elements that have one of these edges.  Nodes are put back on
curves and faces after every minimisation, so all of them are on the CAD all the time.  Where that does not suffice, the edges of
the neighbours of what is turned over still move, too.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize

from ..records import Float, Int
from .elements import Elements
from .moves import Moves
from .shape_energy import ShapeEnergy

__all__ = ["slide"]

GROWTHS = 4  # sets of edges that move, each with one more layer of quads
ROUNDS = 8  # minimisations of a set, with nodes put back between them
STEPS = 40  # of a minimisation
SETTLED = 1e-2  # part of the energy by which it sinks in the last round
LEAST_EPS = 1e-3
STEEP = 0.2  # eps over the least Jacobian, where that is negative


def slide(work: Elements, poor: Int, needed: Float, wanted: Float) -> tuple[Int, Int]:
    """Slide nodes until elements have a Jacobian.

    Parameters
    ----------
    work : Elements
        Changed in place.
    poor : (b,) int64
        Quads, all corners of which have a positive Jacobian while they are straight.
    needed, wanted : (q,) float64
        Bounds of the Jacobian below which the neighbours move, too, and above which no better one is looked for, over
        the Jacobian in the middle of the straight quad; NaN where the straight quad has none in a corner: its edges stay.

    Returns
    -------
    edges : (k,) int64
        Those that moved.
    quads : (m,) int64
        Those that have one of them.
    """
    fixed, moved = np.zeros(len(work.edges), bool), np.zeros(len(work.edges), bool)
    fixed[work.quad_edges[np.isnan(needed)]] = True
    for layers in range(GROWTHS):
        region = poor
        for _ in range(layers):
            region = work.users(work.quad_edges[region])
        edges = np.unique(work.quad_edges[region])
        edges = edges[~fixed[edges]]
        quads = work.users(edges)
        moved[edges] = True
        least = _minimise(work, edges, quads, wanted[quads])
        poor = quads[least <= needed[quads]]
        if not len(poor):
            break
    return np.flatnonzero(moved), work.users(np.flatnonzero(moved))


def _minimise(work: Elements, edges: Int, quads: Int, wanted: Float) -> Float:
    """Least Bernstein coefficients (m,) of `quads` after their `edges` moved."""
    energy = ShapeEnergy.of_straight(work.points[work.mesh.quads[quads]], work.order)
    nodes = work.nodes(quads)
    least, last = energy.least(nodes), np.inf
    for _ in range(ROUNDS):
        eps = max(LEAST_EPS, -STEEP * energy.lowest(nodes))
        moves = Moves.of(work, edges, quads)

        def value(y: Float, moves: Moves = moves, start: Float = nodes, eps: float = eps) -> tuple[float, Float]:
            new, gradient = energy.value(start + moves.displacements(y), eps)
            return new, moves.gradient(gradient)

        out = minimize(value, np.zeros(moves.size), jac=True, method="L-BFGS-B", bounds=moves.bounds, options={"maxiter": STEPS})
        moves.apply(out.x)
        nodes = work.nodes(quads)
        least = energy.least(nodes)
        if (least > wanted).all() or out.fun > (1 - SETTLED) * last:
            break
        last = out.fun
    return least
