"""Directions of curve ends and opening angles of corners, from the CAD.

The tangent at the end of a curve is the CAD's derivative there.  It is not to be trusted where it vanishes or jumps
(a spline with a doubled end point, a cusp): where it differs from the chord to the nearest sample by more than 30
degrees, chords of the curve at growing parameter offsets take its place, the first that agrees with its successor.
Opening angles come from tangents and never from a mesh: at the leading edge of an aerofoil a mesh shows a corner that
is not there.
"""

from __future__ import annotations

import itertools

import gmsh
import numpy as np

from ..records import Curve, Face, Float, Model
from .sample import evaluate
from .session import gmsh_errors

__all__ = ["cad_tangents", "end_directions", "end_tangents", "opening", "sector_angles"]

TRUST = np.cos(np.radians(30.0))
AGREE = np.cos(np.radians(1.0))
OFFSETS = (1e-6, 1e-5, 1e-4, 1e-3)  # of the parameter range
SMOOTH = np.cos(np.radians(10.0))
CUSP = np.radians(0.5)
NARROW = np.radians(1.0)


def _unit(v: Float) -> Float:
    size = np.sqrt((v**2).sum(-1, keepdims=True))
    return np.divide(v, size, out=np.zeros_like(v), where=size > 0)


def cad_tangents(tag: int, kind: str, parameters: Float, points: Float) -> Float | None:
    """Unit directions in which a curve of the current Gmsh model leaves its ends.

    Parameters
    ----------
    tag : int
    kind : str
        Gmsh type of the curve.
    parameters : (n,) float64; points : (n, 3) float64
        Its samples.

    Returns
    -------
    (2, 3) float64 or None
        From the start and from the end, both pointing into the curve.  None for discrete curves, whose samples say all.
    """
    if kind.startswith("Discrete"):
        return None
    chords = _unit(points[[1, -2]] - points[[0, -1]])
    if kind == "Line":
        return chords
    with gmsh_errors("differentiating", entity=(1, tag)):
        derivative = np.asarray(gmsh.model.getDerivative(1, tag, parameters[[0, -1]])).reshape(2, 3)
    tangents = _unit(derivative * [[1.0], [-1.0]])
    trusted = np.isfinite(tangents).all(1) & ((tangents * chords).sum(1) > TRUST)
    for end in np.flatnonzero(~trusted):
        tangents[end] = _chord_limit(tag, parameters, int(end))
    return tangents


def _chord_limit(tag: int, parameters: Float, end: int) -> Float:
    """Direction of the chords of a curve that shrink to one of its ends."""
    lo, hi = parameters[0], parameters[-1]
    steps = np.array([0.0, *OFFSETS]) * (hi - lo)
    points = evaluate(tag, lo + steps if end == 0 else hi - steps)
    chords = _unit(points[1:] - points[0])
    for near, far in itertools.pairwise(chords):
        if near @ far > AGREE:
            return near
    return chords[-1]


def end_tangents(curve: Curve) -> Float:
    """Unit directions (2, 3) in which a curve leaves its start and its end, both pointing into the curve.

    Without tangents from the CAD those of the samples: of the parabola through the first three points where they
    bend little, else of the first segment.
    """
    if curve.tangents is not None:
        return curve.tangents
    out = np.zeros((2, 3))
    for end, points in enumerate((curve.points[:3], curve.points[-3:][::-1])):
        steps = np.diff(points, axis=0)
        size = np.sqrt((steps**2).sum(1))
        slopes = _unit(steps)
        out[end] = slopes[0]
        if len(slopes) == 2 and slopes[0] @ slopes[1] > SMOOTH:
            out[end] += (slopes[0] - slopes[1]) * size[0] / size.sum()
    return _unit(out)


def end_directions(model: Model, face_row: int) -> dict[tuple[int, int], float]:
    """Directions of all curve ends of a face in its frame.

    Parameters
    ----------
    model : Model
    face_row : int

    Returns
    -------
    dict of (curve row, 0 at its start or 1 at its end) -> float
        Angle in the local frame, in (-pi, pi], of the direction in which the curve leaves that vertex.
        Boundary curves and embedded curves.
    """
    face = model.faces[face_row]
    out: dict[tuple[int, int], float] = {}
    rows = list(dict.fromkeys([c for loop in face.loops for c, _ in loop] + list(face.embedded_curves)))
    flat = np.array([end_tangents(model.curves[row]) for row in rows]) @ face.axes.T
    angles = np.arctan2(flat[..., 1], flat[..., 0]).tolist()
    for row, (start, end) in zip(rows, angles):
        out[row, 0], out[row, 1] = start, end
    return out


def opening(angle: float, shown: float) -> float:
    """Opening angle in (0, 2 pi] of a sector.

    Parameters
    ----------
    angle : float
        From the tangents, the representative nearest to `shown`.
    shown : float
        Angle of the triangles in the sector.  It counts where the tangents of both curves agree (a cusp).
    """
    if abs(angle) < CUSP:
        return shown
    return angle + 2 * np.pi if angle <= 0 else angle - 2 * np.pi if angle > 2 * np.pi + 1e-9 else angle


def sector_angles(model: Model, face_row: int) -> tuple[Float, ...]:
    """Opening angles at the corners of a face's loops.

    Parameters
    ----------
    model : Model
    face_row : int

    Returns
    -------
    tuple of (k,) float64, one per loop
        Entry i is the angle in [0, 2 pi] measured inside the face between curve i - 1 and curve i of the loop.
        Embedded curves that end in the corner are not regarded: they divide the angle.

    Notes
    -----
    Where both curves leave in one direction (within `NARROW`) the angle is near 0 (a cusp) or near 2 pi (a crack, the
    outside of a lens).  The turning of a simple loop tells which: its corners and curves turn by 2 pi together, a
    hole by - 2 pi.  Where a loop has both kinds the chords at some distance decide.
    """
    face = model.faces[face_row]
    directions = end_directions(model, face_row)
    out = []
    for row, loop in enumerate(face.loops):
        away = [(c, 0 if sign > 0 else 1) for c, sign in loop]
        back = [(c, 1 if sign > 0 else 0) for c, sign in loop[-1:] + loop[:-1]]
        angles = np.array([directions[b] - directions[a] for a, b in zip(away, back)]) % (2 * np.pi)
        narrow = np.minimum(angles, 2 * np.pi - angles) < NARROW
        if narrow.any():
            angles[narrow] = (angles[narrow] + np.pi) % (2 * np.pi) - np.pi
            turned = sum(sign * _turning(model.curves[c], face, directions[c, 0], directions[c, 1]) for c, sign in loop)
            turned += (np.pi - angles).sum() - (2 * np.pi if row == 0 else -2 * np.pi)
            opened = round(float(turned) / (2 * np.pi))
            if opened == narrow.sum():
                angles[narrow] += 2 * np.pi
            elif opened != 0:
                for i in np.flatnonzero(narrow):
                    angles[i] += 2 * np.pi * round((_shown(model, face, away[i], back[i]) - angles[i]) / (2 * np.pi))
        out.append(np.clip(angles, 0.0, 2 * np.pi))
    return tuple(out)


def _turning(curve: Curve, face: Face, start: float, end: float) -> float:
    """Angle by which a curve turns from its tangent at the start to that at the end."""
    d = np.diff(face.local(curve.points), axis=0)
    angle = np.concatenate([[start], np.arctan2(d[:, 1], d[:, 0]), [end + np.pi]])
    return float(((np.diff(angle) + np.pi) % (2 * np.pi) - np.pi).sum())


def _shown(model: Model, face: Face, away: tuple[int, int], back: tuple[int, int]) -> float:
    """Angle between the chords of two curve ends at a small common distance."""
    reach = 0.05 * min(model.curves[away[0]].length, model.curves[back[0]].length)
    angle = []
    for row, end in (back, away):
        curve = model.curves[row]
        points = curve.at(np.array([0.0, reach]) if end == 0 else np.array([curve.length, curve.length - reach]))
        d = (points[1] - points[0]) @ face.axes.T
        angle.append(np.arctan2(d[1], d[0]))
    return float((angle[0] - angle[1]) % (2 * np.pi))
