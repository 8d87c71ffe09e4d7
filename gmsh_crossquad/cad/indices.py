"""Indices of singular points that the user prescribes, at CAD vertices on the boundary and at embedded points.

An index is a whole number of quarter turns: 1/4, -1/2, 0, also .25 or 2/4.  It is given

- in the name of a Physical Point: ``index=1/4``; where several faces meet, one for every sector that is to have one:
  ``index=1/4 face=3 index=0 face="rotor"`` (the tag of a surface, or the name of a physical surface that holds it);
- in Python: ``{7: "1/4", (8, 3): Fraction(-1, 2)}``, by point or by (point, face).  That has priority over names.

Gmsh knows no points that are embedded in a curve (its .geo language refuses them, ``mesh.embed`` does nothing): in the middle of
a smooth curve, an index needs a point that divides the curve.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from fractions import Fraction
from numbers import Integral, Rational, Real
from typing import Any

import gmsh
import numpy as np

from ..errors import InputError
from ..records import Model
from .inside import curve_distance, height, inside
from .seeds import on_curved
from .session import gmsh_errors

__all__ = ["prescribed_indices"]

ALLOWED = "an index is a whole number of quarter turns: ..., -1/2, -1/4, 0, 1/4, 1/2, ..."
TOKEN = re.compile(r"""\b(index|face)\s*=\s*("[^"]*"|'[^']*'|[^\s;,()\[\]]*)""", re.IGNORECASE)
RATIONAL = re.compile(r"[+-]?(\d+(/0*[1-9]\d*)?|\d*\.\d+|\d+\.)")
NEAR = 1e-6  # of the model
Key = tuple[int, int]


def prescribed_indices(model: Model, options: Mapping[Any, Any] | None = None) -> dict[Key, int]:
    """Indices that names of physical points and an option prescribe.

    Parameters
    ----------
    model : Model
        Read from the current Gmsh model.
    options : mapping, optional
        Point tag, or (point tag, surface tag or name of a physical surface), to an index: a `Fraction`, a number or a text.

    Returns
    -------
    dict of (face row, vertex row) -> int
        Indices in quarter turns, sorted; vertices inside a face are those in its `embedded_points`.

    Raises
    ------
    InputError
        For what is no index, a point that is no vertex of the meshed faces, a face that does not hold the point, a missing face
        where several hold it, and two names that contradict each other.
    """
    holders = _holders(model)
    chosen = _from_options(model, holders, options or {})
    named = _from_names(model, holders, chosen)
    return dict(sorted({**named, **chosen}.items()))


def _holders(model: Model) -> dict[int, list[int]]:
    """Faces that have each vertex, by vertex row."""
    out: dict[int, list[int]] = {}
    for row, face in enumerate(model.faces):
        curves = [c for loop in face.loops for c, _ in loop] + list(face.embedded_curves)
        ends = [v for c in curves for v in (model.curves[c].start, model.curves[c].end)]
        for vertex in dict.fromkeys(ends + list(face.embedded_points)):
            out.setdefault(vertex, []).append(row)
    return out


def _from_options(model: Model, holders: dict[int, list[int]], options: Mapping[Any, Any]) -> dict[Key, int]:
    out: dict[Key, int] = {}
    for key, value in options.items():
        tag, face = key if isinstance(key, tuple) and len(key) == 2 else (key, None)
        source = f"boundary_index[{key!r}]"
        if not isinstance(tag, Integral) or isinstance(tag, bool) or not isinstance(face, (Integral, str, type(None))):
            raise InputError(f"{source} has no valid key", remedy="give a point tag or a pair (point tag, surface tag)")
        vertex = _vertex(model, int(tag), source)
        quarters = _quarters(value, source)
        for row in _rows(model, holders, vertex, face if isinstance(face, str | None) else int(face), source):
            if out.setdefault((row, vertex), quarters) != quarters:
                raise _contradiction(model, row, vertex, f"{source} and another entry")
    return out


def _from_names(model: Model, holders: dict[int, list[int]], chosen: Mapping[Key, int]) -> dict[Key, int]:
    out: dict[Key, int] = {}
    origin: dict[Key, str] = {}
    for tag, name in model.point_names:
        wishes = _wishes(name)
        if not wishes:
            continue
        source = f"the name {name!r}"
        vertex = _vertex(model, tag, source)
        for quarters, face in wishes:
            if face is None and all((row, vertex) in chosen for row in holders[vertex]):
                continue
            for row in _rows(model, holders, vertex, face, source):
                key = row, vertex
                if out.setdefault(key, quarters) != quarters:
                    first = origin[key]
                    raise _contradiction(model, row, vertex, source if first == source else f"{first} and {source}")
                origin[key] = source
    return out


def _wishes(name: str) -> list[tuple[int, int | str | None]]:
    """Indices in the name of a physical point, each with its face (a tag or a name, None where none is given)."""
    tokens = [(m[1].lower(), m[2]) for m in TOKEN.finditer(name)]
    if not any(word == "index" for word, _ in tokens):
        return []
    source = f"the name {name!r}"
    out: list[tuple[int, int | str | None]] = []
    fresh = False
    for word, text in tokens:
        if word == "index":
            out.append((_quarters(text, source), None))
            fresh = True
        elif not out or not text.strip("\"'"):
            raise InputError(f"{source} has a face without an index", remedy="write index=1/4 face=3")
        else:
            face = int(text) if text.isdecimal() else text.strip("\"'")
            out = [*out[:-1], (out[-1][0], face)] if fresh else [*out, (out[-1][0], face)]
            fresh = False
    return out


def _quarters(value: Any, source: str) -> int:
    """Quarter turns of an index."""
    index: Fraction | None = None
    if isinstance(value, str):
        text = value.strip()
        index = Fraction(text) if RATIONAL.fullmatch(text) else None
    elif isinstance(value, Rational) and not isinstance(value, bool):
        index = Fraction(value)
    elif isinstance(value, Real) and not isinstance(value, bool) and math.isfinite(value):
        index = Fraction(float(value))
    if index is None or (4 * index).denominator != 1:
        raise InputError(f"{source} gives the index {value!r}", remedy=ALLOWED)
    return int(4 * index)


def _rows(model: Model, holders: dict[int, list[int]], vertex: int, face: int | str | None, source: str) -> list[int]:
    """Rows of the faces that an index at a vertex is for."""
    here = holders[vertex]
    tag = int(model.vertex_tags[vertex])
    tags = ", ".join(str(model.faces[row].tag) for row in here)
    if face is None:
        if len(here) > 1:
            remedy = f"give one for each face that is to have it: index=1/4 face={model.faces[here[0]].tag}"
            raise InputError(f"{source} gives one index where the surfaces {tags} meet", entity=(0, tag), remedy=remedy)
        return here
    names = model.face_names or ((),) * len(model.faces)
    rows = [row for row in here if face == model.faces[row].tag or face in names[row]]
    if not rows:
        what = f"surface {face}" if isinstance(face, int) else f"physical surface {face!r}"
        known = any(face == f.tag or face in n for f, n in zip(model.faces, names, strict=True))
        problem = "does not have this point" if known else "is not meshed"
        raise InputError(f"{source} gives an index for {what}, which {problem}", entity=(0, tag), remedy=f"choose from {tags}")
    return rows


def _vertex(model: Model, tag: int, source: str) -> int:
    """Row of a point; an error that tells what is missing where it is no vertex of the meshed faces."""
    rows = np.flatnonzero(model.vertex_tags == tag)
    if tag > 0 and len(rows):
        return int(rows[0])
    if (0, tag) not in gmsh.model.getEntities(0):
        raise InputError(f"{source} gives an index to point {tag}, which the model does not have", remedy="check the tag")
    with gmsh_errors("evaluating", entity=(0, tag)):
        place = np.array(gmsh.model.getValue(0, tag, []))
    problem, remedy = _stray(model, tag, (place - model.origin) / model.scale)
    raise InputError(
        f"{source} gives an index to a point that {problem}", entity=(0, tag), location=place.tolist(), remedy=remedy
    )


def _stray(model: Model, tag: int, place: np.ndarray) -> tuple[str, str]:
    """Why a point of the Gmsh model is no vertex of the meshed faces, and what to do."""
    away = np.linalg.norm(model.vertices - place, axis=1)
    twin = int(model.vertex_tags[away.argmin()])
    if away.min() <= NEAR and twin > 0:
        return f"only has the same place as point {twin}", f"give it to point {twin}"
    for row, face in enumerate(model.faces):
        local = face.local(place[None])
        if not face.curved and abs(height(face, place[None])[0]) > NEAR:
            continue
        distance, curve = curve_distance(model, row, local)
        if distance[0] <= NEAR:
            line = model.curves[curve[0]].tag
            split = f"Split Curve {{{line}}} Point {{{tag}}}; or BooleanFragments with OpenCASCADE"
            return f"lies on curve {line} without dividing it", f"divide the curve there ({split})"
        if inside(model, row, local)[0] if not face.curved else on_curved(model, row, place):
            return f"is not embedded in surface {face.tag}", f"write Point{{{tag}}} In Surface{{{face.tag}}};"
    return "is on none of the meshed surfaces", "take the index out of the name, or mesh the surface of the point"


def _contradiction(model: Model, row: int, vertex: int, sources: str) -> InputError:
    what = f"{sources} give different indices in surface {model.faces[row].tag}"
    return InputError(what, entity=(0, int(model.vertex_tags[vertex])), remedy="leave one of them")
