"""Periodic links between entities of the user's model.

Gmsh keeps them when a mesh is cleared, also the node of every linked point, which no longer exists then: a file that is written
afterwards has nonsense in it, and reading it spoils the mesh.  A layout is not made to match across such links; so they are
taken off before a mesh is put on the model, and the user is told.
"""

from __future__ import annotations

import gmsh

from .session import gmsh_errors

__all__ = ["linked", "unlink"]

IDENTITY = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0]


def linked() -> list[tuple[int, int]]:
    """Entities (dim, tag) of the current model that have a periodic master other than themselves."""
    out = []
    with gmsh_errors("reading periodic links"):
        for dim in (0, 1, 2):
            tags = [tag for _, tag in gmsh.model.getEntities(dim)]
            masters = gmsh.model.mesh.getPeriodic(dim, tags) if tags else []
            out += [(dim, tag) for tag, master in zip(tags, masters, strict=True) if int(master) != tag]
    return out


def unlink() -> None:
    """Take all periodic links off the current model."""
    with gmsh_errors("taking off periodic links"):
        for dim, tag in linked():
            gmsh.model.mesh.setPeriodic(dim, [tag], [tag], IDENTITY)
