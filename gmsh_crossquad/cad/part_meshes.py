"""The background triangles of a face that is made of several CAD faces, as Gmsh made them.

Gmsh meshes the joints between the parts like seams: the nodes on them belong to the triangles of both sides.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import gmsh
import numpy as np

from ..errors import MeshError
from ..records import Face, Float, Int, Model, Parts

__all__ = ["PartNodes", "joined", "part_nodes", "parts_of"]


class PartNodes(NamedTuple):
    """Nodes of one CAD face by ascending tag, and its triangles."""

    tags: Int
    points: Float
    parameters: Float
    triangles: Int  # of tags


def part_nodes(model: Model, tag: int, triangles: Int) -> PartNodes:
    """What Gmsh knows of the mesh of a CAD face; points are scaled, parameters NaN where there are none.

    Raises
    ------
    MeshError
    """
    if not len(triangles):
        raise MeshError("Gmsh made none")
    tags, coordinates, parameters = gmsh.model.mesh.getNodes(2, tag, includeBoundary=True, returnParametricCoord=True)
    tags, first = np.unique(np.asarray(tags, np.int64), return_index=True)
    points = (np.asarray(coordinates).reshape(-1, 3)[first] - model.origin) / model.scale
    uv = np.full((len(tags), 2), np.nan)
    if len(parameters) == 2 * len(coordinates) // 3:
        uv = np.asarray(parameters).reshape(-1, 2)[first]
    return PartNodes(tags, points, uv, triangles)


def joined(parts: Sequence[PartNodes], turned: Sequence[bool]) -> PartNodes:
    """All parts as one mesh, oriented as the first, without parameters."""
    tags, first = np.unique(np.concatenate([p.tags for p in parts]), return_index=True)
    points = np.concatenate([p.points for p in parts])[first]
    triangles = np.concatenate([p.triangles[:, ::-1] if t else p.triangles for p, t in zip(parts, turned, strict=True)])
    return PartNodes(tags, points, np.full((len(tags), 2), np.nan), triangles)


def parts_of(model: Model, face: Face, nodes: Sequence[PartNodes]) -> Parts:
    """The record of the parts of a face, from the mesh of the current Gmsh model."""
    edges, at = {}, {}
    owners: dict[int, list[int]] = {}
    ignored = set(model.ignored_curves)
    for part, tag in enumerate(face.tags):
        for c in gmsh.model.getAdjacencies(2, tag)[1].tolist():
            if c in ignored:
                owners.setdefault(c, []).append(part)
                edges[c], at[c] = _edges(c)
    own_edges, own_curve, own_at, other, local = [], [], [], [], []
    for part, p in enumerate(nodes):
        mine = [c for c in sorted(owners) if part in owners[c]]
        flat = np.concatenate([edges[c] for c in mine]) if mine else np.zeros((0, 2), np.int64)
        own_edges.append(np.searchsorted(p.tags, flat))
        own_at.append(np.concatenate([at[c] for c in mine]) if mine else np.zeros((0, 2)))
        own_curve.append(np.repeat(mine, [len(edges[c]) for c in mine]).astype(np.int64))
        beside = [owners[c][0] + owners[c][1] - part for c in mine]
        other.append(np.repeat(beside, [len(edges[c]) for c in mine]).astype(np.int64))
        local.append(np.searchsorted(p.tags, p.triangles))
    return Parts(
        points=tuple(p.points for p in nodes),
        triangles=tuple(local),
        parameters=tuple(p.parameters for p in nodes),
        edges=tuple(own_edges),
        curve=tuple(own_curve),
        at=tuple(own_at),
        other=tuple(other),
    )


def _edges(curve: int) -> tuple[Int, Float]:
    """Node tags (e, 2) of the mesh edges on a curve, from its start to its end, and the parameters there."""
    edges = np.asarray(gmsh.model.mesh.getElementsByType(1, curve)[1], np.int64).reshape(-1, 2)
    tags, _, t = gmsh.model.mesh.getNodes(1, curve, returnParametricCoord=True)
    known = dict(zip(np.asarray(tags, np.int64).tolist(), t.tolist()))
    low, high = (float(b[0]) for b in gmsh.model.getParametrizationBounds(1, curve))
    inner = [known[int(tag)] for tag in edges[1:, 0]]
    places = np.array([low, *inner, high])
    return edges, np.stack([places[:-1], places[1:]], axis=1)
