"""Places of nodes on CAD curves that the CAD itself has off its faces.

A kernel keeps an edge as a curve in space within a tolerance of its faces.  A B-spline that stands for the intersection of two
planes may be 1e-5 to 1e-3 of the model off both of them, and nodes that are exactly on it dent both faces.  Where a curve
between faces is off all of them by more than `OFF`, its nodes are moved to the nearest point x that is on all of them: with
f_i the foot of x on face i and d_i the unit vector from x to f_i (the normal where x is on the face), steps of least length

    d_i . dx = |f_i - x|        for all faces i

are repeated; directions that are nearly dependent (tangent faces) count once.  A node that does not come much nearer to its
faces, or would go farther than a few times the distance that it was off, stays on the curve.  Nodes of the boundary of a single
face and CAD vertices stay in any case.

`OFF` is the distance from which a dent is seen: nodes closer to a face than that are better on the curve, where everybody looks
for them.  Measured: 12 of 122 curves of a diode's housing are 5e-5 to 6e-4 off their planes; their inner nodes come onto both
planes to rounding.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np

from ..records import Float, Int, Model
from ..surfaces import Surfaces
from .put import curve_points

__all__ = ["CurvePlaces"]

OFF = 1e-5  # of the model
SAMPLES = (np.arange(16) + 0.5) / 16  # of the range of parameters
ROUNDS = 8
ON = 1e-13  # of the model: closer to a face the direction to the foot is noise
DEPENDENT = 0.05  # least sine of the angle between faces
FARTHEST = 4.0  # of the distance that the node was off
NEARER = 0.5  # of it that may be left


@dataclass(frozen=True)
class CurvePlaces:
    """Places on CAD curves, in the user's coordinates.

    Attributes
    ----------
    model : Model
        Of the current Gmsh model.
    surfaces : Surfaces
        Its faces.
    faces : tuple of tuple of int
        For every curve the rows of the faces that its nodes are moved to; empty where they stay on the curve.
    """

    model: Model
    surfaces: Surfaces
    faces: tuple[tuple[int, ...], ...]

    @classmethod
    def find(cls, model: Model, surfaces: Surfaces) -> CurvePlaces:
        """Look for the curves that are off all of their faces.

        Raises
        ------
        MeshError
            Where Gmsh cannot evaluate a curve, or a point has no foot.
        """
        uses: list[Counter[int]] = [Counter() for _ in model.curves]
        for row, face in enumerate(model.faces):
            for curve, _ in (item for loop in face.loops for item in loop):
                uses[curve][row] += 1
            for curve in face.embedded_curves:
                uses[curve][row] += 2
        inner = [c for c, of_faces in enumerate(uses) if of_faces.total() > 1]
        out: list[tuple[int, ...]] = [()] * len(model.curves)
        if not inner:
            return cls(model, surfaces, tuple(out))
        points = np.stack([_scaled(model, c, _inside(model, c)) for c in inner])
        pairs = [(k, f) for k, c in enumerate(inner) for f in sorted(uses[c])]
        of_curve, of_face = np.array(pairs).T
        x = points[of_curve].reshape(-1, 3)
        feet = surfaces.feet(np.repeat(of_face, len(SAMPLES)), x)
        off = np.full((len(inner), len(SAMPLES)), np.inf)
        np.minimum.at(off, of_curve, np.linalg.norm(feet - x, axis=1).reshape(-1, len(SAMPLES)))
        for k in np.flatnonzero((off > OFF).any(axis=1)).tolist():
            out[inner[k]] = tuple(sorted(uses[inner[k]]))
        return cls(model, surfaces, tuple(out))

    def __call__(self, curve: int, parameters: Float) -> Float:
        """Places (n, 3) at CAD parameters (n,) of row `curve`."""
        exact = curve_points(self.model, curve, parameters)
        if not self.faces[curve] or not len(exact):
            return exact
        start = (exact - self.model.origin) / self.model.scale
        faces = np.array(self.faces[curve])
        x, away, towards = start, *self._towards(faces, start)
        off = away.max(axis=1)
        for _ in range(ROUNDS):
            if away.max() <= ON:
                break
            x = x + np.einsum("nck,nk->nc", np.linalg.pinv(towards, rcond=DEPENDENT), away)
            away, towards = self._towards(faces, x)
        good = (away.max(axis=1) <= NEARER * off) & (np.linalg.norm(x - start, axis=1) <= FARTHEST * off)
        return np.where(good[:, None], x * self.model.scale + self.model.origin, exact)

    def _towards(self, faces: Int, x: Float) -> tuple[Float, Float]:
        """Distances (n, k) of points from faces (k,), and unit vectors (n, k, 3) to them."""
        n, k = len(x), len(faces)
        face, points = np.repeat(faces, n), np.tile(x, (k, 1))
        feet = self.surfaces.feet(face, points)
        step = feet - points
        away = np.linalg.norm(step, axis=1)
        there = away <= ON
        unit = step / np.where(there, 1.0, away)[:, None]
        if there.any():
            unit[there] = self.surfaces.normals(face[there], feet[there])
        return away.reshape(k, n).T, unit.reshape(k, n, 3).swapaxes(0, 1)


def _inside(model: Model, curve: int) -> Float:
    """Parameters inside a curve."""
    first, last = model.curves[curve].parameters[[0, -1]]
    return np.asarray(first + SAMPLES * (last - first))


def _scaled(model: Model, curve: int, parameters: Float) -> Float:
    """Points (n, 3) of a curve, scaled."""
    return (curve_points(model, curve, parameters) - model.origin) / model.scale
