"""What `cross_field` returns: the aligned cross field of every face, ready to be drawn, written and used again."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from dataclasses import field as attribute
from functools import cached_property
from os import PathLike
from pathlib import Path

from .face_field import FaceField, Singularity, singularities_of
from .formats import check_suffix

__all__ = ["FIELD_FORMATS", "FieldResult"]

FIELD_FORMATS = (".msh", ".vtu")


@dataclass(frozen=True)
class FieldResult:
    """The outcome of `gmsh_crossquad.cross_field`; can be given to `mesh` as its field.

    Attributes
    ----------
    faces : tuple of FaceField
    timings : mapping of str to float
        Wall seconds of every stage.
    notes : tuple of str
        Indices that were changed and other things worth knowing.
    """

    faces: tuple[FaceField, ...]
    timings: Mapping[str, float] = attribute(default_factory=dict)
    notes: tuple[str, ...] = ()

    @cached_property
    def singularities(self) -> tuple[Singularity, ...]:
        """The singularities inside the faces."""
        return tuple(s for f in self.faces for s in singularities_of(f))

    def write(self, path: str | PathLike[str]) -> None:
        """Write the field with all its parts: ``.vtu`` for ParaView, ``.msh`` as Gmsh views; both can be a field's source.

        Raises
        ------
        InputError
            For another extension, or a place that cannot be written to.
        """
        check_suffix(path, FIELD_FORMATS, "field")
        if Path(path).suffix.lower() == ".vtu":
            from .view.field_vtu import write_field_vtu

            write_field_vtu(self.faces, path)
        else:
            from .cad.field_views import write_field_views

            write_field_views(self.faces, path)

    def show(self) -> dict[str, int]:
        """Add the field as views to the current Gmsh session; see `gmsh_crossquad.cad.field_views.add_field_views`."""
        from .cad.field_views import add_field_views

        return add_field_views(self.faces)

    def picture(self, path: str | PathLike[str]) -> None:
        """Draw the given and the aligned field into a PNG file; see `gmsh_crossquad.view.picture`."""
        from .view.picture import field_picture

        field_picture(self.faces, path)
