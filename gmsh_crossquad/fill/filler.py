"""Filling guide grids of one model again and again: judged first, filled at last.

The guide grid that is filled has mostly been judged at the same divisions just before, so what was placed last is kept.  On
curved faces this saves half of the nearest points that the filling needs.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ..records import Float, Guide, Int, Model, QuadMesh
from ..surfaces import Surfaces
from .numbering import guide_chords
from .pipeline import Placed, mesh_of, placed, poor_of, shown_divisions

__all__ = ["Filler"]


class _Last(NamedTuple):
    guide: Guide
    divisions: Int
    work: Placed


class Filler:
    """`pipeline.poor_cells` and `pipeline.fill` for a model.

    Parameters
    ----------
    model, surfaces, evaluate, vertices
        As for `pipeline.fill`.
    """

    def __init__(
        self, model: Model, surfaces: Surfaces, evaluate: Callable[[int, Float], Float], vertices: Float | None = None
    ) -> None:
        self.model, self.surfaces = model, surfaces
        self._evaluate, self._vertices = evaluate, vertices
        self._last: _Last | None = None

    def poor_cells(self, guide: Guide, divisions: Int) -> tuple[Int, Int]:
        """Rows of the guide quads that are filled badly, and of those with an inverted fine quad."""
        return poor_of(self._placed(guide, shown_divisions(self.model, guide, divisions)))

    def unfolded(self, guide: Guide, divisions: Int) -> Int:
        """The divisions (c,), or two for one where cells fold at one: `poor_cells` has judged them at two at least."""
        folded = self._folded(guide, divisions)
        if not len(folded):
            return divisions
        more = np.maximum(divisions, shown_divisions(self.model, guide, divisions))
        _, quad_edges, chord, _ = guide_chords(guide.quads)
        few = divisions.copy()
        own = np.unique(chord[quad_edges[folded]])
        few[own] = more[own]
        return more if len(self._folded(guide, few)) else few

    def _folded(self, guide: Guide, divisions: Int) -> Int:
        """Rows of the guide quads that are not inverted and have an inverted fine quad."""
        work = self._placed(guide, divisions)
        return np.flatnonzero((work.worst <= 0) & (work.own > 0))

    def fill(self, guide: Guide, divisions: Int) -> QuadMesh:
        """The final mesh.

        Raises
        ------
        MeshError
        """
        return mesh_of(self._placed(guide, divisions))

    def _placed(self, guide: Guide, divisions: Int) -> Placed:
        last = self._last
        if last is None or last.guide is not guide or not np.array_equal(last.divisions, divisions):
            work = placed(self.model, self.surfaces, guide, divisions, self._evaluate, self._vertices)
            last = self._last = _Last(guide, np.array(divisions), work)
        return last.work
