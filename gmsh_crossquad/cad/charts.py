"""The parametrizations of CAD faces, evaluated for the points of many faces at once.

Parameters are used in units of the face's own range: u and v are 0 and 1 on its bounds.  Gmsh evaluates a point in .1 to 2
microseconds, and most surfaces also outside their bounds.  Parameters are kept within them where that means nothing (B-splines
run away there within a tenth of their range, a cone has a second half behind its apex).  They run freely on a cylinder, a
sphere, a torus and a cone whose apex is far, round a surface of revolution, and round any face that closes: from one seam to
the other.

Two traps of Gmsh 4.15.2: derivatives of surfaces of the built-in kernel are difference quotients (good to about 1e-7), their
second derivatives quotients of these that are noise; so second derivatives are taken over a step of a thousandth here.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import gmsh
import numpy as np

from ..records import Bool, Float, Int
from .session import gmsh_errors

__all__ = ["Charts", "runs"]

# directions (u, v) of surfaces that are the same surface outside their bounds
FREE = {"Cylinder": (True, True), "Cone": (True, False), "Sphere": (True, True), "Torus": (True, True)}
FREE["Surface of Revolution"] = (True, False)
CLOSED = 1e-9  # of the model: gap of a closed surface at its seam
PROBES = np.array([0.13, 0.31, 0.5, 0.71, 0.9])
STEP = 1e-3  # of the range, for second derivatives


def runs(face: Int) -> Iterator[tuple[int, slice]]:
    """Every face of a sorted array with the slice of its entries."""
    bounds = [0, *(np.flatnonzero(np.diff(face)) + 1).tolist(), len(face)]
    for a, b in pairwise(bounds):
        if b > a:
            yield int(face[a]), slice(a, b)


@dataclass(frozen=True)
class Charts:
    """Parametrizations of faces; `face` is always a sorted (n,) array of rows.

    Attributes
    ----------
    tags : (f,) int64
        Gmsh tags.
    low, width : (f, 2) float64
        Least parameters and their range; NaN where there are none.
    closed, clamped : (f, 2) bool
        Directions that come back to their start, and that end at their bounds.
    sphere : (f,) bool
    """

    tags: Int
    low: Float
    width: Float
    closed: Bool
    clamped: Bool
    sphere: Bool

    @classmethod
    def read(cls, tags: Int, evaluable: Bool, size: float) -> Charts:
        """The charts of faces of the current Gmsh model, of diagonal `size`; `evaluable` (f,) marks those that have one."""
        shape = len(tags), 2
        none = [np.zeros(s, bool) for s in (shape, shape, len(tags))]
        out = cls(tags, np.full(shape, np.nan), np.ones(shape), *none)
        for row in np.flatnonzero(evaluable).tolist():
            tag = int(tags[row])
            with gmsh_errors("reading the parameters", entity=(2, tag)):
                low, high = (np.asarray(b, float) for b in gmsh.model.getParametrizationBounds(2, tag))
                kind = gmsh.model.getType(2, tag)
            out.low[row], out.width[row] = low, high - low
            out.sphere[row] = kind == "Sphere"
            free = FREE.get(kind, (False, False))
            if kind == "Cone":  # free where the apex is more than half of the range away
                ring = out.derivatives(np.full(2, row), np.array([[0.5, 0.0], [0.5, 1.0]]))[:, 0]
                radius = np.linalg.norm(ring, axis=1)
                free = True, bool(3 * radius.min() > radius.max())
            for k in range(2):
                ends = np.empty((2, len(PROBES), 2))
                ends[..., k], ends[..., 1 - k] = np.array([[0.0], [1.0]]), PROBES
                a, b = out.values(np.full(2 * len(PROBES), row), ends.reshape(-1, 2)).reshape(2, -1, 3)
                out.closed[row, k] = np.abs(a - b).max() <= CLOSED * size
                out.clamped[row, k] = not (out.closed[row, k] or free[k])
        return out

    def values(self, face: Int, uv: Float) -> Float:
        """Points (n, 3) in the user's coordinates."""
        out = np.empty((len(uv), 3))
        own = self.low[face] + uv * self.width[face]
        for row, part in runs(face):
            tag = int(self.tags[row])
            with gmsh_errors("evaluating", entity=(2, tag)):
                out[part] = gmsh.model.getValue(2, tag, own[part].ravel()).reshape(-1, 3)
        return out

    def derivatives(self, face: Int, uv: Float) -> Float:
        """Derivatives (n, 2, 3) in u and v."""
        out = np.empty((len(uv), 2, 3))
        own = self.low[face] + uv * self.width[face]
        for row, part in runs(face):
            tag = int(self.tags[row])
            with gmsh_errors("evaluating", entity=(2, tag)):
                out[part] = gmsh.model.getDerivative(2, tag, own[part].ravel()).reshape(-1, 2, 3)
        out *= self.width[face][:, :, None]
        return out

    def second_derivatives(self, face: Int, uv: Float) -> Float:
        """Second derivatives (n, 3, 3): uu, uv, vv."""
        out = np.empty((len(uv), 3, 3))
        mixed = []
        for k in range(2):
            move = np.zeros(2)
            move[k] = STEP
            # one-sided at bounds
            a, b = uv - move, uv + move
            ends = self.clamped[face]
            a = np.where(ends, np.minimum(np.maximum(a, 0.0), 1.0 - move), a)
            b = np.where(ends, np.maximum(np.minimum(b, 1.0), move), b)
            quotient = (self.derivatives(face, b) - self.derivatives(face, a)) / (b - a)[:, k, None, None]
            out[:, 2 * k] = quotient[:, k]
            mixed.append(quotient[:, 1 - k])
        out[:, 1] = 0.5 * (mixed[0] + mixed[1])
        return out

    def moved(self, face: Int, uv: Float, step: Float) -> tuple[Float, Float]:
        """Parameters `uv + step`, kept within bounds that end there; and the steps that were really made."""
        out = uv + step
        ends = self.clamped[face]
        if ends.any():
            out = np.where(ends, np.clip(out, 0.0, 1.0), out)
        step = out - uv
        turns = self.closed[face]
        if turns.any():
            out = np.where(turns, out - np.floor(out), out)
        return out, step

    def to_user(self, face: Int, uv: Float) -> Float:
        """The CAD's own parameters (n, 2); on a sphere with the latitude within a quarter turn."""
        out = self.low[face] + uv * self.width[face]
        ball = self.sphere[face]
        if ball.any():
            u, v = out[ball].T
            v = np.arctan2(np.sin(v), np.cos(v))
            over = np.abs(v) > 0.5 * np.pi
            v = np.where(over, np.copysign(np.pi, v) - v, v)
            u = np.where(over, u + np.pi, u)
            middle = self.low[face[ball], 0] + 0.5 * self.width[face[ball], 0]
            u = np.where(over, u - 2 * np.pi * np.round((u - middle) / (2 * np.pi)), u)
            out[ball] = np.stack([u, v], axis=1)
        return out

    def from_user(self, face: Int, own: Float) -> Float:
        """Parameters (n, 2) in units of the range."""
        return (own - self.low[face]) / self.width[face]
