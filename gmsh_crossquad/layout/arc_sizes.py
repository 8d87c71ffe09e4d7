"""Target edge length along every arc of a T-mesh.

The user's size, made smaller near CAD curves that are shorter than it: at distance d from a curve of length L an edge should
not be longer than 3 L + d.  A crowd of short curves then lies among edges that grow away from it, not beside a long one.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..records import Float, Int, Model, TMesh
from ..spatial import cKDTree

if TYPE_CHECKING:
    from ..cad.sizes import SizeMap

__all__ = ["arc_sizes"]

SAMPLES = 6
NEAR = 3.0
GROWTH = 1.0


def arc_sizes(model: Model, tmesh: TMesh, sizes: SizeMap) -> tuple[Float, Float]:
    """Mean target size (a,) along every arc, and the user's own there without the growth from short curves; both scaled.

    Parameters
    ----------
    model : Model
    tmesh : TMesh
    sizes : SizeMap
        The user's sizes.
    """
    t = (np.arange(SAMPLES) + 0.5) / SAMPLES
    places = np.stack([_along(line, t) for line in tmesh.polyline])
    wanted = _user_sizes(model, tmesh, sizes, places, t)
    short = [c for c in model.curves if c.spacing is None and c.length < float(wanted.max())]
    flat = places.reshape(-1, 3)
    limit = np.full(len(flat), np.inf)
    octave = np.array([int(np.floor(np.log2(c.length))) for c in short])
    for k in np.unique(octave).tolist():
        group = [c for c, o in zip(short, octave.tolist()) if o == k]
        points = np.concatenate([c.points[[0, len(c.points) // 2, -1]] for c in group])
        longest = max(c.length for c in group)
        distance, _ = cKDTree(points).query(flat)
        limit = np.minimum(limit, NEAR * longest + GROWTH * distance)
    graded = np.minimum(wanted.ravel(), limit).reshape(wanted.shape)
    return 1.0 / (1.0 / graded).mean(axis=1), 1.0 / (1.0 / wanted).mean(axis=1)


def _along(line: Float, t: Float) -> Float:
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    return np.stack([np.interp(t * s[-1], s, line[:, k]) for k in range(3)], axis=1)


def _user_sizes(model: Model, tmesh: TMesh, sizes: SizeMap, places: Float, t: Float) -> Float:
    """The user's size (a, SAMPLES) at the sample places of every arc."""
    if sizes.constant is not None:
        return np.full(places.shape[:2], sizes.constant)
    out = np.empty(places.shape[:2])
    face = _arc_face(tmesh)
    for arc in range(len(out)):
        c = int(tmesh.arc_curve[arc])
        if c >= 0:
            out[arc] = sizes.at_curve(c, tmesh.arc_start[arc] + t * tmesh.length[arc])
        else:
            f = int(face[arc])
            out[arc] = sizes.at_face(f, model.faces[f].local(places[arc]))
    return out


def _arc_face(tmesh: TMesh) -> Int:
    """A face of every arc."""
    out = np.full(len(tmesh.length), -1, np.int64)
    for patch, face in zip(tmesh.patches, tmesh.patch_face.tolist()):
        for side in patch:
            for arc, _ in side:
                out[arc] = face
    return out
