"""Block-structured pure-quad meshes of Gmsh models from cross fields.

    import gmsh
    import gmsh_crossquad as cq

    gmsh.initialize()
    gmsh.open("part.geo")
    result = cq.mesh(size=0.05)

The names below are loaded when they are first used, so that importing the package costs nothing.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .api import cross_field, mesh
    from .block_layout import Block, Edge, Layout
    from .errors import CrossQuadError, FieldError, GeometryError, InputError, LayoutError, MeshError
    from .face_field import FaceField, Singularity
    from .field_result import FieldResult
    from .options import MeshOptions
    from .quality import Quality
    from .result import MeshResult

__version__ = "0.1.0"

_HOME = {
    "cross_field": "api",
    "mesh": "api",
    "CrossQuadError": "errors",
    "FieldError": "errors",
    "GeometryError": "errors",
    "InputError": "errors",
    "LayoutError": "errors",
    "MeshError": "errors",
    "MeshOptions": "options",
    "Quality": "quality",
    "Block": "block_layout",
    "Edge": "block_layout",
    "FaceField": "face_field",
    "FieldResult": "field_result",
    "Layout": "block_layout",
    "MeshResult": "result",
    "Singularity": "face_field",
}

__all__ = [
    "Block",
    "CrossQuadError",
    "Edge",
    "FaceField",
    "FieldError",
    "FieldResult",
    "GeometryError",
    "InputError",
    "Layout",
    "LayoutError",
    "MeshError",
    "MeshOptions",
    "MeshResult",
    "Quality",
    "Singularity",
    "__version__",
    "cross_field",
    "mesh",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(importlib.import_module(f".{_HOME[name]}", __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
