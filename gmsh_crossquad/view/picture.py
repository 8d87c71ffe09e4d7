"""A picture of a result: cross field with singularities, block layout, mesh.

VTK draws in a process of its own, since it crashes where the machine has no off-screen rendering; matplotlib steps in there.
"""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import InputError
from ..formats import PICTURE_FORMATS, check_output, check_suffix, temporary_beside
from .scene import Scene, build_field_scene, build_scene

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ..face_field import FaceField
    from .subject import Subject

__all__ = ["draw_scene", "field_picture", "picture"]

_PATIENCE = 120.0
_SIGNATURE = b"\x89PNG\r\n\x1a\n"


def picture(result: Subject, path: str | os.PathLike[str]) -> None:
    """Draw a result into a PNG file.

    Parameters
    ----------
    result : Subject
    path : path
        A `.png` file; it appears only when it is complete.

    Raises
    ------
    InputError
        For another extension, a place that cannot be written to, or a machine with neither a working VTK nor matplotlib.
    """
    _write(build_scene(result), path)


def field_picture(faces: Sequence[FaceField], path: str | os.PathLike[str]) -> None:
    """Draw a given and the aligned cross field into a PNG file; as `picture`."""
    _write(build_field_scene(faces), path)


def _write(scene: Scene, path: str | os.PathLike[str]) -> None:
    check_suffix(path, PICTURE_FORMATS, "picture")
    place = check_output(path)
    unfinished = temporary_beside(place)
    try:
        draw_scene(scene, unfinished)
        os.replace(unfinished, place)
    finally:
        unfinished.unlink(missing_ok=True)


def draw_scene(scene: Scene, path: Path) -> None:
    """Draw a scene with VTK, else with matplotlib.

    Raises
    ------
    InputError
        Where neither can.
    """
    reason = _draw_with_vtk(scene, path)
    if not reason:
        return
    try:
        from .mpl_draw import draw

        draw(scene, os.fspath(path))
    except ImportError:
        raise InputError(f"no picture can be drawn, VTK {reason}", remedy="install matplotlib, or EGL for VTK") from None


def _draw_with_vtk(scene: Scene, path: Path) -> str:
    """Empty where the picture is there, else what went wrong."""
    command = [sys.executable, "-m", f"{__package__}.vtk_draw", os.fspath(path)]
    try:
        done = subprocess.run(command, input=pickle.dumps(scene), capture_output=True, timeout=_PATIENCE, check=False)
    except subprocess.TimeoutExpired:
        return "does not end"
    if done.returncode < 0:
        return f"crashes with signal {-done.returncode}"
    if done.returncode > 0:
        return "fails (" + (done.stderr.decode(errors="replace").strip().splitlines() or ["no reason given"])[-1] + ")"
    try:
        with open(path, "rb") as file:
            return "" if file.read(8) == _SIGNATURE else "writes no picture"
    except OSError:
        return "writes no picture"
