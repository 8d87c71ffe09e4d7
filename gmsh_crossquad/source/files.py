"""Cross fields in VTU and VTK files.

A file of this library (`field_arrays`) comes back as it was.  In any other one an array is taken: vectors (3 components) are one
arm of the cross, symmetric tensors (6 or 9 components; 3 on plane meshes cannot be told from vectors) give their principal
directions, scalars are angles.  Arrays on points are preferred to those of the same name on cells.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from ..errors import FieldError, InputError
from ..field_arrays import CELL_ARRAYS, POINT_ARRAYS, field_from_arrays
from ..formats import check_input
from .known import Known
from .samples import Samples
from .values import Kind

__all__ = ["read_field"]

PRINCIPAL = "principal"
CELLS = ("triangle", "triangle6", "quad", "quad8", "quad9")
KINDS: dict[int, Kind] = {1: "angle", 3: "direction", 6: "tensor", 9: "tensor"}


def read_field(path: str | os.PathLike[str], array: str | None = None) -> Samples | Known:
    """The cross field in a file.

    Parameters
    ----------
    path : path
        A `.vtu` or `.vtk` file with a surface mesh.
    array : str, optional
        Name of an array, or "principal": the only tensor.  Needed where there are several arrays, unless the file was written by
        this library.

    Raises
    ------
    InputError
        If there is no such file or array.
    FieldError
        If the file cannot be read or has no field that can be used.
    """
    check_input(path)
    name = os.fspath(path)
    import meshio

    with _reading(name):
        mesh = meshio.read(path)
    blocks = [i for i, block in enumerate(mesh.cells) if block.type in CELLS]
    if not blocks:
        raise FieldError(f"{name!r} has no triangles or quadrangles", remedy="give a field on a surface mesh")
    points = np.asarray(mesh.points, float)
    points = points if points.shape[1] == 3 else np.c_[points, np.zeros(len(points))]
    cell_data = {key: [np.asarray(data[i]) for i in blocks] for key, data in mesh.cell_data.items()}
    if array is None and {*POINT_ARRAYS} <= set(mesh.point_data) and {*CELL_ARRAYS} <= set(cell_data):
        data: dict[str, Any] = {key: np.asarray(mesh.point_data[key]) for key in POINT_ARRAYS}
        data |= {key: np.concatenate(cell_data[key]) for key in CELL_ARRAYS}
        return Known(field_from_arrays(points, np.concatenate([mesh.cells[i].data for i in blocks]), data))
    usable: dict[str, tuple[Any, str]] = {}
    for key, parts in cell_data.items():
        usable[key] = np.concatenate(parts), "cells"
    for key, values in mesh.point_data.items():
        usable[key] = np.asarray(values), "points"
    usable = {key: found for key, found in usable.items() if _components(found[0]) in KINDS}
    values, where = usable[_chosen(name, array, usable)]
    flat = values.reshape(len(values), -1) if values.ndim > 1 else values
    kind = KINDS[_components(values)]
    return Samples(points, [mesh.cells[i].data for i in blocks], flat, kind, "points" if where == "points" else "cells")


@contextmanager
def _reading(name: str) -> Iterator[None]:
    """Whatever the reader raises (it ends the program for some formats) as one line."""
    try:
        yield
    except (Exception, SystemExit) as error:
        reason = " ".join(str(error).split())[:200] or type(error).__name__
        raise FieldError(f"{name!r} cannot be read ({reason})", remedy="give a .vtu or .vtk file") from error


def _components(values: Any) -> int:
    return int(np.prod(np.shape(values)[1:], dtype=np.int64))


def _chosen(name: str, array: str | None, usable: dict[str, tuple[Any, str]]) -> str:
    """The array that is meant."""
    listed = ", ".join(repr(key) for key in usable) or "none"
    if array in usable:
        return str(array)
    if array == PRINCIPAL:
        tensors = [key for key, (values, _) in usable.items() if KINDS[_components(values)] == "tensor"]
        if len(tensors) == 1:
            return tensors[0]
        what = "no tensor" if not tensors else f"{len(tensors)} tensors"
        raise InputError(f"{name!r} has {what} for {PRINCIPAL!r}", remedy=f"name an array; its arrays are: {listed}")
    if array is not None:
        raise InputError(f"{name!r} has no array {array!r}", remedy=f"its arrays are: {listed}")
    vectors = [key for key, (values, _) in usable.items() if KINDS[_components(values)] != "angle"]
    several = vectors or list(usable)
    if len(several) != 1:
        raise InputError(f"{name!r} has {len(several)} arrays that could be the field", remedy=f"name one of: {listed}")
    return several[0]
