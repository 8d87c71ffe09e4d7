"""A cross field of this library as the input of another run: out and in again, bit for bit where the background is the same.

Where the background mesh has the same vertices and triangles, the angles and rotations are taken as they are.  Elsewhere the
field is sampled (see `samples`), and the integers are found anew.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..errors import FieldError
from ..field_arrays import quadratic
from ..records import CrossField, Float
from .samples import Samples

if TYPE_CHECKING:
    from ..face_field import FaceField
    from ..field.edge_frames import EdgeFrames

__all__ = ["Known"]

SAME = 1e-9  # of the extent


@dataclass(frozen=True)
class Known:
    """The fields of some faces.

    Parameters
    ----------
    faces : sequence of FaceField
        ``result.field``, or what `read_field` made of a file.
    """

    faces: Sequence[FaceField]

    def points(self) -> Float:
        """(k, 3) singular points that were vertices of the background because the user set them."""
        return np.concatenate([np.zeros((0, 3)), *(f.seeds for f in self.faces)])

    def on(self, frames: EdgeFrames) -> CrossField:
        """The field of the face with the same tag, else whatever covers it."""
        for f in self.faces:
            if f.face == frames.face and _same(f, frames):
                return CrossField(f.theta.copy(), f.rotation.copy())
        own = [f for f in self.faces if f.face == frames.face] or list(self.faces)
        if not own:
            raise FieldError("the field has no faces", entity=(2, frames.face))
        return _sampled(own).on(frames)


def _same(f: FaceField, frames: EdgeFrames) -> bool:
    """Whether the field lives on this background mesh."""
    if f.points.shape != frames.points.shape or not np.array_equal(f.triangles, frames.surface.triangles):
        return False
    extent = float(np.ptp(frames.points, axis=0).max())
    return bool(np.abs(f.points - frames.points).max() <= SAME * extent)


def _sampled(faces: Sequence[FaceField]) -> Samples:
    """The aligned field on quadratic triangles."""
    points, cells, data = quadratic(faces)
    return Samples(points, cells, data["v"], "direction")
