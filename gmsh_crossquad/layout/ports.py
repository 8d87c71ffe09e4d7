"""Where separatrices leave a seed: a singularity, a corner or a wanted block corner.

Around an interior vertex of index q (quarter turns) the cross turns against the polar angle by ``V pi/2`` with
``V = 4 - q``; around a boundary vertex ``n_q = 2 - q`` quads fill the sector.  With the polar angle ``a`` scaled to the
total angle ``A`` of the star, the cross relative to the ray is ``g(a) = g0 - V (pi/2) a / A``, and a separatrix leaves where
``g(a)`` is a multiple of pi/2: V equally spaced rays, `g0` by least squares over the edge midpoints of the star.  On the
boundary both ends of the sector are given and the rays are ``j A / n_q``.  Where the field is not like that (another seed is
only a few edges away) the rays are where the values at the midpoints, interpolated, pass the multiples of pi/2.

Which ray belongs to which branch of the cross follows from counting around the star, not from comparing angles.
"""

from __future__ import annotations

import itertools
from math import atan2, ceil, hypot, pi, sin
from typing import NamedTuple

from ..errors import LayoutError
from .step import CLEAR
from .trace_mesh import QUARTER, TraceMesh, next_of, previous_of

__all__ = ["Fan", "Port", "fan"]

EVEN = 0.25
"""Greatest misfit, in radians, of a field that counts as evenly spread around a seed."""

SLIDE = 0.02
"""Fraction of an edge next to a vertex where a direction along the boundary passes."""


class Port(NamedTuple):
    """First crossing of a separatrix: half-edge opposite the seed, fraction of it, branch in that triangle."""

    half_edge: int
    fraction: float
    branch: int


class Fan(NamedTuple):
    """The separatrices of a seed, counter-clockwise (at the boundary from the outgoing half-edge), and its gates.

    A gate is a half-edge of a spoke and the set of branches (bits) that may leave its triangle there: the spoke lies between two
    separatrices of branches b and b + 1, hence b and b + 3 cross it clockwise and the other two counter-clockwise.
    """

    ports: list[Port]
    gates: list[tuple[int, int]]


def fan(mesh: TraceMesh, h: int, index: int) -> Fan:
    """Ports and gates of a seed.

    Parameters
    ----------
    mesh : TraceMesh
    h : int
        A half-edge that starts at the seed; at the boundary the boundary half-edge.
    index : int
        In quarter turns.

    Raises
    ------
    LayoutError
        If no quad would fit (index too high), or the field does not have this index.
    """
    star = mesh.star(h)
    boundary = mesh.wall[h] >= 0
    count = (2 if boundary else 4) - index
    where = mesh.points[mesh.start[h]]
    if count <= 0:
        raise LayoutError(
            f"{'a corner' if boundary else 'a singularity'} of index {index}/4 leaves no room for a block",
            location=where,
            remedy="choose a smaller index there",
        )
    polar, branch, offset = _develop(mesh, star)
    total = polar[-1]
    last = previous_of(star[-1])
    seen = mesh.wall[last] + 2 - branch[-1] if boundary else branch[0] - branch[-1] - mesh.shift[last]
    if (seen - count) % 4 != 0:
        raise LayoutError(
            f"the field does not have index {index}/4 at this vertex", location=where, remedy="align the field first"
        )
    slope = count * QUARTER / total
    samples = _samples(mesh, star, polar, offset)
    if boundary:
        g0, low, high = 0.0, 1, count
        samples = [*samples, (total, -count * QUARTER)]
    else:
        g0 = (
            sum(g + slope * angle for angle, g in samples[::2]) + 2.0 * sum(g + slope * angle for angle, g in samples[1::2])
        ) / (1.5 * len(samples))
        low = ceil(-g0 / QUARTER)
        high = low + count
    if max(abs(g + slope * angle - g0) for angle, g in samples) < EVEN:
        rays = [((g0 + j * QUARTER) / slope, j) for j in range(low, high)]
    elif boundary:
        rays = [(_where(samples, -j * QUARTER), j) for j in range(low, high)]
    else:
        around = samples + [(angle + total, g - count * QUARTER) for angle, g in samples[:1]]
        low = ceil(-samples[0][1] / QUARTER)
        rays = [(_where(around, -j * QUARTER), j) for j in range(low, low + count)]
    placed = _place(mesh, star, polar, branch, rays)
    return Fan(_ports(mesh, star, branch, placed, count), _gates(mesh, star, branch, placed, count))


def _develop(mesh: TraceMesh, star: list[int]) -> tuple[list[float], list[int], list[float]]:
    """Unfold a star into the plane, the first spoke along the x axis.

    Returns
    -------
    polar : angle of every spoke, and of the last one's end
    branch : branch of the tracked direction in every triangle (0 in the first; at the boundary along the first spoke)
    offset : tracked direction minus the spoke's angle at the middle of every spoke
    """
    polar, branch, offset = [0.0], [max(mesh.wall[star[0]], 0)], []
    direction = 0.0
    for i, h in enumerate(star):
        n, p = next_of(h), previous_of(h)
        spoke = atan2(mesh.ey[h], mesh.ex[h])
        corner = atan2(mesh.ey[h] * mesh.ex[p] - mesh.ex[h] * mesh.ey[p], -mesh.ex[h] * mesh.ex[p] - mesh.ey[h] * mesh.ey[p])
        if i:
            branch.append((branch[-1] + mesh.shift[previous_of(star[i - 1])]) % 4)
        own = 0.5 * (mesh.value[h] + mesh.value[n]) + branch[i] * QUARTER - spoke + polar[i]
        turns = round((direction - own) / (2.0 * pi))
        offset.append(own + 2.0 * pi * turns - polar[i])
        direction = own + 2.0 * pi * turns + 0.5 * (mesh.value[p] - mesh.value[n])
        polar.append(polar[i] + corner)
    return polar, branch, offset


def _samples(mesh: TraceMesh, star: list[int], polar: list[float], offset: list[float]) -> list[tuple[float, float]]:
    """Polar angle and ``g`` at the middles of the spokes and of the rim edges in turn."""
    out = []
    for i, h in enumerate(star):
        n, p = next_of(h), previous_of(h)
        mx, my = 0.5 * (mesh.x[n] + mesh.x[p]) - mesh.x[h], 0.5 * (mesh.y[n] + mesh.y[p]) - mesh.y[h]
        inside = atan2(mesh.ex[h] * my - mesh.ey[h] * mx, mesh.ex[h] * mx + mesh.ey[h] * my)
        out.append((polar[i], offset[i]))
        out.append((polar[i] + inside, offset[i] + 0.5 * (mesh.value[p] - mesh.value[h]) - inside))
    return out


def _where(samples: list[tuple[float, float]], level: float) -> float:
    """Polar angle where ``g``, made monotone, falls to `level`."""
    (at, g) = samples[0]
    for angle, value in samples[1:]:
        if value <= level:
            return at + (angle - at) * (g - level) / (g - value) if g > level else at
        at, g = angle, min(g, value)
    return samples[-1][0]


def _place(
    mesh: TraceMesh, star: list[int], polar: list[float], branch: list[int], rays: list[tuple[float, int]]
) -> list[tuple[int, float, int]]:
    """Triangle of the star (counted on where the star closes), fraction of the rim edge, and number of every ray, in order."""
    n = len(star)
    closed = mesh.wall[star[0]] < 0
    out = []
    i = 0
    for angle, j in rays:
        while i + 1 < n and angle >= polar[i + 1]:
            i += 1
        at, b = i, branch[i] + j
        s = _rim_fraction(mesh, star[i], angle - polar[i], polar[i + 1] - polar[i])
        for _ in range(n):
            way = _aside(mesh, next_of(star[at % n]), b, s)
            if way == 0:
                break
            b += mesh.shift[previous_of(star[at % n]) if way > 0 else star[at % n]]
            at, s = (at + 1, SLIDE) if way > 0 else (at - 1, 1.0 - SLIDE)
            if not (closed or 0 <= at < n):
                raise LayoutError("no way out of a corner", location=mesh.points[mesh.start[star[0]]])
        else:
            raise LayoutError("no way out of a singularity", location=mesh.points[mesh.start[star[0]]])
        out.append((at, s, j))
    return out


def _aside(mesh: TraceMesh, rim: int, branch: int, s: float) -> int:
    """0 if a branch may cross a rim edge, else the way around the seed to an edge beside it, +1 or -1.

    A boundary edge is only left straight outwards.  An edge that ends at the boundary is not crossed against the direction in
    which the branch passes that end; it has to pass on the other side of it.
    """
    if mesh.gate[rim] >> branch % 4 & 1:
        return 0
    if mesh.wall[rim] >= 0:
        turn = (branch - mesh.wall[rim]) % 4
        return 1 if turn == 0 or (turn == 1 and s >= 0.5) else -1
    return -1 if mesh.on_boundary[mesh.start[rim]] else 1


def _ports(mesh: TraceMesh, star: list[int], branch: list[int], placed: list[tuple[int, float, int]], count: int) -> list[Port]:
    """Crossings of the rim, apart from each other where rays share a triangle."""
    n = len(star)
    sectors: dict[int, list[tuple[int, float]]] = {}
    for at, s, j in placed:
        sectors.setdefault(at % n, []).append((j - at // n * count, s))
    found: list[tuple[int, Port]] = []
    for at, unsorted in sectors.items():
        group = sorted(unsorted)
        fractions = [min(max(s, CLEAR), 1.0 - CLEAR) for _, s in group]
        if any(q - p < CLEAR for p, q in itertools.pairwise(fractions)):
            fractions = [(m + 1.0) / (len(group) + 1.0) for m in range(len(group))]
        found += [(j, Port(next_of(star[at]), s, (branch[at] + j) % 4)) for s, (j, _) in zip(fractions, group)]
    first = placed[0][2] if placed else 0
    return [port for _, port in sorted(found, key=lambda item: (item[0] - first) % count)]


def _gates(
    mesh: TraceMesh, star: list[int], branch: list[int], placed: list[tuple[int, float, int]], count: int
) -> list[tuple[int, int]]:
    """Gates of all spokes inside the face."""
    n = len(star)
    closed = mesh.wall[star[0]] < 0
    if closed:
        placed = [(at + w * n, s, j + w * count) for w in (-1, 0, 1) for at, s, j in placed]
    out = []
    for i in range(0 if closed else 1, n):
        low = max((j for at, _, j in placed if at < i), default=0)
        b = branch[i] + low
        out.append((star[i], 1 << b % 4 | 1 << (b + 3) % 4))
        b += mesh.shift[star[i]]
        out.append((mesh.twin[star[i]], 1 << (b + 1) % 4 | 1 << (b + 2) % 4))
    return out


def _rim_fraction(mesh: TraceMesh, h: int, angle: float, corner: float) -> float:
    """Fraction of the opposite edge that a ray meets which leaves the start of `h` at `angle` from it."""
    p = previous_of(h)
    a = sin(angle) * hypot(mesh.ex[h], mesh.ey[h])
    b = sin(corner - angle) * hypot(mesh.ex[p], mesh.ey[p])
    return a / (a + b)
