"""The options of a run from keyword arguments, checked before anything is done."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import Any

from .errors import InputError
from .options import MeshOptions

__all__ = ["check_options"]

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


def _positive(name: str, value: Any) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"{name} is {value!r}", remedy="give a positive number") from None
    if not (math.isfinite(number) and number > 0.0):
        raise InputError(f"{name} is {number:g}", remedy="give a positive number")
    return number
