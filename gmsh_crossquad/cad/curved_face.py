"""Curved CAD faces on reading: seams, chains of boundary curves, area.

The boundary that the CAD gives for a periodic face has a *seam*, which it runs along twice, and poles, curves without extent.
Neither need be followed by a mesh.  A seam is left out of the model where nothing else needs it: no other face is bounded by
it, it is embedded nowhere and in no physical group.  What is left may be several loops in any order, or none (a sphere, a torus).
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import replace

import gmsh
import numpy as np

from ..records import Curve, Face, Float
from .joints import Group
from .loops import Loop
from .session import gmsh_errors

__all__ = ["chains", "curved_face", "merged_face", "seams"]

GRID = 10


def seams(bounds: dict[int, list[int]], curved: Sequence[int], needed: set[int]) -> set[int]:
    """Tags of the curves that no mesh need follow.

    Parameters
    ----------
    bounds : dict of int -> list of int
        Curves of every face, repeated where the boundary runs along them repeatedly.
    curved : sequence of int
        Tags of the curved faces.
    needed : set of int
        Curves that are wanted for another reason.
    """
    out: set[int] = set()
    for f in curved:
        out |= {c for c, n in Counter(bounds[f]).items() if n % 2 == 0}
    users = Counter(c for curves in bounds.values() for c in set(curves))
    return {c for c in out - needed if users[c] == 1}


def chains(signed: Sequence[int], curves: Sequence[Curve], row: dict[int, int]) -> tuple[Loop, ...]:
    """Closed chains of the curves of a boundary.

    Parameters
    ----------
    signed : sequence of int
        Curve tags, negative where the boundary runs against the curve.
    curves : sequence of Curve
    row : dict of int -> int
        Row of every tag among `curves`.
    """
    start: dict[int, list[tuple[int, int]]] = defaultdict(list)
    for c in signed:
        record = curves[row[abs(c)]]
        start[record.start if c > 0 else record.end].append((row[abs(c)], 1 if c > 0 else -1))
    loops = []
    for first in list(start):
        while start[first]:
            loop, at = [], first
            while start[at]:
                item = start[at].pop(0)
                loop.append(item)
                at = curves[item[0]].end if item[1] > 0 else curves[item[0]].start
            loops.append(tuple(loop))
    return tuple(loops)


def curved_face(
    tag: int,
    signed: list[int],
    inside: list[int],
    points: list[int],
    curves: tuple[Curve, ...],
    row: dict[int, int],
    scale: float,
) -> Face:
    """The record of a curved face.

    Parameters
    ----------
    tag : int
    signed : list of int
        Tags of its boundary curves, negative where it runs against them; seams are left out.
    inside, points : list of int
        Rows of embedded curves and points.
    curves : tuple of Curve
    row : dict of int -> int
    scale : float
        User's units in a scaled unit.
    """
    count = Counter(abs(c) for c in signed)
    both = [row[c] for c, n in count.items() if n % 2 == 0]
    loops = chains([c for c in signed if count[abs(c)] % 2], curves, row)
    embedded = tuple(dict.fromkeys([*both, *inside]))
    on_curves = {v for c in [*(r for loop in loops for r, _ in loop), *embedded] for v in (curves[c].start, curves[c].end)}
    free = tuple(p for p in dict.fromkeys(points) if p not in on_curves)
    area, extent = _measures(tag)
    return Face(tag, np.zeros(3), np.eye(3), loops, embedded, free, area / scale**2, extent / scale)


def merged_face(
    group: Group,
    planes: Sequence[tuple[Float, Float] | None],
    inside: list[int],
    points: list[int],
    curves: tuple[Curve, ...],
    row: dict[int, int],
    scale: float,
) -> Face:
    """The record of faces that are one surface.

    Parameters
    ----------
    group : Group
    planes : sequence of (origin, axes) or None
        Frames of the plane ones.
    inside, points, curves, row
        As for `curved_face`.
    scale : float
        User's units in a scaled unit.
    """
    parts = []
    for tag, turned, plane in zip(group.tags, group.turned, planes, strict=True):
        centre, axes = plane or (np.zeros(3), np.eye(3))
        area, extent = _measures(tag)
        parts.append(Face(tag, centre, axes, (), area=area / scale**2, extent=extent / scale, turned=turned))
    whole = curved_face(group.tags[0], [c for c in group.signed if abs(c) in row], inside, points, curves, row, scale)
    boxes = np.array([gmsh.model.getBoundingBox(2, tag) for tag in group.tags])
    extent = float(np.linalg.norm(boxes[:, 3:].max(axis=0) - boxes[:, :3].min(axis=0))) / scale
    return replace(whole, area=sum(p.area for p in parts), extent=extent, parts=tuple(parts))


def _measures(tag: int) -> tuple[float, float]:
    """Area and extent of a face: from the kernel and from samples, in the user's units."""
    with gmsh_errors("measuring", entity=(2, tag)):
        box = np.array(gmsh.model.getBoundingBox(2, tag))
        extent = float(np.linalg.norm(box[3:] - box[:3]))
        if (2, tag) in gmsh.model.occ.getEntities(2):
            return float(gmsh.model.occ.getMass(2, tag)), extent
        if gmsh.model.getType(2, tag).startswith("Discrete"):
            return float("nan"), extent
        lo, hi = (np.asarray(b) for b in gmsh.model.getParametrizationBounds(2, tag))
        t = (np.arange(GRID) + 0.5) / GRID
        u, v = (g.ravel() for g in np.meshgrid(lo[0] + t * (hi[0] - lo[0]), lo[1] + t * (hi[1] - lo[1])))
        slopes: Float = np.asarray(gmsh.model.getDerivative(2, tag, np.column_stack([u, v]).ravel())).reshape(-1, 2, 3)
    density = np.linalg.norm(np.cross(slopes[:, 0], slopes[:, 1]), axis=1)
    return float(np.nanmean(density) * (hi[0] - lo[0]) * (hi[1] - lo[1])), extent
