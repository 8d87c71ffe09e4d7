"""Put the final mesh on the user's own CAD entities, and exact points of them.

Every entity gets its nodes and elements in one call each (more calls are quadratic in Gmsh).  Nodes on curves carry their
CAD parameter, so that Gmsh can make elements of higher order on them.  Nodes and elements are numbered from 1 without
gaps: vertices, curves, faces.  Physical groups hang on entities and need nothing.

The seam of a periodic face and its poles need no nodes: `setOrder` finds the place of every node on such faces itself (tried on
spheres, cylinders and tori with and without parameters; only a curve whose end vertex carries no node made it crash).  So it may
where a curve without length was left out: one of its end vertices carries an element only, with the node of the other.

Measured with 10^6 quads: 0.13 s where Gmsh's memory is warm, 0.35 s where it is not; the numbers go over without a copy
but for the + 1.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import gmsh
import numpy as np

from ..errors import MeshError
from ..records import Float, Int, Model, QuadMesh
from .loose import evenly_spaced, loose_curves, loose_points
from .periodic import unlink
from .session import gmsh_errors

__all__ = ["curve_points", "on_faces", "put_mesh", "vertex_points"]

POINT, LINE, QUAD = 15, 1, 3  # Gmsh's element types


def curve_points(model: Model, curve_row: int, parameters: Float) -> Float:
    """Exact points of a CAD curve of the current Gmsh model.

    Parameters
    ----------
    model : Model
    curve_row : int
        Row of ``model.curves``.
    parameters : (n,) float64
        CAD parameters.

    Returns
    -------
    (n, 3) float64
        In the user's coordinates.  A discrete curve is the polyline of its mesh.

    Raises
    ------
    MeshError
        Gmsh cannot evaluate the curve.
    """
    curve = model.curves[curve_row]
    if gmsh.model.getType(1, curve.tag).startswith("Discrete"):
        columns = [np.interp(parameters, curve.parameters, curve.points[:, c]) for c in range(3)]
        return np.stack(columns, axis=1) * model.scale + model.origin
    with gmsh_errors("evaluating", entity=(1, curve.tag)):
        return np.asarray(gmsh.model.getValue(1, curve.tag, parameters)).reshape(-1, 3)


def vertex_points(model: Model) -> Float:
    """Exact places (v, 3) of the CAD vertices of the current Gmsh model, in the user's coordinates."""
    out: Float = model.vertices * model.scale + model.origin
    for row, tag in enumerate(model.vertex_tags.tolist()):
        if tag >= 0 and not gmsh.model.getType(0, tag).startswith("Discrete"):
            with gmsh_errors("evaluating", entity=(0, tag)):
                out[row] = gmsh.model.getValue(0, tag, [])
    return out


def put_mesh(model: Model, mesh: QuadMesh, parameters: Sequence[Float | None] | None = None) -> None:
    """Replace the mesh of the current Gmsh model.

    All entities lose the mesh they had.  Vertices, curves and faces of `model` get nodes and elements; so do points and
    curves in physical groups that are on no face, as Gmsh does.  The edges of those curves are about as long as the mesh's.

    Parameters
    ----------
    model : Model
        Read from the current Gmsh model.
    mesh : QuadMesh
    parameters : sequence of (k, 2) float64 or None, optional
        For every face the CAD parameters (u, v) of ``mesh.face_nodes``, or None; they spare Gmsh from finding them again.

    Raises
    ------
    MeshError
        Gmsh refuses the mesh.
    """
    of_faces: Sequence[Float | None] = [None] * len(model.faces) if parameters is None else parameters
    with gmsh_errors("taking the mesh"):
        alone = loose_points(model)
        alone_points = [gmsh.model.getValue(0, tag, []) for tag in alone]
        gmsh.model.mesh.clear()
        unlink()
        element = 1
        free_vertices = {}  # nodes of CAD vertices that Gmsh has not: they belong to their curve
        for tag, node in zip(model.vertex_tags.tolist(), mesh.vertex_node.tolist()):
            if node < 0:
                continue
            if tag < 0:
                free_vertices[node] = True
                continue
            element += _put_point(tag, node + 1, mesh.points[node], element)
        for tag, row in model.vertex_twins:  # an element alone: a second node at the same place would be a crack
            gmsh.model.mesh.addElementsByType(tag, POINT, [element], [int(mesh.vertex_node[row]) + 1])
            element += 1
        for number, (tag, point) in enumerate(zip(alone, alone_points), start=len(mesh.points) + 1):
            element += _put_point(tag, number, point, element)
        for curve, nodes, places in zip(model.curves, mesh.curve_nodes, mesh.curve_parameters):
            first = 0 if free_vertices.pop(int(nodes[0]), False) else 1
            _put_nodes(1, curve.tag, nodes[first:-1], mesh.points, places[first:-1])
            element += _put_elements(curve.tag, LINE, np.stack([nodes[:-1], nodes[1:]], axis=1), element)
        owned = list(on_faces(model, mesh, mesh.face_nodes, mesh.face_node_tag))
        for row, (tag, _, nodes) in enumerate(owned):  # first of all faces: a quad may have nodes of two
            _put_nodes(2, abs(tag), nodes, mesh.points, None if len(mesh.quad_tag) else of_faces[row])
        for tag, rows, _ in owned:
            quads = mesh.quads[rows] if tag > 0 else mesh.quads[rows][:, [0, 3, 2, 1]]
            element += _put_elements(abs(tag), QUAD, quads, element) if len(quads) else 0
        if loose := loose_curves(model):
            numbers = {tag: node + 1 for tag, node in zip(model.vertex_tags.tolist(), mesh.vertex_node.tolist()) if node >= 0}
            numbers.update(zip(alone, range(len(mesh.points) + 1, len(mesh.points) + len(alone) + 1)))
            sides = mesh.points[mesh.quads] - mesh.points[np.roll(mesh.quads, 1, axis=1)]
            size = float(np.median(np.linalg.norm(sides, axis=-1)))
            number = len(mesh.points) + len(alone) + 1
            for tag in loose:
                added, elements = _put_loose_curve(tag, size, numbers, number, element)
                number, element = number + added, element + elements


def on_faces(
    model: Model, mesh: QuadMesh, face_nodes: Sequence[Int], node_tags: Sequence[Int]
) -> Iterator[tuple[int, slice | Int, Int]]:
    """What belongs on every CAD face.

    Parameters
    ----------
    model : Model
    mesh : QuadMesh
    face_nodes : sequence of (j,) int64
        Nodes inside every face of the model.
    node_tags : sequence of (j,) int64
        Gmsh tags of the CAD faces that they are on; only read where there are faces of several.

    Yields
    ------
    tag : int
        Gmsh tag of a CAD face, negative where its quads are oriented the other way.
    rows : slice or (n,) int64
        Its quads.
    nodes : (j,) int64
        The nodes inside it.

    Raises
    ------
    MeshError
        The quads are not ordered by face.
    """
    if np.any(np.diff(mesh.quad_face) < 0):
        raise MeshError("the quads are not ordered by face", remedy="report this model")
    bounds = np.searchsorted(mesh.quad_face, np.arange(len(model.faces) + 1)).tolist()
    for row, (face, nodes) in enumerate(zip(model.faces, face_nodes, strict=True)):
        own = slice(bounds[row], bounds[row + 1])
        if not face.parts:
            yield face.tag, own, nodes
            continue
        for part in face.parts:
            signed = -part.tag if part.turned else part.tag
            yield signed, np.flatnonzero(mesh.quad_tag == signed), nodes[node_tags[row] == part.tag]


def _put_loose_curve(tag: int, size: float, nodes: dict[int, int], number: int, element: int) -> tuple[int, int]:
    """Nodes, numbered from `number`, and elements of a curve on no face; its ends keep the node that they have in `nodes`.

    Returns the numbers of nodes and of elements.
    """
    places, points = evenly_spaced(tag, size)
    ends = [abs(end) for _, end in gmsh.model.getBoundary([(1, tag)], combined=False)]
    if not ends:
        raise MeshError("the curve has no end point", entity=(1, tag), remedy="give it one, or take it out of its Physical Curve")
    first, made = number, 0
    for end, point in zip(ends, (points[0], points[-1])):
        if end not in nodes:
            nodes[end] = number
            number += 1
            made += _put_point(end, nodes[end], point, element + made)
    inner = np.arange(number, number + len(places) - 2)
    if len(inner):
        gmsh.model.mesh.addNodes(1, tag, inner.astype(np.uint64), points[1:-1].ravel(), places[1:-1])
    chain = np.array([nodes[ends[0]], *inner.tolist(), nodes[ends[-1]]]) - 1
    made += _put_elements(tag, LINE, np.stack([chain[:-1], chain[1:]], axis=1), element + made)
    return number + len(inner) - first, made


def _put_point(tag: int, node: int, point: Float, element: int) -> int:
    """A node and a point element on a CAD vertex; the number of elements."""
    gmsh.model.mesh.addNodes(0, tag, [node], point)
    gmsh.model.mesh.addElementsByType(tag, POINT, [element], [node])
    return 1


def _put_nodes(dim: int, tag: int, nodes: Int, points: Float, parameters: Float | None = None) -> None:
    """Nodes of an entity, in one call."""
    if len(nodes) == 0:
        return
    consecutive = nodes[-1] - nodes[0] == len(nodes) - 1 and bool(np.all(np.diff(nodes) == 1))
    part = points[nodes[0] : nodes[-1] + 1] if consecutive else points[nodes]
    places: Float | list[float] = [] if parameters is None else np.ravel(parameters)
    gmsh.model.mesh.addNodes(dim, tag, (nodes + 1).view(np.uint64), part.ravel(), places)


def _put_elements(tag: int, kind: int, nodes: Int, first: int) -> int:
    """Elements of an entity, numbered from `first`, in one call; their number."""
    numbers = np.arange(first, first + len(nodes), dtype=np.uint64)
    gmsh.model.mesh.addElementsByType(tag, kind, numbers, (nodes.ravel() + 1).view(np.uint64))
    return len(nodes)
