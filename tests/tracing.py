"""Meshes and fields for the tests of tracing, and checks of what must hold for every T-mesh."""

from __future__ import annotations

import itertools

import numpy as np

from gmsh_crossquad.field.surface_mesh import SurfaceMesh
from gmsh_crossquad.records import CrossField, FaceMesh, FaceTMesh, Float, Int


def face_mesh(points: Float, triangles: Int, corners: Int) -> FaceMesh:
    """A face mesh whose boundary is one curve, with CAD vertices at `corners`."""
    surface = SurfaceMesh(np.asarray(points, float), np.asarray(triangles, np.int64))
    boundary = surface.half_edges[surface.edge_half_edges[surface.boundary_edge, 0]]
    vertex = np.full(len(points), -1, np.int64)
    vertex[corners] = np.arange(len(corners))
    return FaceMesh(
        face=0,
        points=surface.points,
        triangles=surface.triangles,
        boundary=boundary,
        boundary_curve=np.zeros(len(boundary), np.int64),
        boundary_arclength=np.tile([0.0, 1.0], (len(boundary), 1)),
        vertex=vertex,
        opening_angle=np.where((vertex >= 0) & surface.boundary_vertex, surface.angle_sum, np.nan),
        port=np.zeros(len(points), bool),
    )


def polygon_mesh(n: int, divisions: int, turn: float = 0.0, order: Int | None = None) -> FaceMesh:
    """A regular n-gon with its centre a vertex: n sectors, `divisions` squared triangles each."""
    corners = turn + 2 * np.pi * np.arange(n) / n
    ring = np.stack([np.cos(corners), np.sin(corners)], axis=1)
    points: list[Float] = [np.zeros(2)]
    index: dict[tuple[int, int], int] = {(0, 0): 0}
    for layer in range(1, divisions + 1):
        for k in range(n * layer):
            sector, step = divmod(k, layer)
            a, b = ring[sector], ring[(sector + 1) % n]
            index[layer, k] = len(points)
            points.append((a * (layer - step) + b * step) / divisions)
    triangles = _fill_sectors(index, n, divisions)
    xy, cells = np.array(points), np.array(triangles)
    first = np.array([index[divisions, divisions * s] for s in range(n)])
    if order is None:
        return face_mesh(xy, cells, first)
    to = np.empty(len(xy), np.int64)
    to[order] = np.arange(len(xy))
    return face_mesh(xy[order], to[cells], to[first])


def _fill_sectors(index: dict[tuple[int, int], int], n: int, divisions: int) -> list[tuple[int, int, int]]:
    """Triangles of all sectors."""
    out = []
    for s in range(n):

        def at(layer: int, step: int, s: int = s) -> int:
            return index[layer, (s * layer + step) % (n * layer)] if layer else 0

        for layer in range(divisions):
            for step in range(layer + 1):
                out.append((at(layer, step), at(layer + 1, step), at(layer + 1, step + 1)))
                if step < layer:
                    out.append((at(layer, step), at(layer + 1, step + 1), at(layer, step + 1)))
    return out


def field_of(mesh: FaceMesh, angle: Float) -> CrossField:
    """The cross field with the given angles at the edge midpoints."""
    surface = SurfaceMesh(mesh.points, mesh.triangles)
    edge = mesh.points[surface.edges[:, 1]] - mesh.points[surface.edges[:, 0]]
    theta = angle - np.arctan2(edge[:, 1], edge[:, 0])
    local = theta[surface.triangle_edges] + surface.edge_direction
    rotation = np.roll(local, -1, axis=1) - local
    return CrossField(theta, rotation - 0.5 * np.pi * np.round(rotation / (0.5 * np.pi)))


def midpoints(mesh: FaceMesh) -> Float:
    """Edge midpoints (e, 2)."""
    return mesh.points[SurfaceMesh(mesh.points, mesh.triangles).edges].mean(axis=1)


def check_tmesh(mesh: FaceMesh, index: Int, tmesh: FaceTMesh) -> None:
    """All that holds for every T-mesh, whatever the field."""
    surface = SurfaceMesh(mesh.points, mesh.triangles)
    uses: dict[tuple[int, int], int] = {}
    quads = np.zeros(len(tmesh.position), np.int64)
    area = 0.0
    for patch in tmesh.patches:
        assert len(patch) == 4 and all(patch)
        nodes = [tmesh.arcs[arc][0 if way > 0 else 1] for side in patch for arc, way in side]
        ends = [tmesh.arcs[arc][1 if way > 0 else 0] for side in patch for arc, way in side]
        assert ends == nodes[1:] + nodes[:1]
        for side in patch:
            arc, way = side[0]
            quads[tmesh.arcs[arc][0 if way > 0 else 1]] += 1
            for half in side:
                uses[half] = uses.get(half, 0) + 1
            for arc, way in side[1:]:
                quads[tmesh.arcs[arc][0 if way > 0 else 1]] += 2
        for arc, way in itertools.chain.from_iterable(patch):
            p = tmesh.polyline[arc][::way]
            area += 0.5 * float(np.sum(p[:-1, 0] * p[1:, 1] - p[1:, 0] * p[:-1, 1]))
    on_boundary = tmesh.loop >= 0
    for arc in range(len(tmesh.arcs)):
        assert uses.get((arc, 1), 0) == 1
        assert uses.get((arc, -1), 0) == (0 if on_boundary[arc] else 1)
    expected = np.where(tmesh.half_edge >= 0, 2, 4) - np.where(tmesh.vertex >= 0, index[tmesh.vertex], 0)
    assert quads.tolist() == expected.tolist()
    assert set(np.flatnonzero(index).tolist()) <= set(tmesh.vertex.tolist())
    assert len(tmesh.position) - len(tmesh.arcs) + len(tmesh.patches) == surface.euler
    assert abs(area - surface.area.sum()) < 1e-9 * surface.area.sum()
    for arc, (a, b) in enumerate(tmesh.arcs):
        assert np.array_equal(tmesh.polyline[arc][[0, -1]], tmesh.position[[a, b]])
        assert np.isclose(tmesh.length[arc], np.linalg.norm(np.diff(tmesh.polyline[arc], axis=0), axis=1).sum())
    for node in np.flatnonzero(tmesh.half_edge >= 0):
        a, b = mesh.points[mesh.boundary[tmesh.half_edge[node]]]
        s = tmesh.half_edge_fraction[node]
        assert 0.0 <= s < 1.0 and np.allclose((1 - s) * a + s * b, tmesh.position[node], atol=1e-12)


def crossings(tmesh: FaceTMesh) -> int:
    """Number of proper crossings between segments of traces: 0 in a planar map."""
    lines = [p for p, loop in zip(tmesh.polyline, tmesh.loop) if loop < 0]
    if not lines:
        return 0
    a, b = np.concatenate([p[:-1] for p in lines]), np.concatenate([p[1:] for p in lines])

    def side(p: Float, q: Float, r: Float) -> Float:
        u, v = q - p, r - p
        cross = u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]
        return np.where(np.abs(cross) < 1e-13, 0.0, np.sign(cross))

    first = side(a[:, None], b[:, None], a[None]) * side(a[:, None], b[:, None], b[None]) < 0
    return int((first & first.T).sum()) // 2
