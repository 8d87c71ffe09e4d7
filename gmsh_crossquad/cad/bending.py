"""How a curved CAD face bends at the edges of its background mesh: the derivative of its unit normal.

That of the points of the mesh comes from the CAD (`surface_samples`); at a point without parameters or at a pole it is that of
the nearest sample.  An edge has the mean of its ends, each seen in the frame that has the edge's direction there (on a sphere
that is exact, elsewhere of second order).

`gmsh.model.getPrincipalCurvatures` is not used: for surfaces of the built-in kernel it gives wrong values (Gmsh 4.15.2).
"""

from __future__ import annotations

import gmsh
import numpy as np

from ..field.surface_mesh import surface_of
from ..records import FaceMesh, Float, Model
from .charts import Charts
from .joined_surfaces import split
from .session import gmsh_errors
from .surface_samples import surface_samples

__all__ = ["edge_bending"]


def edge_bending(model: Model, mesh: FaceMesh) -> Float:
    """The bending of a curved face at the edge midpoints of its background mesh.

    Parameters
    ----------
    model : Model
        Of the current Gmsh model.
    mesh : FaceMesh

    Returns
    -------
    (e, 3) float64
        Components xx, yy and xy of the symmetric tensors that take a tangent vector to the derivative of the unit normal, x
        along the edge from its lower to its higher vertex, y to the left of it; times the face's extent.  NaN on a face without
        a parametrization.
    """
    face = model.faces[mesh.face]
    edges = surface_of(mesh).edges
    known = _at_points(model, mesh, mesh.points) if mesh.parts is None else _of_parts(model, mesh)
    if known is None:
        return np.full((len(edges), 3), np.nan)
    turning, normal = known[0][edges], known[1][edges]
    along = (mesh.points[edges[:, 1]] - mesh.points[edges[:, 0]])[:, None]
    x = along - np.einsum("eic,eic->ei", along.repeat(2, axis=1), normal)[..., None] * normal
    x /= np.linalg.norm(x, axis=2)[..., None]
    y = np.cross(normal, x)
    parts = [np.einsum("eic,eicd,eid->e", a, turning, b) for a, b in ((x, x), (y, y), (x, y))]
    return 0.5 * face.extent * np.stack(parts, axis=1)


def _at_points(model: Model, mesh: FaceMesh, points: Float) -> tuple[Float, Float] | None:
    """Derivatives (n, 3, 3) of the unit normal of a face and the normals (n, 3) at points, on the side of its triangles."""
    face = model.faces[mesh.face]
    if not face.curved:
        return np.zeros((len(points), 3, 3)), np.tile(face.normal, (len(points), 1))
    with gmsh_errors("reading the kind of the surface", entity=(2, face.tag)):
        discrete = gmsh.model.getType(2, face.tag).startswith("Discrete")
    if discrete or not np.isfinite(mesh.parameters).all(axis=1).any():
        return None
    own = np.arange(len(model.faces)) == mesh.face
    charts = Charts.read(np.array([f.tag for f in model.faces]), own, model.scale)
    samples = surface_samples(model, (mesh,), charts)
    near = samples.nearest(np.full(len(points), mesh.face), points, 1, True)[:, 0]
    return samples.turning[near], samples.normals[near]


def _of_parts(model: Model, mesh: FaceMesh) -> tuple[Float, Float] | None:
    """The same at the points of the mesh of a face that is made of parts: of the part with the nearest point."""
    from ..spatial import cKDTree

    assert mesh.parts is not None
    whole, meshes, _ = split(model, (mesh,))
    owner = np.repeat(np.arange(len(meshes)), [len(m.points) for m in meshes])
    owner = owner[cKDTree(np.concatenate(mesh.parts.points)).query(mesh.points)[1]]
    turning, normal = np.zeros((len(owner), 3, 3)), np.zeros((len(owner), 3))
    for k in np.unique(owner).tolist():
        known = _at_points(whole, meshes[k], mesh.points[owner == k])
        if known is None:
            return None
        side = -1.0 if whole.faces[meshes[k].face].turned else 1.0
        turning[owner == k], normal[owner == k] = side * known[0], side * known[1]
    return turning, normal
