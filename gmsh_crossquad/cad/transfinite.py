"""Nodes that the user's Transfinite Curve commands prescribe.

Gmsh has no call that returns them, so they are measured: the curves are meshed once with an endless size and without
minimum counts, all sizes made endless once more by the factor, which also scales those of a metric (that ignores the
least size) but not prescribed counts.  More than two segments on an open curve, or four on a closed one, are then
prescribed (up to that many Gmsh makes itself, for instance where two curves bound a face); the parameters of the nodes
hold count and progression.  Only where that finds something the curves are meshed once more, with a small size: a curve
that is long compared with it and has as few segments as before is prescribed to have them.

The mesh and the options of the model are as before afterwards.
"""

from __future__ import annotations

from collections.abc import Sequence

import gmsh
import numpy as np

from ..records import Float
from .session import MeshSnapshot, gmsh_errors, options

__all__ = ["transfinite_parameters"]

ENDLESS, FACTOR = 1e22, 1e6
OWN_OPEN, OWN_CLOSED = 2, 4  # segments that Gmsh makes itself, at most
FINE_NODES = 2000  # in the second mesh, on all curves together
PLAIN = {
    "General.AbortOnError": 0,  # homology that the user asks for fails on a mesh of curves
    "Mesh.MeshSizeFromPoints": 0,
    "Mesh.MeshSizeFromCurvature": 0,
    "Mesh.MinimumCircleNodes": 0,
    "Mesh.MinimumCurveNodes": 0,
    "Mesh.FlexibleTransfinite": 0,
    "Mesh.ElementOrder": 1,
    "Mesh.SubdivisionAlgorithm": 0,
    "Mesh.MeshOnlyVisible": 0,
    "Mesh.MeshOnlyEmpty": 0,
}


def transfinite_parameters(lengths: dict[int, float], closed: Sequence[int], kinds: dict[int, str]) -> dict[int, Float]:
    """Parameters of the prescribed nodes of curves of the current model.

    Parameters
    ----------
    lengths : dict
        Curve tag to its length, in the user's units.
    closed : sequence of int
        Tags of the closed curves among them.
    kinds : dict
        Curve tag to its Gmsh type.

    Returns
    -------
    dict
        Curve tag to the parameters (d + 1,) of all nodes, ascending; only for curves with prescribed nodes.
        Nothing where the model has discrete curves or a boundary layer, which put nodes on curves of their own.
    """
    fields = [gmsh.model.mesh.field.getType(int(tag)) for tag in gmsh.model.mesh.field.list()]
    if any(kind.startswith("Discrete") for kind in kinds.values()) or "BoundaryLayer" in fields:
        return {}
    own = {tag: OWN_CLOSED if tag in set(closed) else OWN_OPEN for tag in lengths}
    snapshot = MeshSnapshot.take()
    try:
        nodes = _mesh_curves(ENDLESS, list(lengths), FACTOR)
        found = {tag: nodes[tag] for tag in lengths if len(nodes[tag]) + 1 > own[tag]}
        if found:
            size = sum(lengths.values()) / FINE_NODES
            unsure = [t for t in lengths if t not in found and lengths[t] > 4 * own[t] * size]
            fine = _mesh_curves(size, unsure)
            found.update({tag: fine[tag] for tag in unsure if len(fine[tag]) == len(nodes[tag])})
    finally:
        snapshot.restore()
    bounds = {tag: gmsh.model.getParametrizationBounds(1, tag) for tag in found}
    return {tag: np.concatenate([bounds[tag][0], found[tag], bounds[tag][1]]) for tag in found}


def _mesh_curves(size: float, tags: Sequence[int], factor: float = 1.0) -> dict[int, Float]:
    """Parameters of the inner nodes of curves, meshed with a uniform size."""
    sizes = {"Mesh.MeshSizeMin": size, "Mesh.MeshSizeMax": size, "Mesh.MeshSizeFactor": factor}
    with gmsh_errors("meshing the curves"), options(**PLAIN, **sizes):
        gmsh.model.mesh.generate(1)
        if not len(gmsh.model.mesh.getNodes(1)[0]):
            return dict.fromkeys(tags, np.zeros(0))
        return {tag: np.sort(gmsh.model.mesh.getNodes(1, tag, returnParametricCoord=True)[2]) for tag in tags}
