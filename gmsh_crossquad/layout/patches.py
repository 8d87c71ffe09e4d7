"""Patches of a planar map from its rotation system.

Around every node the arcs are known in counter-clockwise order, with the number of quads between neighbours: 1 at a corner,
2 along a straight side, 0 for the outside.  Walking with the face on the left, a walk that arrives along an arc leaves along
the next arc clockwise.  A patch has a corner at every single quad.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

from ..errors import LayoutError
from ..records import Float

__all__ = ["Half", "Ring", "patches"]

Half = tuple[int, int]
"""An arc and a direction: +1 from its start to its end, -1 back."""

Ring = list[tuple[Half, int]]
"""Arcs that leave a node, counter-clockwise, each with the number of quads between it and the next one (0: outside)."""


def patches(rings: Sequence[Ring], position: Sequence[Float]) -> tuple[tuple[tuple[Half, ...], ...], ...]:
    """All patches, each as four sides of directed arcs, counter-clockwise.

    Parameters
    ----------
    rings : one per node
    position : coordinates of every node, for messages

    Raises
    ------
    LayoutError
        If a patch does not have four corners.
    """
    following: dict[Half, tuple[Half, int, int]] = {}
    for node, ring in enumerate(rings):
        for i, ((arc, way), _) in enumerate(ring):
            after, quads = ring[i - 1]
            following[arc, -way] = (after, quads, node)
    out: list[tuple[tuple[Half, ...], ...]] = []
    seen: set[Half] = set()
    for first in following:
        if first in seen:
            continue
        walk: list[tuple[Half, int]] = []
        half, inside, node = first, True, 0
        while half not in seen:
            seen.add(half)
            after, quads, node = following[half]
            walk.append((half, quads))
            inside &= quads > 0
            half = after
        if inside:
            out.append(_sides(walk, position[node]))
    return tuple(out)


def _sides(walk: list[tuple[Half, int]], location: Float) -> tuple[tuple[Half, ...], ...]:
    """Split a closed walk at its corners."""
    corners = [i for i, (_, quads) in enumerate(walk) if quads == 1]
    if len(corners) != 4:
        raise LayoutError(
            f"a patch of the layout has {len(corners)} corners instead of 4",
            location=location.tolist(),
            remedy="another size, or a finer background mesh, may help",
        )
    turned = [half for half, _ in walk[corners[-1] + 1 :] + walk[: corners[-1] + 1]]
    ends = [0, *((c - corners[-1]) % len(walk) or len(walk) for c in corners)]
    return tuple(tuple(turned[a:b]) for a, b in itertools.pairwise(ends))
