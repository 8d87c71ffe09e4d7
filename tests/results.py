"""A hand-made result for tests: two unit squares beside each other, cut into four blocks of 3 x 2 quads."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gmsh_crossquad.field.surface_mesh import SurfaceMesh
from gmsh_crossquad.records import AlignedField, CrossField, FaceMesh, Model, QuadMesh
from gmsh_crossquad.result import MeshResult
from tests.models import two_squares

NX, NY = 3, 2
"""Quads of a block along x and y."""


@dataclass(frozen=True)
class HandMade:
    model: Model
    meshes: tuple[FaceMesh, ...]
    fields: tuple[AlignedField, ...]
    mesh: QuadMesh


def two_squares_mesh() -> QuadMesh:
    """Nodes row by row from below; blocks 0, 1 in the left square (below, above), 2, 3 in the right one."""
    columns, rows = 2 * NX, 2 * NY
    x, y = np.meshgrid(np.linspace(0, 2, columns + 1), np.linspace(0, 1, rows + 1))
    node = np.arange((columns + 1) * (rows + 1)).reshape(rows + 1, columns + 1)
    quads = np.stack([node[:-1, :-1], node[:-1, 1:], node[1:, 1:], node[1:, :-1]], axis=-1).reshape(-1, 4)
    j, i = np.divmod(np.arange(len(quads)), columns)
    face = (i >= NX).astype(np.int64)
    chains = (
        node[0, : NX + 1],
        node[0, NX:],
        node[:, -1],
        node[-1, NX:][::-1],
        node[-1, : NX + 1][::-1],
        node[:, 0][::-1],
        node[:, NX],
    )
    inner = np.zeros(node.shape, bool)
    inner[1:-1, 1:-1] = True
    inner[:, NX] = False
    side = np.broadcast_to(np.arange(columns + 1) >= NX, node.shape)
    return QuadMesh(
        points=np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1),
        quads=quads,
        quad_face=face,
        quad_block=2 * face + (j >= NY),
        vertex_node=np.array([node[0, 0], node[0, NX], node[0, -1], node[-1, -1], node[-1, NX], node[-1, 0]]),
        curve_nodes=tuple(c.copy() for c in chains),
        curve_parameters=tuple(np.linspace(0, 1, len(c)) for c in chains),
        face_nodes=(node[inner & ~side], node[inner & side]),
    )


def _face_mesh(model: Model, row: int) -> FaceMesh:
    """Four triangles around the centre of a square."""
    corners = np.array([(row, 0), (row + 1, 0), (row + 1, 1), (row, 1), (row + 0.5, 0.5)], float)
    points = model.faces[row].local((np.c_[corners, np.zeros(5)] - model.origin) / model.scale)
    ring = np.array([(0, 1), (1, 2), (2, 3), (3, 0)])
    return FaceMesh(
        face=row,
        points=points,
        triangles=np.c_[ring, [4, 4, 4, 4]],
        boundary=ring,
        boundary_curve=np.zeros(4, np.int64),
        boundary_arclength=np.zeros((4, 2)),
        vertex=np.full(5, -1),
        opening_angle=np.full(5, np.nan),
        port=np.zeros(5, bool),
    )


def hand_made() -> MeshResult:
    """The result; the crosses follow the axes, and the centre of the left square is said to have index +1."""
    model = two_squares()
    meshes = tuple(_face_mesh(model, row) for row in range(2))
    fields = []
    for row, m in enumerate(meshes):
        surface = SurfaceMesh(m.points, m.triangles)
        d = m.points[surface.edges[:, 1]] - m.points[surface.edges[:, 0]]
        index = np.array([1, 1, 1, 1, 1 if row == 0 else 0])
        field = CrossField(-np.arctan2(d[:, 1], d[:, 0]), np.zeros((4, 3)))
        fields.append(
            AlignedField(
                field,
                index,
                np.zeros(1, np.int64),
                np.zeros(1),
                0.0,
                field,
                np.zeros_like(field.theta),
                np.zeros_like(field.theta),
            )
        )
    return MeshResult(HandMade(model, meshes, tuple(fields), two_squares_mesh()), {"fill": 0.25}, ("a note",))
