"""Target edge lengths of the quads.

A size that the caller gives holds everywhere, else they are Gmsh's own (`gmsh_sizes`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ..errors import InputError
from ..options import MeshOptions
from ..records import FaceMesh, Float, Model
from .gmsh_sizes import gmsh_sizes, triangle_areas

__all__ = ["SizeMap", "target_sizes"]


@dataclass(frozen=True)
class SizeMap:
    """Target edge length as a function of place, in scaled coordinates.

    Attributes
    ----------
    model : Model
    meshes : tuple of FaceMesh
    constant : float or None
        The size where it is the same everywhere.
    curve : tuple of (n,) float64
        Size at the samples of every curve; empty where `constant` is set.
    face : tuple of (n,) float64
        Size at the points of every background mesh; empty where `constant` is set.
    """

    model: Model
    meshes: tuple[FaceMesh, ...]
    constant: float | None
    curve: tuple[Float, ...] = ()
    face: tuple[Float, ...] = ()

    def at_curve(self, row: int, s: Float | float) -> Float:
        """Sizes (k,) at arc lengths `s` (k,) of curve `row`."""
        s = np.asarray(s, float)
        if self.constant is not None:
            return np.full(s.shape, self.constant)
        curve = self.model.curves[row]
        s = np.mod(s, curve.length) if curve.closed else s
        return np.asarray(np.interp(s, curve.arclength, self.curve[row]))

    def at_face(self, row: int, local_points: Float) -> Float:
        """Sizes (k,) at local coordinates (k, 2) or (k, 3) of face `row`: those of the nearest background points."""
        points = np.asarray(local_points, float).reshape(-1, self.meshes[row].points.shape[1])
        if self.constant is not None:
            return np.full(len(points), self.constant)
        if row not in self._trees:
            from ..spatial import cKDTree

            self._trees[row] = cKDTree(self.meshes[row].points)
        return self.face[row][self._trees[row].query(points)[1]]

    @cached_property
    def _trees(self) -> dict[int, Any]:
        return {}


def target_sizes(model: Model, meshes: tuple[FaceMesh, ...], options: MeshOptions) -> SizeMap:
    """Target sizes for the current Gmsh model, whose mesh and options stay as they are.

    Parameters
    ----------
    model : Model
    meshes : tuple of FaceMesh
    options : MeshOptions
        `size` in the user's units, or None for Gmsh's own sizes.

    Raises
    ------
    InputError
        A size that is not a positive number, or more than `max_quads` quads.
    """
    if options.size is not None:
        size = options.size
        if not (np.isfinite(size) and size > 0):
            raise InputError(f"the size must be a positive number, not {size:g}", remedy="give an edge length in model units")
        out = SizeMap(model, meshes, size / model.scale)
    else:
        out = SizeMap(model, meshes, None, *gmsh_sizes(model, meshes))
    _check_count(out, options)
    return out


def _check_count(sizes: SizeMap, options: MeshOptions) -> None:
    """Refuse to make more quads than allowed; their number is the integral of 1 / size^2."""
    count = 0.0
    for row, mesh in enumerate(sizes.meshes):
        area = triangle_areas(mesh)
        h2 = sizes.constant**2 if sizes.constant is not None else (sizes.face[row][mesh.triangles] ** 2).mean(axis=1)
        count += float(np.sum(area / h2))
    if not count <= options.max_quads:
        raise InputError(
            f"this size makes about {count:.3g} quads, more than the {options.max_quads} allowed",
            remedy="choose a larger size or raise max_quads",
        )
