"""A cross field in a VTU file; see `field_arrays` for what is in it."""

from __future__ import annotations

import os
from collections.abc import Sequence

from ..face_field import FaceField
from ..field_arrays import CELL_ARRAYS, POINT_ARRAYS, quadratic
from ..formats import check_output, temporary_beside

__all__ = ["write_field_vtu"]


def write_field_vtu(faces: Sequence[FaceField], path: str | os.PathLike[str]) -> None:
    """Write the field of some faces; the file appears only when it is complete."""
    place = check_output(path)
    import meshio

    points, cells, data = quadratic(faces)
    point_data = {name: data[name] for name in POINT_ARRAYS}
    cell_data = {name: [data[name]] for name in CELL_ARRAYS}
    unfinished = temporary_beside(place)
    try:
        meshio.Mesh(points, [("triangle6", cells)], point_data=point_data, cell_data=cell_data).write(
            unfinished, file_format="vtu"
        )
        os.replace(unfinished, place)
    finally:
        unfinished.unlink(missing_ok=True)
