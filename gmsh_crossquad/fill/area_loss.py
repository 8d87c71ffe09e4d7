"""Final edges along chords so that the mesh has nearly the area of the CAD.

A final edge of length l over which a curve turns by t within a face cuts about l^2 t / 12 off the face.  A cell of area A over
which a curved face turns by s and t loses about A (s^2 + t^2) / 24.  With p edges along every guide edge of a chord both fall as
1 / p^2, so the loss of face f is sum over chords of W_fc / p_c^2.

The model as a whole, and every physical surface, may lose `LOST` of its area, a face `LOST_ALONE`.  Until that is so, chords get
one edge more, those first whose edge saves most for the quads it costs; those within `ALIKE` of the best one together, so that
what is symmetric stays symmetric.  No final edge may turn by more than `STEEP`.

Measured on a pump housing of 119 faces with 15,331 quads, which loses .1 % of its area: doubling all chords that have an edge of
more than 20 degrees at a face that loses more than `LOST` would make 45,121.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ..records import Bool, Float, Guide, Int, Model
from ..surfaces import Surfaces
from .curve_edges import edges_on_curves, surface_turning
from .numbering import guide_chords

__all__ = ["followed"]

STEEP = np.radians(60.0)
LOST = 0.016
LOST_ALONE = 0.05
ALIKE = 0.9
STEPS = 200
MOST = 4  # times the quads before


class _Losses(NamedTuple):
    """W (f, c) sparse, areas of the faces (f,), and the greatest turning of an edge of every chord (c,)."""

    weight: Any
    area: Float
    turning: Float


def followed(model: Model, surfaces: Surfaces, guide: Guide, fine: Int) -> Int:
    """Final edges per guide edge of every guide chord: `fine` (c,), and more where curves and faces are not followed well enough.

    Chords that end on curves with prescribed nodes are kept.
    """
    from scipy.sparse import coo_array, csr_array

    edges, quad_edges, chord, n = guide_chords(guide.quads)
    losses = _losses(model, surfaces, guide, edges, quad_edges, chord, n)
    free = np.ones(n, bool)
    for curve, (row, _, _) in zip(model.curves, edges_on_curves(model, guide, edges)):
        if curve.spacing is not None:
            free[chord[row]] = False
    out = np.where(free, np.maximum(fine, np.ceil(losses.turning / STEEP - 1e-9)), fine).astype(np.int64)
    groups = csr_array(_groups(model))
    limit: Float = LOST * np.asarray(groups @ losses.area)
    pairs = chord[quad_edges[:, :2]]
    crossing = csr_array(coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(n, n)))
    crossing = crossing + crossing.T
    most = MOST * float(out @ (crossing @ out))
    for _ in range(STEPS):
        lost: Float = np.asarray(losses.weight @ (1.0 / out**2))
        over: Bool = np.asarray(groups @ lost) > limit
        alone = lost > LOST_ALONE * losses.area
        if not (over.any() or alone.any()):
            break
        need = groups.T @ np.where(over, 1.0 / np.maximum(limit, np.finfo(float).tiny), 0.0)
        need += np.where(alone, 1.0 / np.maximum(LOST_ALONE * losses.area, np.finfo(float).tiny), 0.0)
        cost = crossing @ out
        gain = np.where(free, (losses.weight.T @ need) * (1.0 / out**2 - 1.0 / (out + 1) ** 2) / cost, 0.0)
        if gain.max() <= 0.0:
            break
        more = out + (gain >= ALIKE * gain.max())
        if more @ (crossing @ more) > most:
            break
        out = more
    return out


def _groups(model: Model) -> Float:
    """(g, f) 1 where a face is in a group: the whole model, and every physical surface."""
    names = sorted({name for face in model.face_names for name in face})
    rows = [np.ones(len(model.faces))]
    rows += [np.array([float(name in face) for face in model.face_names]) for name in names]
    return np.stack(rows)


def _losses(model: Model, surfaces: Surfaces, guide: Guide, edges: Int, quad_edges: Int, chord: Int, n: int) -> _Losses:
    """What every face loses at every chord with one final edge per guide edge."""
    from scipy.sparse import coo_array, csr_array

    diagonals = guide.points[guide.quads[:, 2:]] - guide.points[guide.quads[:, :2]]
    areas = 0.5 * np.linalg.norm(np.cross(diagonals[:, 0], diagonals[:, 1]), axis=1)
    curves = edges_on_curves(model, guide, edges)
    bent, bent_face, bend = surface_turning(surfaces, guide, edges, quad_edges)
    turning = np.zeros(n)
    for row, _, turn in curves:
        np.maximum.at(turning, chord[row], turn)
    np.maximum.at(turning, chord[bent], bend)
    face_of, chord_of, loss = [], [], []
    for f, face in enumerate(model.faces):
        with_face = np.zeros(len(edges))
        if face.curved:  # what the curve turns with the surface cuts nothing off
            with_face[bent[bent_face == f]] = bend[bent_face == f]
        for row, length, turn in (curves[c] for loop in face.loops for c, _ in loop):
            within = np.sqrt(np.maximum(turn**2 - with_face[row] ** 2, 0.0))
            face_of.append(np.full(len(row), f))
            chord_of.append(chord[row])
            loss.append(length**2 * within / 12.0)
    q = np.flatnonzero(surfaces.curved[guide.quad_face])
    if len(q):
        side = bend[np.searchsorted(bent_face * len(edges) + bent, guide.quad_face[q, None] * len(edges) + quad_edges[q])]
        for k in range(2):
            face_of.append(guide.quad_face[q])
            chord_of.append(chord[quad_edges[q, k]])
            loss.append(areas[q] * np.maximum(side[:, k], side[:, k + 2]) ** 2 / 24.0)
    area = np.bincount(guide.quad_face, areas, minlength=len(model.faces)).astype(np.float64)
    if not loss:
        return _Losses(csr_array((len(area), n)), area, turning)
    entries = np.concatenate(loss), (np.concatenate(face_of), np.concatenate(chord_of))
    return _Losses(csr_array(coo_array(entries, shape=(len(area), n))), area, turning)
