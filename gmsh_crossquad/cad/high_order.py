"""Raise the order of the mesh that was put on the user's model.

Gmsh's own `setOrder` finds a node's parameters again for every new one, and neither sees nor cures elements that it turns over.
Here all new nodes are found at once (`fill.high_order`); every curve and every face gets its new nodes and elements in one call
each, and keeps its first-order nodes and the numbers of its elements.
"""

from __future__ import annotations

import gmsh
import numpy as np

from ..errors import InputError, MeshError
from ..fill.high_order import high_order, turned_over
from ..records import Float, Int, Model, QuadMesh
from ..surfaces import Surfaces
from .curve_places import CurvePlaces
from .joined_surfaces import JoinedSurfaces
from .put import on_faces
from .session import gmsh_errors

__all__ = ["element_order", "raise_order"]

LINES = {2: 8, 3: 26}  # Gmsh's element types by order
QUADS = {2: 10, 3: 36}
INCOMPLETE = 16, 8  # type and number of nodes of the quad of order 2 without a node inside


def element_order(order: int | None, incomplete: bool | None) -> tuple[int, bool]:
    """Order of the elements, and whether quads of order 2 have 8 nodes; for None Gmsh's own options.

    Raises
    ------
    InputError
        `Mesh.ElementOrder` is no order that can be made.
    """
    if order is None:
        wanted = gmsh.option.getNumber("Mesh.ElementOrder")
        if wanted not in (1, 2, 3):
            raise InputError(f"Mesh.ElementOrder is {wanted:g}", remedy="use order 1, 2 or 3")
        order = int(wanted)
    if incomplete is None:
        incomplete = gmsh.option.getNumber("Mesh.SecondOrderIncomplete") != 0
    return order, bool(incomplete) and order == 2


def raise_order(model: Model, surfaces: Surfaces, mesh: QuadMesh, order: int, *, incomplete: bool = False) -> tuple[str, ...]:
    """Make the elements of the current Gmsh model those of a higher order, with all nodes on the CAD.

    Curves on no face keep their edges of order 1.

    Parameters
    ----------
    model : Model
    surfaces : Surfaces
    mesh : QuadMesh
        As `put_mesh` has just put it.
    order : {1, 2, 3}
        1 changes nothing.
    incomplete : bool
        At order 2, quads without a node inside.

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
    new = high_order(model, surfaces, mesh, order, CurvePlaces.find(model, surfaces), incomplete=incomplete)
    kind, kept = INCOMPLETE if incomplete else (QUADS[order], (order + 1) ** 2)
    quads = new.quads[:, :kept]
    n = len(mesh.points)
    used = np.ones(n + len(new.points), bool)
    used[new.quads[:, kept:]] = False
    with gmsh_errors("raising the order"):
        # points and curves on no face are numbered after the mesh (Gmsh's greatest number may be that of a mesh of before)
        lower = [*gmsh.model.getEntities(0), *gmsh.model.getEntities(1)]
        shift = sum(int(np.sum(gmsh.model.mesh.getNodes(*entity)[0] > n)) for entity in lower)
        tags = np.cumsum(used)
        tags[n:] += shift
        for curve, nodes, parameters, lines in zip(model.curves, new.curve_nodes, new.curve_parameters, new.lines, strict=True):
            numbers = _removed(1, curve.tag, len(lines))
            _add_nodes(1, curve.tag, tags[nodes], new.points[nodes - n], parameters)
            _add_elements(curve.tag, LINES[order], numbers, tags[lines])
        kept_nodes = [nodes[used[nodes]] for nodes in new.face_nodes]
        back = turned_over(order)[:kept]
        node_tags = [np.zeros(0, np.int64)] * len(kept_nodes)
        if isinstance(surfaces, JoinedSurfaces):
            node_tags = [surfaces.tags(row, new.points[nodes - n]) for row, nodes in enumerate(kept_nodes)]
        owned = list(on_faces(model, mesh, kept_nodes, node_tags))
        for tag, _, nodes in owned:  # first of all faces: a quad may have nodes of two
            _add_nodes(2, abs(tag), tags[nodes], new.points[nodes - n], [])
        for tag, rows, _ in owned:
            own = quads[rows] if tag > 0 else quads[rows][:, back]
            _add_elements(abs(tag), kind, _removed(2, abs(tag), len(own)), tags[own])
    return new.notes


def _removed(dim: int, tag: int, count: int) -> Int:
    """Remove the elements of an entity; their numbers."""
    _, numbers, _ = gmsh.model.mesh.getElements(dim, tag)
    if sum(len(n) for n in numbers) != count:
        raise MeshError("the mesh of an entity is not the one that was put", entity=(dim, tag), remedy="report this model")
    if not count:
        return np.zeros(0, np.int64)
    gmsh.model.mesh.removeElements(dim, tag)
    return np.asarray(numbers[0])


def _add_nodes(dim: int, tag: int, nodes: Int, points: Float, parameters: Float | list[float]) -> None:
    if len(nodes):
        gmsh.model.mesh.addNodes(dim, tag, nodes, points.ravel(), parameters)


def _add_elements(tag: int, kind: int, numbers: Int, nodes: Int) -> None:
    if len(nodes):
        gmsh.model.mesh.addElementsByType(tag, kind, numbers, nodes.ravel())
