"""The parts into which the separatrices of a cross field that need not be aligned cut a plane domain, and their corners.

From every interior singular point of index I leave 4 - 4 I separatrices.  They are integral curves of the field's own angle
function (Runge-Kutta of order 4), grow all at the same speed, and end where they meet the boundary or an older one (a motorcycle
graph).  The parts are the faces of the planar graph of boundary and separatrices.  A corner of a part is

- each sector at an interior singular point,
- the two sectors on both sides of a separatrix that ends,
- a boundary point that has one quad (index 1/4).

Boundary points with two quads are no corners, and the straight side of a T-junction is none.  Of an aligned field all parts have
four corners; the count uses nothing but the graph, so it can tell.  The code is independent of the package's own tracer.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

Complex = npt.NDArray[np.complex128]
Power = Callable[[Complex], Complex]

#: of the domain's diagonal: step of a separatrix, and the greatest length
STEP, LONGEST = 0.006, 2.5
#: directions around a singular point that are looked at
AROUND = 1440


@dataclass(frozen=True)
class Part:
    """A part: its number of corners and its outline."""

    corners: int
    outline: Complex


@dataclass(frozen=True)
class Parts:
    """All parts, and the curves that bound them."""

    parts: list[Part]
    separatrices: list[Complex]

    @property
    def corners(self) -> list[int]:
        return sorted(p.corners for p in self.parts)


def formula(points: list[tuple[float, float]], quarters: list[int]) -> Power:
    """The fourth power of the cross of formula (2)."""

    def power(z: Complex) -> Complex:
        out = np.ones(z.shape, np.complex128)
        for (x, y), d in zip(points, quarters):
            out *= ((z - complex(x, y)) / np.abs(z - complex(x, y))) ** d
        return out

    return power


def interpolated(places: Complex, arms: Complex) -> Power:
    """The fourth power of the cross, linear between the places (k,) where it has an arm `arms` (k,)."""
    from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator

    at = np.stack([places.real, places.imag], axis=1)
    linear, nearest = LinearNDInterpolator(at, arms**4), NearestNDInterpolator(at, arms**4)

    def power(z: Complex) -> Complex:
        out = linear(z.real, z.imag)
        outside = np.isnan(out)
        if np.any(outside):
            out[outside] = nearest(z.real[outside], z.imag[outside])
        return out

    return power


def winding(power: Power, loop: Complex) -> float:
    """Degree of the cross along a closed polyline, in turns; it must be sampled finely."""
    p = power(loop)
    return float(np.angle(np.roll(p, -1) / p).sum() / (8 * np.pi))


def rays(power: Power, centre: complex, radius: float) -> list[float]:
    """Directions in which separatrices leave a singular point."""
    angle = 0.1 + 2 * np.pi * np.arange(AROUND + 1) / AROUND  # not from 0: formulas have separatrices there
    off = np.unwrap(np.angle(power(centre + radius * np.exp(1j * angle)))) - 4 * angle
    turns = off / (2 * np.pi)
    k = np.flatnonzero(np.floor(turns[:-1]) != np.floor(turns[1:]))
    whole = np.maximum(np.floor(turns[k]), np.floor(turns[k + 1]))
    return (angle[k] + (whole - turns[k]) / (turns[k + 1] - turns[k]) * (angle[1] - angle[0])).tolist()


def trace(
    power: Power, centres: list[complex], radii: list[float], step: float, box: tuple[complex, complex]
) -> tuple[Complex, list[int]]:
    """(n, k) points of all separatrices, until all have left a box (low, high), and the singular point of each."""
    count = int(LONGEST * abs(box[1] - box[0]) / step)
    start, owner = [], []
    for i, (c, r) in enumerate(zip(centres, radii)):
        for a in rays(power, c, r):
            start.append((c, c + r * np.exp(1j * a)))
            owner.append(i)
    path = np.empty((len(start), count + 2), np.complex128)
    path[:, :2] = start
    ahead = (path[:, 1] - path[:, 0]) / np.abs(path[:, 1] - path[:, 0])

    def arm(z: Complex, near: Complex) -> Complex:
        one = np.exp(0.25j * np.angle(power(z)))
        return one * 1j ** np.rint(np.angle(near / one) / (np.pi / 2))

    for k in range(1, count + 1):
        z = path[:, k]
        if not np.any((z.real > box[0].real) & (z.real < box[1].real) & (z.imag > box[0].imag) & (z.imag < box[1].imag)):
            return path[:, : k + 1], owner
        a = arm(z, ahead)
        b = arm(z + 0.5 * step * a, a)
        c = arm(z + 0.5 * step * b, b)
        d = arm(z + step * c, c)
        ahead = a + 2 * b + 2 * c + d
        ahead /= np.abs(ahead)
        path[:, k + 1] = z + step * ahead
    return path, owner


def crossings(p: Complex, q: Complex, same: bool = False) -> list[tuple[float, float]]:
    """Where two polylines cross: positions as segment number plus fraction."""
    a, u = p[:-1, None], np.diff(p)[:, None]
    b, v = q[None, :-1], np.diff(q)[None]
    with np.errstate(divide="ignore", invalid="ignore"):
        bottom = (np.conj(u) * v).imag
        s = (np.conj(b - a) * v).imag / bottom
        t = (np.conj(b - a) * u).imag / bottom
    hit = (np.abs(bottom) > 1e-9 * np.abs(u) * np.abs(v)) & (s >= 0) & (s < 1) & (t >= 0) & (t < 1)
    i, j = np.nonzero(hit)
    if same:
        i, j = i[j > i + 2], j[j > i + 2]
    return list(zip((i + s[i, j]).tolist(), (j + t[i, j]).tolist()))


def parts(power: Power, boundary: list[Complex], singular: list[complex], radii: list[float], sharp: list[complex]) -> Parts:
    """The parts of a domain.

    Parameters
    ----------
    power : callable
        Fourth power of the cross at points (k,).
    boundary : list of (n,) complex
        Closed polylines (first point not repeated), the domain on the left.
    singular : list of complex
        Interior singular points; `radii` are those of circles around them on which the field is taken as it is.
    sharp : list of complex
        Vertices of the boundary that have one quad.
    """
    everything = np.concatenate(boundary)
    box = complex(everything.real.min(), everything.imag.min()), complex(everything.real.max(), everything.imag.max())
    paths, owner = trace(power, singular, radii, STEP * abs(box[1] - box[0]), box)
    rims = [np.append(b, b[0]) for b in boundary]
    lines = [*rims, *paths]
    n, first = len(lines), len(rims)
    # meetings, by the time at which the later one arrives: (time, later, where, older, where)
    meetings = []
    for i in range(first, n):
        hits = [(t, i, t, j, s) for j in range(first) for s, t in crossings(lines[j], lines[i])]
        if not hits:
            continue
        meetings.append(min(hits))
        lines[i] = lines[i][: int(min(hits)[0]) + 2]
    for i in range(first, n):
        for j in range(first, i + 1):
            for s, t in crossings(lines[j], lines[i], j == i):
                if s < 1 and t < 1:
                    continue  # both leave the same singular point
                if (t, i) >= (s, j):
                    meetings.append((t, i, t, j, s))
                else:
                    meetings.append((s, j, s, i, t))
    end = np.full(n, np.inf)
    stops: dict[int, tuple[int, float]] = {}
    for _, i, t, j, s in sorted(meetings):
        if t <= end[i] and s <= end[j] and i not in stops:
            end[i] = t
            stops[i] = (j, s)
    if len(stops) < n - first:
        raise RuntimeError("a separatrix does not end")
    return _faces(lines, first, owner, len(singular), end, stops, sharp)


def _point(line: Complex, s: float) -> complex:
    k = min(int(s), len(line) - 2)
    return complex(line[k] + (s - k) * (line[k + 1] - line[k]))


def _faces(
    lines: list[Complex],
    first: int,
    owner: list[int],
    singular: int,
    end: npt.NDArray[np.float64],
    stops: dict[int, tuple[int, float]],
    sharp: list[complex],
) -> Parts:
    """The graph as half-edges, and its faces."""
    # nodes: singular points, then ends of traces, then sharp boundary points
    on: dict[int, list[tuple[float, int]]] = {i: [] for i in range(len(lines))}
    trace_end = {}
    count = singular
    for i, (j, s) in sorted(stops.items()):
        on[j].append((s, count))
        on[i].append((end[i], count))
        trace_end[i] = count
        count += 1
    corner_nodes = set()
    for z in sharp:
        rim, k = min(((abs(line[k] - z), r, k) for r, line in enumerate(lines[:first]) for k in range(len(line) - 1)))[1:]
        on[rim].append((float(k), count))
        corner_nodes.add(count)
        count += 1
    arcs: list[tuple[int, int, int, Complex]] = []  # start, end, line, points
    for i, line in enumerate(lines):
        marks = sorted(on[i])
        if i < first:
            if not marks:
                raise RuntimeError("no separatrix ends on a boundary loop")
            period = len(line) - 1
            marks = [*marks, (marks[0][0] + period, marks[0][1])]
            line = np.concatenate([line, line[1:]])
        else:
            marks = [(0.0, owner[i - first]), *marks]
        for (s, a), (t, b) in pairwise(marks):
            inner = line[int(np.floor(s)) + 1 : int(np.ceil(t))]
            arcs.append((a, b, i, np.array([_point(line, s), *inner, _point(line, t)])))
    # half-edge 2 k runs along arc k, 2 k + 1 against it
    start = np.array([v for a, b, _, _ in arcs for v in (a, b)])
    leaving: list[list[tuple[float, int]]] = [[] for _ in range(count)]
    for h in range(2 * len(arcs)):
        p = arcs[h // 2][3] if h % 2 == 0 else arcs[h // 2][3][::-1]
        leaving[start[h]].append((float(np.angle(next(q for q in p[1:] if abs(q - p[0]) > 1e-12) - p[0])), h))
    around = [[h for _, h in sorted(out)] for out in leaving]
    seen: set[int] = set()
    found = []
    for h0 in range(2 * len(arcs)):
        if h0 in seen:
            continue
        h, corners, outline, outside = h0, 0, [], False
        while h not in seen:
            seen.add(h)
            line = arcs[h // 2][2]
            outside |= line < first and h % 2 == 1
            points = arcs[h // 2][3]
            outline.append(points[:-1] if h % 2 == 0 else points[:0:-1])
            back = h ^ 1
            ring = around[start[back]]
            following = ring[(ring.index(back) - 1) % len(ring)]
            node = int(start[back])
            if node < singular or node in corner_nodes or arcs[following // 2][2] != line:
                corners += 1
            h = following
        if not outside:
            found.append(Part(corners, np.concatenate(outline)))
    if count - len(arcs) + len(found) != 2 - first:
        raise RuntimeError("the separatrices do not cut the domain into simple parts")
    drawn = [np.append(line[: int(end[i]) + 1], _point(line, end[i])) for i, line in enumerate(lines) if i >= first]
    return Parts(found, drawn)
