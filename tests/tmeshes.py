"""Hand-made T-meshes for tests."""

from __future__ import annotations

import numpy as np

from gmsh_crossquad.layout.glue import glue
from gmsh_crossquad.records import FaceMesh, FaceTMesh, Model, TMesh
from tests import models


def coarse_face(model: Model, triangles: list[tuple[int, int, int]], opening: list[float]) -> FaceMesh:
    """The face of a polygon model as a background mesh whose points are the CAD vertices."""
    n = len(model.vertices)
    loop = model.faces[0].loops[0]
    boundary = np.array([[model.curves[c].start, model.curves[c].end] for c, _ in loop])
    return FaceMesh(
        face=0,
        points=model.faces[0].local(model.vertices),
        triangles=np.array(triangles),
        boundary=boundary,
        boundary_curve=np.array([c for c, _ in loop]),
        boundary_arclength=np.array([[0.0, model.curves[c].length] for c, _ in loop]),
        vertex=np.arange(n),
        opening_angle=np.array(opening),
        port=np.zeros(n, bool),
    )


def l_shape() -> tuple[Model, TMesh]:
    """Three unit squares in an L; the re-entrant corner (1, 1) sends one trace to (1, 0) and one to (0, 1)."""
    model = models.l_shape()
    right = np.pi / 2
    mesh = coarse_face(model, [(0, 1, 3), (1, 2, 3), (0, 3, 5), (3, 4, 5)], [right, right, right, 3 * right, right, right])
    local = model.faces[0].local(model.vertices)
    bottom, left = 0.5 * (local[0] + local[1]), 0.5 * (local[5] + local[0])
    position = np.concatenate([local, [bottom, left]])
    # nodes: 0 (0,0)  1 (2,0)  2 (2,1)  3 (1,1)  4 (1,2)  5 (0,2)  6 (1,0)  7 (0,1)
    arcs = [(0, 6), (6, 1), (1, 2), (2, 3), (3, 4), (4, 5), (5, 7), (7, 0), (3, 6), (3, 7)]
    unit = float(np.linalg.norm(local[2] - local[1]))
    patches = (
        (((0, 1),), ((8, -1),), ((9, 1),), ((7, 1),)),
        (((1, 1),), ((2, 1),), ((3, 1),), ((8, 1),)),
        (((9, -1),), ((4, 1),), ((5, 1),), ((6, 1),)),
    )
    tmesh = FaceTMesh(
        face=0,
        position=position,
        vertex=np.array([0, 1, 2, 3, 4, 5, -1, -1]),
        index=np.array([1, 1, 1, -1, 1, 1, 0, 0]),
        half_edge=np.array([0, 1, 2, 3, 4, 5, 0, 5]),
        half_edge_fraction=np.array([0, 0, 0, 0, 0, 0, 0.5, 0.5]),
        arcs=np.array(arcs),
        length=np.full(len(arcs), unit),
        polyline=tuple(position[[a, b]] for a, b in arcs),
        loop=np.array([0] * 8 + [-1, -1]),
        patches=patches,
    )
    return model, glue(model, [mesh], [tmesh])
