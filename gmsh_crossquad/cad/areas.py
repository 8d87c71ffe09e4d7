"""Areas of the curved faces of the CAD model.

The OpenCASCADE kernel integrates them itself.  Elsewhere they come from the background triangles, cut into four with the middles
of their edges on the face until that changes little; the error falls with the square of the size, so a third of the last change
is added (Richardson's extrapolation).  On a long thin tube with one triangle over a quarter of a turn the first change says
nothing yet: triangles that stand across the tube have too large an area, as in Schwarz's lantern.
"""

from __future__ import annotations

import gmsh
import numpy as np

from ..records import FaceMesh, Float, Int, Model
from ..surfaces import Surfaces
from .session import gmsh_errors

__all__ = ["curved_areas"]

CLOSE = 5e-3
HALVINGS = 2


def curved_areas(model: Model, surfaces: Surfaces, meshes: tuple[FaceMesh, ...]) -> Float:
    """Areas (f,), scaled, of the faces of the current Gmsh model; NaN for plane ones.

    Raises
    ------
    MeshError
        Gmsh cannot integrate over a face.
    """
    out = np.full(len(model.faces), np.nan)
    with gmsh_errors("measuring the faces"):
        known = {tag for _, tag in gmsh.model.occ.getEntities(2)}
    for row in np.flatnonzero(surfaces.curved).tolist():
        tags = model.faces[row].tags
        if known.issuperset(tags):
            with gmsh_errors("measuring a face", entity=(2, tags[0])):
                out[row] = sum(gmsh.model.occ.getMass(2, tag) for tag in tags) / model.scale**2
        else:
            out[row] = _extrapolated(surfaces, row, meshes[row].points, meshes[row].triangles)
    return out


def _extrapolated(surfaces: Surfaces, row: int, points: Float, triangles: Int) -> float:
    """Area of a face from its triangles, halved until they have nearly all of it."""
    corner = points[triangles]
    coarse = fine = _area(corner)
    for _ in range(HALVINGS):
        middle = 0.5 * (corner + np.roll(corner, -1, axis=1))
        flat = middle.reshape(-1, 3)
        middle = surfaces.feet(np.full(len(flat), row), flat).reshape(middle.shape)
        corner = np.concatenate([middle, *(np.stack([corner[:, k], middle[:, k], middle[:, k - 1]], axis=1) for k in range(3))])
        coarse, fine = fine, _area(corner)
        if abs(fine - coarse) <= CLOSE * fine:
            break
    return fine + (fine - coarse) / 3.0


def _area(corner: Float) -> float:
    return 0.5 * float(np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1).sum())
