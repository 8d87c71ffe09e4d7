"""Mesh file formats by extension, and what must hold of the paths before any work is done.

Gmsh writes all of them but `.vtu`, which goes through meshio.  Formats that hold geometry and no mesh, or no quads, are
refused, so that nobody waits for a file without a mesh in it; and so are those that lose nodes or elements of a higher order
(what Gmsh 4.15.2 writes was read again).
"""

from __future__ import annotations

import os
from pathlib import Path

from .errors import GeometryError, InputError

__all__ = [
    "MESH_FORMATS",
    "PICTURE_FORMATS",
    "check_input",
    "check_order",
    "check_output",
    "check_suffix",
    "temporary_beside",
]

MESH_FORMATS = (
    ".msh",
    ".msh2",
    ".msh22",
    ".msh3",
    ".msh4",
    ".msh40",
    ".msh41",
    ".bdf",
    ".cgns",
    ".dat",
    ".inp",
    ".key",
    ".m",
    ".mail",
    ".med",
    ".mesh",
    ".nas",
    ".obj",
    ".off",
    ".su2",
    ".unv",
    ".vtk",
    ".vtu",
    ".wrl",
)
"""Extensions that `gmsh-crossquad mesh -o` accepts."""

PICTURE_FORMATS = (".png",)

_MSH = tuple(suffix for suffix in MESH_FORMATS if suffix.startswith(".msh"))
_SECOND = (*_MSH, ".bdf", ".cgns", ".dat", ".inp", ".m", ".med", ".nas", ".vtk", ".vtu")
_HIGH_ORDER = {(2, False): _SECOND, (2, True): tuple(sorted((*_SECOND, ".key", ".unv"))), (3, False): (*_MSH, ".cgns", ".vtu")}
"""Formats that carry elements by order and whether the quads have no node inside."""


def check_input(path: str | os.PathLike[str]) -> None:
    """Check that there is a file to read.

    Raises
    ------
    InputError
        If there is no such file, or it cannot be read.
    GeometryError
        If it is empty.
    """
    if not os.path.exists(path):
        raise InputError(f"no such file {os.fspath(path)!r}")
    if not os.path.isfile(path):
        raise InputError(f"{os.fspath(path)!r} is not a file")
    if not os.access(path, os.R_OK):
        raise InputError(f"no permission to read {os.fspath(path)!r}")
    if os.path.getsize(path) == 0:
        raise GeometryError(f"the file {os.fspath(path)!r} is empty", remedy="give a model that Gmsh can read")


def check_suffix(path: str | os.PathLike[str], allowed: tuple[str, ...], what: str) -> None:
    """Check the extension of a file name.

    Raises
    ------
    InputError
        Where it is not among `allowed`.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in allowed:
        said = f"unknown {what} format {suffix!r}" if suffix else f"the {what} {os.fspath(path)!r} has no extension"
        raise InputError(said, remedy="use one of " + " ".join(allowed))


def check_order(path: str | os.PathLike[str], order: int, incomplete: bool) -> None:
    """Check that a format carries elements of an order.

    Parameters
    ----------
    path : path
    order : {1, 2, 3}
    incomplete : bool
        Quads of order 2 have 8 nodes.

    Raises
    ------
    InputError
    """
    suffix = Path(path).suffix.lower()
    if order == 1 or suffix in _HIGH_ORDER[order, incomplete and order == 2]:
        return
    if order == 2 and not incomplete and suffix in _HIGH_ORDER[2, True]:
        raise InputError(f"{suffix} files hold no quads of 9 nodes", remedy="use --incomplete (8 nodes) or another format")
    remedy = "use --order 1 or one of " + " ".join(_HIGH_ORDER[order, incomplete and order == 2])
    raise InputError(f"{suffix} files hold no quads of order {order}", remedy=remedy)


def check_output(path: str | os.PathLike[str]) -> Path:
    """Check that a file can be written where it is wanted.

    Returns
    -------
    Path
        The real place of the file (symbolic links resolved: the link stays, its target is replaced).

    Raises
    ------
    InputError
        For a missing folder, one that cannot be written to, a folder or a device in the file's place, a read-only file.
    """
    place = Path(os.path.realpath(path))
    folder = place.parent
    if not folder.is_dir():
        raise InputError(f"the folder {str(folder)!r} of the output does not exist", remedy="make it first")
    if place.exists() and not place.is_file():
        raise InputError(f"the output {os.fspath(path)!r} is not a regular file", remedy="choose another name")
    if place.exists() and not os.access(place, os.W_OK):
        raise InputError(f"the output {os.fspath(path)!r} is read-only", remedy="choose another name or change its permissions")
    probe = temporary_beside(place)
    try:
        with open(probe, "xb"):
            pass
        probe.unlink()
    except OSError as error:
        raise InputError(
            f"cannot write in the folder {str(folder)!r} ({error.strerror})", remedy="choose another folder for the output"
        ) from None
    return place


def temporary_beside(place: Path) -> Path:
    """A name for the unfinished file, in the same folder and with the same extension (formats are told by it)."""
    return place.with_name(f".{place.stem[:100]}.{os.getpid()}{place.suffix.lower()}")
