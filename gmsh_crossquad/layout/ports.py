"""Where separatrices leave a seed: a singularity, a corner or a wanted block corner.

Around an interior vertex of index q (quarter turns) the cross turns against the polar angle by ``V pi/2`` with
``V = 4 - q``; around a boundary vertex ``n_q = 2 - q`` quads fill the sector.  With the polar angle ``a`` scaled to the
total angle ``A`` of the star, the cross relative to the ray is ``g(a) = g0 - V (pi/2) a / A``, and a separatrix leaves where
``g(a)`` is a multiple of pi/2: V equally spaced rays, `g0` by least squares over the edge midpoints of the star.  On the boundary
both ends of the sector are given and the rays are ``j A / n_q``.

Which ray belongs to which branch of the cross follows from counting around the star, not from comparing angles.
"""

from __future__ import annotations

from math import atan2, ceil, hypot, pi, sin
from typing import NamedTuple

from ..errors import LayoutError
from .step import CLEAR
from .trace_mesh import QUARTER, TraceMesh, next_of, previous_of

__all__ = ["Port", "ports"]

SLIDE = 0.02
"""Fraction of an edge next to a vertex where a direction along the boundary passes."""


class Port(NamedTuple):
    """First crossing of a separatrix: half-edge opposite the seed, fraction of it, branch in that triangle."""

    half_edge: int
    fraction: float
    branch: int


def ports(mesh: TraceMesh, h: int, index: int) -> list[Port]:
    """Ports of a seed, counter-clockwise (at the boundary from the outgoing half-edge).

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
    if round((offset[-1] - offset[0]) / QUARTER) != -count:
        raise LayoutError(
            f"the field does not have index {index}/4 at this vertex", location=where, remedy="align the field first"
        )
    slope = count * QUARTER / total
    if boundary:
        rays = [(j * total / count, j) for j in range(1, count)]
    else:
        g0 = _fit(mesh, star, polar, branch, offset, slope)
        low = ceil(-g0 / QUARTER)
        rays = [((g0 + j * QUARTER) / slope, j) for j in range(low, low + count)]
    return _place(mesh, star, polar, branch, rays)


def _develop(mesh: TraceMesh, star: list[int]) -> tuple[list[float], list[int], list[float]]:
    """Unfold a star into the plane, the first spoke along the x axis.

    Returns
    -------
    polar : angle of every spoke, and of the last one's end
    branch : branch of the tracked direction of the cross in every triangle (0 in the first; along the first spoke at the boundary)
    offset : tracked direction minus the spoke's angle at the middle of every spoke, and at the last
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
        if i == 0:
            direction = own
        turns = round((direction - own) / (2.0 * pi))
        offset.append(own + 2.0 * pi * turns - polar[i])
        direction = own + 2.0 * pi * turns + 0.5 * (mesh.value[p] - mesh.value[n])
        polar.append(polar[i] + corner)
    offset.append(direction - polar[-1])
    return polar, branch, offset


def _fit(mesh: TraceMesh, star: list[int], polar: list[float], branch: list[int], offset: list[float], slope: float) -> float:
    """Least-squares ``g0`` in ``g(a) = g0 - slope a`` over spokes and opposite edges (twice the weight)."""
    total, weight = 0.0, 0
    for i, h in enumerate(star):
        n, p = next_of(h), previous_of(h)
        mx, my = 0.5 * (mesh.x[n] + mesh.x[p]) - mesh.x[h], 0.5 * (mesh.y[n] + mesh.y[p]) - mesh.y[h]
        inside = atan2(mesh.ex[h] * my - mesh.ey[h] * mx, mesh.ex[h] * mx + mesh.ey[h] * my)
        opposite = offset[i] + 0.5 * (mesh.value[p] - mesh.value[h]) - inside
        total += offset[i] + slope * polar[i] + 2.0 * (opposite + slope * (polar[i] + inside))
        weight += 3
    return total / weight


def _place(mesh: TraceMesh, star: list[int], polar: list[float], branch: list[int], rays: list[tuple[float, int]]) -> list[Port]:
    """Turn rays into crossings of the star's rim, in the same order and apart from each other."""
    n = len(star)
    closed = mesh.wall[star[0]] < 0
    sectors: dict[int, list[tuple[int, int, float, int]]] = {}
    i = 0
    for angle, j in rays:
        while i + 1 < n and angle >= polar[i + 1]:
            i += 1
        at, b = i, (branch[i] + j) % 4
        s = _rim_fraction(mesh, star[i], angle - polar[i], polar[i + 1] - polar[i])
        for _ in range(n):  # a rim edge on the boundary is only left straight outwards: slide along it to the neighbour
            wall = mesh.wall[next_of(star[at % n])]
            turn = (b - wall) % 4
            if wall < 0 or turn == 3:
                break
            onward = turn == 0 or (turn == 1 and s >= 0.5)
            b += mesh.shift[previous_of(star[at % n]) if onward else star[at % n]]
            at, s = (at + 1, SLIDE) if onward else (at - 1, 1.0 - SLIDE)
            if not (closed or 0 <= at < n):
                raise LayoutError("no way out of a corner", location=mesh.points[mesh.start[star[0]]])
        sectors.setdefault(at % n, []).append((-(at // n), j, s, b % 4))
    out = []
    for at, unsorted in sectors.items():
        group = sorted(unsorted)
        fractions = [min(max(s, CLEAR), 1.0 - CLEAR) for _, _, s, _ in group]
        if any(q - p < CLEAR for p, q in zip(fractions, fractions[1:])):
            fractions = [(m + 1.0) / (len(group) + 1.0) for m in range(len(group))]
        out += [(j, Port(next_of(star[at]), s, b)) for s, (_, j, _, b) in zip(fractions, group)]
    return [port for _, port in sorted(out)]


def _rim_fraction(mesh: TraceMesh, h: int, angle: float, corner: float) -> float:
    """Fraction of the opposite edge that a ray meets which leaves the start of `h` at `angle` from it."""
    p = previous_of(h)
    a = sin(angle) * hypot(mesh.ex[h], mesh.ey[h])
    b = sin(corner - angle) * hypot(mesh.ex[p], mesh.ey[p])
    return a / (a + b)
