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
    "VOLUME_FORMATS",
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

VOLUME_FORMATS = tuple(suffix for suffix in MESH_FORMATS if suffix not in (".obj", ".off", ".wrl"))
"""Those that hold hexahedra."""

_MSH = tuple(suffix for suffix in MESH_FORMATS if suffix.startswith(".msh"))
_BOTH = (*_MSH, ".cgns", ".dat", ".inp", ".m", ".med", ".vtk", ".vtu")
_EIGHT = (*_BOTH, ".bdf", ".key", ".nas", ".unv")
# by order, whether the elements have no node inside, and whether there are hexahedra
_HIGH_ORDER = {
    (2, False, False): (*_BOTH, ".bdf", ".nas"),
    (2, True, False): _EIGHT,
    (3, False, False): (*_MSH, ".cgns", ".vtu"),
    (2, False, True): _BOTH,
    (2, True, True): _EIGHT,
    (3, False, True): _MSH,
}


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


def check_order(path: str | os.PathLike[str], order: int, incomplete: bool, *, volumes: bool = False) -> None:
    """Check that a format carries elements of an order.

    Parameters
    ----------
    path : path
    order : {1, 2, 3}
    incomplete : bool
        Elements of order 2 have no node inside.
    volumes : bool
        There are hexahedra.

    Raises
    ------
    InputError
    """
    suffix = Path(path).suffix.lower()
    if order == 1:
        return
    fit = _HIGH_ORDER[order, incomplete and order == 2, volumes]
    if suffix in fit:
        return
    what = f"{suffix} files hold no {'hexahedra' if volumes else 'quads'} of order {order}"
    if order == 2 and not incomplete and suffix in _HIGH_ORDER[2, True, volumes]:
        raise InputError(f"{what} with a node inside", remedy="use --incomplete or another format")
    raise InputError(what, remedy="use --order 1 or one of " + " ".join(fit))


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
