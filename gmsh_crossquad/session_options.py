"""The options of a run in a Gmsh session: arguments first, then what the model sets, then defaults; fields become sources."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .arguments import check_options
from .cad.onelab import onelab_options
from .options import MeshOptions
from .source.base import FieldSource

__all__ = ["session_options"]


def session_options(**arguments: Any) -> MeshOptions:
    """Options of a run on the current model.

    Parameters
    ----------
    **arguments
        As for `gmsh_crossquad.mesh`; None stands for "not given".

    Raises
    ------
    InputError, FieldError
    """
    given = {name: value for name, value in arguments.items() if value is not None}
    merged = {**onelab_options(), **given}
    if "field" in merged:
        merged["field"] = _source(merged["field"])
    return check_options(**merged)


def _source(value: Any) -> FieldSource:
    """A source from whatever the user gave."""
    from .cad.views import read_view_file, view_samples
    from .face_field import FaceField
    from .field_result import FieldResult
    from .source.known import Known
    from .source.parse import parse_field

    if isinstance(value, FieldResult):
        return Known(value.faces)
    if isinstance(value, FaceField):
        return Known((value,))
    if isinstance(value, (tuple, list)) and value and all(isinstance(f, FaceField) for f in value):
        return Known(tuple(value))
    if isinstance(value, Mapping):
        value = {face: v if v is None else _source(v) for face, v in value.items()}
    return parse_field(value, view_samples, read_view_file)
