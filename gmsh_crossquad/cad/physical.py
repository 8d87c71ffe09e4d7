"""Physical groups of the current Gmsh model."""

from __future__ import annotations

import gmsh

__all__ = ["group_names", "group_tags", "physical_points"]


def physical_points() -> set[int]:
    """Tags of the points in physical groups."""
    return {int(p) for d, t in gmsh.model.getPhysicalGroups(0) for p in gmsh.model.getEntitiesForPhysicalGroup(d, t)}


def group_names(dim: int) -> dict[int, list[str]]:
    """Names of the physical groups that hold each entity of a dimension."""
    out: dict[int, list[str]] = {}
    for _, group in gmsh.model.getPhysicalGroups(dim):
        name = gmsh.model.getPhysicalName(dim, group)
        for entity in gmsh.model.getEntitiesForPhysicalGroup(dim, group) if name else ():
            out.setdefault(abs(int(entity)), []).append(name)
    return out


def group_tags(dim: int) -> dict[int, list[int]]:
    """Tags of the physical groups, with a name or without, that hold each entity of a dimension."""
    out: dict[int, list[int]] = {}
    for _, group in gmsh.model.getPhysicalGroups(dim):
        for entity in gmsh.model.getEntitiesForPhysicalGroup(dim, group):
            out.setdefault(abs(int(entity)), []).append(int(group))
    return out
