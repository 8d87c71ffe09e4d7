"""Mesh, layout, field and singularities in one file for ParaView.

The cell array `part` tells them apart (Threshold on it): 0 quads of the mesh, 1 edges of the layout, 2 background triangles
with the field, 3 singularities.  Further cell arrays, NaN or -1 where they have no meaning:

    face               CAD face of a quad, triangle or singularity
    block              block of a quad
    scaled_jacobian    of a quad
    layout_edge        number of the layout edge
    curve              CAD curve of a layout edge, -1 inside a face
    cross_1, cross_2   the two axes of the cross of a triangle, as vectors
    index              quarter turns of a singularity
"""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import numpy as np

from ..formats import check_output, check_suffix, temporary_beside
from ..records import Float, Int

if TYPE_CHECKING:
    from .subject import Subject

__all__ = ["write_vtu"]

_WHOLE = {"part": 0, "face": -1, "block": -1, "layout_edge": -1, "curve": -1, "index": 0}
_REAL = {"scaled_jacobian": (), "cross_1": (3,), "cross_2": (3,)}


def write_vtu(result: Subject, path: str | os.PathLike[str]) -> None:
    """Write a result for ParaView.

    Parameters
    ----------
    result : Subject
    path : path
        A `.vtu` file; it appears only when it is complete.

    Raises
    ------
    InputError
        For another extension, or a place that cannot be written to.
    """
    check_suffix(path, (".vtu",), "ParaView")
    place = check_output(path)
    import meshio

    mesh = result.mesh
    points: list[Float] = [mesh.points]
    cells: list[tuple[str, Int]] = []
    rows: list[dict[str, object]] = []
    tags = np.array(result.face_tags)

    def add(kind: str, connectivity: Int, **values: object) -> None:
        if len(connectivity):
            cells.append((kind, connectivity))
            rows.append(values)

    add("quad", mesh.quads, part=0, face=tags[mesh.quad_face], block=mesh.quad_block, scaled_jacobian=result.quad_quality)
    edges = result.layout.edges
    number = np.repeat(np.arange(len(edges)), [e.divisions for e in edges])
    curve = np.array([-1 if e.curve is None else e.curve for e in edges], np.int64)
    segments = np.concatenate([np.stack([e.nodes[:-1], e.nodes[1:]], axis=1) for e in edges])
    add("line", segments, part=1, layout_edge=number, curve=curve[number])
    first = len(mesh.points)
    for f in result.field:
        arm = f.triangle_arms
        add("triangle", f.triangles + first, part=2, face=f.face, cross_1=arm, cross_2=np.cross(f.triangle_normals, arm))
        points.append(f.points)
        first += len(f.points)
    spots = result.singularities
    if spots:
        points.append(np.array([s.point for s in spots]))
        face, index = np.array([s.face for s in spots]), np.array([s.index for s in spots])
        add("vertex", first + np.arange(len(spots))[:, None], part=3, face=face, index=index)
    data = {
        **{
            n: [np.broadcast_to(np.asarray(r.get(n, d), np.int64), len(c)).copy() for (_, c), r in zip(cells, rows)]
            for n, d in _WHOLE.items()
        },
        **{
            n: [np.broadcast_to(np.asarray(r.get(n, np.nan), float), (len(c), *s)).copy() for (_, c), r in zip(cells, rows)]
            for n, s in _REAL.items()
        },
    }
    unfinished = temporary_beside(place)
    try:
        meshio.Mesh(np.concatenate(points), cells, cell_data=data).write(unfinished, file_format="vtu")
        os.replace(unfinished, place)
    finally:
        unfinished.unlink(missing_ok=True)
