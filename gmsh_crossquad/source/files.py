"""Cross fields in VTU and VTK files.

A file of this library (`field_arrays`) comes back as it was.  In any other one an array is taken, on points or cells (those on
points are preferred to those of the same name on cells):

    stress              vectors (2 or 3 components) are one arm of the cross, symmetric tensors (4, 6 or 9 components) give their
                        principal directions, scalars are angles in radians
    stress:principal    a tensor, even with 3 components: xx, yy, xy
    principal           the only tensor
    a,b                 two arrays of vectors: two arms

Without a name the only vector or tensor is taken; a scalar has to be named, since few are angles.
"""

from __future__ import annotations

import io
import os
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np

from ..errors import FieldError, InputError
from ..field_arrays import CELL_ARRAYS, POINT_ARRAYS, field_from_arrays
from ..formats import check_input
from ..records import Float
from .known import Known
from .samples import Samples
from .values import Kind

__all__ = ["read_field"]

PRINCIPAL = "principal"
CELLS = ("triangle", "triangle6", "quad", "quad8", "quad9")
KINDS: dict[int, Kind] = {1: "angle", 2: "direction", 3: "direction", 4: "tensor", 6: "tensor", 9: "tensor"}


class _Array(NamedTuple):
    """Values (n, components) on points or cells."""

    values: Float
    where: Literal["points", "cells"]

    @property
    def kind(self) -> Kind:
        return KINDS[self.values.shape[1]]


def read_field(path: str | os.PathLike[str], array: str | None = None) -> Samples | Known:
    """The cross field in a file.

    Parameters
    ----------
    path : path
        A `.vtu` or `.vtk` file with a surface mesh.
    array : str, optional
        As in the module's table.  Needed where there are several arrays, unless the file was written by this library.

    Raises
    ------
    InputError
        If there is no such file or array.
    FieldError
        If the file cannot be read or has no field that can be used.
    """
    name = os.fspath(path)
    if Path(name).is_file() and Path(name).stat().st_size == 0:
        raise FieldError(f"the file {name!r} is empty", remedy="give a field file")
    check_input(path)
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
    usable: dict[str, _Array] = {}
    for key, parts in cell_data.items():
        usable[key] = _Array(_flat(np.concatenate(parts)), "cells")
    for key, values in mesh.point_data.items():
        usable[key] = _Array(_flat(values), "points")
    usable = {key: found for key, found in usable.items() if found.values.shape[1] in KINDS}
    values, kind, where = _chosen(name, array, usable)
    return Samples(points, [mesh.cells[i].data for i in blocks], values, kind, where)


@contextmanager
def _reading(name: str) -> Iterator[None]:
    """Whatever the reader raises or prints (it ends the program for some formats) as one line."""
    said = io.StringIO()
    try:
        with redirect_stdout(said), redirect_stderr(said):
            yield
    except (Exception, SystemExit) as error:
        text = said.getvalue() if isinstance(error, SystemExit) else str(error)
        reason = " ".join(text.split())[:200] or type(error).__name__
        raise FieldError(f"{name!r} cannot be read ({reason})", remedy="give a .vtu or .vtk file") from error


def _flat(values: Any) -> Float:
    """(n, components)"""
    v = np.asarray(values)
    return v.reshape(len(v), -1) if v.size else np.zeros((len(v), 0))


def _chosen(name: str, array: str | None, usable: dict[str, _Array]) -> tuple[Float, Kind, Literal["points", "cells"]]:
    """The values that are meant, their kind and place."""
    listed = ", ".join(repr(key) for key in usable) or "none"
    if array is None:
        array = _only(name, "vectors or tensors", [k for k, a in usable.items() if a.kind != "angle"], listed)
    if array in usable:
        return usable[array].values, usable[array].kind, usable[array].where
    if array == PRINCIPAL:
        array = _only(name, "tensors", [k for k, a in usable.items() if a.kind == "tensor"], listed) + ":" + PRINCIPAL
    base, _, word = array.rpartition(":")
    if word == PRINCIPAL and base in usable:
        found = usable[base]
        if found.kind != "tensor" and found.values.shape[1] != 3:
            raise InputError(f"the array {base!r} of {name!r} has no tensors", remedy=f"its arrays are: {listed}")
        return found.values, "tensor", found.where
    two = [usable[key.strip()] for key in array.split(",") if key.strip() in usable]
    if len(two) == array.count(",") + 1 == 2:
        if {a.kind for a in two} != {"direction"} or two[0].where != two[1].where:
            raise InputError(
                f"the arrays {array!r} of {name!r} are no vectors on the same places", remedy=f"its arrays are: {listed}"
            )
        both = [np.pad(a.values, ((0, 0), (0, 3 - a.values.shape[1]))) for a in two]
        return np.stack(both, axis=1), "directions", two[0].where
    raise InputError(f"{name!r} has no array {array!r}", remedy=f"its arrays are: {listed}")


def _only(name: str, what: str, found: list[str], listed: str) -> str:
    if len(found) != 1:
        raise InputError(f"{name!r} has {len(found) or 'no'} arrays of {what}", remedy=f"name one of its arrays: {listed}")
    return found[0]
