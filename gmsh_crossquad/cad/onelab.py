"""Options that a model sets itself, as ONELAB parameters.

    DefineConstant[ h = {0.2, Name "CrossQuad/Element size"} ];
    DefineConstant[ f = {"eigenmode:4", Name "CrossQuad/Field"} ];
    DefineConstant[ g = {"smooth", Name "CrossQuad/Field 3"} ];  // for surface 3

Names are compared without case and without the digits in front of a part, which order Gmsh's menus.

The parameters belong to the Gmsh session, not to a model.  What was found with Gmsh 4.15.2: opening another file leaves them, so
does ``gmsh.clear``; a file that defines a parameter that is there already gets its present value; every parameter that a .geo
file defines has the client "Gmsh", one that a program sets with ``gmsh.onelab.set`` has none; the "changed" flags do not tell
what a file has defined.  So a parameter of client "Gmsh" counts only where the file of the current model, or one that it
includes, has its name in it, or makes names of its own from pieces, or cannot be read any more.  Parameters that a program sets
always count.  `forget_options` removes all, for whoever opens several files one after the other.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import gmsh

from ..errors import InputError

__all__ = ["forget_options", "onelab_options"]

NUMBERS = {
    "element size": "size",
    "max quads": "max_quads",
    "block size": "block_size",
    "background": "background",
    "feature angle": "feature_angle",
}
SWITCHES = {"fix indices": "fix_indices", "relax": "relax"}
KNOWN = "Element size, Max quads, Block size, Background, Feature angle, Fix indices, Relax, Field, Field 3 (for surface 3)"
OURS = re.compile(r"\d*crossquad/", re.IGNORECASE)
FACE_FIELD = re.compile(r"field (\d+)")
QUOTED = re.compile(r""""([^"\n]*)"|'([^'\n]*)'""")
MERGED = re.compile(r"\b(?:Include|Merge|MergeFile)\b\s*([^;\n]*)")
SCRIPTS = (".geo", ".geo_unrolled", ".opt", ".pro", ".txt")
MOST_FILES = 100


def onelab_options() -> dict[str, Any]:
    """Options of the current Gmsh model.

    Returns
    -------
    dict
        Some of `size`, `max_quads`, `block_size`, `background` (float), `fix_indices`, `relax` (bool) and `field`: a text, or a
        dict of surface tag to text, in which None stands for all other surfaces.

    Raises
    ------
    InputError
        For an unknown parameter, a number where a text is needed or the reverse, and a switch that is neither 0 nor 1.
    """
    out: dict[str, Any] = {}
    origin: dict[str, str] = {}
    fields: dict[int | None, str] = {}
    for name in _names():
        key = re.sub(r"^\d+\s*", "", name.rsplit("/", 1)[1]).strip().lower()
        face = FACE_FIELD.fullmatch(key)
        option = NUMBERS.get(key) or SWITCHES.get(key) or (key if key == "field" or face else "")
        if not option:
            raise InputError(f"unknown ONELAB parameter {name!r}", remedy=f"the parameters of CrossQuad are {KNOWN}")
        if origin.setdefault(option, name) != name:
            raise InputError(f"the ONELAB parameters {origin[option]!r} and {name!r} are the same option", remedy="leave one")
        if key in NUMBERS:
            out[option] = _number(name)
        elif key in SWITCHES:
            out[option] = _switch(name)
        else:
            fields[int(face[1]) if face else None] = _text(name)
    if fields:
        out["field"] = fields[None] if list(fields) == [None] else fields
    return out


def forget_options() -> None:
    """Remove all parameters of CrossQuad from the Gmsh session, so that the next file starts with its own values."""
    for name in gmsh.onelab.getNames():
        if OURS.match(name):
            gmsh.onelab.clear(name)


def _names() -> list[str]:
    """Names of the parameters that hold for the current model, sorted."""
    names = sorted(n for n in gmsh.onelab.getNames() if OURS.match(n))
    if not names:
        return []
    file = Path(gmsh.model.getFileName())
    texts = _sources(file)
    if not texts:
        return names if file.suffix.lower() in SCRIPTS else [n for n in names if not _of_a_file(n)]
    written = {(m[1] or m[2] or "").lower() for text in texts for m in QUOTED.finditer(text)}
    pieces = any("%" in w or w.endswith("/") for w in written if OURS.match(w) or w.rstrip("/") == "crossquad")
    return [n for n in names if pieces or n.lower() in written or not _of_a_file(n)]


def _of_a_file(name: str) -> bool:
    """Whether a parameter was defined by a .geo file."""
    return re.search(r'"clients"\s*:\s*{\s*"Gmsh"', gmsh.onelab.get(name)) is not None


def _sources(path: Path) -> list[str]:
    """Texts of a script and of those that it includes; nothing where a model has none."""
    todo, texts = [path], list[str]()
    done: set[Path] = set()
    while todo and len(done) < MOST_FILES:
        file = todo.pop()
        if file in done or file.suffix.lower() not in SCRIPTS:
            continue
        done.add(file)
        try:
            text = _without_comments(file.read_text(encoding="utf-8", errors="replace"))
        except OSError:
            continue
        texts.append(text)
        for command in MERGED.finditer(text):
            name = QUOTED.search(command[1])
            if name:
                todo.append(file.parent / (name[1] or name[2]))
    return texts


def _without_comments(text: str) -> str:
    return re.sub(r'("[^"\n]*")|/\*.*?\*/|//[^\n]*', lambda m: m[1] or " ", text, flags=re.DOTALL)


def _number(name: str) -> float:
    values = gmsh.onelab.getNumber(name)
    if len(values) != 1:
        raise InputError(f"the ONELAB parameter {name!r} is no single number", remedy=f'write {{0.2, Name "{name}"}}')
    return float(values[0])


def _switch(name: str) -> bool:
    value = _number(name)
    if value not in (0.0, 1.0):
        raise InputError(f"the ONELAB parameter {name!r} is {value:g}", remedy="it must be 0 or 1")
    return value == 1.0


def _text(name: str) -> str:
    values = gmsh.onelab.getString(name)
    if len(values) != 1:
        raise InputError(f"the ONELAB parameter {name!r} is no single text", remedy=f'write {{"smooth", Name "{name}"}}')
    return str(values[0])
