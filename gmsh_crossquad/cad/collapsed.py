"""Curves and vertices that are left out of the model: those without length, those inside merged faces, seams and poles."""

from __future__ import annotations

import numpy as np

from ..errors import GeometryError
from .joints import Group
from .physical import physical_points
from .raw_curves import NO_EXTENT, RawCurve, Vertices

__all__ = ["check_contacts", "needed_vertices", "without_joints", "without_points"]


def without_points(
    raw: list[RawCurve], vertices: Vertices, points: dict[int, list[int]], scale: float
) -> tuple[list[RawCurve], dict[int, int]]:
    """The curves but open ones without extent, whose two vertices become one; the rows of `points` are changed.

    The first of the vertices stays, one in a physical group before others; the tags of the others are returned with its tag.
    """
    short = [r for r in raw if np.ptp(r.points, axis=0).max() <= NO_EXTENT * scale and r.ends[0] != r.ends[1]]
    if not short:
        return raw, {}
    same: dict[int, int] = {}
    asked = physical_points()

    def first(v: int) -> int:
        while v in same:
            v = same[v]
        return v

    for r in short:
        ends = {first(v) for v in r.ends}
        if len(ends) == 2:
            stays, goes = sorted(ends, key=lambda v: (vertices.tags[v] not in asked, v))
            same[goes] = stays
    kept = [r for r in raw if not any(r is s for s in short)]
    for r in kept:
        r.ends = [first(v) for v in r.ends]
    for rows in points.values():
        rows[:] = [first(v) for v in rows]
    return kept, {vertices.tags[v]: vertices.tags[first(v)] for v in same}


def without_joints(
    groups: tuple[Group, ...], kept: list[RawCurve], vertices: Vertices, points: dict[int, list[int]]
) -> tuple[list[RawCurve], Vertices, dict[int, list[int]]]:
    """Curves, vertices and points inside faces without the joints of groups; points in physical groups on joints are inside."""
    asked = physical_points()
    ends = {r.tag: r.ends for r in kept}
    points = dict(points)
    for group in groups:
        inside = [v for f in group.tags for v in points[f]]
        inside += [v for c in group.ignored for v in ends[c] if vertices.tags[v] in asked]
        points[group.tags[0]] = list(dict.fromkeys(inside))
    ignored = {c for group in groups for c in group.ignored}
    if ignored:
        kept = [r for r in kept if r.tag not in ignored]
        vertices, points = needed_vertices(vertices, kept, points)
    return kept, vertices, points


def check_contacts(
    vertices: Vertices, raw: list[RawCurve], kept: list[RawCurve], bounds: dict[int, list[int]], points: dict[int, list[int]]
) -> None:
    """Refuse a face that another one touches in a vertex to which only a seam or a pole of it leads: no node would be there."""
    ends, own = {r.tag: set(r.ends) for r in raw}, {r.tag: set(r.ends) for r in kept}
    used = set().union(*own.values(), *points.values())
    for f, curves in bounds.items():
        left = set().union(*(ends[c] for c in curves)) - set().union(*(own.get(c, set()) for c in curves), points[f])
        for v in sorted(left & used):
            remedy = "split the face there, or move the faces apart"
            place = vertices.points[v].tolist()
            raise GeometryError(
                "another face touches this one in a point of its seam", entity=(2, f), location=place, remedy=remedy
            )


def needed_vertices(
    vertices: Vertices, kept: list[RawCurve], points: dict[int, list[int]]
) -> tuple[Vertices, dict[int, list[int]]]:
    """The vertices at curves that are kept, and embedded points; the rows in `kept` are changed, those in `points` returned."""
    used = sorted({v for r in kept for v in r.ends} | {v for rows in points.values() for v in rows})
    new = {old: i for i, old in enumerate(used)}
    tags = [vertices.tags[v] for v in used]
    for r in kept:
        r.ends = [new[v] for v in r.ends]
    fewer = Vertices(tags, [vertices.points[v] for v in used], {t: i for i, t in enumerate(tags) if t >= 0})
    return fewer, {f: [new[v] for v in rows] for f, rows in points.items()}
