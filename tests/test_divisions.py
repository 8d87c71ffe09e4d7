"""Divisions that chords want."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from gmsh_crossquad.layout.divisions import BEND, GUIDE_BEND, SHORT, TURN, Segments, _wanted


@pytest.mark.parametrize(("length", "least"), [(1.0, 8), (1.01 * SHORT, 8), (0.99 * SHORT, 2)])
def test_a_bend_of_a_very_short_arc_asks_for_two_edges_at_most(length: float, least: int) -> None:
    """An arc inside a face that turns by 355 degrees, and a straight one on the same chord; sizes 1."""
    seg = Segments(np.zeros(2, np.int64), np.arange(2), np.array([length, 1.0]), np.zeros(2), np.array([np.radians(355.0), 0.0]))
    tmesh = cast(Any, SimpleNamespace(arc_curve=np.full(2, -1)))
    model = cast(Any, SimpleNamespace(curves=()))
    _, found = _wanted(model, tmesh, seg, 1, np.ones(2), TURN, BEND, True)
    assert found.tolist() == [least]
    guide, _ = _wanted(model, tmesh, seg, 1, np.ones(2), TURN, GUIDE_BEND, True)
    assert guide.tolist() == [12 if least == 8 else 3]
