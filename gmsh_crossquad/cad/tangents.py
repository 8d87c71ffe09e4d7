"""Directions of curve ends and opening angles of corners, from the CAD.

The tangent at the end of a curve is that of the CAD (`gmsh.model.getDerivative`).  It is not to be trusted where the
derivative vanishes or jumps (a spline with a doubled end point, a cusp): where it differs from the chord to the nearest
sample by more than 30 degrees, chords of the curve at growing parameter offsets take its place, the first that agrees
with its successor.  Angles come from tangents and never from a mesh: at the leading edge of an aerofoil a mesh sees a
corner that is not there.
"""

from __future__ import annotations

import itertools

import gmsh
import numpy as np

from gmsh_crossquad.cad.sample import evaluate
from gmsh_crossquad.cad.session import gmsh_errors
from gmsh_crossquad.records import Curve, Float, Model

__all__ = ["end_directions", "end_tangents", "sector_angles"]

TRUST = np.cos(np.radians(30.0))
AGREE = np.cos(np.radians(1.0))
OFFSETS = (1e-6, 1e-5, 1e-4, 1e-3)  # of the parameter range


def _unit(v: Float) -> Float:
    size = np.sqrt((v**2).sum(-1, keepdims=True))
    return np.divide(v, size, out=np.zeros_like(v), where=size > 0)


def end_tangents(curve: Curve) -> Float:
    """Unit directions (2, 3) in which a curve leaves its start and its end, both pointing into the curve.

    Parameters
    ----------
    curve : Curve
        Of the current Gmsh model.
    """
    chords = _unit(np.stack([curve.points[1] - curve.points[0], curve.points[-2] - curve.points[-1]]))
    if gmsh.model.getType(1, curve.tag) == "Line" or gmsh.model.getType(1, curve.tag).startswith("Discrete"):
        return chords
    lo, hi = curve.parameters[0], curve.parameters[-1]
    with gmsh_errors("differentiating", entity=(1, curve.tag)):
        derivative = np.asarray(gmsh.model.getDerivative(1, curve.tag, np.array([lo, hi]))).reshape(2, 3)
    derivative[1] *= -1
    tangents = _unit(derivative)
    trusted = np.isfinite(tangents).all(1) & ((tangents * chords).sum(1) > TRUST)
    for end in np.flatnonzero(~trusted):
        tangents[end] = _chord_limit(curve, int(end))
    return tangents


def _chord_limit(curve: Curve, end: int) -> Float:
    """Direction of the chords of a curve that shrink to one of its ends."""
    lo, hi = curve.parameters[0], curve.parameters[-1]
    steps = np.array([0.0, *OFFSETS]) * (hi - lo)
    points = evaluate(curve.tag, lo + steps if end == 0 else hi - steps)
    chords = _unit(points[1:] - points[0])
    for near, far in itertools.pairwise(chords):
        if near @ far > AGREE:
            return near
    return chords[-1]


def end_directions(model: Model, face_row: int) -> dict[tuple[int, int], float]:
    """Directions of all curve ends of a face in its frame.

    Parameters
    ----------
    model : Model
        Read from the current Gmsh model.
    face_row : int

    Returns
    -------
    dict of (curve row, 0 at its start or 1 at its end) -> float
        Angle in the local frame, in (-pi, pi], of the direction in which the curve leaves that vertex.
        Boundary curves and embedded curves.
    """
    face = model.faces[face_row]
    out: dict[tuple[int, int], float] = {}
    for row in dict.fromkeys([c for loop in face.loops for c, _ in loop] + list(face.embedded_curves)):
        flat = end_tangents(model.curves[row]) @ face.axes.T
        for end in (0, 1):
            out[row, end] = float(np.arctan2(flat[end, 1], flat[end, 0]))
    return out


def sector_angles(model: Model, face_row: int) -> tuple[Float, ...]:
    """Opening angles at the corners of a face's loops.

    Parameters
    ----------
    model : Model
        Read from the current Gmsh model.
    face_row : int

    Returns
    -------
    tuple of (k,) float64, one per loop
        Entry i is the angle in (0, 2 pi] measured inside the face between curve i - 1 and curve i of the loop.  Where
        both leave in one direction the sampled curves tell a cusp (near 0) from a slit (near 2 pi).  Embedded curves
        that end in the corner are not regarded: they divide the angle.
    """
    face = model.faces[face_row]
    directions = end_directions(model, face_row)
    out = []
    for loop in face.loops:
        angles = np.zeros(len(loop))
        for i, (c, sign) in enumerate(loop):
            before, before_sign = loop[i - 1]
            away, back = (c, 0 if sign > 0 else 1), (before, 1 if before_sign > 0 else 0)
            exact = (directions[back] - directions[away]) % (2 * np.pi)
            if min(exact, 2 * np.pi - exact) < np.radians(1.0):
                exact = _narrow(exact, _seen(model, face_row, away, back))
            angles[i] = exact
        out.append(angles)
    return tuple(out)


def _narrow(exact: float, seen: float) -> float:
    """Of a nearly closed angle, the representative (0 or 2 pi side) that the curves show at some distance."""
    turns = np.round((seen - exact) / (2 * np.pi))
    return float(min(max(exact + 2 * np.pi * turns, 0.0), 2 * np.pi))


def _seen(model: Model, face_row: int, away: tuple[int, int], back: tuple[int, int]) -> float:
    """Angle between chords of two curve ends at a small common distance."""
    face = model.faces[face_row]
    reach = 0.05 * min(model.curves[away[0]].length, model.curves[back[0]].length)
    angle = []
    for row, end in (back, away):
        curve = model.curves[row]
        ends = np.array([0.0, reach]) if end == 0 else np.array([1.0, 1.0]) * curve.length - np.array([0.0, reach])
        points = np.stack([np.interp(ends, curve.arclength, curve.points[:, k]) for k in range(3)], axis=1)
        d = (points[1] - points[0]) @ face.axes.T
        angle.append(np.arctan2(d[1], d[0]))
    return float((angle[0] - angle[1]) % (2 * np.pi))
