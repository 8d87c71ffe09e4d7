"""Divide the bent patches of a curved face, see `bends`, by branches, see `branches`.

A branch begins at the crossing of a trace with an edge of the background, or the middle of a boundary edge, that is nearest to
the middle of the patch's side.  Every branch halves the turning of a patch, so that few are needed: a torus is cut into 16 to
18 patches, a pipe that bends by 180 degrees into 8, a sphere with its eight singularities is left as it is.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from ..records import FaceMesh, FaceTMesh, Float
from ..spatial import cKDTree
from .assemble import Source
from .bends import bent_patches, middle, vertex_normals
from .branches import branch, branch_inwards
from .crossing import ONE
from .step import CLEAR
from .trace import Growth

__all__ = ["Divider"]

MOST_BRANCHES = 200
"""Bound on the branches of a face; what is bent then stays so."""

TRIES = 8
"""Places on a side where a branch may begin that are tried."""


class Divider:
    """Divides bent patches of a finished motorcycle graph by branches.

    Parameters
    ----------
    mesh : FaceMesh
        Of a curved face.
    growth : Growth
        Gets the branches.
    """

    def __init__(self, mesh: FaceMesh, growth: Growth) -> None:
        self.mesh, self.growth = mesh, growth
        self.used: set[tuple[int, int]] = set()  # crossings where a branch begins
        self.count = 0

    def divide(self, tmesh: FaceTMesh, sources: list[Source]) -> bool:
        """Grow a branch into every bent patch, of patches with a common arc into one only; whether there was any.

        Parameters
        ----------
        tmesh, sources
            The T-mesh of the traces and where its arcs come from, see `assemble`.
        """
        before = self.count
        busy: set[int] = set()
        sides = [side for patch in tmesh.patches for side in patch]
        lines = [np.concatenate([_run(tmesh, half)[k > 0 :] for k, half in enumerate(side)]) for side in sides]
        for p, order in bent_patches(lines, self._normals).items():
            patch = tmesh.patches[p]
            arcs = {arc for side in patch for arc, _ in side}
            for i in order:
                if self.count < MOST_BRANCHES and not arcs & busy and self._cut_side(tmesh, sources, patch[i], lines[4 * p + i]):
                    self.count += 1
                    busy |= arcs
                    break
        return self.count > before

    def _normals(self, points: Float) -> Float:
        return self._vertex_normals[self._tree.query(points)[1]]

    @cached_property
    def _vertex_normals(self) -> Float:
        return vertex_normals(self.mesh.points, self.mesh.triangles)

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self.mesh.points)

    @cached_property
    def _row_after(self) -> list[int]:
        """Row of `FaceMesh.boundary` after every row."""
        row_of = np.full(len(self.mesh.points), -1, np.int64)
        row_of[self.mesh.boundary[:, 0]] = np.arange(len(self.mesh.boundary))
        out: list[int] = row_of[self.mesh.boundary[:, 1]].tolist()
        return out

    def _cut_side(self, tmesh: FaceTMesh, sources: list[Source], side: tuple[tuple[int, int], ...], line: Float) -> bool:
        """Grow a branch from the place nearest to the middle of a side where one can begin."""
        wanted = middle(line)
        places: list[tuple[float, int, int, int]] = []  # distance from there, arc, way, rank on the arc
        reached = 0.0
        for arc, way in side:
            run = _run(tmesh, (arc, way))
            s = reached + np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(run, axis=0), axis=1))])
            reached = float(s[-1])
            at = s[1:-1] if sources[arc][0] >= 0 else 0.5 * (s[1:] + s[:-1])
            places += [(abs(x - wanted), arc, way, k if way > 0 else len(at) - 1 - k) for k, x in enumerate(at.tolist())]
        return any(self._begin(tmesh, sources[arc], arc, way, rank) for _, arc, way, rank in sorted(places)[:TRIES])

    def _begin(self, tmesh: FaceTMesh, source: Source, arc: int, way: int, rank: int) -> bool:
        """Grow a branch from the inner point of a trace's arc, or the segment of a boundary arc, with this rank."""
        trace, first, _ = source
        if trace >= 0:
            if (trace, first + rank) in self.used or not branch(self.growth, trace, first + rank, way > 0):
                return False
            self.used.add((trace, first + rank))
            return True
        nodes = tmesh.arcs[arc].tolist()
        row = int(tmesh.half_edge[nodes[0]])
        for _ in range(rank):
            row = self._row_after[row]
        low = float(tmesh.half_edge_fraction[nodes[0]]) if rank == 0 else 0.0
        last = rank == len(tmesh.polyline[arc]) - 2
        high = (float(tmesh.half_edge_fraction[nodes[1]]) or 1.0) if last else 1.0
        fraction = low + 0.45 * (high - low)
        mesh = self.growth.mesh
        for h, (a, b) in enumerate(mesh.span):
            if mesh.row[h] == row and a <= fraction <= b:
                place = min(max((fraction - a) / (b - a), CLEAR), 1.0 - CLEAR)
                return branch_inwards(self.growth, h, int(place * ONE), int(self.mesh.boundary[row, 0]))
        return False


def _run(tmesh: FaceTMesh, half: tuple[int, int]) -> Float:
    """Polyline of an arc in one of its directions."""
    arc, way = half
    out: Float = tmesh.polyline[arc][::way]
    return out
