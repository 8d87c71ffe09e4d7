"""Raise the order of the mesh that was put on the user's model.

Gmsh's own `setOrder` finds a node's parameters again for every new one, and neither sees nor cures elements that it turns over.
Here all new nodes are found at once (`fill.high_order`); every curve and every face gets its new nodes and elements in one call
each, and keeps its first-order nodes and the numbers of its elements.
"""

from __future__ import annotations

import gmsh
import numpy as np

from ..errors import MeshError
from ..fill.high_order import high_order
from ..records import Float, Int, Model, QuadMesh
from ..surfaces import Surfaces
from .put import curve_points
from .session import gmsh_errors

__all__ = ["raise_order"]

LINES = {2: 8, 3: 26}  # Gmsh's element types by order
QUADS = {2: 10, 3: 36}


def raise_order(model: Model, surfaces: Surfaces, mesh: QuadMesh, order: int) -> tuple[str, ...]:
    """Make the elements of the current Gmsh model those of a higher order, with all nodes on the CAD.

    Parameters
    ----------
    model : Model
    surfaces : Surfaces
    mesh : QuadMesh
        As `put_mesh` has just put it.
    order : {1, 2, 3}
        1 changes nothing.

    Returns
    -------
    tuple of str
        What the user should know: elements that had to be straighter than the model.

    Raises
    ------
    InputError
        Another order.
    MeshError
        Gmsh refuses the elements, or the mesh is not that of the model.
    """
    if order == 1:
        return ()
    new = high_order(model, surfaces, mesh, order, lambda row, t: curve_points(model, row, t))
    with gmsh_errors("raising the order"):
        # isolated points have numbers after those of the mesh
        shift = int(gmsh.model.mesh.getMaxNodeTag()) - len(mesh.points)
        tags = np.arange(1, len(mesh.points) + len(new.points) + 1)
        tags[len(mesh.points) :] += shift
        for curve, nodes, parameters, lines in zip(model.curves, new.curve_nodes, new.curve_parameters, new.lines, strict=True):
            _replace(1, curve.tag, LINES[order], tags[lines], tags[nodes], new.points[nodes - len(mesh.points)], parameters)
        bounds = np.searchsorted(mesh.quad_face, np.arange(len(model.faces) + 1))
        for row, (face, nodes) in enumerate(zip(model.faces, new.face_nodes, strict=True)):
            quads = tags[new.quads[bounds[row] : bounds[row + 1]]]
            _replace(2, face.tag, QUADS[order], quads, tags[nodes], new.points[nodes - len(mesh.points)], [])
    return new.notes


def _replace(dim: int, tag: int, kind: int, elements: Int, nodes: Int, points: Float, parameters: Float | list[float]) -> None:
    """The elements of an entity by others in the same order with the same numbers, and their new nodes."""
    _, numbers, _ = gmsh.model.mesh.getElements(dim, tag)
    if sum(len(n) for n in numbers) != len(elements):
        raise MeshError("the mesh of an entity is not the one that was put", entity=(dim, tag), remedy="report this model")
    if not len(elements):
        return
    gmsh.model.mesh.removeElements(dim, tag)
    if len(nodes):
        gmsh.model.mesh.addNodes(dim, tag, nodes, points.ravel(), parameters)
    gmsh.model.mesh.addElementsByType(tag, kind, numbers[0], elements.ravel())
