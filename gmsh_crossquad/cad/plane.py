"""The plane of a CAD face and its frame.

The normal is that of the polygon of all boundary samples (Newell's formula, half the sum of p_i x p_{i+1}), exact in
the coordinate planes; where the signed area vanishes (a figure of eight) that of the best fitting plane.  Its side is
that of Gmsh's triangles: for the built-in kernel the one that the direction of the boundary gives (there `getNormal` may
be on the other side), for OpenCASCADE the one of `getNormal` (there the boundary of a reversed face runs the other way),
for a discrete face the one of its mesh.
"""

from __future__ import annotations

import gmsh
import numpy as np

from ..records import Float
from .session import gmsh_errors

__all__ = ["face_plane"]

FLATNESS = 1e-6  # of the model
GRID = 9  # interior evaluations per direction


def face_plane(tag: int, boundary: list[Float], origin: Float, scale: float) -> tuple[Float, Float] | None:
    """Frame of a planar face; None where the face is curved.

    Parameters
    ----------
    tag : int
        Gmsh tag.
    boundary : list of (n, 3) float64, scaled
        Samples of the boundary curves, in the direction in which the CAD boundary runs.
    origin : (3,) float64; scale : float
        scaled = (x - origin) / scale.

    Returns
    -------
    centre : (3,) float64, scaled
        Origin of the frame, the middle of the boundary's box.
    axes : (2, 3) float64
        Their cross product is the CAD normal.

    """
    points = np.concatenate(boundary)
    centre = 0.5 * (points.min(0) + points.max(0))
    normal, area = _newell(boundary, centre)
    extent = float(np.linalg.norm(np.ptp(points, axis=0)))
    if area < 1e-6 * extent**2:
        fitted = np.linalg.svd(points - centre, full_matrices=False)[2][2]
        normal = fitted if fitted @ normal >= 0 else -fitted
    kind = gmsh.model.getType(2, tag)
    if not _flat(points, normal):
        return None
    if kind != "Plane" and not _flat(np.concatenate([points, (_inside(tag, kind) - origin) / scale]), normal):
        return None
    side = _side(tag, kind)
    if side is not None and side @ normal < 0:
        normal = -normal
    return centre - ((centre - points.mean(0)) @ normal) * normal, _axes(normal)


def _newell(boundary: list[Float], centre: Float) -> tuple[Float, float]:
    """Unit normal (zero where the area is) and area of the polygon that the boundary curves make."""
    p = np.concatenate([curve[:-1] for curve in boundary]) - centre
    q = np.concatenate([curve[1:] for curve in boundary]) - centre
    vector = 0.5 * np.array([p[:, i] @ q[:, j] - p[:, j] @ q[:, i] for i, j in ((1, 2), (2, 0), (0, 1))])
    area = float(np.linalg.norm(vector))
    return (vector / area if area > 0 else vector), area


def _axes(normal: Float) -> Float:
    """Right-handed axes of a plane; the first is near the coordinate axis that is most in the plane."""
    e = np.eye(3)[int(np.argmin(np.abs(normal) > np.abs(normal).min() + 1e-9))]
    first = e - (e @ normal) * normal
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(normal, first)])


def _flat(points: Float, normal: Float) -> bool:
    height = (points - points.mean(0)) @ normal
    return bool(0.5 * np.ptp(height) <= FLATNESS)


def _inside(tag: int, kind: str) -> Float:
    """Points (n, 3) inside a face whose type does not say that it is plane, in the user's coordinates."""
    with gmsh_errors("evaluating", entity=(2, tag)):
        if kind.startswith("Discrete"):
            return gmsh.model.mesh.getNodes(2, tag)[1].reshape(-1, 3)
        lo, hi = gmsh.model.getParametrizationBounds(2, tag)
        t = (np.arange(GRID) + 0.5) / GRID
        u, v = (grid.ravel() for grid in np.meshgrid(lo[0] + t * (hi[0] - lo[0]), lo[1] + t * (hi[1] - lo[1])))
        pairs = np.column_stack([u, v])
        points = np.asarray(gmsh.model.getValue(2, tag, pairs.ravel())).reshape(-1, 3)
        inside = np.array([gmsh.model.isInside(2, tag, p, True) > 0 for p in pairs])
    finite = np.isfinite(points).all(1)
    return points[inside & finite] if (inside & finite).any() else points[finite]


def _side(tag: int, kind: str) -> Float | None:
    """A vector on the side of a face that its mesh shows; None where the direction of its boundary tells."""
    if kind.startswith("Discrete"):
        return _triangle_normal(tag)
    if (2, tag) not in gmsh.model.occ.getEntities(2):
        return None
    with gmsh_errors("evaluating the normal of", entity=(2, tag)):
        lo, hi = gmsh.model.getParametrizationBounds(2, tag)
        return np.asarray(gmsh.model.getNormal(tag, 0.5 * (np.asarray(lo) + np.asarray(hi))))


def _triangle_normal(tag: int) -> Float:
    """Sum of the area vectors of the mesh of a discrete face."""
    total = np.zeros(3)
    types, _, nodes = gmsh.model.mesh.getElements(2, tag)
    for kind, node in zip(types, nodes):
        corners = node.reshape(-1, gmsh.model.mesh.getElementProperties(int(kind))[3])[:, :3]
        where = np.array([gmsh.model.mesh.getNode(int(n))[0] for n in corners.ravel()]).reshape(-1, 3, 3)
        total += np.cross(where[:, 1] - where[:, 0], where[:, 2] - where[:, 0]).sum(0)
    return total
