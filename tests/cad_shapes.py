"""Meshed CAD shapes of all kinds, and their records made by hand."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import gmsh
import numpy as np

from gmsh_crossquad.cad import session
from gmsh_crossquad.field.surface_mesh import SurfaceMesh
from gmsh_crossquad.records import Curve, Face, FaceMesh, Model

SCALE = 2.5  # of all models here, not the diagonal of any
ORIGIN = np.array([0.1, -0.2, 0.3])


def records(tags: list[int]) -> tuple[Model, tuple[FaceMesh, ...]]:
    """A model of the faces `tags` and their meshes, from the mesh of the current Gmsh model; its curves are their meshes."""
    nodes, x, _ = gmsh.model.mesh.getNodes()
    place = np.zeros((int(nodes.max()) + 1, 3))
    place[nodes.astype(np.int64)] = (x.reshape(-1, 3) - ORIGIN) / SCALE
    faces, meshes = [], []
    curves: dict[int, tuple[int, Curve]] = {}
    on_curve: dict[tuple[int, int], tuple[int, float, float]] = {}
    ends: list[int] = []
    for row, tag in enumerate(tags):
        kind = gmsh.model.getType(2, tag)
        discrete = kind.startswith("Discrete")
        _, elements = gmsh.model.mesh.getElementsByType(2, tag)
        used, flat = np.unique(elements.astype(np.int64), return_inverse=True)
        points, triangles = place[used], flat.reshape(-1, 3)
        own = np.full((len(used), 2), np.nan)
        if not discrete:
            inner, _, uv = gmsh.model.mesh.getNodes(2, tag, includeBoundary=True, returnParametricCoord=True)
            inner, once = np.unique(inner, return_index=True)
            own = uv.reshape(-1, 2)[once][np.searchsorted(inner, used)]
        axes, origin = np.eye(3), np.zeros(3)
        if kind == "Plane":
            a, b, c = points[triangles[0]]
            first = (b - a) / np.linalg.norm(b - a)
            third = np.cross(first, c - a)
            axes, origin = np.stack([first, np.cross(third / np.linalg.norm(third), first)]), a
            points, own = (points - a) @ axes.T, np.zeros((0, 2))
        mesh = SurfaceMesh(points, triangles)
        half = mesh.half_edges[mesh.edge_half_edges[mesh.boundary_edge, 0]]
        for _, curve in gmsh.model.getBoundary([(2, tag)], oriented=False) if len(half) else []:
            _, flat = gmsh.model.mesh.getElementsByType(1, curve)
            if curve in curves or not len(flat):
                continue
            line = np.append(flat.reshape(-1, 2)[:, 0], flat[-1]).astype(np.int64)
            s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(place[line], axis=0), axis=1))])
            for end in (line[0], line[-1]):
                if end not in ends:
                    ends.append(int(end))
            start, end = ends.index(line[0]), ends.index(line[-1])
            curves[curve] = len(curves), Curve(curve, start, end, place[line], np.linspace(0, 1, len(line)), s)
            for k, (p, q) in enumerate(zip(line[:-1].tolist(), line[1:].tolist())):
                on_curve[p, q], on_curve[q, p] = (curves[curve][0], s[k], s[k + 1]), (curves[curve][0], s[k + 1], s[k])
        found = [on_curve[p, q] for p, q in used[half].tolist()]
        n = len(used)
        vertex = np.array([ends.index(p) if p in ends else -1 for p in used.tolist()])
        faces.append(Face(tag, origin, axes, ()))
        meshes.append(
            FaceMesh(
                row,
                points,
                triangles,
                half,
                np.array([c for c, _, _ in found], np.int64),
                np.array([(s, t) for _, s, t in found]).reshape(-1, 2),
                vertex,
                np.full(n, np.nan),
                np.zeros(n, bool),
                parameters=own,
            )
        )
    corners = np.array(ends, np.int64)
    model = Model(
        name=gmsh.model.getCurrent(),
        origin=ORIGIN,
        scale=SCALE,
        vertex_tags=np.full(len(ends), -1),
        vertices=place[corners].reshape(-1, 3),
        vertex_ports=np.zeros(len(ends), bool),
        curves=tuple(c for _, c in curves.values()),
        faces=tuple(faces),
    )
    return model, tuple(meshes)


@contextmanager
def shape(build: Callable[[], object], size: float = 0.15) -> Iterator[None]:
    """A meshed scratch model."""
    options = {"Mesh.MeshSizeMax": size, "General.Terminal": 0, "Mesh.MeshSizeFromCurvature": 0, "Mesh.Algorithm": 6}
    with session.guest(), session.options(**options), session.scratch_model():
        build()
        gmsh.model.occ.synchronize()
        gmsh.model.geo.synchronize()
        gmsh.model.mesh.generate(2)
        yield


def curved_tag() -> int:
    """The first face that is not plane."""
    return next(t for _, t in gmsh.model.getEntities(2) if gmsh.model.getType(2, t) != "Plane")


def wave() -> int:
    occ = gmsh.model.occ
    n = 5
    places = [(i / 4, j / 4, 0.3 * np.sin(0.75 * i) * np.cos(0.5 * j)) for j in range(n) for i in range(n)]
    return occ.addBSplineSurface([occ.addPoint(*p) for p in places], n)


def trimmed() -> None:
    occ = gmsh.model.occ
    surface = wave()
    wire = occ.addWire([occ.addCircle(0.5, 0.5, 0, 0.3)])
    occ.addTrimmedSurface(surface, [wire], wire3D=False)
    occ.remove([(2, surface)])


def filling(kernel: object) -> None:
    """A face with two curved sides."""
    p = [kernel.addPoint(*q) for q in [(0, 0, 0), (1, 0, 0.2), (1, 1, 0), (0, 1, 0.3)]]
    low = kernel.addSpline([p[0], kernel.addPoint(0.5, -0.1, 0.3), p[1]])
    high = kernel.addSpline([p[2], kernel.addPoint(0.5, 1.1, 0.3), p[3]])
    sides = [low, kernel.addLine(p[1], p[2]), high, kernel.addLine(p[3], p[0])]
    if kernel is gmsh.model.occ:
        kernel.addSurfaceFilling(kernel.addWire(sides))
    else:
        kernel.addSurfaceFilling([kernel.addCurveLoop(sides)])


def octant(sphere: bool) -> None:
    geo = gmsh.model.geo
    centre = geo.addPoint(0, 0, 0)
    p = [geo.addPoint(*q) for q in np.eye(3).tolist()]
    sides = [geo.addCircleArc(p[i], centre, p[(i + 1) % 3]) for i in range(3)]
    geo.addSurfaceFilling([geo.addCurveLoop(sides)], -1, centre if sphere else -1)


def profile(kernel: object, start: float = 1.0) -> int:
    return kernel.addSpline([kernel.addPoint(*q) for q in [(start, 0, 0), (1.5, 0, 0.5), (0.8, 0, 1), (1.2, 0, 1.5)]])


def turned(kernel: object, angle: float, start: float = 1.0) -> None:
    kernel.revolve([(1, profile(kernel, start))], 0, 0, 0, 0, 0, 1, angle)


def drawn() -> None:
    occ = gmsh.model.occ
    occ.extrude([(1, profile(occ))], 0, 1, 0.3)


def lofted_ring() -> None:
    """A B-spline tube, closed but for Gmsh not periodic."""
    occ = gmsh.model.occ
    rings = [occ.addCircle(0, 0, z, r) for z, r in ((0, 1.0), (0.5, 0.6), (1, 0.9))]
    occ.addThruSections([occ.addWire([c]) for c in rings], makeSolid=False)


OCC: dict[str, Callable[[], object]] = {
    "cylinder": lambda: gmsh.model.occ.addCylinder(0, 0, 0, 0, 0, 2, 0.7),
    "part of a cylinder": lambda: gmsh.model.occ.addCylinder(0, 0, 0, 0, 0, 2, 0.7, angle=1.0),
    "cone": lambda: gmsh.model.occ.addCone(0, 0, 0, 0, 0, 1, 1, 0),
    "sphere": lambda: gmsh.model.occ.addSphere(0, 0, 0, 1),
    "torus": lambda: gmsh.model.occ.addTorus(0, 0, 0, 1, 0.3),
    "B-spline": wave,
    "trimmed": trimmed,
    "filling": lambda: filling(gmsh.model.occ),
    "revolution": lambda: turned(gmsh.model.occ, 2 * np.pi),
    "quarter turn": lambda: turned(gmsh.model.occ, np.pi / 2),
    "revolution to the axis": lambda: turned(gmsh.model.occ, 2 * np.pi, 0.0),
    "extrusion": drawn,
    "tube": lofted_ring,
}
GEO: dict[str, Callable[[], object]] = {
    "ruled": lambda: filling(gmsh.model.geo),
    "ruled, three sides": lambda: octant(False),
    "in sphere": lambda: octant(True),
    "turned": lambda: turned(gmsh.model.geo, np.pi / 2),
}
EVERY = OCC | GEO
