"""Models with one curved face, whose CAD is a triangulated surface itself: curves are its boundary, cut at corners."""

from __future__ import annotations

import itertools

import numpy as np

from gmsh_crossquad.field.surface_mesh import SurfaceMesh
from gmsh_crossquad.records import Curve, Face, FaceMesh, Float, Int, Model


def model_of(surface: SurfaceMesh, kink: float = np.radians(25.0)) -> tuple[Model, FaceMesh]:
    """The model and the background mesh of a surface.

    CAD vertices are boundary points whose angle differs from pi by more than `kink`, or the first point of a loop without any.
    """
    low, high = surface.points.min(axis=0), surface.points.max(axis=0)
    origin, scale = 0.5 * (low + high), float(np.linalg.norm(high - low))
    points = (surface.points - origin) / scale
    vertex = np.full(len(points), -1, np.int64)
    opening = np.full(len(points), np.nan)
    tags: list[int] = []
    curves: list[Curve] = []
    loops: list[tuple[tuple[int, int], ...]] = []
    boundary: list[tuple[int, int]] = []
    boundary_curve: list[int] = []
    boundary_arclength: list[Float] = []
    for loop in surface.loops:
        corners = np.flatnonzero(np.abs(surface.angle_sum[loop] - np.pi) > kink)
        sharp = len(corners) > 0
        corners = corners if sharp else np.zeros(1, np.int64)
        around = np.roll(loop, -corners[0])
        stops = np.append(corners - corners[0], len(loop))
        first = len(tags)
        for k in stops[:-1]:
            vertex[around[k]] = len(tags)
            opening[around[k]] = surface.angle_sum[around[k]] if sharp else np.pi
            tags.append(int(around[k]))
        mine = []
        for i, (a, b) in enumerate(itertools.pairwise(stops)):
            rows = around[np.arange(a, b + 1) % len(loop)]
            s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points[rows], axis=0), axis=1))])
            end = first + (i + 1) % (len(stops) - 1)
            mine.append((len(curves), 1))
            boundary += list(zip(rows[:-1].tolist(), rows[1:].tolist()))
            boundary_curve += [len(curves)] * (len(rows) - 1)
            boundary_arclength.append(np.stack([s[:-1], s[1:]], axis=1))
            curves.append(Curve(len(curves) + 1, first + i, end, points[rows], np.linspace(0, 1, len(rows)), s))
        loops.append(tuple(mine))
    model = Model(
        name="surface",
        origin=origin,
        scale=scale,
        vertex_tags=np.arange(1, len(tags) + 1),
        vertices=points[tags].reshape(-1, 3),
        vertex_ports=np.zeros(len(tags), bool),
        curves=tuple(curves),
        faces=(Face(1, np.zeros(3), np.eye(3), tuple(loops)),),
    )
    rows: Int = np.array(boundary, np.int64).reshape(-1, 2)
    mesh = FaceMesh(
        face=0,
        points=points,
        triangles=surface.triangles,
        boundary=rows,
        boundary_curve=np.array(boundary_curve, np.int64),
        boundary_arclength=np.concatenate([*boundary_arclength, np.zeros((0, 2))]),
        vertex=vertex,
        opening_angle=opening,
        port=np.zeros(len(points), bool),
    )
    return model, mesh
