"""Gmsh's own mesh sizes, as it applies them to the user's model.

They are measured, with all of the user's options, point sizes and transfinite counts in force: the edge lengths of Gmsh's curve
mesh, extended into the faces harmonically.  Where a background size field is set, which the curves alone do not show, Gmsh's
surface mesh is measured as well, made coarser by `Mesh.MeshSizeFactor` (which scales all sizes after everything else) so that it
costs little.  The user's mesh is put back.

A face without boundary is measured on its seams, or on its triangles where it has no seam (discrete faces).  Where
`Mesh.MeshSizeFromCurvature` asks for N elements on a full turn, the sizes inside curved faces are at most 2 pi / (N kappa), kappa
being the greatest principal curvature there.  It is taken from the CAD's derivatives: `getCurvature` of Gmsh 4.15.2 is wrong on
surfaces of the built-in kernel (0 to 2.9 on a unit sphere).  These sizes are at least 1e-5 of the model: without a least size
Gmsh does not come to an end on a curve that runs into the apex of a cone.
"""

from __future__ import annotations

from collections.abc import Sequence

import gmsh
import numpy as np

from ..errors import MeshError
from ..field.surface_mesh import surface_of
from ..records import Curve, Face, FaceMesh, Float, Int, Model
from . import session
from .joined_surfaces import cad_surfaces

__all__ = ["gmsh_sizes", "triangle_areas"]

TRIAL = 32.0
MEASURED_EDGES = 100_000.0
LEAST = 1e-5  # of the model
MEASURED_ELEMENTS = 3000  # of the coarsened surface mesh
# An error that Gmsh throws while it meshes leaves its mesher locked for the rest of the session: errors are looked for instead.
KEPT_OPTIONS = {"General.AbortOnError": 0, "Mesh.ElementOrder": 1, "Mesh.MeshOnlyVisible": 0, "Mesh.MeshOnlyEmpty": 0}


def triangle_areas(mesh: FaceMesh) -> Float:
    """(m,) areas of the triangles of a background mesh."""
    if mesh.points.shape[1] == 3:
        return surface_of(mesh).area
    a, b, c = (mesh.points[mesh.triangles[:, k]] for k in range(3))
    return 0.5 * ((b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0]))


def gmsh_sizes(model: Model, meshes: tuple[FaceMesh, ...]) -> tuple[tuple[Float, ...], tuple[Float, ...]]:
    """Gmsh's own sizes for the current model, whose mesh and options stay as they are.

    Parameters
    ----------
    model : Model
    meshes : tuple of FaceMesh

    Returns
    -------
    curve : tuple of (n,) float64, scaled
        Size at the samples of every curve.
    face : tuple of (n,) float64, scaled
        Size at the points of every background mesh.

    Raises
    ------
    MeshError
        Where Gmsh gives no size.
    """
    snapshot = session.MeshSnapshot.take()
    try:
        with session.options(**KEPT_OPTIONS, **_floor(model)):
            if not any(gmsh.model.getType(*entity).startswith("Discrete") for entity in gmsh.model.getEntities()):
                gmsh.model.mesh.clear()  # a mesh that was put back has lost what it knew about periodic curves
            curve, inner = _measured_curves(model, meshes)
            face = tuple(_extended(model, mesh, curve, inner.get(mesh.face)) for mesh in meshes)
            if len(gmsh.model.mesh.field.list()):
                face = _field_sizes(model, meshes, face)
            elif gmsh.option.getNumber("Mesh.MeshSizeFromCurvature") > 0:
                face = _bounded_by_curvature(model, meshes, face)
    finally:
        snapshot.restore()
    if not all(np.isfinite(h).all() and (h > 0).all() for h in (*curve, *face)):
        raise MeshError("Gmsh gives no positive size somewhere", remedy="give the size explicitly")
    return curve, face


def _floor(model: Model) -> dict[str, float]:
    """A least size where sizes come from the curvature, which is infinite at an apex."""
    if not (gmsh.option.getNumber("Mesh.MeshSizeFromCurvature") > 0 and any(face.curved for face in model.faces)):
        return {}
    return {"Mesh.MeshSizeMin": max(gmsh.option.getNumber("Mesh.MeshSizeMin"), LEAST * model.scale)}


_Places = tuple[Float, Float]
"""Places (k, 3), scaled, with their sizes (k,)."""


def _measured_curves(model: Model, meshes: tuple[FaceMesh, ...]) -> tuple[tuple[Float, ...], dict[int, _Places]]:
    """Sizes at the samples of every curve, and on the faces without boundary, by their rows.

    They are from one curve mesh, which is coarser than Gmsh's where that would be very fine.
    """
    closed = [model.faces[mesh.face] for mesh in meshes if not len(mesh.boundary)]
    row = {face.tag: k for k, face in enumerate(model.faces)}
    factor = gmsh.option.getNumber("Mesh.MeshSizeFactor")
    with session.gmsh_errors("meshing the curves to learn their sizes"):
        with session.options(**{"Mesh.MeshSizeFactor": factor * TRIAL}):
            gmsh.model.mesh.generate(1)
        number = sum(len(_curve_edges(curve, model)) for curve in model.curves)
        guess = TRIAL * (number + sum(len(_seam_edges(face, model)[1]) for face in closed))
        coarser = max(1.0, guess / MEASURED_EDGES)
        with session.options(**{"Mesh.MeshSizeFactor": factor * coarser}):
            gmsh.model.mesh.generate(1)
        edges = [_curve_edges(curve, model) for curve in model.curves]
        inner = {}
        for face in closed:
            places, sizes = _seam_edges(face, model)
            if len(places):
                inner[row[face.tag]] = places, sizes / coarser
            else:
                inner[row[face.tag]] = _face_elements(face, model)
    known = _curve_sizes(model, edges)
    if coarser == 1.0:
        return known, inner
    finer = tuple(h / coarser if len(e) > 1 else np.minimum(h / coarser, c.length) for h, e, c in zip(known, edges, model.curves))
    return finer, inner


def _seam_edges(face: Face, model: Model) -> _Places:
    """Middles and lengths of the mesh edges on the curves of a face."""
    middles, lengths = [np.zeros((0, 3))], [np.zeros(0)]
    curves = dict.fromkeys(c for tag in face.tags for c in gmsh.model.getAdjacencies(2, tag)[1].tolist())
    for tag in curves:  # seams and joints are no boundary
        points = _edge_points(tag, model)
        middles.append(points.mean(axis=1))
        lengths.append(np.linalg.norm(points[:, 1] - points[:, 0], axis=1))
    return np.concatenate(middles), np.concatenate(lengths)


def _edge_points(tag: int, model: Model) -> Float:
    """Scaled ends (k, 2, 3) of the mesh edges on a curve."""
    _, nodes = gmsh.model.mesh.getElementsByType(1, tag)
    tags, coordinates, _ = gmsh.model.mesh.getNodes(1, tag, includeBoundary=True)
    if not len(nodes):
        return np.zeros((0, 2, 3))
    order = np.argsort(tags)
    rows: Int = order[np.searchsorted(tags[order], nodes.reshape(-1, 2))]
    return (coordinates.reshape(-1, 3)[rows] - model.origin) / model.scale


def _curve_edges(curve: Curve, model: Model) -> Float:
    """Lengths of the mesh edges on a curve from its start to its end, scaled to sum up to the curve's length."""
    points = _edge_points(curve.tag, model)
    if not len(points):
        return np.array([curve.length])
    lengths: Float = np.linalg.norm(points[:, 1] - points[:, 0], axis=1)
    first, last = points[0, 0], points[-1, 1]
    if np.linalg.norm(last - curve.points[0]) < np.linalg.norm(first - curve.points[0]):
        lengths = lengths[::-1]
    return lengths * (curve.length / lengths.sum())


def _curve_sizes(model: Model, edges: Sequence[Float]) -> tuple[Float, ...]:
    """Sizes at the samples of every curve from the edge lengths of Gmsh's mesh.

    A curve with one edge only tells that the size is not smaller; it takes the least size at its ends of curves with more.
    """
    single = np.array([len(e) == 1 for e in edges])
    ends = np.array([(c.start, c.end) for c in model.curves])
    at_vertex = np.full(len(model.vertices), np.inf)
    for e, (a, b) in zip(edges, ends, strict=True):
        if len(e) > 1:
            at_vertex[a], at_vertex[b] = min(at_vertex[a], e[0]), min(at_vertex[b], e[-1])
    out = []
    for row, (curve, e) in enumerate(zip(model.curves, edges, strict=True)):
        if single[row]:
            near = float(at_vertex[ends[row]].min())
            out.append(np.full(len(curve.points), max(curve.length, near) if np.isfinite(near) else curve.length))
        else:
            middle = np.cumsum(e) - 0.5 * e
            out.append(np.interp(curve.arclength, middle, e))
    return tuple(out)


def _extended(model: Model, mesh: FaceMesh, curve: tuple[Float, ...], measured: _Places | None) -> Float:
    """Harmonic extension of the boundary sizes (and of point sizes inside) to all points of a background mesh.

    The weights are those of the graph, all positive: the sizes stay between the least and the greatest one.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.linalg import splu

    n = len(mesh.points)
    total, count = np.zeros(n), np.zeros(n)
    for c in np.unique(mesh.boundary_curve):
        half = mesh.boundary_curve == c
        h = np.interp(mesh.boundary_arclength[half], model.curves[c].arclength, curve[c])
        np.add.at(total, mesh.boundary[half], h)
        np.add.at(count, mesh.boundary[half], 1.0)
    inside = np.flatnonzero((mesh.vertex >= 0) & (count == 0))
    for point in inside[model.vertex_tags[mesh.vertex[inside]] >= 0]:
        (size,) = gmsh.model.mesh.getSizes([(0, int(model.vertex_tags[mesh.vertex[point]]))])
        factor = gmsh.option.getNumber("Mesh.MeshSizeFactor")
        bounds = gmsh.option.getNumber("Mesh.MeshSizeMin"), gmsh.option.getNumber("Mesh.MeshSizeMax")
        if size > 0 and gmsh.option.getNumber("Mesh.MeshSizeFromPoints"):
            total[point], count[point] = min(max(size, bounds[0]), bounds[1]) * factor / model.scale, 1.0
    if measured is not None:
        from ..spatial import cKDTree

        near = cKDTree(mesh.points).query(measured[0])[1]
        np.add.at(total, near, measured[1])
        np.add.at(count, near, 1.0)
    known = count > 0
    if not known.any():
        what = "nothing tells how large the elements should be"
        raise MeshError(what, entity=(2, model.faces[mesh.face].tag), remedy="give the size explicitly")
    out = np.zeros(n)
    out[known] = total[known] / count[known]
    low, high = out[known].min(), out[known].max()
    if high <= 1.01 * low:
        return np.where(known, out, 0.5 * (low + high))
    half_edges = np.stack([mesh.triangles, np.roll(mesh.triangles, -1, axis=1)], axis=2).reshape(-1, 2)
    i, j = np.concatenate([half_edges, half_edges[:, ::-1]]).T
    weights = coo_array((np.ones(len(i)), (i, j)), shape=(n, n)).tocsr()
    free = np.flatnonzero(~known)
    rows = weights[free]
    inner = (-rows[:, free]).tocsc()
    inner.setdiag(np.asarray(rows.sum(axis=1)).ravel())
    solver = splu(inner, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    out[free] = solver.solve(rows @ out)
    return out


def _bounded_by_curvature(model: Model, meshes: tuple[FaceMesh, ...], face: tuple[Float, ...]) -> tuple[Float, ...]:
    """Sizes that are nowhere larger than the curvature of the faces allows."""
    turn = gmsh.option.getNumber("Mesh.MeshSizeFromCurvature")
    factor = gmsh.option.getNumber("Mesh.MeshSizeFactor")
    low, high = (gmsh.option.getNumber(f"Mesh.MeshSize{end}") / model.scale for end in ("Min", "Max"))
    out = []
    for h, curvature in zip(face, cad_surfaces(model, meshes).seed_curvatures, strict=True):
        bent = curvature > 0
        most = np.full(len(h), np.inf)
        most[bent] = np.clip(2 * np.pi / (turn * curvature[bent]), low, high) * factor
        out.append(np.minimum(h, most))
    return tuple(out)


def _field_sizes(model: Model, meshes: tuple[FaceMesh, ...], known: tuple[Float, ...]) -> tuple[Float, ...]:
    """Sizes at the points of every background mesh, measured on a surface mesh that Gmsh makes.

    `known` are those that the curves tell.
    """
    from ..spatial import cKDTree

    guess = sum(
        float(np.sum(triangle_areas(mesh) / (h[mesh.triangles] ** 2).mean(axis=1))) for mesh, h in zip(meshes, known, strict=True)
    )
    coarser = max(1.0, float(np.sqrt(2 * guess / MEASURED_ELEMENTS)))
    factor = gmsh.option.getNumber("Mesh.MeshSizeFactor")
    with (
        session.options(**{"Mesh.MeshSizeFactor": factor * coarser, "Mesh.RecombineAll": 0}),
        session.gmsh_errors("meshing the surfaces to learn their sizes"),
    ):
        gmsh.model.mesh.generate(2)
        measured = [_face_elements(face, model) for face in model.faces]
    out = []
    for mesh, (centres, sizes) in zip(meshes, measured, strict=True):
        if not len(centres):
            raise MeshError("Gmsh made no mesh to learn sizes from", entity=(2, model.faces[mesh.face].tag))
        near = cKDTree(centres).query(mesh.points, k=min(3, len(centres)))[1].reshape(len(mesh.points), -1)
        out.append(sizes[near].mean(axis=1) / coarser)
    return tuple(out)


def _face_elements(face: Face, model: Model) -> tuple[Float, Float]:
    """Centres (k, 2) or (k, 3), local, and mean edge lengths (k,) of the elements on a face."""
    centres, sizes = [np.zeros((0, len(face.axes)))], [np.zeros(0)]
    for part in face.tags:
        tags, coordinates, _ = gmsh.model.mesh.getNodes(2, part, includeBoundary=True)
        order = np.argsort(tags)
        local = face.local((coordinates.reshape(-1, 3) - model.origin) / model.scale)
        for kind, corners in ((2, 3), (3, 4)):
            _, nodes = gmsh.model.mesh.getElementsByType(kind, part)
            points = local[order[np.searchsorted(tags[order], nodes.reshape(-1, corners))]]
            centres.append(points.mean(axis=1))
            sizes.append(np.linalg.norm(points - np.roll(points, 1, axis=1), axis=2).mean(axis=1))
    return np.concatenate(centres), np.concatenate(sizes)
