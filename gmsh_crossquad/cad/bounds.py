"""Keep Gmsh's idea of how large the user's model is.

Synchronising a scratch model makes its bounding box that of the session (`General.MinX` ... `General.BoundingBoxSize`, all
read-only), and Gmsh bounds mesh sizes by it, also in models that are made current later.  Here the box is put back by
synchronising one more scratch model, of two points: the corners of the box.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import gmsh

from . import session

__all__ = ["kept_bounds"]


@contextmanager
def kept_bounds() -> Iterator[None]:
    """Restore the session's bounding box at the end of the block."""
    low, high = ([gmsh.option.getNumber(f"General.{end}{axis}") for axis in "XYZ"] for end in ("Min", "Max"))
    size = gmsh.option.getNumber("General.BoundingBoxSize")
    try:
        yield
    finally:
        if gmsh.option.getNumber("General.BoundingBoxSize") != size and low != high:
            with session.scratch_model():
                for corner in (low, high):
                    gmsh.model.geo.addPoint(*corner)
                gmsh.model.geo.synchronize()
