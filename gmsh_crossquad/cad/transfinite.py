"""Counts that the user's Transfinite Curve commands prescribe."""

from __future__ import annotations

from collections.abc import Sequence

from ..records import Float

__all__ = ["transfinite_spacing"]


def transfinite_spacing(tags: Sequence[int]) -> dict[int, Float]:
    """Curve tag to the parameters of the nodes that a Transfinite Curve command prescribes."""
    return {}
