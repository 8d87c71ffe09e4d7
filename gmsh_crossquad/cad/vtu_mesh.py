"""The mesh of the current model as a .vtu file, through meshio; elements of order 2 and 3 as such.

VTK has cells of their own for order 2, with Gmsh's order of nodes, and Lagrange cells for order 3.  The edges of these run
along the coordinates u and v, not around the quad, and the nodes inside follow row by row.  Hexahedra have the edges of the start
and of the end, each around, and those between; then the faces to -x, x, -y, y, -z, z and the middle.
"""

from __future__ import annotations

import os
from typing import NamedTuple

import gmsh
import numpy as np

from ..records import Int

__all__ = ["write_vtu_mesh"]


class _Cell(NamedTuple):
    name: str
    order: tuple[int, ...] | slice = slice(None)  # places in Gmsh's element of the nodes of VTK's


CELLS = {
    1: _Cell("line"),
    8: _Cell("line3"),
    26: _Cell("VTK_LAGRANGE_CURVE"),
    3: _Cell("quad"),
    16: _Cell("quad8"),
    10: _Cell("quad9"),
    5: _Cell("hexahedron"),
    17: _Cell("hexahedron20", (*range(8), 8, 11, 13, 9, 16, 18, 19, 17, 10, 12, 14, 15)),
    12: _Cell("hexahedron27", (*range(8), 8, 11, 13, 9, 16, 18, 19, 17, 10, 12, 14, 15, 22, 23, 21, 24, 20, 25, 26)),
    36: _Cell("VTK_LAGRANGE_QUADRILATERAL", (0, 1, 2, 3, 4, 5, 6, 7, 9, 8, 11, 10, 12, 13, 15, 14)),
}


def write_vtu_mesh(path: str | os.PathLike[str], save_all: bool) -> None:
    """Write lines, quads and hexahedra with physical numbers and entity tags as cell data.

    Parameters
    ----------
    path : path
    save_all : bool
        Also the elements of no physical group.
    """
    import meshio

    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    row = np.zeros(int(tags.max()) + 1, np.int64)
    row[tags.astype(np.int64)] = np.arange(len(tags))
    found: dict[int, list[tuple[Int, Int, Int]]] = {kind: [] for kind in CELLS}
    for dim, tag in [e for d in (1, 2, 3) for e in gmsh.model.getEntities(d)]:
        groups = gmsh.model.getPhysicalGroupsForEntity(dim, tag)
        if not len(groups) and not save_all:
            continue
        for kind, elements, nodes in zip(*gmsh.model.mesh.getElements(dim, tag), strict=True):
            if kind in CELLS:
                cells = row[nodes.astype(np.int64)].reshape(len(elements), -1)[:, CELLS[kind].order]
                number = np.full(len(cells), groups[0] if len(groups) else 0, np.int64)
                found[kind].append((cells, number, np.full(len(cells), tag, np.int64)))
    blocks = {k: [np.concatenate(column) for column in zip(*parts, strict=True)] for k, parts in found.items() if parts}
    used = np.unique(np.concatenate([cells.ravel() for cells, _, _ in blocks.values()]))
    new = np.full(len(tags), -1, np.int64)
    new[used] = np.arange(len(used))
    meshio.Mesh(
        coordinates.reshape(-1, 3)[used],
        [(CELLS[k].name, new[cells]) for k, (cells, _, _) in blocks.items()],
        cell_data={"physical": [b[1] for b in blocks.values()], "entity": [b[2] for b in blocks.values()]},
    ).write(path, file_format="vtu")
