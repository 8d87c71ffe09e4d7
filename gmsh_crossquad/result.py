"""What `mesh` returns: the block layout, the cross field and the numbers, in the user's coordinates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from dataclasses import field as attribute
from functools import cached_property
from os import PathLike
from typing import TYPE_CHECKING, Protocol

import numpy as np

from .block_layout import Block, Edge, Layout, build_layout
from .face_field import FaceField, Singularity, face_field, singularities_of
from .quality import Quality, measure_quality, quad_quality
from .records import AlignedField, FaceMesh, Float, Model, QuadMesh

if TYPE_CHECKING:
    from .cad.extrude import Extrusion

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
    order : int
        Order of the elements in Gmsh; all numbers here are of the straight quads.
    incomplete : bool
        Quads of order 2 have 8 nodes.
    """

    stages: Stages
    timings: Mapping[str, float] = attribute(default_factory=dict)
    notes: tuple[str, ...] = ()
    order: int = 1
    incomplete: bool = False

    @property
    def mesh(self) -> QuadMesh:
        """The nodes and quads."""
        return self.stages.mesh

    @property
    def face_tags(self) -> tuple[int, ...]:
        """Gmsh tags of the faces, by row of the model's faces."""
        return tuple(face.tag for face in self.stages.model.faces)

    @property
    def ignored_curves(self) -> tuple[int, ...]:
        """Gmsh tags of the curves that were not followed, because faces go on smoothly across them (`feature_angle`)."""
        return self.stages.model.ignored_curves

    @cached_property
    def normals(self) -> Float:
        """(f, 3) unit normal of every plane face, by row of the model's faces; NaN for curved ones."""
        return np.array([np.full(3, np.nan) if face.curved else face.normal for face in self.stages.model.faces])

    @cached_property
    def quad_quality(self) -> Float:
        """(q,) scaled Jacobian of every quad."""
        return quad_quality(self.mesh, self.normals)

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
        return tuple(face_field(self.stages.model, m, a) for m, a in zip(self.stages.meshes, self.stages.fields, strict=True))

    @cached_property
    def singularities(self) -> tuple[Singularity, ...]:
        """The singularities inside the faces."""
        return tuple(s for f in self.field for s in singularities_of(f))

    def extrude(
        self, along: float | Sequence[float], layers: int, *, most: int | None = None, name: str | None = None
    ) -> Extrusion:
        """Sweep the mesh of a plane model into hexahedra, in a new Gmsh model, which becomes the current one.

        Physical surfaces become physical volumes of the same name, their ends NAME_bottom and NAME_top, physical curves the
        side walls; see `gmsh_crossquad.cad.extrude`.

        Parameters
        ----------
        along : float or (3,) sequence of float
            Length along the normal of the first face, or the whole vector.
        layers : int
            Number of hexahedra along it.
        most : int, optional
            Refuse to make more hexahedra.
        name : str, optional
            Name of the new model.

        Returns
        -------
        Extrusion

        Raises
        ------
        InputError
            Without the mesh in the current Gmsh model, for a vector along the faces, and too few or too many layers.
        GeometryError
            For faces that are curved or not parallel.
        """
        from .cad.extrude import extrude

        return extrude(self.stages.model, along, layers, most=most, name=name)

    def write_vtu(self, path: str | PathLike[str]) -> None:
        """Write mesh, layout, field and singularities for ParaView; see `gmsh_crossquad.view.vtu`."""
        from .view.vtu import write_vtu

        write_vtu(self, path)

    def write_field(self, path: str | PathLike[str]) -> None:
        """Write the cross field with all its parts, ``.vtu`` or ``.msh``; see `FieldResult.write`."""
        from .field_result import FieldResult

        FieldResult(self.field).write(path)

    def picture(self, path: str | PathLike[str]) -> None:
        """Draw field, layout and mesh into a PNG file; see `gmsh_crossquad.view.picture`."""
        from .view.picture import picture

        picture(self, path)
