"""What `mesh` returns: the block layout, the cross field and the numbers, in the user's coordinates.

The layout is read off the final mesh, whose quads carry the block that they belong to.  A half-edge is on a block's boundary
where the quad across it belongs to another block, or where it lies on a CAD curve.  The boundary of a block is walked
counter-clockwise: after half-edge h comes the next one of the same quad if that is on the boundary too (a corner of the
block), else the one that continues straight ahead in the quad beside.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from dataclasses import field as attribute
from functools import cached_property
from os import PathLike
from typing import Protocol

import numpy as np

from .errors import MeshError
from .field.surface_mesh import SurfaceMesh
from .quality import Quality, curve_edges, measure_quality, twins
from .records import AlignedField, Bool, FaceMesh, Float, Int, Model, QuadMesh

__all__ = ["Block", "Edge", "FaceField", "Layout", "MeshResult", "Singularity", "Stages", "build_layout"]


class Stages(Protocol):
    """What the pipeline hands over (see `stages`)."""

    @property
    def model(self) -> Model: ...
    @property
    def meshes(self) -> Sequence[FaceMesh]: ...
    @property
    def fields(self) -> Sequence[AlignedField]: ...
    @property
    def mesh(self) -> QuadMesh: ...


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


@dataclass(frozen=True)
class Singularity:
    """A point where the cross field turns by a multiple of a quarter.

    Attributes
    ----------
    point : (3,) float64
    index : int
        Quarter turns: +1 where three blocks meet, -1 where five do.
    face : int
        Gmsh tag of the CAD face.
    """

    point: Float
    index: int
    face: int

    @property
    def valence(self) -> int:
        """Number of blocks around it."""
        return 4 - self.index


@dataclass(frozen=True)
class FaceField:
    """The cross field of one CAD face.

    Attributes
    ----------
    face : int
        Gmsh tag.
    points : (n, 3) float64; triangles : (m, 3) int64
        Background mesh.
    places : (e, 3) float64
        Midpoints of its edges, where the crosses sit.
    directions : (e, 3) float64
        Unit vector of one arm of every cross; the others are at quarter turns about `normal`.
    normal : (3,) float64
    """

    face: int
    points: Float
    triangles: Int
    places: Float
    directions: Float
    normal: Float


@dataclass(frozen=True)
class MeshResult:
    """The outcome of `gmsh_crossquad.mesh`.

    Attributes
    ----------
    stages : Stages
        The records of the pipeline (scaled coordinates).
    timings : mapping of str to float
        Wall seconds of every stage.
    notes : tuple of str
        Fall-backs that were taken and other things worth knowing.
    """

    stages: Stages
    timings: Mapping[str, float] = attribute(default_factory=dict)
    notes: tuple[str, ...] = ()

    @property
    def mesh(self) -> QuadMesh:
        """The nodes and quads."""
        return self.stages.mesh

    @cached_property
    def normals(self) -> Float:
        """(f, 3) unit normal of every face, by row of the model's faces."""
        return np.array([np.cross(face.axes[0], face.axes[1]) for face in self.stages.model.faces])

    @cached_property
    def quality(self) -> Quality:
        """Numbers of the mesh."""
        return measure_quality(self.mesh, self.normals)

    @cached_property
    def layout(self) -> Layout:
        """The blocks and their edges."""
        return build_layout(self.mesh, self.stages.model)

    @cached_property
    def field(self) -> tuple[FaceField, ...]:
        """The cross field, one record per CAD face."""
        return tuple(_face_field(self.stages.model, m, a) for m, a in zip(self.stages.meshes, self.stages.fields, strict=True))

    @cached_property
    def singularities(self) -> tuple[Singularity, ...]:
        """The singularities inside the faces."""
        model = self.stages.model
        out = []
        for mesh, aligned in zip(self.stages.meshes, self.stages.fields, strict=True):
            inner = np.ones(len(mesh.points), bool)
            inner[mesh.boundary.ravel()] = False
            rows = np.flatnonzero(inner & (aligned.index != 0))
            points = _unscale(model, model.faces[mesh.face].world(mesh.points[rows]))
            out += [Singularity(p, int(q), model.faces[mesh.face].tag) for p, q in zip(points, aligned.index[rows], strict=True)]
        return tuple(out)

    def write_vtu(self, path: str | PathLike[str]) -> None:
        """Write mesh, layout, field and singularities for ParaView; see `gmsh_crossquad.view.vtu`."""
        from .view.vtu import write_vtu

        write_vtu(self, path)

    def picture(self, path: str | PathLike[str]) -> None:
        """Draw field, layout and mesh into a PNG file; see `gmsh_crossquad.view.picture`."""
        from .view.picture import picture

        picture(self, path)


def _unscale(model: Model, points: Float) -> Float:
    out: Float = model.origin + model.scale * points
    return out


def _face_field(model: Model, mesh: FaceMesh, aligned: AlignedField) -> FaceField:
    face = model.faces[mesh.face]
    surface = SurfaceMesh(mesh.points, mesh.triangles)
    a, b = mesh.points[surface.edges[:, 0]], mesh.points[surface.edges[:, 1]]
    angle = np.arctan2(b[:, 1] - a[:, 1], b[:, 0] - a[:, 0]) + aligned.field.theta
    return FaceField(
        face=face.tag,
        points=_unscale(model, face.world(mesh.points)),
        triangles=mesh.triangles,
        places=_unscale(model, face.world(0.5 * (a + b))),
        directions=np.stack([np.cos(angle), np.sin(angle)], axis=1) @ face.axes,
        normal=np.cross(face.axes[0], face.axes[1]),
    )


def _on_block_boundary(mesh: QuadMesh, twin: Int, curve: Int) -> Bool:
    block = np.repeat(mesh.quad_block, 4)
    out: Bool = (twin < 0) | (curve >= 0)
    out |= block[np.maximum(twin, 0)] != block
    return out


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
