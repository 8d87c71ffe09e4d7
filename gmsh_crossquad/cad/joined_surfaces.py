"""The faces of a model in which some are made of several CAD faces.

A point belongs to the nearest part of its face (`part_search`); what is asked for is then that part's (`surfaces`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..records import Bool, Face, FaceMesh, Float, Int, Model, QuadMesh
from .part_search import PartSearch
from .surfaces import CadSurfaces

__all__ = ["JoinedSurfaces", "cad_surfaces", "split"]


def cad_surfaces(model: Model, meshes: tuple[FaceMesh, ...]) -> CadSurfaces | JoinedSurfaces:
    """The faces of a model, of whatever kind.

    Parameters
    ----------
    model : Model
    meshes : tuple of FaceMesh
        One for each face.
    """
    return JoinedSurfaces(model, meshes) if any(face.parts for face in model.faces) else CadSurfaces(model, meshes)


def split(model: Model, meshes: tuple[FaceMesh, ...]) -> tuple[Model, tuple[FaceMesh, ...], Int]:
    """The model of the parts with their meshes, and for every face (and one more) the row of its first part."""
    first = np.cumsum([0, *(len(face.tags) for face in model.faces)])
    faces: list[Face] = [part for face in model.faces for part in (face.parts or (face,))]
    out = []
    for mesh in meshes:
        row = int(first[mesh.face])
        if mesh.parts is None:
            out.append(replace(mesh, face=row))
            continue
        for k, (points, triangles, parameters) in enumerate(zip(mesh.parts.points, mesh.parts.triangles, mesh.parts.parameters)):
            face = faces[row + k]
            none = np.full(len(points), -1)
            out.append(
                FaceMesh(
                    face=row + k,
                    points=face.local(points),
                    triangles=triangles,
                    boundary=np.zeros((0, 2), np.int64),
                    boundary_curve=np.zeros(0, np.int64),
                    boundary_arclength=np.zeros((0, 2)),
                    vertex=none,
                    opening_angle=np.full(len(points), np.nan),
                    port=np.zeros(len(points), bool),
                    parameters=parameters if face.curved else np.zeros((0, 2)),
                )
            )
    return replace(model, faces=tuple(faces)), tuple(out), first


@dataclass(frozen=True)
class JoinedSurfaces:
    """Faces, some of them made of parts; implements `surfaces.Surfaces`.

    Parameters
    ----------
    model : Model
    meshes : tuple of FaceMesh
        One for each face.
    """

    model: Model
    meshes: tuple[FaceMesh, ...]

    @cached_property
    def _split(self) -> tuple[CadSurfaces, Int]:
        model, meshes, first = split(self.model, self.meshes)
        return CadSurfaces(model, meshes), first

    @cached_property
    def _searches(self) -> dict[int, PartSearch]:
        inner, first = self._split
        model = self.model

        def search(mesh: FaceMesh) -> PartSearch:
            assert mesh.parts is not None
            start = int(first[mesh.face])
            return PartSearch(mesh.parts, model.origin, model.scale, lambda part, points: inner.normals(part + start, points))

        return {m.face: search(m) for m in self.meshes if m.parts is not None}

    @cached_property
    def curved(self) -> Bool:
        """(f,) True where a face is not plane."""
        return np.array([face.curved for face in self.model.faces], bool)

    def part(self, face: Int, points: Float) -> tuple[Int, Bool, Float]:
        """Rows (n,) of the parts that points of faces are nearest to, whether that is on a joint, and where there."""
        inner, first = self._split
        out, on_joint, place = first[face], np.zeros(len(face), bool), np.zeros((len(face), 3))
        for row, search in self._searches.items():
            rows = np.flatnonzero(face == row)
            if len(rows):
                with inner.current():
                    part, on_joint[rows], place[rows] = search.find(points[rows])
                out[rows] += part
        return out, on_joint, place

    def feet(self, face: Int, points: Float) -> Float:
        """Nearest points on faces; as `CadSurfaces.feet`."""
        face, points = np.asarray(face, np.int64), np.asarray(points, float)
        part, on_joint, place = self.part(face, points)
        out = self._split[0].feet(part, points)
        out[on_joint] = place[on_joint]
        return out

    def normals(self, face: Int, points: Float) -> Float:
        """Unit normals on the side of the background triangles; as `CadSurfaces.normals`."""
        face, points = np.asarray(face, np.int64), np.asarray(points, float)
        inner, first = self._split
        part = first[face]
        for row, search in self._searches.items():  # close to a joint the normals of both parts are much the same
            rows = np.flatnonzero(face == row)
            if len(rows):
                part[rows] += search.about(points[rows])[0]
        return inner.normals(part, points) * np.where(self._turned[part], -1.0, 1.0)[:, None]

    @cached_property
    def _turned(self) -> Bool:
        return np.array([f.turned for f in self._split[0].model.faces], bool)

    @cached_property
    def seed_normals(self) -> tuple[Float, ...]:
        """Unit normals (n, 3) of every face at the points of its background mesh."""
        return tuple(self.normals(np.full(len(m.points), m.face), self.model.faces[m.face].world(m.points)) for m in self.meshes)

    @cached_property
    def seed_curvatures(self) -> tuple[Float, ...]:
        """Greatest principal curvature (n,) as `CadSurfaces.seed_curvatures`; of a face of parts the greatest of those near."""
        from ..spatial import cKDTree

        inner, first = self._split
        own, out = inner.seed_curvatures, []
        for mesh in self.meshes:
            rows = range(int(first[mesh.face]), int(first[mesh.face + 1]))
            if mesh.parts is None:
                out.append(next(c for m, c in zip(inner.meshes, own) if m.face == rows.start))
                continue
            known = [c for m, c in zip(inner.meshes, own) if m.face in rows]
            near = cKDTree(np.concatenate(mesh.parts.points)).query(mesh.points, k=2)[1]  # two points are on a joint
            out.append(np.concatenate(known)[near].max(axis=1))
        return tuple(out)

    def tags(self, row: int, points: Float) -> Int:
        """Gmsh tags (n,) of the CAD faces of face `row` that points (n, 3), in the user's coordinates, are nearest to."""
        scaled = (points - self.model.origin) / self.model.scale
        out: Int = np.abs(self._tags[self.part(np.full(len(points), row), scaled)[0]])
        return out

    @cached_property
    def _tags(self) -> Int:
        return np.array([-f.tag if f.turned else f.tag for f in self._split[0].model.faces])

    def owned(self, mesh: QuadMesh) -> QuadMesh:
        """The mesh with the CAD face of every quad, that which its middle is nearest to, and of every node."""
        middle = (mesh.points[mesh.quads].mean(axis=1) - self.model.origin) / self.model.scale
        quad_tag = self._tags[self.part(mesh.quad_face, middle)[0]]
        node_tag = tuple(self.tags(row, mesh.points[nodes]) for row, nodes in enumerate(mesh.face_nodes))
        return replace(mesh, quad_tag=quad_tag, face_node_tag=node_tag)
