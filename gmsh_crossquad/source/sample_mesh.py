"""The mesh of a sampled field as the user gives it: points, cells, and values on them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

import numpy as np
import numpy.typing as npt

from ..errors import FieldError
from ..records import Float, Int

__all__ = ["check_finite", "mesh_cells", "mesh_points"]


def mesh_points(positions: npt.ArrayLike) -> Float:
    """(n, 3) finite points from two or three coordinates; FieldError if they are none."""
    try:
        points = np.asarray(positions, float)
    except (TypeError, ValueError):
        raise FieldError("the points of the field's mesh are no numbers", remedy="give an array (n, 3)") from None
    if points.ndim != 2 or points.shape[1] not in (2, 3) or len(points) == 0:
        raise FieldError(f"the points of the field's mesh have shape {points.shape}", remedy="give an array (n, 3)")
    if not np.all(np.isfinite(points)):
        raise FieldError("the points of the field's mesh are not finite", remedy="give an array (n, 3) of numbers")
    return points if points.shape[1] == 3 else np.concatenate([points, np.zeros((len(points), 1))], axis=1)


def mesh_cells(cells: npt.ArrayLike | Sequence[npt.ArrayLike], count: int) -> list[Int]:
    """Cells by number of nodes, from one array or several; FieldError if there are none or if they name no point of `count`."""
    given = [cells] if isinstance(cells, np.ndarray) else list(cast(Sequence[npt.ArrayLike], cells))
    if given and np.ndim(given[0]) == 1:
        given = [np.asarray(cells)]
    blocks = [np.asarray(b) for b in given]
    if not sum(b.size for b in blocks):
        raise FieldError(
            "the field has no triangles or quadrangles", remedy="scattered points cannot be used: give a surface mesh"
        )
    if any(b.dtype.kind not in "iu" or (b.size and (b.min() < 0 or b.max() >= count)) for b in blocks):
        raise FieldError("the cells of the field's mesh name points that it does not have", remedy="give rows of the points")
    return [b.astype(np.int64) for b in blocks if b.size]


def check_finite(values: Float, points: Float, blocks: list[Int], where: str) -> None:
    """Raise FieldError for a value that is not finite, with the place of the first one."""
    bad = np.flatnonzero(~np.isfinite(values.reshape(len(values), -1)).all(axis=1))
    if len(bad) == 0:
        return
    if where == "points":
        place = points[bad[0]]
    else:
        ends = np.cumsum([len(b) for b in blocks])
        i = int(np.searchsorted(ends, bad[0], side="right"))
        place = points[blocks[i][bad[0] - (ends[i] - len(blocks[i]))]].mean(axis=0)
    raise FieldError(
        f"{len(bad)} of {len(values)} values of the field are no finite numbers, first",
        location=place,
        remedy="give a value at every point",
    )
