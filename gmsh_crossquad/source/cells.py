"""Triangles from the cells of a surface mesh.

Cells of second order are cut through their mid-side nodes, so that a linear function on the triangles takes every node's value.
The nodes are numbered as in VTK and in Gmsh, which agree for these cells: corners, middles of the sides, centre.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..errors import FieldError
from ..records import Int

__all__ = ["linear_triangles"]

_TRIANGLES = {
    3: ((0, 1, 2),),
    4: ((0, 1, 2), (0, 2, 3)),
    6: ((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)),
    8: ((0, 4, 7), (4, 1, 5), (5, 2, 6), (6, 3, 7), (4, 5, 6), (4, 6, 7)),
    9: ((0, 4, 8), (4, 1, 8), (1, 5, 8), (5, 2, 8), (2, 6, 8), (6, 3, 8), (3, 7, 8), (7, 0, 8)),
}


def linear_triangles(blocks: Sequence[Int]) -> tuple[Int, Int]:
    """Triangles of cells, and the cell that each comes from.

    Parameters
    ----------
    blocks : sequence of (m, k) int64
        Cells with k = 3 or 6 (triangles), 4, 8 or 9 nodes (quadrangles).

    Returns
    -------
    (t, 3) int64, (t,) int64
        Vertices; rows of all blocks, one after the other.

    Raises
    ------
    FieldError
        For another number of nodes.
    """
    triangles, cells, first = [np.zeros((0, 3), np.int64)], [np.zeros(0, np.int64)], 0
    for block in blocks:
        if block.ndim != 2 or block.shape[1] not in _TRIANGLES:
            remedy = "give triangles (3 or 6 nodes) or quadrangles (4, 8 or 9 nodes)"
            raise FieldError(f"cells of shape {block.shape}", remedy=remedy)
        cut = np.array(_TRIANGLES[block.shape[1]])
        triangles.append(block[:, cut].reshape(-1, 3))
        cells.append(np.repeat(first + np.arange(len(block)), len(cut)))
        first += len(block)
    return np.concatenate(triangles), np.concatenate(cells)
