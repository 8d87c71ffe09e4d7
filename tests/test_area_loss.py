"""Final edges that follow curves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gmsh_crossquad.fill.area_loss import LOST, LOST_ALONE, ROUND, followed
from gmsh_crossquad.fill.numbering import guide_chords
from gmsh_crossquad.records import Float, Guide, Int, Model
from gmsh_crossquad.surfaces import Planes
from tests.smoothing_grids import mapped_grid, sector


def _ring(inner: float, outer: float, angle: float) -> tuple[Guide, Model]:
    """Three cells along the arcs; the face knows its loop."""
    guide, model = mapped_grid(sector(inner, outer, angle), 1, 3)
    loop = tuple((c, 1) for c in range(len(model.curves)))
    return guide, replace(model, faces=(replace(model.faces[0], loops=(loop,)),))


def _lost(model: Model, guide: Guide, fine: Int) -> float:
    """Part of a quarter of a ring that polygons within its two arcs leave out, or add; both counted as lost."""
    edges, _, chord, _ = guide_chords(guide.quads)
    total = 0.0
    for a, b in zip(guide.points[edges[:, 0]], guide.points[edges[:, 1]]):
        radius = np.linalg.norm([a, b], axis=1)
        if abs(radius[0] - radius[1]) < 1e-9:
            (row,) = np.flatnonzero((guide.points[edges] == [a, b]).all(axis=(1, 2)))
            p = int(fine[chord[row]])
            angle = np.arccos(np.clip(a @ b / radius[0] ** 2, -1, 1)) / p
            total += p * 0.5 * radius[0] ** 2 * (angle - np.sin(angle))
    return total


@pytest.mark.parametrize(("outer", "angle"), [(1.2, 2.9), (2.0, 3.5), (4.0, 2.9)])
def test_a_ring_keeps_its_area(outer: float, angle: float) -> None:
    """Against the exact areas of circular segments, or edges of 20 degrees; one edge less on all chords is not enough."""
    guide, model = _ring(1.0, outer, angle)
    n = guide_chords(guide.quads)[3]
    area = 0.5 * angle * (outer**2 - 1.0)
    found = followed(model, Planes(model), guide, np.ones(n, np.int64))
    assert _lost(model, guide, found) < LOST * area or angle / 3 / found.max() < ROUND
    fewer = np.maximum(found - 1, 1)
    assert _lost(model, guide, fewer) > LOST * area
    assert angle / 3 / fewer.max() > ROUND
    assert (found == 1).sum() == 1  # across the ring


def test_a_crescent_of_no_area_is_left_alone_where_its_edges_hardly_turn() -> None:
    guide, model = _ring(1.0, 1.0001, 1.0)
    n = guide_chords(guide.quads)[3]
    assert (followed(model, Planes(model), guide, np.ones(n, np.int64)) == 1).all()


def test_what_is_followed_is_left_alone_and_prescribed_edges_always() -> None:
    guide, model = _ring(1.0, 1.2, 1.5)
    n = guide_chords(guide.quads)[3]
    assert (followed(model, Planes(model), guide, np.full(n, 30)) == 30).all()
    held = replace(model, curves=tuple(replace(c, spacing=np.array([0.0, c.length])) for c in model.curves))
    assert (followed(held, Planes(held), guide, np.ones(n, np.int64)) == 1).all()


def test_a_face_of_its_own_may_lose_more_than_the_model() -> None:
    assert LOST < LOST_ALONE


def test_edges_turn_by_sixty_degrees_at_most() -> None:
    """A thick ring loses little over 300 degrees of its inner circle; two edges a cell are needed all the same."""
    guide, model = _ring(0.02, 1.0, float(np.radians(300.0)))
    _, _, _, n = guide_chords(guide.quads)
    found: Float = followed(model, Planes(model), guide, np.ones(n, np.int64)).astype(float)
    assert found.max() >= 2
