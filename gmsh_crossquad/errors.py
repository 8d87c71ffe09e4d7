"""The errors a caller can meet.

Every error says what is wrong, where (entity and coordinates) and what to do about it, on one line.
"""

from __future__ import annotations

from collections.abc import Sequence

__all__ = ["CrossQuadError", "FieldError", "GeometryError", "InputError", "LayoutError", "MeshError"]


class CrossQuadError(Exception):
    """Base of all errors of this package.

    Parameters
    ----------
    what : str
        What is wrong.
    entity : tuple of (int, int), optional
        Dimension and tag of the CAD entity that it is about.
    location : sequence of float, optional
        Coordinates in the user's model.
    remedy : str, optional
        What the user can do.
    """

    exit_status = 1

    def __init__(
        self,
        what: str,
        *,
        entity: tuple[int, int] | None = None,
        location: Sequence[float] | None = None,
        remedy: str = "",
    ) -> None:
        self.what = what
        self.entity = entity
        self.location = None if location is None else tuple(float(x) for x in location)
        self.remedy = remedy
        super().__init__(self._line())

    def _line(self) -> str:
        kinds = ("point", "curve", "surface", "volume")
        line = self.what
        if self.entity is not None:
            line += f", {kinds[self.entity[0]]} {self.entity[1]}"
        if self.location is not None:
            line += " at (" + ", ".join(f"{x:.6g}" for x in self.location) + ")"
        if self.remedy:
            line += f": {self.remedy}"
        return line


class InputError(CrossQuadError):
    """A wrong argument, option, size or path (exit status 2)."""

    exit_status = 2


class FieldError(CrossQuadError):
    """A cross field that cannot be used: bad values, another domain, indices that do not fit together (exit status 2)."""

    exit_status = 2


class GeometryError(CrossQuadError):
    """The CAD model cannot be meshed as it is (exit status 3)."""

    exit_status = 3


class LayoutError(CrossQuadError):
    """No valid block layout was found (exit status 1)."""


class MeshError(CrossQuadError):
    """The mesh could not be made from a valid layout, or Gmsh failed (exit status 1)."""
