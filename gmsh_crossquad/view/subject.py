"""What is drawn and written: the part of a result that the views need."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from ..block_layout import Layout
from ..face_field import FaceField, Singularity
from ..quality import Quality
from ..records import Float, QuadMesh

__all__ = ["Subject"]


class Subject(Protocol):
    """As `gmsh_crossquad.MeshResult` has them."""

    @property
    def mesh(self) -> QuadMesh: ...
    @property
    def layout(self) -> Layout: ...
    @property
    def quality(self) -> Quality: ...
    @property
    def face_tags(self) -> Sequence[int]: ...
    @property
    def quad_quality(self) -> Float: ...
    @property
    def field(self) -> Sequence[FaceField]: ...
    @property
    def singularities(self) -> Sequence[Singularity]: ...
