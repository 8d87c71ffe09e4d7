"""Chords of traces in one triangle, and which of them cross: integers only.

Places on the rim of a triangle run counter-clockwise from corner 0, side k from ``k ONE`` to ``(k + 1) ONE``.  Two chords cross
if and only if their ends alternate; the rim from the start of a chord counter-clockwise to its end is on its right.  A chord of
branch ``b + 1`` may cross one of branch ``b`` from its right to its left, and in no other way; chords of branches ``b`` and
``b + 2`` never cross.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

__all__ = ["AROUND", "ONE", "Chord", "beside", "meet", "on_left"]

ONE = 1 << 48
"""Length of a side in integer places."""

AROUND = 3 * ONE

BESIDE = ONE // 20
"""Distance that a chord keeps where it is led out beside an obstacle, if there is room."""


class Chord(NamedTuple):
    """A trace in one triangle.

    Attributes
    ----------
    a, b : int
        Entry and exit; a seed's chord starts at a corner.
    branch : int
    trace, segment : int
        Whose chord it is, and the how-many-th of it.
    host : Chord or None
        The chord that stops this one: it ends there, not at `b`.
    """

    a: int
    b: int
    branch: int
    trace: int
    segment: int
    host: Chord | None


def on_left(chord: Chord, place: int) -> bool:
    """Is a place of the rim on the left of a chord?"""
    return (chord.a - place) % AROUND < (chord.b - place) % AROUND


def meet(chords: Iterable[Chord], a: int, b: int, branch: int) -> tuple[Chord | None, bool]:
    """First chord that a new one from `a` to `b` stops at, and whether one is in the way that must not be crossed.

    A stopped chord only counts on the side of its host that it is on.  The chords that the new one may cross are of one family
    and do not cross each other, so the nearest is the one with the greatest part of the rim behind it.
    """
    xb = (b - a) % AROUND
    first, nearest = None, AROUND
    for chord in chords:
        p, q, other, _, _, host = chord
        xp, xq = (p - a) % AROUND, (q - a) % AROUND
        if (xp < xb) == (xq < xb) or (host is not None and on_left(host, a) != on_left(host, p)):
            continue
        turn = (other - branch) % 4
        if not ((turn == 1 and xp < xq) or (turn == 3 and xp > xq)):
            return None, True
        if min(xp, xq) < nearest:
            first, nearest = chord, min(xp, xq)
    return first, False


def beside(chords: Iterable[Chord], a: int, b: int, branch: int, shut: Sequence[int]) -> int:
    """The allowed exit nearest to `b`, or -1.

    Every chord that must not be crossed forbids the rim behind it; the side of entry and the sides `shut` are forbidden too.
    """
    side = a // ONE
    corner = (side + 1) * ONE - a
    forbidden = [(0, corner), (corner + ONE, corner + ONE), (corner + 2 * ONE, AROUND)]
    forbidden += [(corner + (k - 1) * ONE, corner + k * ONE) for k in (1, 2) if (side + k) % 3 in shut]
    for p, q, other, _, _, host in chords:
        if host is not None and on_left(host, a) != on_left(host, p):
            continue
        xp, xq = (p - a) % AROUND, (q - a) % AROUND
        turn = (other - branch) % 4
        if not ((turn == 1 and xp < xq) or (turn == 3 and xp > xq)):
            forbidden.append((min(xp, xq), max(xp, xq)))
    forbidden.sort()
    wanted = (b - a) % AROUND
    best, distance, reach = -1, AROUND, 0
    for low, high in forbidden:
        room = low - reach
        if room > 3:
            margin = min(room // 2, BESIDE)
            x = min(max(wanted, reach + margin), low - margin)
            if abs(x - wanted) < distance:
                best, distance = x, abs(x - wanted)
        reach = max(reach, high)
    return (a + best) % AROUND if best >= 0 else -1
