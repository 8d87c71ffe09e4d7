"""The sizes of the triangles that Gmsh makes of curved faces.

At first they are those of the nodes on the curves, growing inwards (`space_size`), where the surface bends those that Gmsh finds
from its curvature, and near points that must be vertices those of the points.  A face for which Gmsh asks more often than it
ever should is told to stop: its mesher does not end.  The plain sizes are the greatest one of the face everywhere.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np

from ..records import Float, Model
from .curved_triangles import curves_of
from .seeds import GROWTH, InnerPoints
from .space_size import SpaceSize

__all__ = ["PER_TURN", "Sizes"]

PER_TURN = 16  # triangles per full turn of the surface
MOST_TRIANGLES, FEW_TRIANGLES = 8_000.0, 250.0  # in the model, and of a face of a large one, because of curvature
MOST_CALLS, MOST_PLAIN_CALLS = 25_000, 500_000  # for a face, before its mesher is told to stop
ENDLESS = 1e22  # the size that tells it


class Sizes:
    """Gmsh's size callback for curved faces.

    Parameters
    ----------
    model, rows, spacing, sizes, inner
        As for `curved_mesh.triangulate_curved`.
    plain : bool
        Whether only the greatest size of every face counts.
    """

    def __init__(
        self,
        model: Model,
        rows: Sequence[int],
        spacing: tuple[Float, ...],
        sizes: Float,
        inner: Mapping[int, InnerPoints],
        plain: bool,
    ) -> None:
        self._plain, self._most = plain, MOST_PLAIN_CALLS if plain else MOST_CALLS
        self._limit, self._floor = _limits(model, rows, sizes)
        self._least, self._lowest = min(self._limit.values()), min(self._floor.values())
        self._near = {model.faces[r].tag: _curve_sizes(model, curves_of(model, r), spacing) for r in rows}
        self._around = {} if plain else _around(model, rows, inner)
        self._asked: Counter[int] = Counter()

    @property
    def endless(self) -> frozenset[int]:
        """Tags of the faces whose mesher had to be stopped."""
        return frozenset(tag for tag, count in self._asked.items() if count > self._most)

    def __call__(self, dim: int, tag: int, x: float, y: float, z: float, lc: float) -> float:
        """Size at a point of an entity, where Gmsh by itself would take `lc`."""
        if dim == 2:
            self._asked[tag] += 1
            if self._asked[tag] > self._most:
                return ENDLESS
            limit = self._limit.get(tag, self._least)
            if self._plain:
                return min(lc, limit)
            if tag not in self._near:
                return self._least
            wanted = self._near[tag](x, y, z, min(max(lc, self._floor[tag]), limit))
        else:  # seams: the size from curvature vanishes at an apex
            wanted, tag = min(max(lc, self._lowest), self._least), 0
        if tag in self._around:
            places, most = self._around[tag]
            away = np.sqrt(((places - (x, y, z)) ** 2).sum(axis=1))
            wanted = min(wanted, float((most + GROWTH * away).min()))
        return wanted


def _around(model: Model, rows: Sequence[int], inner: Mapping[int, InnerPoints]) -> dict[int, tuple[Float, Float]]:
    """Places and greatest sizes of the points inside, in the user's units, by face tag; of all faces by 0."""
    out = {}
    for r in rows:
        if r in inner and len(inner[r].points):
            places = model.origin + model.scale * inner[r].points, model.scale * inner[r].size
            out.update(dict.fromkeys(model.faces[r].tags, places))
    if out:
        own = [out[model.faces[r].tag] for r in rows if model.faces[r].tag in out]
        places, sizes = zip(*own, strict=True)
        out[0] = np.concatenate(places), np.concatenate(sizes)
    return out


def _curve_sizes(model: Model, rows: Sequence[int], spacing: tuple[Float, ...]) -> SpaceSize:
    """Sizes that the nodes on the curves `rows` ask for, in the user's units."""
    points, sizes = [np.zeros((0, 3))], [np.zeros(0)]
    for c in rows:
        step = np.diff(spacing[c]) * model.scale
        points.append(model.curves[c].at(spacing[c]) * model.scale + model.origin)
        sizes.append(0.5 * (np.concatenate([step[:1], step]) + np.concatenate([step, step[-1:]])))
    return SpaceSize(np.concatenate(points), np.concatenate(sizes))


def _limits(model: Model, rows: Sequence[int], sizes: Float) -> tuple[dict[int, float], dict[int, float]]:
    """Greatest size of triangles by face tag, and the size below which the curvature of the surface counts no more."""
    limit = {tag: float(sizes[r]) * model.scale for r in rows for tag in model.faces[r].tags}
    most = max(MOST_TRIANGLES / len(model.faces), FEW_TRIANGLES)
    wanted = {r: float(np.sqrt(2.3 * model.faces[r].area / most)) * model.scale for r in rows}
    floor = {tag: wanted[r] for r in rows for tag in model.faces[r].tags}
    return limit, {tag: min(size, limit[tag]) if np.isfinite(size) else 0.1 * limit[tag] for tag, size in floor.items()}
