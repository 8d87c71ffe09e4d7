"""The options of a run from keyword arguments, checked before anything is done."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import Any

from .errors import InputError
from .options import MeshOptions

__all__ = ["check_options", "parse_extrusion"]

LARGEST_ANGLE = 60.0
_NAMES = tuple(f.name for f in dataclasses.fields(MeshOptions))


def check_options(**options: Any) -> MeshOptions:
    """Options from keyword arguments, each checked.

    Raises
    ------
    InputError
        For an unknown name, and for a value that is no number, not finite or out of range.
    """
    for name in options:
        if name not in _NAMES:
            raise InputError(f"unknown option {name!r}", remedy="the options are " + ", ".join(_NAMES))
    if options.get("size") is None:
        options.pop("size", None)
    for name in ("size", "block_size", "background"):
        if name in options:
            options[name] = _positive(name, options[name])
    if options.get("feature_angle") is not None:
        options["feature_angle"] = _angle("feature_angle", options["feature_angle"])
    if "max_quads" in options:
        count = _positive("max_quads", options["max_quads"])
        if count != int(count):
            raise InputError(f"max_quads is {count:g}", remedy="give a whole number")
        options["max_quads"] = int(count)
    if options.get("order") not in (None, 1, 2, 3) or isinstance(options.get("order"), bool):
        raise InputError(f"order is {options['order']!r}", remedy="use order 1, 2 or 3")
    for name in ("fix_indices", "relax", "incomplete"):
        if name in options and options[name] not in (True, False, None, 0, 1):
            raise InputError(f"{name} is {options[name]!r}", remedy="give True or False")
    if isinstance(options.get("field"), str):
        from .source.parse import parse_text

        parse_text(options["field"])
    if options.get("boundary_index") is None:
        options.pop("boundary_index", None)
    elif not isinstance(options["boundary_index"], Mapping):
        raise InputError(f"boundary_index is {options['boundary_index']!r}", remedy="give a dict of point tags to indices")
    return MeshOptions(**options)


def parse_extrusion(text: str) -> tuple[float | list[float], int]:
    """Length or vector, and number of layers, from ``LENGTH:LAYERS`` or ``DX,DY,DZ:LAYERS``.

    Raises
    ------
    InputError
    """
    remedy = "write LENGTH:LAYERS or DX,DY,DZ:LAYERS, for example 2:8"
    along, _, layers = text.rpartition(":")
    try:
        values, count = [float(x) for x in along.split(",")], int(layers)
    except ValueError:
        raise InputError(f"the extrusion is {text!r}", remedy=remedy) from None
    if len(values) not in (1, 3) or count < 1 or not all(map(math.isfinite, values)) or not any(values):
        raise InputError(f"the extrusion is {text!r}", remedy=remedy)
    return values[0] if len(values) == 1 else values, count


def _angle(name: str, value: Any) -> float | None:
    """An angle in degrees; None for 0."""
    number = 0.0 if value == 0 else _positive(name, value)
    if number > LARGEST_ANGLE:
        raise InputError(f"{name} is {number:g}", remedy=f"give degrees, at most {LARGEST_ANGLE:g}")
    return number or None


def _positive(name: str, value: Any) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"{name} is {value!r}", remedy="give a positive number") from None
    if not (math.isfinite(number) and number > 0.0):
        raise InputError(f"{name} is {number:g}", remedy="give a positive number")
    return number
