"""The layouts that are tried, one after the other, until the mesh is good."""

from __future__ import annotations

from typing import NamedTuple

from .field_stage import Rule, Wishes
from .layout.alignment import LEAST
from .options import MeshOptions

__all__ = ["Attempt", "attempts"]


class Attempt(NamedTuple):
    """Factors on the edge length of the background and of blocks, whether short curves cap the divisions of chords, the
    shift between the sides of strips that costs nothing (see `layout.alignment`), and what is
    done with a given field (see `field_of_face`)."""

    background: float = 1.0
    blocks: float = 1.0
    capped: bool = True
    shift: float = LEAST
    rule: Rule = "keep"
    pinned: bool = True


ATTEMPTS = (
    Attempt(),
    Attempt(blocks=0.4),
    Attempt(capped=False, shift=0.6),
    Attempt(blocks=0.15),
    Attempt(background=0.7),
    Attempt(rule="divisible"),
)
GIVEN_ATTEMPTS = (
    Attempt(),
    Attempt(rule="divisible"),
    Attempt(rule="divisible", pinned=False),
    Attempt(rule="divisible", blocks=0.4),
    Attempt(rule="divisible", capped=False),
    Attempt(rule="divisible", background=0.7),
    Attempt(rule="divisible", background=0.7, pinned=False),
)


def attempts(wanted: Wishes, options: MeshOptions) -> tuple[Attempt, ...]:
    """What is tried, in order."""
    if not wanted.given:
        return ATTEMPTS
    if options.relax:
        return (*(a._replace(rule="relaxed") for a in ATTEMPTS), Attempt(rule="divisible"))
    return tuple(a for a in GIVEN_ATTEMPTS if a.pinned or (options.relax is None and wanted.pinned))
