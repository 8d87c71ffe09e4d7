"""Target edge lengths of the quads.

A size that the caller gives holds everywhere.  Else the sizes are Gmsh's own, as it applies them to the user's model with
all of its options, point sizes and transfinite counts: the edge lengths of its curve mesh, extended into the faces
harmonically.  Where a background size field is set, which the curves alone do not show, Gmsh's surface mesh is measured as
well, made coarser by `Mesh.MeshSizeFactor` (which scales all sizes after everything else) so that it costs little.  The
user's mesh is put back.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import gmsh
import numpy as np

from ..errors import InputError, MeshError
from ..options import MeshOptions
from ..records import Curve, Face, FaceMesh, Float, Model
from . import session

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["SizeMap", "target_sizes"]

TRIAL = 32.0
MEASURED_EDGES = 100_000.0
MEASURED_ELEMENTS = 3000  # of the coarsened surface mesh
# An error that Gmsh throws while it meshes leaves its mesher locked for the rest of the session: errors are looked for instead.
KEPT_OPTIONS = {"General.AbortOnError": 0, "Mesh.ElementOrder": 1, "Mesh.MeshOnlyVisible": 0, "Mesh.MeshOnlyEmpty": 0}


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
        """Sizes (k,) at local coordinates (k, 2) of face `row`: those of the nearest background points."""
        points = np.asarray(local_points, float).reshape(-1, 2)
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
        out = _measured(model, meshes)
    _check_count(out, options)
    return out


def _areas(mesh: FaceMesh) -> Float:
    a, b, c = (mesh.points[mesh.triangles[:, k]] for k in range(3))
    return 0.5 * ((b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0]))


def _check_count(sizes: SizeMap, options: MeshOptions) -> None:
    """Refuse to make more quads than allowed; their number is the integral of 1 / size^2."""
    count = 0.0
    for row, mesh in enumerate(sizes.meshes):
        area = _areas(mesh)
        h2 = sizes.constant**2 if sizes.constant is not None else (sizes.face[row][mesh.triangles] ** 2).mean(axis=1)
        count += float(np.sum(area / h2))
    if not count <= options.max_quads:
        raise InputError(
            f"this size makes about {count:.3g} quads, more than the {options.max_quads} allowed",
            remedy="choose a larger size or raise max_quads",
        )


def _measured(model: Model, meshes: tuple[FaceMesh, ...]) -> SizeMap:
    """Gmsh's own sizes."""
    snapshot = session.MeshSnapshot.take()
    try:
        with session.options(**KEPT_OPTIONS):
            if not any(gmsh.model.getType(*entity).startswith("Discrete") for entity in gmsh.model.getEntities()):
                gmsh.model.mesh.clear()  # a mesh that was put back has lost what it knew about periodic curves
            curve = _measured_curves(model)
            if len(gmsh.model.mesh.field.list()):
                face = _field_sizes(model, meshes, curve)
            else:
                face = tuple(_extended(model, mesh, curve) for mesh in meshes)
    finally:
        snapshot.restore()
    if not all(np.isfinite(h).all() and (h > 0).all() for h in (*curve, *face)):
        raise MeshError("Gmsh gives no positive size somewhere", remedy="give the size explicitly")
    return SizeMap(model, meshes, None, curve, face)


def _measured_curves(model: Model) -> tuple[Float, ...]:
    """Sizes at the samples of every curve, from one curve mesh; it is coarser than Gmsh's where that would be very fine."""
    factor = gmsh.option.getNumber("Mesh.MeshSizeFactor")
    with session.gmsh_errors("meshing the curves to learn their sizes"):
        with session.options(**{"Mesh.MeshSizeFactor": factor * TRIAL}):
            gmsh.model.mesh.generate(1)
        guess = TRIAL * sum(len(_curve_edges(curve, model)) for curve in model.curves)
        coarser = max(1.0, guess / MEASURED_EDGES)
        with session.options(**{"Mesh.MeshSizeFactor": factor * coarser}):
            gmsh.model.mesh.generate(1)
        edges = [_curve_edges(curve, model) for curve in model.curves]
    sizes = _curve_sizes(model, edges)
    if coarser == 1.0:
        return sizes
    return tuple(h / coarser if len(e) > 1 else np.minimum(h / coarser, c.length) for h, e, c in zip(sizes, edges, model.curves))


def _curve_edges(curve: Curve, model: Model) -> Float:
    """Lengths of the mesh edges on a curve from its start to its end, scaled to sum up to the curve's length."""
    _, nodes = gmsh.model.mesh.getElementsByType(1, curve.tag)
    tags, coordinates, _ = gmsh.model.mesh.getNodes(1, curve.tag, includeBoundary=True)
    if not len(nodes):
        return np.array([curve.length])
    order = np.argsort(tags)
    rows = order[np.searchsorted(tags[order], nodes.reshape(-1, 2))]
    points = (coordinates.reshape(-1, 3)[rows] - model.origin) / model.scale
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


def _extended(model: Model, mesh: FaceMesh, curve: tuple[Float, ...]) -> Float:
    """Harmonic extension of the boundary sizes (and of point sizes inside) to all points of a background mesh."""
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
    known = count > 0
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


def _field_sizes(model: Model, meshes: tuple[FaceMesh, ...], curve: tuple[Float, ...]) -> tuple[Float, ...]:
    """Sizes at the points of every background mesh, measured on a surface mesh that Gmsh makes."""
    from ..spatial import cKDTree

    guess = sum(
        float(np.sum(_areas(mesh) / (_extended(model, mesh, curve)[mesh.triangles] ** 2).mean(axis=1))) for mesh in meshes
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
    """Centres (k, 2) and mean edge lengths (k,) of the elements on a face."""
    tags, coordinates, _ = gmsh.model.mesh.getNodes(2, face.tag, includeBoundary=True)
    order = np.argsort(tags)
    local = face.local((coordinates.reshape(-1, 3) - model.origin) / model.scale)
    centres, sizes = [np.zeros((0, 2))], [np.zeros(0)]
    for kind, corners in ((2, 3), (3, 4)):
        _, nodes = gmsh.model.mesh.getElementsByType(kind, face.tag)
        points = local[order[np.searchsorted(tags[order], nodes.reshape(-1, corners))]]
        centres.append(points.mean(axis=1))
        sizes.append(np.linalg.norm(points - np.roll(points, 1, axis=1), axis=2).mean(axis=1))
    return np.concatenate(centres), np.concatenate(sizes)
