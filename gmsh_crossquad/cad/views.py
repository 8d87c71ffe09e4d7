"""Gmsh mesh files with views as cross fields, and everything about views in one place.

A file that is no mesh is run by Gmsh as a script, so only files that begin like a mesh are opened.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import gmsh
import numpy as np

from ..errors import FieldError, InputError
from ..field_arrays import CELL_ARRAYS, POINT_ARRAYS, field_from_arrays
from ..formats import check_input
from ..records import Float, Int
from ..source.known import Known
from ..source.samples import Samples
from . import session
from .bounds import kept_bounds
from .field_views import add_field_views, write_field_views
from .view_data import shaped, surface_mesh, view_samples

__all__ = ["add_field_views", "read_view_file", "view_samples", "write_field_views"]


def read_view_file(path: str | os.PathLike[str], name: str | None = None) -> Samples | Known:
    """The cross field in a Gmsh mesh file with views; the current session stays as it is.

    Parameters
    ----------
    path : path
    name : str, optional
        Of the view; needed where there are several, unless the file was written by this package.

    Raises
    ------
    InputError
        If there is no such file or view.
    FieldError
        If the file holds no field that can be used.
    """
    with session.guest(), _merged(path) as views:
        if name is None and {*POINT_ARRAYS, *CELL_ARRAYS} <= set(views):
            return Known(field_from_arrays(*_arrays(views)))
        chosen = [tag for key, tags in views.items() for tag in tags if name in (None, key)]
        have = ", ".join(repr(key) for key in views) or "none"
        if name is not None and not chosen:
            raise InputError(f"{os.fspath(path)!r} has no view {name!r}", remedy=f"its views are: {have}")
        if len(chosen) != 1:
            what = f"views named {name!r}" if name else "views"
            raise FieldError(f"{os.fspath(path)!r} has {len(chosen)} {what}", remedy=f"choose one of its views: {have}")
        return view_samples(chosen[0])


@contextmanager
def _merged(path: str | os.PathLike[str]) -> Iterator[dict[str, list[int]]]:
    """The views of a file by name, its mesh in a scratch model; all is removed at the end."""
    check_input(path)
    with open(path, "rb") as file:
        if not file.read(64).lstrip().startswith(b"$"):
            raise FieldError(f"{os.fspath(path)!r} is no Gmsh mesh file", remedy="give a .msh file with views")
    before = set(gmsh.view.getTags().tolist())
    parameters = _parameters()
    with kept_bounds(), session.options(**{"General.AbortOnError": 2}), session.scratch_model():
        try:
            try:
                gmsh.merge(os.fspath(path))
            except Exception as error:
                if type(error) is not Exception:
                    raise
                reason = " ".join((str(error) or gmsh.logger.getLastError()).split())
                raise FieldError(f"Gmsh cannot read {os.fspath(path)!r} ({reason})", remedy="write it again") from error
            views: dict[str, list[int]] = {}
            for tag in gmsh.view.getTags().tolist():
                if tag not in before:
                    views.setdefault(gmsh.view.option.getString(tag, "Name"), []).append(tag)
            yield views
        finally:
            for tag in set(gmsh.view.getTags().tolist()) - before:
                gmsh.view.remove(tag)
            _put_back(parameters)


def _parameters() -> dict[str, tuple[list[float], list[str]]]:
    """Values of all ONELAB parameters: Gmsh itself keeps there what it has opened."""
    return {n: (list(gmsh.onelab.getNumber(n)), list(gmsh.onelab.getString(n))) for n in gmsh.onelab.getNames()}


def _put_back(parameters: dict[str, tuple[list[float], list[str]]]) -> None:
    for name, values in _parameters().items():
        if name not in parameters:
            gmsh.onelab.clear(name)
        elif values != parameters[name]:
            numbers, texts = parameters[name]
            gmsh.onelab.setNumber(name, numbers) if numbers else gmsh.onelab.setString(name, texts)


def _arrays(views: dict[str, list[int]]) -> tuple[Float, Int, dict[str, Any]]:
    """Nodes, quadratic triangles and all arrays of a file that this package has written."""
    tags, points, blocks = surface_mesh()
    order = np.argsort(tags)
    ((elements, cells),) = [b for b in blocks if b[1].shape[1] == 6] or [(np.zeros(0, np.int64), np.zeros((0, 6), np.int64))]
    turn = np.argsort(elements)
    data: dict[str, Any] = {}
    expected = dict.fromkeys(POINT_ARRAYS, tags[order]) | dict.fromkeys(CELL_ARRAYS, elements[turn])
    for name, wanted in expected.items():
        _, numbers, values, _, parts = gmsh.view.getHomogeneousModelData(views[name][0], 0)
        rows = np.argsort(numbers)
        if not np.array_equal(np.asarray(numbers, np.int64)[rows], wanted):
            raise FieldError(f"the view {name!r} does not fit the mesh of the file", remedy="write it with the field command")
        data[name] = shaped(np.asarray(values, float).reshape(-1, parts)[rows], parts)
    data["face"] = np.rint(data["face"]).astype(np.int64)
    return points[order], np.searchsorted(tags[order], cells[turn]), data
