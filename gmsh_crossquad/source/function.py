"""A cross field from a Python function of the place."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import CrossQuadError, FieldError, InputError
from ..records import CrossField, Float
from .values import checked_values

if TYPE_CHECKING:
    from ..field.edge_frames import EdgeFrames

__all__ = ["Function", "function_values", "load_function"]


@dataclass(frozen=True)
class Function:
    """The field of a function that is called once per face, with all places.

    Parameters
    ----------
    function : callable
        ``function(points)`` with points (n, 3) in the user's coordinates gives (n, 3) or (n, 2) directions, not necessarily of
        unit length or tangent to the face, or (n,) angles in radians (from the x axis; on a plane other than xy from the
        projected x axis, about the normal whose last coordinate is positive).

    Directions are projected on the tangent plane of the face.  On a curved face angles are measured from its frame (see `frame`),
    the smoothest directions without zeros, about its normal.  A single place without direction (zero, normal to the face) is
    filled from its neighbours.
    """

    function: Callable[[Float], Any]

    def points(self) -> Float:
        """None: (0, 3)."""
        return np.zeros((0, 3))

    def on(self, frames: EdgeFrames) -> CrossField:
        """The field at the edge midpoints of a face.

        Raises
        ------
        FieldError
            If the function fails or gives values of the wrong shape or that are not finite; if the field is undefined or jumps
            along a curve, or if the background is too coarse for it.
        """
        from ..field.smooth import from_angles
        from .checks import check_turns, fill_gaps
        from .frame import frame_angles
        from .plane import angle_arms
        from .power import unit_power

        values = function_values(self.function, frames)
        angles = values.ndim == 1
        if angles and frames.curved:
            return check_turns(frames, from_angles(frames.surface, frame_angles(frames) + values))
        arms = angle_arms(frames, values)[:, None] if angles else values
        power, defined = unit_power(arms, frames.x, frames.y, float(np.abs(arms).max()))
        theta = fill_gaps(frames, 0.25 * np.angle(power), defined)
        return check_turns(frames, from_angles(frames.surface, theta))


def function_values(function: Callable[[Float], Any], frames: EdgeFrames) -> Float:
    """What a function gives at the edge midpoints of a face: angles (e,), or directions (e, 1, 3).

    Raises
    ------
    FieldError
        If the function fails or gives values of the wrong shape or that are not finite.
    """
    places = frames.places.copy()
    try:
        found = function(places)
    except CrossQuadError:
        raise
    except Exception as error:
        raise _failed("the function of the field", error, entity=(2, frames.face)) from error
    try:
        angles = np.ndim(found) == 1 or np.shape(found) == (len(places), 1)
    except ValueError:  # rows of different length
        angles = False
    values = checked_values(found, "angle" if angles else "direction", len(places))
    bad = np.flatnonzero(~np.isfinite(values.reshape(len(values), -1)).all(axis=1))
    if len(bad):
        raise FieldError(
            f"the function of the field gives {len(bad)} values that are no finite numbers, first",
            entity=(2, frames.face),
            location=frames.places[bad[0]].tolist(),
            remedy="give a direction everywhere",
        )
    return values


def load_function(name: str) -> Any:
    """The object ``module:function`` (a dotted path in both parts); the module is also looked for in the current folder.

    Raises
    ------
    InputError
        If there is no such module or function, or the module cannot be imported.
    """
    module, _, path = name.partition(":")
    folder = str(Path.cwd())
    sys.path.insert(0, folder)
    try:
        importlib.invalidate_caches()
        found: Any = importlib.import_module(module)
    except ModuleNotFoundError as error:
        if error.name is not None and (module == error.name or module.startswith(error.name + ".")):
            raise InputError(f"there is no module {module!r}", remedy=f"the field {name!r} names a Python function") from None
        raise InputError(f"module {module!r} cannot be imported: {_line(error)}", remedy="repair the module") from error
    except Exception as error:
        raise InputError(f"module {module!r} cannot be imported: {_line(error)}", remedy="repair the module") from error
    finally:
        sys.path.remove(folder)
    for part in path.split("."):
        if not hasattr(found, part):
            raise InputError(f"module {module!r} has no function {path!r}", remedy="check the name in " + repr(name))
        found = getattr(found, part)
    if not callable(found):
        raise InputError(f"{name!r} is no function", remedy="name a function f(points) -> directions")
    return found


def _failed(what: str, error: Exception, **where: Any) -> FieldError:
    return FieldError(f"{what} raised {_line(error)}", remedy="it gets points (n, 3) and must give directions (n, 3)", **where)


def _line(error: Exception) -> str:
    """Kind and message of an error, on one line."""
    return f"{type(error).__name__}: {' '.join(str(error).split())}".removesuffix(": ")
