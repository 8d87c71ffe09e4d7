"""The triangles and the cross field of one face, laid out for tracing.

Inside a triangle the angle of the cross is the linear function through its Crouzeix–Raviart values at the edge midpoints.
Its four directions are counted by a *branch* ``b`` modulo 4: direction = angle + b pi/2.  Branches in neighbouring triangles
differ by a whole number (`shift`, from the value they share at the midpoint of the edge), and the direction of a boundary
half-edge is a branch (`wall`).  The tracer decides about families, sides and ends with these integers alone.

An edge that joins two seeds (singularities, corners, ports) is bisected, so that no triangle holds two of them:
separatrices that start in one triangle at two of its vertices could not pass one another.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..errors import LayoutError
from ..field.surface_mesh import SurfaceMesh
from ..records import AlignedField, Bool, FaceMesh

__all__ = ["QUARTER", "TraceMesh", "next_of", "previous_of", "trace_mesh"]

QUARTER = 0.5 * np.pi


def next_of(h: int) -> int:
    """Next half-edge of the triangle."""
    return h + 1 if h % 3 < 2 else h - 2


def previous_of(h: int) -> int:
    """Previous half-edge of the triangle."""
    return h - 1 if h % 3 > 0 else h + 2


@dataclass
class TraceMesh:
    """Plain lists, one entry per half-edge ``h = 3 t + k``, since the tracer reads single numbers.

    Attributes
    ----------
    points : list of coordinates
        Vertices; those of the face's mesh first.
    start : list of int
        Vertex where a half-edge starts.
    x, y : list of float
        Its place in the plane layout of the triangle.
    value : list of float
        Angle of the cross there, as seen in this triangle.
    twin : list of int
        Opposite half-edge, -1 on the boundary.
    shift : list of int
        Branch in the neighbour minus branch here.
    wall : list of int
        Branch of a boundary half-edge's direction, -1 inside.
    gate : list of int
        Branches (bits) that may leave the triangle through a half-edge.
    row : list of int
        Row of `FaceMesh.boundary` that a boundary half-edge is part of, -1 inside.
    span : list of (float, float)
        The part of that row, as fractions.
    on_boundary : list of bool
        Per vertex.
    ex, ey, ux, uy : list of float
        Vector of the half-edge, and of unit length.
    constant, gx, gy : list of float
        Per triangle: angle = constant + gx x + gy y.
    """

    points: list[list[float]]
    start: list[int]
    x: list[float]
    y: list[float]
    value: list[float]
    twin: list[int]
    shift: list[int]
    wall: list[int]
    gate: list[int]
    row: list[int]
    span: list[tuple[float, float]]
    on_boundary: list[bool] = field(default_factory=list)
    ex: list[float] = field(default_factory=list)
    ey: list[float] = field(default_factory=list)
    ux: list[float] = field(default_factory=list)
    uy: list[float] = field(default_factory=list)
    constant: list[float] = field(default_factory=list)
    gx: list[float] = field(default_factory=list)
    gy: list[float] = field(default_factory=list)

    def star(self, h: int) -> list[int]:
        """Half-edges that start at the start of `h`, counter-clockwise from `h`, one per triangle.

        At a boundary vertex `h` must be the boundary half-edge.
        """
        out = [h]
        while len(out) <= len(self.start):
            g = self.twin[previous_of(out[-1])]
            if g < 0 or g == h:
                return out
            out.append(g)
        raise LayoutError("the background mesh is not manifold", location=self.points[self.start[h]])

    def point(self, h: int, s: float) -> list[float]:
        """Point at fraction `s` of half-edge `h`."""
        a, b = self.points[self.start[h]], self.points[self.start[next_of(h)]]
        return [(1.0 - s) * p + s * q for p, q in zip(a, b)]


def trace_mesh(mesh: FaceMesh, surface: SurfaceMesh, aligned: AlignedField, seed: Bool) -> TraceMesh:
    """Lay a face out for tracing.

    Parameters
    ----------
    mesh : FaceMesh
    surface : SurfaceMesh
        Of the same points and triangles.
    aligned : AlignedField
    seed : (n,) bool
        Vertices where separatrices start or corners are: no edge of the result joins two of them.

    Raises
    ------
    LayoutError
        If the field does not fit together across an edge, or is not aligned with the boundary.
    """
    theta, rotation = aligned.field.theta, aligned.field.rotation
    first = theta[surface.triangle_edges[:, 0]] + surface.edge_direction[:, 0]
    angle = np.stack([first, first + rotation[:, 0], first + rotation[:, 0] + rotation[:, 1]], axis=1)
    flat, twin = angle.ravel(), surface.twin
    relative = flat - surface.edge_direction.ravel()
    jump = np.where(twin >= 0, relative - relative[twin], 0.0) / QUARTER
    along = np.where(twin < 0, surface.half_edge_direction.ravel() - flat, 0.0) / QUARTER
    shift, wall = np.rint(jump), np.rint(along)
    off = np.maximum(np.abs(jump - shift), np.abs(along - wall))
    if off.max() > 1e-3:
        t = int(off.argmax()) // 3
        raise LayoutError(
            "the cross field does not fit together or is not aligned with the boundary",
            location=mesh.points[mesh.triangles[t]].mean(axis=0),
            remedy="align the field first",
        )
    row = np.full(len(twin), -1, np.int64)
    row[surface.outgoing_boundary[mesh.boundary[:, 0]]] = np.arange(len(mesh.boundary))
    # value at a corner = the two adjacent midpoints minus the opposite one
    value = angle + np.roll(angle, 1, axis=1) - np.roll(angle, -1, axis=1)
    out = TraceMesh(
        points=mesh.points.tolist(),
        start=mesh.triangles.ravel().tolist(),
        x=surface.layout[..., 0].ravel().tolist(),
        y=surface.layout[..., 1].ravel().tolist(),
        value=value.ravel().tolist(),
        twin=twin.tolist(),
        shift=(shift.astype(np.int64) % 4).tolist(),
        wall=np.where(twin < 0, wall.astype(np.int64) % 4, -1).tolist(),
        gate=np.where(twin < 0, 1 << (wall.astype(np.int64) + 3) % 4, 15).tolist(),
        row=row.tolist(),
        span=[(0.0, 1.0)] * len(twin),
    )
    crowded = seed[mesh.triangles].sum(axis=1) > 1
    seeds = set(np.flatnonzero(seed).tolist())
    _separate(out, seeds, np.flatnonzero(crowded).tolist())
    _guard_boundary(out, seeds)
    _prepare(out)
    return out


def _separate(mesh: TraceMesh, seeds: set[int], crowded: list[int]) -> None:
    """Bisect every edge of the triangles `crowded` that joins two seeds."""
    while crowded:
        t = crowded.pop()
        for h in range(3 * t, 3 * t + 3):
            if mesh.start[h] in seeds and mesh.start[next_of(h)] in seeds:
                crowded += _bisect(mesh, h)
                break


def _bisect(mesh: TraceMesh, h: int) -> list[int]:
    """Bisect the edge of half-edge `h`; returns the triangles that were changed or made."""
    middle = len(mesh.points)
    mesh.points.append(mesh.point(h, 0.5))
    g = mesh.twin[h]
    near = _bisect_triangle(mesh, h, middle)
    if g < 0:
        mesh.twin[near[0]] = mesh.twin[near[1]] = -1
        return [near[0] // 3, near[1] // 3]
    far = _bisect_triangle(mesh, g, middle)
    for a, b in ((near[0], far[1]), (near[1], far[0])):
        mesh.twin[a], mesh.twin[b] = b, a
    return [q // 3 for q in near + far]


def _bisect_triangle(mesh: TraceMesh, h: int, middle: int) -> tuple[int, int]:
    """Cut a triangle from the middle of `h` to the opposite corner; returns the two halves of `h`.

    The first half keeps the number `h`; a triangle at the end of the lists gets the second.
    """
    n, p = next_of(h), previous_of(h)
    new = len(mesh.start)
    half, following, back = new, new + 1, new + 2
    for data, mid in (
        (mesh.x, 0.5 * (mesh.x[h] + mesh.x[n])),
        (mesh.y, 0.5 * (mesh.y[h] + mesh.y[n])),
        (mesh.value, 0.5 * (mesh.value[h] + mesh.value[n])),
    ):
        data += [mid, data[n], data[p]]
        data[n] = mid
    mesh.start += [middle, mesh.start[n], mesh.start[p]]
    mesh.start[n] = middle
    lo, hi = mesh.span[h]
    mesh.span += [(0.5 * (lo + hi), hi), mesh.span[n], (0.0, 1.0)]
    mesh.span[h], mesh.span[n] = (lo, 0.5 * (lo + hi)), (0.0, 1.0)
    for data_, inner in ((mesh.shift, 0), (mesh.wall, -1), (mesh.gate, 15), (mesh.row, -1)):
        data_ += [data_[h], data_[n], inner]
        data_[n] = inner
    outer = mesh.twin[n]
    mesh.twin += [-1, outer, n]
    mesh.twin[n] = back
    if outer >= 0:
        mesh.twin[outer] = following
    return h, half


def _guard_boundary(mesh: TraceMesh, seeds: set[int]) -> None:
    """Gates at the spokes of regular boundary vertices: what runs along the boundary passes them, it does not turn back there."""
    for h, wall in enumerate(mesh.wall):
        if wall < 0 or mesh.start[h] in seeds:
            continue
        along = wall
        for g in mesh.star(h)[1:]:
            mesh.gate[mesh.twin[g]] &= ~(1 << along)
            along = (along + mesh.shift[mesh.twin[g]]) % 4
            mesh.gate[g] &= ~(1 << (along + 2) % 4)


def _prepare(mesh: TraceMesh) -> None:
    """Edge vectors, the linear function of every triangle, and vertices on the boundary."""
    mesh.on_boundary = [False] * len(mesh.points)
    for start, wall in zip(mesh.start, mesh.wall):
        mesh.on_boundary[start] |= wall >= 0
    x, y, v = (np.array(a).reshape(-1, 3) for a in (mesh.x, mesh.y, mesh.value))
    ex, ey = np.roll(x, -1, axis=1) - x, np.roll(y, -1, axis=1) - y
    length = np.hypot(ex, ey)
    twice_area = ex[:, 0] * -ey[:, 2] + ey[:, 0] * ex[:, 2]
    # gradient of the barycentric coordinate of a corner = opposite edge turned by a quarter, over twice the area
    gx = -(v * np.roll(ey, -1, axis=1)).sum(axis=1) / twice_area
    gy = (v * np.roll(ex, -1, axis=1)).sum(axis=1) / twice_area
    mesh.ex, mesh.ey = ex.ravel().tolist(), ey.ravel().tolist()
    mesh.ux, mesh.uy = (ex / length).ravel().tolist(), (ey / length).ravel().tolist()
    mesh.gx, mesh.gy = gx.tolist(), gy.tolist()
    mesh.constant = (v[:, 0] - gx * x[:, 0] - gy * y[:, 0]).tolist()
