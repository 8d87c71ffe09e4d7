"""What every source of a cross field can do: a formula, an eigenmode, samples of a file or a view, a function."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from ..field.edge_frames import EdgeFrames
from ..records import CrossField, Float

__all__ = ["FieldSource"]


@runtime_checkable
class FieldSource(Protocol):
    """A cross field given by the user, independent of any mesh."""

    def points(self) -> Float:
        """(k, 3) points in the user's coordinates that must be vertices of the background mesh where they are inside a face.

        A third coordinate of NaN stands for "on the face, whatever its height".
        """
        ...

    def on(self, frames: EdgeFrames) -> CrossField | None:
        """The field on one face; None for the default smooth field.

        It need not be aligned with the boundary; all its integers are in `CrossField.rotation` (an index that is not at a
        vertex sits in a triangle).

        Raises
        ------
        FieldError
            If it has no usable values there.
        """
        ...
