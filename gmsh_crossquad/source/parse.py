"""From what a user writes to a source of the cross field.

    smooth                              the default; smooth:0.02 with the core size epsilon
    singularities:(-0.4,0):1,(0.4,0):1  points (2 or 3 coordinates) and their indices in quarter turns
    eigenmode:4                         4th eigenfunction; eigenmode:4:neumann, eigenmode:4:isolines
    curvature                           principal directions of curved faces
    heat-frame                          frame of the vector heat method; heat-frame:module:function with angles to it
    stress.vtu:principal                a file (.vtu, .vtk, .msh) and its array (see `files`) or view
    view:2                              a Gmsh view of the session, by tag or by name
    module:function                     a Python function
    1=eigenmode:4; 2=smooth             by surface; a part without number is for all others

`parse_text` checks the syntax and loads nothing; `parse_field` makes the source.
"""

from __future__ import annotations

import operator
import os
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import InputError

if TYPE_CHECKING:
    from .base import FieldSource

__all__ = ["FieldText", "parse_field", "parse_text"]

FORMS = (
    "write smooth, singularities:(x,y):q,..., eigenmode:k, curvature, heat-frame, file.vtu:array, file.msh:view, view:name or "
    "module:function, or 1=...;2=... by surface"
)
FILES = (".vtu", ".vtk", ".msh")
NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
POINT = re.compile(rf"\(({NUMBER}),({NUMBER})(?:,({NUMBER}))?\):([+-]?\d+)(?:,|$)")
FACE = re.compile(r"\s*(\d+)\s*=\s*(.*)", re.DOTALL)
FILE = re.compile(rf"(.*(?:{'|'.join(re.escape(s) for s in FILES)}))(?::(.*))?", re.IGNORECASE | re.DOTALL)
PATH = re.compile(r"[^\W\d]\w*(\.[^\W\d]\w*)*:[^\W\d]\w*(\.[^\W\d]\w*)*")


@dataclass(frozen=True)
class FieldText:
    """A parsed text: the kind of source and its arguments.

    Attributes
    ----------
    kind : {"smooth", "singularities", "eigenmode", "curvature", "heat-frame", "file", "view", "function"}
    arguments : tuple
    """

    kind: str
    arguments: tuple[Any, ...]


def parse_text(text: str) -> dict[int | None, FieldText]:
    """What a text says, by surface tag; None for all others.

    Raises
    ------
    InputError
        For a text that is none of the forms.
    """
    out: dict[int | None, FieldText] = {}
    for part in text.split(";"):
        if not part.strip() and out:
            continue
        face = FACE.fullmatch(part)
        tag = int(face[1]) if face else None
        if tag in out:
            what = "two fields" if tag is None else f"two fields for surface {tag}"
            raise InputError(f"{what} in {text!r}", remedy=FORMS)
        out[tag] = _single(face[2].strip() if face else part.strip())
    return out


def _single(text: str) -> FieldText:
    """One source."""
    word, _, rest = text.partition(":")
    made = MADE.get(word.strip().lower())
    if made:
        return made(rest, text)
    file = FILE.fullmatch(text)
    if file:
        return FieldText("file", (file[1], file[2] or None))
    if PATH.fullmatch(text):
        return FieldText("function", (text,))
    raise InputError(f"the field {text!r} is none", remedy=FORMS)


def _smooth(rest: str, text: str) -> FieldText:
    if not rest:
        return FieldText("smooth", ())
    if not re.fullmatch(NUMBER, rest.strip()) or not float(rest) > 0:
        raise InputError(f"the core size in {text!r} is no positive number", remedy="write smooth or smooth:0.02")
    return FieldText("smooth", (float(rest),))


def _singularities(rest: str, text: str) -> FieldText:
    plain = re.sub(r"\s", "", rest)
    place, points, quarters = 0, [], []
    while place < len(plain):
        found = POINT.match(plain, place)
        if not found:
            raise InputError(
                f"the singularities {text!r} cannot be read from {plain[place : place + 30]!r} on",
                remedy="write (x,y):q,(x,y):q,... with whole numbers q of quarter turns",
            )
        points.append((float(found[1]), float(found[2]), float(found[3]) if found[3] else float("nan")))
        quarters.append(int(found[4]))
        place = found.end()
    return FieldText("singularities", (tuple(points), tuple(quarters)))


def _eigenmode(rest: str, text: str) -> FieldText:
    number, *words = (w.strip().lower() for w in rest.split(":"))
    boundary = [w for w in words if w in ("dirichlet", "neumann")]
    lines = [w for w in words if w in ("gradient", "isolines")]
    if not number.isdecimal() or int(number) < 1 or len(boundary) > 1 or len(lines) > 1 or len(boundary + lines) < len(words):
        remedy = "write eigenmode:4, and :dirichlet or :neumann, :gradient or :isolines after it"
        raise InputError(f"the eigenmode {text!r} is none", remedy=remedy)
    return FieldText("eigenmode", (int(number), *(boundary or ["dirichlet"]), *(lines or ["gradient"])))


def _view(rest: str, text: str) -> FieldText:
    name = rest.strip()
    if not name:
        raise InputError(f"the view {text!r} has no tag", remedy="write view:2, or view:name")
    return FieldText("view", (int(name) if name.isdecimal() else name,))


def _curvature(rest: str, text: str) -> FieldText:
    if rest:
        raise InputError(f"the field {text!r} is none", remedy="write curvature alone")
    return FieldText("curvature", ())


def _heat_frame(rest: str, text: str) -> FieldText:
    if rest and not PATH.fullmatch(rest.strip()):
        raise InputError(f"the field {text!r} is none", remedy="write heat-frame, or heat-frame:module:function")
    return FieldText("heat-frame", (rest.strip() or None,))


MADE = {
    "smooth": _smooth,
    "singularities": _singularities,
    "eigenmode": _eigenmode,
    "curvature": _curvature,
    "heat-frame": _heat_frame,
    "view": _view,
}


def parse_field(
    value: Any, load_view: Callable[[int | str], FieldSource], load_views: Callable[[str, str | None], FieldSource]
) -> FieldSource:
    """The source that a user gave as a text or an object.

    Parameters
    ----------
    value : str, path, callable, FieldSource, or mapping of surface tag (None: all others) to these
    load_view : callable
        Makes a source of the tag or the name of a Gmsh view.
    load_views : callable
        Makes a source of a Gmsh mesh file and the name of one of its views, or None.

    Raises
    ------
    InputError, FieldError
    """
    from .base import FieldSource
    from .per_face import PerFace
    from .smooth import Smooth

    if isinstance(value, os.PathLike):
        value = os.fspath(value)
    if isinstance(value, str):
        parts: dict[int | None, FieldSource] = {t: _made(f, load_view, load_views) for t, f in parse_text(value).items()}
    elif isinstance(value, Mapping):
        parts = {_tag(t): parse_field(v, load_view, load_views) for t, v in value.items()}
    elif isinstance(value, FieldSource):
        return value
    elif callable(value):
        from .function import Function

        return Function(value)
    else:
        raise InputError(f"a field cannot be made of {type(value).__name__}", remedy=FORMS + "; in Python also a function")
    if set(parts) == {None}:
        return parts[None]
    return PerFace({t: s for t, s in parts.items() if t is not None}, parts.get(None, Smooth()))


def _tag(value: Any) -> int | None:
    """Surface tag of a key."""
    try:
        return None if value is None else operator.index(value)
    except TypeError:
        raise InputError(f"a field is given for surface {value!r}", remedy="give the tag of a surface") from None


def _made(
    text: FieldText, load_view: Callable[[int | str], FieldSource], load_views: Callable[[str, str | None], FieldSource]
) -> FieldSource:
    """The source of a parsed text."""
    if text.kind == "smooth":
        from .smooth import Smooth

        return Smooth(*text.arguments)
    if text.kind == "singularities":
        from .formula import Singularities

        return Singularities(*text.arguments)
    if text.kind == "eigenmode":
        from .eigenmode import Eigenmode

        return Eigenmode(*text.arguments)
    if text.kind == "curvature":
        from .curvature import Curvature

        return Curvature()
    if text.kind == "heat-frame":
        from .function import load_function
        from .heat_frame import HeatFrame

        (function,) = text.arguments
        return HeatFrame() if function is None else HeatFrame(load_function(function))
    if text.kind == "view":
        return load_view(*text.arguments)
    if text.kind == "function":
        from .function import Function, load_function

        return Function(load_function(*text.arguments))
    path, array = text.arguments
    if Path(path).suffix.lower() == ".msh":
        return load_views(path, array)
    from .files import read_field

    return read_field(path, array)
