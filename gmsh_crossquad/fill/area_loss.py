"""Final edges along chords so that the mesh has nearly the area of the CAD.

A final edge of length l over which a curve turns by t within a face cuts about l^2 t / 12 off the face.  A cell of area A over
which a curved face turns by s and t loses about A (s^2 + t^2) / 24.  With p edges along every guide edge of a chord both fall as
1 / p^2, so the loss of face f is sum over chords of W_fc / p_c^2.

The model as a whole, and every physical surface, may lose `LOST` of its area, a face `LOST_ALONE`.  Until that is so, chords get
one edge more, those first whose edge saves most for the quads it costs; those within `ALIKE` of the best one together, so that
what is symmetric stays symmetric.  Edges that turn by less than `ROUND` are good enough: between two curves that nearly touch a
face has hardly an area that could be lost.  No final edge may turn by more than `STEEP`.

Measured on a pump housing of 119 faces with 15,331 quads, which loses .1 % of its area: doubling all chords that have an edge of
more than 20 degrees at a face that loses more than `LOST` would make 45,121.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..records import Bool, Float, Guide, Int, Model
from ..surfaces import Surfaces
from .curve_edges import edges_on_curves, surface_turning
from .numbering import guide_chords

__all__ = ["followed"]

STEEP = np.radians(60.0)
ROUND = np.radians(20.0)
LOST = 0.016
LOST_ALONE = 0.05
ALIKE = 0.9
STEPS = 200
MOST = 4  # times the quads before


class _Losses(NamedTuple):
    """What is lost with one final edge per guide edge: entries (k,) of faces and chords, with the turning of the edge.

    `area` (f,) and the greatest turning (c,) of an edge of every chord, curves and curved faces alike.
    """

    face: Int
    chord: Int
    loss: Float
    turn: Float
    area: Float
    turning: Float


def followed(model: Model, surfaces: Surfaces, guide: Guide, fine: Int) -> Int:
    """Final edges per guide edge of every guide chord: `fine` (c,), and more where curves and faces are not followed well enough.

    Chords that end on curves with prescribed nodes are kept.
    """
    from scipy.sparse import coo_array, csr_array

    edges, quad_edges, chord, n = guide_chords(guide.quads)
    curves = edges_on_curves(model, guide, edges)
    losses = _losses(model, surfaces, guide, curves, edges, quad_edges, chord, n)
    free = np.ones(n, bool)
    for curve, (row, _, _) in zip(model.curves, curves):
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
        pieces = out[losses.chord]
        lost = np.bincount(losses.face, losses.loss / pieces**2, minlength=len(losses.area)).astype(np.float64)
        over: Bool = np.asarray(groups @ lost) > limit
        alone = lost > LOST_ALONE * losses.area
        if not (over.any() or alone.any()):
            break
        need = groups.T @ np.where(over, 1.0 / np.maximum(limit, np.finfo(float).tiny), 0.0)
        need += np.where(alone, 1.0 / np.maximum(LOST_ALONE * losses.area, np.finfo(float).tiny), 0.0)
        saved = np.where(losses.turn > ROUND * pieces, losses.loss * (1.0 / pieces**2 - 1.0 / (pieces + 1) ** 2), 0.0)
        saving = np.bincount(losses.chord, saved * need[losses.face], minlength=n)
        gain = np.where(free, saving / (crossing @ out), 0.0)
        if gain.max() <= 0.0:
            break
        more = out + (gain >= ALIKE * gain.max())
        if more @ (crossing @ more) > most:
            break
        out = more
    return out


def _groups(model: Model) -> Float:
    """(g, f) 1 where a face is in a group: the whole model, and every physical surface."""
    tags = sorted({tag for face in model.face_groups for tag in face})
    rows = [np.ones(len(model.faces))]
    rows += [np.array([float(tag in face) for face in model.face_groups]) for tag in tags]
    return np.stack(rows)


def _losses(
    model: Model,
    surfaces: Surfaces,
    guide: Guide,
    curves: list[tuple[Int, Float, Float]],
    edges: Int,
    quad_edges: Int,
    chord: Int,
    n: int,
) -> _Losses:
    diagonals = guide.points[guide.quads[:, 2:]] - guide.points[guide.quads[:, :2]]
    areas = 0.5 * np.linalg.norm(np.cross(diagonals[:, 0], diagonals[:, 1]), axis=1)
    bent, bent_face, bend = surface_turning(surfaces, guide, edges, quad_edges)
    turning = np.zeros(n)
    for row, _, turn in curves:
        np.maximum.at(turning, chord[row], turn)
    np.maximum.at(turning, chord[bent], bend)
    entries = [(np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0), np.zeros(0))]
    for f, face in enumerate(model.faces):
        with_face = np.zeros(len(edges))
        if face.curved:  # what the curve turns with the surface cuts nothing off
            with_face[bent[bent_face == f]] = bend[bent_face == f]
        for row, length, turn in (curves[c] for loop in face.loops for c, _ in loop):
            within = np.sqrt(np.maximum(turn**2 - with_face[row] ** 2, 0.0))
            entries.append((np.full(len(row), f), chord[row], length**2 * within / 12.0, turn))
    q = np.flatnonzero(surfaces.curved[guide.quad_face])
    if len(q):
        side = bend[np.searchsorted(bent_face * len(edges) + bent, guide.quad_face[q, None] * len(edges) + quad_edges[q])]
        for k in range(2):
            turn = np.maximum(side[:, k], side[:, k + 2])
            entries.append((guide.quad_face[q], chord[quad_edges[q, k]], areas[q] * turn**2 / 24.0, turn))
    face_of, chord_of, loss, turns = (np.concatenate(column) for column in zip(*entries))
    area = np.bincount(guide.quad_face, areas, minlength=len(model.faces)).astype(np.float64)
    return _Losses(face_of, chord_of, loss, turns, area, turning)
