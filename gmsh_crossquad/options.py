"""What a user can set."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .source.base import FieldSource

__all__ = ["MeshOptions"]


@dataclass(frozen=True)
class MeshOptions:
    """Options of `gmsh_crossquad.mesh`, in the user's units.

    Attributes
    ----------
    size : float or None
        Target edge length; None takes the sizes of the model (points, fields, `Mesh.MeshSizeMax`).
    max_quads : int
        Refuse to make more quads than this.
    block_size : float
        Wanted block edge over the target size; sets the number of blocks, never whether a layout exists.
    background : float
        Factor on the edge length of the background triangles.
    field : FieldSource or None
        The cross field; None for the default smooth one.
    boundary_index : mapping of point tag or (point tag, face tag) to number
        Indices of singular points, as fractions of a turn (multiples of 1/4).
    fix_indices : bool
        Change as few indices as possible where they do not fit together, instead of an error.
    relax : bool or None
        Move singular points that the user set: always, so that the flux around holes vanishes; never; None: only if there is no
        layout otherwise, not even with a pair of singularities added.
    order : {1, 2, 3} or None
        Order of the elements; None takes `Mesh.ElementOrder`.
    incomplete : bool or None
        Quads of order 2 with 8 nodes instead of 9; None takes `Mesh.SecondOrderIncomplete`.
    feature_angle : float or None
        Degrees.  Faces whose normals differ by less everywhere on their common curve are meshed as one surface, and the curve is
        not followed, unless it is in a physical group, transfinite, embedded or between different physical surfaces.  None
        or 0: every curve is followed.
    """

    size: float | None = None
    max_quads: int = 10_000_000
    block_size: float = 4.0
    background: float = 1.0
    field: FieldSource | None = None
    boundary_index: Mapping[Any, Any] = dataclasses.field(default_factory=dict)
    fix_indices: bool = False
    relax: bool | None = None
    order: int | None = None
    incomplete: bool | None = None
    feature_angle: float | None = None
