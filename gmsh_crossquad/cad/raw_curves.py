"""CAD curves as they are read: samples in the user's coordinates between rows of CAD vertices."""

from __future__ import annotations

from dataclasses import dataclass, field

import gmsh
import numpy as np

from ..records import Float
from .sample import sample
from .session import gmsh_errors

__all__ = ["NO_EXTENT", "RawCurve", "Vertices", "degenerate", "read_curve"]

NO_EXTENT = 1e-9  # of the model: shorter curves are points
COLLAPSED = 1e-6  # of the model: edges that the CAD itself calls a point; kernels draw them within the tolerance of the vertex


@dataclass
class RawCurve:
    """A curve in the user's coordinates."""

    tag: int
    kind: str
    ends: list[int]
    parameters: Float
    points: Float
    untied: bool = False


@dataclass
class Vertices:
    """Rows of the CAD vertices, in the order in which they are met."""

    tags: list[int] = field(default_factory=list)
    points: list[Float] = field(default_factory=list)
    row: dict[int, int] = field(default_factory=dict)

    def cad(self, tag: int) -> int:
        """Row of Gmsh point `tag`."""
        if tag not in self.row:
            self.row[tag] = self.made(np.array(gmsh.model.getValue(0, tag, [])), tag)
        return self.row[tag]

    def made(self, point: Float, tag: int = -1) -> int:
        """Row of a new vertex."""
        self.tags.append(tag)
        self.points.append(point)
        return len(self.tags) - 1


def read_curve(tag: int, vertices: Vertices) -> RawCurve:
    """First samples of a curve, between its CAD vertices."""
    with gmsh_errors("reading", entity=(1, tag)):
        kind = gmsh.model.getType(1, tag)
        tags = [int(p) for _, p in gmsh.model.getBoundary([(1, tag)], combined=False, oriented=False)]
        ends = [vertices.cad(p) for p in tags]
    parameters, points = sample(tag, kind)
    if not ends:
        ends = [vertices.made(points[0])]
    if len(ends) == 1:
        ends = ends * 2
    snap = np.array([vertices.points[p] for p in ends])
    if ((points[[0, -1]] - snap[::-1]) ** 2).sum() < ((points[[0, -1]] - snap) ** 2).sum():
        ends, snap = ends[::-1], snap[::-1]
    points[[0, -1]] = snap
    return RawCurve(tag, kind, ends, parameters, points)


def degenerate(raw: RawCurve, scale: float) -> bool:
    """A closed curve without extent, as at a pole; Gmsh has no type for the edges that OpenCASCADE calls degenerate."""
    limit = COLLAPSED if raw.kind == "Unknown" else NO_EXTENT
    return raw.ends[0] == raw.ends[1] and bool(np.ptp(raw.points, axis=0).max() <= limit * scale)
