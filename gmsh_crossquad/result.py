"""What `mesh` returns: the block layout, the cross field and the numbers, in the user's coordinates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from dataclasses import field as attribute
from functools import cached_property
from os import PathLike
from typing import Protocol

import numpy as np

from .block_layout import Block, Edge, Layout, build_layout
from .field.surface_mesh import SurfaceMesh
from .quality import Quality, measure_quality
from .records import AlignedField, FaceMesh, Float, Int, Model, QuadMesh

__all__ = ["Block", "Edge", "FaceField", "Layout", "MeshResult", "Singularity", "Stages"]


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
