"""Another field for every face."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from dataclasses import field as attribute
from typing import TYPE_CHECKING

import numpy as np

from .smooth import Smooth

if TYPE_CHECKING:
    from ..field.edge_frames import EdgeFrames
    from ..records import CrossField, Float
    from .base import FieldSource

__all__ = ["PerFace"]


@dataclass(frozen=True)
class PerFace:
    """A source for every face.

    Parameters
    ----------
    sources : mapping of int to FieldSource
        By Gmsh tag of the surface.
    default : FieldSource, optional
        For all others.
    """

    sources: Mapping[int, FieldSource]
    default: FieldSource = attribute(default_factory=Smooth)

    def of(self, face: int) -> FieldSource:
        """The source of a face."""
        return self.sources.get(face, self.default)

    def points(self) -> Float:
        """(k, 3) those of all sources."""
        return np.concatenate([s.points() for s in (*self.sources.values(), self.default)])

    def on(self, frames: EdgeFrames) -> CrossField | None:
        """The field of the face's own source."""
        return self.of(frames.face).on(frames)
