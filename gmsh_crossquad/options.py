"""What a user can set."""

from __future__ import annotations

from dataclasses import dataclass

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
    """

    size: float | None = None
    max_quads: int = 10_000_000
    block_size: float = 4.0
    background: float = 1.0
