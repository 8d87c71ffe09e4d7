"""Random plane domains, boundary indices and singularities that fit together: what `random_draws.py` and the tests mesh.

Ten families: disc, ellipse, rectangle, L, annulus, eccentric ring, plate with two and with three holes, flower of splines,
airfoil in a box. All are about one unit wide. CAD points on smooth curves are at random places. The indices of up to three
CAD points are one quarter turn off what their angle asks for, as long as every block has 20 to 170 degrees there, or a single
one at a point where the boundary is convex. The singularities inside make the sum chi; some are pairs of opposite sign, some
have index +-1/2.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

__all__ = ["FAMILIES", "Draw", "draw"]

FAMILIES = ("disc", "ellipse", "rectangle", "L", "annulus", "ring", "two holes", "three holes", "flower", "airfoil")
APART = 0.1  # of the extent: from singularities to the boundary and to one another
SMOOTH = 0.25  # radians off a straight angle
MOST = 9
TRIES = 500

Complex = npt.NDArray[np.complex128]


class Piece(NamedTuple):
    """A CAD curve: how Gmsh makes it, and points on it; the domain is on its left."""

    kind: str
    points: Complex
    centre: complex = 0.0


Loops = list[list[Piece]]


@dataclass(frozen=True)
class Draw:
    """One random case.

    Attributes
    ----------
    family : str
    loops : list of list of Piece
        The outer loop first; point tags count along the pieces of all loops from 1 on.
    indices : dict of int -> int
        Quarter turns at point tags whose index is not the default one.
    positions : (k, 2) float64
    quarters : list of int
    """

    family: str
    loops: Loops
    indices: dict[int, int]
    positions: npt.NDArray[np.float64]
    quarters: list[int]

    @property
    def geo(self) -> str:
        """The domain as a .geo file."""
        lines: list[str] = []
        first, aux, curve = 1, 10_000, 1
        for number, loop in enumerate(self.loops, 1):
            lines += [_point(first + i, piece.points[0]) for i, piece in enumerate(loop)]
            for i, (kind, points, centre) in enumerate(loop):
                between = {"Line": [], "Circle": [centre], "Spline": points[1:-1].tolist()}[kind]
                lines += [_point(aux + k, z) for k, z in enumerate(between)]
                tags = [first + i, *range(aux, aux + len(between)), first + (i + 1) % len(loop)]
                lines.append(f"{kind}({curve + i}) = {{{', '.join(map(str, tags))}}};")
                aux += len(between)
            lines.append(f"Curve Loop({number}) = {{{', '.join(str(curve + i) for i in range(len(loop)))}}};")
            first += len(loop)
            curve += len(loop)
        lines.append(f"Plane Surface(1) = {{{', '.join(str(i + 1) for i in range(len(self.loops)))}}};")
        return "\n".join(lines) + "\n"


def _point(tag: int, z: complex) -> str:
    return f"Point({tag}) = {{{z.real:.15g}, {z.imag:.15g}, 0}};"


def draw(seed: int) -> Draw:
    """A random case of the family ``seed % 10``."""
    rng = np.random.default_rng(seed)
    family = FAMILIES[seed % len(FAMILIES)]
    for _ in range(TRIES):
        loops = _domain(rng, family)
        default, wanted = _indices(rng, loops)
        missing = 4 * (2 - len(loops)) - sum({**default, **wanted}.values())
        quarters = _quarters(rng, missing)
        positions = _positions(rng, loops, len(quarters))
        if len(quarters) <= MOST and len(positions) == len(quarters):
            plane = np.array([[z.real, z.imag] for z in positions]).reshape(-1, 2)
            return Draw(family, loops, wanted, plane, quarters)
    raise RuntimeError(f"no case of the family {family} for seed {seed}")


def _angles(rng: np.random.Generator, least: int, most: int) -> npt.NDArray[np.float64]:
    """Angles of CAD points on a round curve, neither close together nor far apart."""
    n = int(rng.integers(least, most + 1))
    for _ in range(TRIES):
        a = np.sort(rng.uniform(0, 2 * np.pi, n))
        gap = np.diff(np.append(a, a[0] + 2 * np.pi))
        if gap.min() > 0.35 and gap.max() < 2.6:
            return a
    return 2 * np.pi * np.arange(n) / n


def _round(
    rng: np.random.Generator, radius: float, centre: complex = 0.0, hole: bool = False, squeeze: float = 1.0
) -> list[Piece]:
    a = _angles(rng, 3, 4 if hole else 6)
    pieces = []
    for start, end in zip(a, np.append(a[1:], a[0] + 2 * np.pi), strict=True):
        t = np.linspace(start, end, 40)
        z = centre + radius * (np.cos(t) + 1j * squeeze * np.sin(t))
        pieces.append(Piece("Circle" if squeeze == 1.0 else "Spline", z[::-1] if hole else z, centre))
    return pieces[::-1] if hole else pieces


def _polygon(*corners: complex) -> list[Piece]:
    return [Piece("Line", np.linspace(a, b, 40)) for a, b in zip(corners, (*corners[1:], corners[0]), strict=True)]


def _domain(rng: np.random.Generator, family: str) -> Loops:
    u = rng.uniform
    if family == "disc":
        return [_round(rng, 0.5)]
    if family == "ellipse":
        return [_round(rng, 0.5, squeeze=u(0.45, 0.85))]
    if family == "rectangle":
        h = 1j * u(0.4, 1.0)
        return [_polygon(0, u(0.3, 0.7), 1, 1 + h, h) if rng.random() < 0.5 else _polygon(0, 1, 1 + h, h)]
    if family == "L":
        x, y = u(0.35, 0.65), 1j * u(0.35, 0.65)
        return [_polygon(0, 1, 1 + y, x + y, x + 1j, 1j)]
    if family == "annulus":
        return [_round(rng, 0.5), _round(rng, u(0.12, 0.25), hole=True)]
    if family == "ring":
        r = u(0.1, 0.2)
        return [_round(rng, 0.5), _round(rng, r, u(0.08, 0.36 - r) * np.exp(1j * u(0, 2 * np.pi)), hole=True)]
    if family == "two holes":
        h = u(0.5, 0.8)
        centres = [u(*x) + 1j * h * u(0.4, 0.6) for x in ((0.22, 0.32), (0.68, 0.78))]
        return [_polygon(0, 1, 1 + 1j * h, 1j * h), *(_round(rng, u(0.06, 0.13), c, hole=True) for c in centres)]
    if family == "three holes":
        boxes = ((0.22, 0.3, 0.22, 0.35), (0.7, 0.78, 0.22, 0.4), (0.4, 0.6, 0.68, 0.78))
        centres = [u(a, b) + 1j * u(c, d) for a, b, c, d in boxes]
        return [_polygon(0, 1, 1 + 1j, 1j), *(_round(rng, u(0.05, 0.1), c, hole=True) for c in centres)]
    if family == "flower":
        petals, depth, phase = int(rng.integers(3, 6)), u(0.05, 0.16), u(0, 2 * np.pi)
        a = _angles(rng, 4, 6)
        spans = [np.linspace(s, t, 60) for s, t in zip(a, np.append(a[1:], a[0] + 2 * np.pi), strict=True)]
        return [[Piece("Spline", 0.42 * (1 + depth * np.cos(petals * t + phase)) * np.exp(1j * t)) for t in spans]]
    x = 0.5 * (1 - np.cos(np.linspace(0, np.pi, 60)))
    y = 5 * u(0.1, 0.2) * (0.2969 * np.sqrt(x) - 0.126 * x - 0.3516 * x**2 + 0.2843 * x**3 - 0.1036 * x**4)
    nose, chord = 0.22 + 1j * u(0.35, 0.5), 0.55 * np.exp(1j * u(-0.2, 0.2))
    upper, lower = nose + chord * (x + 1j * y), nose + chord * (x - 1j * y)
    return [_polygon(0, 1, 1 + 0.85j, 0.85j), [Piece("Spline", upper), Piece("Spline", lower[::-1])]]


def _indices(rng: np.random.Generator, loops: Loops) -> tuple[dict[int, int], dict[int, int]]:
    """Default indices of all CAD points, and the wanted ones of some."""
    angle: dict[int, float] = {}
    turning: dict[int, float] = {}
    for loop in loops:
        for before, piece in zip([loop[-1], *loop[:-1]], loop, strict=True):
            tag = len(angle) + 1
            back, ahead = np.diff(before.points), np.diff(piece.points)
            angle[tag] = float(np.angle(-back[-1] / ahead[0]) % (2 * np.pi))
            turning[tag] = float(min(np.angle(back[-1] / back[-2]), np.angle(ahead[1] / ahead[0])))
    smooth = {t: abs(a - np.pi) < SMOOTH for t, a in angle.items()}
    default = {t: 0 if smooth[t] else 2 - max(1, int(np.floor(a / (np.pi / 2) + 0.5 + 1e-6))) for t, a in angle.items()}
    wanted = {}
    some = rng.permutation(list(angle))[: int(rng.integers(1, 4))].tolist() if rng.random() < 0.6 else []
    for tag in some:
        index = default[tag] + int(rng.choice([-1, 1]))
        blocks = 2 - index
        if smooth[tag] and index == 1:
            fits = turning[tag] > np.radians(2.0)
        else:
            fits = blocks >= 1 and 20 <= np.degrees(angle[tag]) / blocks <= 170
        if fits:
            wanted[tag] = index
    return default, wanted


def _quarters(rng: np.random.Generator, total: int) -> list[int]:
    """Indices that add up to `total`."""
    out = [int(np.sign(total))] * abs(total) + [1, -1] * int(rng.choice([0, 1, 2], p=[0.5, 0.35, 0.15]))
    sign = int(rng.choice([-1, 1]))
    if rng.random() < 0.25 and out.count(sign) >= 2:
        out.remove(sign)
        out.remove(sign)
        out.append(2 * sign)
    return [int(q) for q in rng.permutation(out)]


def _positions(rng: np.random.Generator, loops: Loops, count: int) -> list[complex]:
    """Places inside, as many as were found."""
    border = np.concatenate([piece.points for loop in loops for piece in loop])
    low = border.real.min() + 1j * border.imag.min()
    width, height = np.ptp(border.real), np.ptp(border.imag)
    apart = APART * max(width, height)
    out: list[complex] = []
    for _ in range(6 * TRIES):
        if len(out) == count:
            break
        z = low + width * rng.random() + 1j * height * rng.random()
        near = np.abs(np.append(border, np.array(out, complex)) - z).min() < apart
        if not near and _winding(loops, z) == 1:
            out.append(z)
    return out


def _winding(loops: Loops, z: complex) -> int:
    total = 0.0
    for loop in loops:
        p = np.concatenate([piece.points[:-1] for piece in loop]) - z
        total += float(np.angle(np.roll(p, -1) / p).sum())
    return round(total / (2 * np.pi))
