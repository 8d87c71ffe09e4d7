"""Physical groups of the current Gmsh model."""

from __future__ import annotations

import gmsh

__all__ = ["group_names", "group_tags", "physical_points"]


def physical_points() -> set[int]:
    """Tags of the points in physical groups."""
    return {int(p) for d, t in gmsh.model.getPhysicalGroups(0) for p in gmsh.model.getEntitiesForPhysicalGroup(d, t)}


def group_tags(dim: int) -> dict[int, list[int]]:
    """Tags of the physical groups, with a name or without, that hold each entity of a dimension."""
    out: dict[int, list[int]] = {}
    for _, group in gmsh.model.getPhysicalGroups(dim):
        for entity in gmsh.model.getEntitiesForPhysicalGroup(dim, group):
            out.setdefault(abs(int(entity)), []).append(int(group))
    return out


def group_names(dim: int) -> dict[int, list[str]]:
    """Names of the physical groups that hold each entity of a dimension."""
    names = {group: gmsh.model.getPhysicalName(dim, group) for _, group in gmsh.model.getPhysicalGroups(dim)}
    named = {entity: [names[g] for g in groups if names[g]] for entity, groups in group_tags(dim).items()}
    return {entity: own for entity, own in named.items() if own}
