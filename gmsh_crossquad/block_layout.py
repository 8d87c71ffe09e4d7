"""The block layout of a mesh as records: blocks, edges, and the CAD entities that they lie on.

The layout is read off the final mesh, whose quads carry the block that they belong to.  A half-edge is on a block's boundary
where the quad across it belongs to another block, or where it lies on a CAD curve.  The boundary of a block is walked
counter-clockwise: after half-edge h comes the next one of the same quad if that is on the boundary too (a corner of the
block), else the one that continues straight ahead in the quad beside.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .errors import MeshError
from .quality import curve_edges, twins
from .records import Bool, Float, Int, Model, QuadMesh

__all__ = ["Block", "Edge", "Layout", "build_layout"]


@dataclass(frozen=True)
class Edge:
    """An edge of the block layout.

    Attributes
    ----------
    curve : int or None
        Gmsh tag of the CAD curve that it is a piece of.
    points : (k, 3) float64
        Polyline through its mesh nodes, in the user's coordinates.
    nodes : (k,) int64
        Rows of the mesh's nodes.
    """

    curve: int | None
    points: Float
    nodes: Int

    @property
    def divisions(self) -> int:
        """Number of mesh edges."""
        return len(self.nodes) - 1


@dataclass(frozen=True)
class Block:
    """A four-sided block.

    Attributes
    ----------
    face : int
        Gmsh tag of its CAD face.
    sides : four of (int, int)
        Edge of the layout and +1 or -1 (run backwards), counter-clockwise around the block.
    divisions : (int, int)
        Quads along sides 0 and 2, and along sides 1 and 3.
    """

    face: int
    sides: tuple[tuple[int, int], ...]
    divisions: tuple[int, int]


@dataclass(frozen=True)
class Layout:
    """The block layout: conforming, every side of a block is one edge.

    Attributes
    ----------
    blocks : tuple of Block
    edges : tuple of Edge
    """

    blocks: tuple[Block, ...]
    edges: tuple[Edge, ...]


def _on_block_boundary(mesh: QuadMesh, twin: Int, curve: Int) -> Bool:
    block = np.repeat(mesh.quad_block, 4)
    out: Bool = (twin < 0) | (curve >= 0)
    out |= block[np.maximum(twin, 0)] != block
    return out


def _cut_rings(mesh: QuadMesh, boundary: Bool, twin: Int, ahead: Int, straight: Int) -> None:
    """Mark a line across every block without corners: a ring is one block that is its own neighbour there.

    The line starts at the CAD vertex with the lowest node, else at the lowest node, of the ring's boundary.  A torus is cut
    open first, along a line through its lowest node.
    """
    block = np.repeat(mesh.quad_block, 4)
    cornered = np.bincount(block, boundary & boundary[ahead], minlength=int(block.max(initial=-1)) + 1) > 0
    node = mesh.quads.ravel()
    on_boundary = np.zeros(len(mesh.points), bool)
    on_boundary[node[boundary]] = True
    cad = np.zeros(len(mesh.points), bool)
    cad[mesh.vertex_node[mesh.vertex_node >= 0]] = True
    for ring in np.flatnonzero(~cornered & (np.bincount(block, minlength=len(cornered)) > 0)).tolist():
        if not boundary[block == ring].any():  # a torus: the first cut makes it a ring
            mine = np.flatnonzero(block == ring)
            h = int(mine[np.argmin(node[mine])])
            while not boundary[h]:
                boundary[h] = boundary[twin[h]] = on_boundary[node[h]] = True
                h = int(straight[h])
        across = np.flatnonzero((block == ring) & ~boundary & on_boundary[node])
        if not len(across):
            continue
        h = int(across[np.lexsort((node[across], ~cad[node[across]]))[0]])
        while not boundary[h]:
            boundary[h] = boundary[twin[h]] = True
            if boundary[ahead[h]]:
                break
            h = int(straight[h])


def build_layout(mesh: QuadMesh, model: Model) -> Layout:
    """The block layout of a mesh.

    Parameters
    ----------
    mesh : QuadMesh
    model : Model

    Returns
    -------
    Layout
        Blocks in the order of their numbers in ``mesh.quad_block``.

    Raises
    ------
    MeshError
        Where a block is not a grid of quads.
    """
    twin, curve = twins(mesh.quads), curve_edges(mesh)
    boundary = _on_block_boundary(mesh, twin, curve)
    h = np.arange(len(twin))
    ahead = h - h % 4 + (h + 1) % 4
    beside = twin[ahead]
    straight = beside - beside % 4 + (beside + 1) % 4
    _cut_rings(mesh, boundary, twin, ahead, straight)
    turns = boundary[ahead]
    following = np.where(turns, ahead, straight)
    corner = np.zeros(len(h), bool)  # half-edges that start a side
    corner[ahead[boundary & turns]] = True
    starts = np.flatnonzero(boundary & corner)
    starts = starts[np.argsort(mesh.quad_block[starts // 4], kind="stable")]
    first = np.flatnonzero(np.diff(mesh.quad_block[starts // 4], prepend=-1))
    members = np.bincount(mesh.quad_block)
    follow, is_corner = following.tolist(), corner.tolist()
    node = mesh.quads.ravel()
    edges: list[Edge] = []
    number: dict[tuple[int, ...], int] = {}
    blocks: list[Block] = []
    for f in first.tolist():
        g = int(starts[f])
        sides: list[tuple[int, int]] = []
        counts: list[int] = []
        for _ in range(4):
            begin, run = g, [g]
            g = follow[g]
            while not is_corner[g] and len(run) <= len(h):
                run.append(g)
                g = follow[g]
            nodes = np.append(node[run], node[g])
            key = tuple(nodes.tolist())
            forward = key <= key[::-1]
            key = key if forward else key[::-1]
            if key not in number:
                number[key] = len(edges)
                row = int(curve[begin])
                ordered = np.array(key)
                edges.append(Edge(model.curves[row].tag if row >= 0 else None, mesh.points[ordered], ordered))
            sides.append((number[key], 1 if forward else -1))
            counts.append(len(run))
        quad = int(starts[f]) // 4
        tag = model.faces[int(mesh.quad_face[quad])].tag
        size = int(members[mesh.quad_block[quad]])
        if g != int(starts[f]) or counts[0] != counts[2] or counts[1] != counts[3] or counts[0] * counts[1] != size:
            raise MeshError(
                "a block of the mesh is not a grid of quads", entity=(2, tag), location=mesh.points[mesh.quads[quad, 0]]
            )
        blocks.append(Block(tag, tuple(sides), (counts[0], counts[1])))
    if len(blocks) != np.count_nonzero(members):
        raise MeshError("a block of the mesh has no corners", remedy="this is a fault of the program, please report it")
    return Layout(tuple(blocks), tuple(edges))
