"""Surfaces of bare triangles (STL and the like) become faces, curves and points.

Gmsh reads such a file as one surface that has no boundary.  It is cut along the edges where its triangles turn by more than
40 degrees and along its free boundary.  Every piece that is not plane gets a map to the plane, through which Gmsh can mesh it
anew; where one is no disc and no tube, and has none, all pieces are cut further into such that have.
"""

from __future__ import annotations

import gmsh
import numpy as np

from ..records import Float, Int
from .session import options

__all__ = ["classify"]

SHARP = np.radians(40.0)
PLANE = 1e-6  # height of a plane piece over its extent; files hold single precision
TRIANGLE = 2


def classify() -> bool:
    """Cut the current model, where it is nothing but triangles without boundary and without physical groups, into faces.

    Returns
    -------
    bool
        Whether it was such a model.
    """
    surfaces = gmsh.model.getEntities(2)
    if not surfaces or gmsh.model.getEntities(1) or gmsh.model.getPhysicalGroups(2):
        return False
    if any(gmsh.model.getType(*entity) != "Discrete surface" for entity in surfaces):
        return False
    with options(**{"General.AbortOnError": 0}):  # a piece without a map is reported where it is meshed
        gmsh.model.mesh.classifySurfaces(float(SHARP), True, False, np.pi)
        tags, coordinates, _ = gmsh.model.mesh.getNodes()
        row = np.full(int(tags.max(initial=0)) + 1, -1, np.int64)
        row[tags] = np.arange(len(tags))
        points = coordinates.reshape(-1, 3)
        pieces = [row[gmsh.model.mesh.getElementsByType(TRIANGLE, f)[1]].reshape(-1, 3) for _, f in gmsh.model.getEntities(2)]
        if not all(_has_map(points, piece) for piece in pieces):
            gmsh.model.mesh.classifySurfaces(float(SHARP), True, True, np.pi)
        gmsh.model.mesh.createGeometry()
    return True


def _has_map(points: Float, triangles: Int) -> bool:
    """Whether a connected piece needs no further cut: it is plane, or a disc or a tube (Euler characteristic, free edges)."""
    used = np.unique(triangles)
    own = points[used] - points[used].mean(axis=0)
    spread = np.ptp(own @ np.linalg.svd(own, full_matrices=False)[2].T, axis=0)
    if spread[2] <= PLANE * spread[0]:
        return True
    half = np.sort(np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    edges, count = np.unique(half, axis=0, return_counts=True)
    return bool((count == 1).any()) and len(used) - len(edges) + len(triangles) in (0, 1)
