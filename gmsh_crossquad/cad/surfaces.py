"""The faces of the CAD model as the later stages need them: nearest points, parameters and normals.

A plane face is its plane.  On a curved face the foot of a point is found by Newton's method (`feet`), which starts at the nearest
sample (`surface_samples`); where that does not converge, or ends at a pole, where it may have gone astray, the next nearest ones
are tried, and at last Gmsh's own projection.  Normals are those of the nearest sample, turned by the curvature on the way from
it; at poles and apexes, where the CAD has none, the mean of the background triangles.  Their side is that of the background
triangles, one for each face.

Faces without a parametrization (discrete ones) are their background triangles.

Measured on one core: 10^6 feet take 2.7 s on a cylinder and 5 s on a B-spline surface of 25 control points (3,000 feet 11 and 24
milliseconds), 10^6 normals 1 s; normals are good to .3 degrees in the mean where the background triangles turn by up to 25
degrees, and worst (7 degrees) where the curvature itself changes within a triangle.  Feet are exact to rounding, on
surfaces of the built-in kernel, whose derivatives are difference quotients, to 1e-7 of the distance.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import gmsh
import numpy as np

from ..errors import MeshError
from ..records import Bool, FaceMesh, Float, Int, Model
from ..surfaces import Planes
from .charts import Charts, runs
from .facets import Facets
from .feet import newton
from .session import gmsh_errors
from .surface_samples import SurfaceSamples, surface_samples

__all__ = ["CadSurfaces"]

CHUNK = 1 << 14
TRIES = 6


@dataclass(frozen=True)
class CadSurfaces:
    """The faces of a Gmsh model; implements `surfaces.Surfaces`.

    Parameters
    ----------
    model : Model
        Gmsh's model of that name is evaluated, also while another one is current.
    meshes : tuple of FaceMesh
        One for each face, with CAD parameters on curved ones.
    """

    model: Model
    meshes: tuple[FaceMesh, ...]

    @cached_property
    def curved(self) -> Bool:
        """(f,) True where a face is not plane."""
        return self._planes.curved

    @cached_property
    def seed_normals(self) -> tuple[Float, ...]:
        """Unit normals (n, 3) of every face at the points of its background mesh."""
        return tuple(self.normals(np.full(len(m.points), m.face), self.model.faces[m.face].world(m.points)) for m in self.meshes)

    @cached_property
    def seed_curvatures(self) -> tuple[Float, ...]:
        """Greatest principal curvature (n,), scaled and absolute, of every face at the points of its background mesh.

        0 on plane faces and on those without a parametrization; at a pole or an apex that of the nearest point.
        """
        out = []
        for m in self.meshes:
            if self.curved[m.face] and self._facets[m.face] is None:
                near = self._samples.nearest(np.full(len(m.points), m.face), m.points, 1, True)[:, 0]
                out.append(self._samples.curvature[near])
            else:
                out.append(np.zeros(len(m.points)))
        return tuple(out)

    def feet(self, face: Int, points: Float) -> Float:
        """Nearest points on faces.

        Parameters
        ----------
        face : (n,) int64
            Rows of `Model.faces`.
        points : (n, 3) float64, scaled
            Near their faces: the foot is the one that is reached from the nearest point of the background mesh.

        Returns
        -------
        (n, 3) float64, scaled
            On the faces to rounding, within their range of parameters.

        Raises
        ------
        MeshError
            Where there is no foot.
        """
        face, points = np.asarray(face, np.int64), np.asarray(points, float)
        if not self.curved.any():
            return self._planes.feet(face, points)
        out = np.empty_like(points)
        for rows in self._split(face):
            on = face[rows]
            if self._facets[on[0]] is not None:
                for row, part in runs(on):
                    out[rows[part]] = self._facets[row].nearest(points[rows[part]])[0]
            elif self.curved[on[0]]:
                out[rows] = (self._foot(on, points[rows])[1] - self.model.origin) / self.model.scale
            else:
                out[rows] = self._planes.feet(on, points[rows])
        return out

    def parameters(self, face_row: int, points: Float) -> Float:
        """CAD parameters (n, 2) of the feet of points (n, 3) on a face; NaN on a face that has none.

        Raises
        ------
        MeshError
            Where there is no foot.
        """
        points = np.asarray(points, float)
        if self._facets[face_row] is not None:
            return np.full((len(points), 2), np.nan)
        tag = self.model.faces[face_row].tag
        x = self.model.origin + self.model.scale * points
        if not self.curved[face_row]:
            with self.current(), gmsh_errors("evaluating", entity=(2, tag)):
                origin, u, v = gmsh.model.getValue(2, tag, [0.0, 0.0, 1.0, 0.0, 0.0, 1.0]).reshape(3, 3)
            return np.linalg.lstsq(np.stack([u - origin, v - origin], axis=1), (x - origin).T, rcond=None)[0].T
        on = np.full(len(points), face_row)
        out = np.empty((len(points), 2))
        for rows in self._split(on):
            out[rows] = self._charts.to_user(on[rows], self._foot(on[rows], points[rows])[0])
        return out

    def normals(self, face: Int, points: Float) -> Float:
        """Unit normals on the side of the background triangles.

        Parameters
        ----------
        face : (n,) int64
        points : (n, 3) float64, scaled
            Near their faces.

        Returns
        -------
        (n, 3) float64
        """
        face, points = np.asarray(face, np.int64), np.asarray(points, float)
        if not self.curved.any():
            return self._planes.normals(face, points)
        out = np.empty_like(points)
        for rows in self._split(face):
            on, x = face[rows], points[rows]
            if self._facets[on[0]] is not None:
                for row, part in runs(on):
                    out[rows[part]] = self._facets[row].normals(x[part])
            elif self.curved[on[0]]:
                out[rows] = self._samples.normals_near(on, x)
            else:
                out[rows] = self._planes.normals(on, x)
        return out

    @cached_property
    def _planes(self) -> Planes:
        return Planes(self.model)

    @contextmanager
    def current(self) -> Iterator[None]:
        """Gmsh's model of this name current."""
        before = gmsh.model.getCurrent()
        if before == self.model.name:
            yield
            return
        gmsh.model.setCurrent(self.model.name)
        try:
            yield
        finally:
            gmsh.model.setCurrent(before)

    @cached_property
    def _facets(self) -> list[Any]:
        """The triangles of faces without a parametrization, None for others."""
        out: list[Facets | None] = [None] * len(self.model.faces)
        with self.current():
            for mesh in self.meshes:
                tag = self.model.faces[mesh.face].tag
                if self.curved[mesh.face] and (
                    not np.isfinite(mesh.parameters).any() or gmsh.model.getType(2, tag).startswith("Discrete")
                ):
                    out[mesh.face] = Facets(mesh.points, mesh.triangles)
        return out

    @cached_property
    def _charts(self) -> Charts:
        own = np.array([c and f is None for c, f in zip(self.curved, self._facets)], bool)
        with self.current():
            return Charts.read(np.array([f.tag for f in self.model.faces]), own, self.model.scale)

    def _split(self, face: Int) -> Iterator[Int]:
        """Rows of the points by face, in pieces of one kind of face: plane, parametrized, triangles."""
        kind = np.where([f is not None for f in self._facets], 2, self.curved)
        order = np.lexsort((face, kind[face]))
        for _, part in runs(kind[face[order]]):
            for a in range(part.start, part.stop, CHUNK):
                yield order[a : min(a + CHUNK, part.stop)]

    @cached_property
    def _samples(self) -> SurfaceSamples:
        with self.current():
            return surface_samples(self.model, self.meshes, self._charts)

    def _foot(self, face: Int, points: Float) -> tuple[Float, Float]:
        """Parameters (n, 2) and feet (n, 3), in the user's coordinates, of scaled points; `face` is sorted."""
        charts, samples, size = self._charts, self._samples, self.model.scale
        x = self.model.origin + size * points
        if not np.isfinite(x).all():
            row = int(np.flatnonzero(~np.isfinite(x).all(axis=1))[0])
            raise MeshError("a node has no place", entity=(2, self.model.faces[face[row]].tag), location=x[row].tolist())
        near = samples.nearest(face, points, 1, True)[:, 0]
        with self.current():
            uv, foot, good = newton(charts, face, x, samples.start[near], size)
            again = np.flatnonzero(~good | samples.at_pole(charts, face, uv))
            if not len(again):
                return uv, foot
            more = samples.nearest(face[again], points[again], TRIES, True)
            for k in range(1, TRIES):
                other = newton(charts, face[again], x[again], samples.start[more[:, k]], size)
                was, new = (np.linalg.norm(x[again] - p, axis=1) for p in (foot[again], other[1]))
                better = np.where(other[2] == good[again], new < was, other[2])
                take = again[better]
                uv[take], foot[take], good[take] = other[0][better], other[1][better], other[2][better]
            for i in np.flatnonzero(~good).tolist():
                uv[i], foot[i] = self._projected(int(face[i]), x[i])
        return uv, foot

    def _projected(self, row: int, x: Float) -> tuple[Float, Float]:
        """Parameters and foot of one point by Gmsh."""
        tag = int(self._charts.tags[row])
        try:
            with gmsh_errors("projecting a node", entity=(2, tag)):
                own = gmsh.model.getClosestPoint(2, tag, x)[1].reshape(1, 2)
        except MeshError as error:
            raise MeshError(error.what, entity=(2, tag), location=x.tolist(), remedy="mesh this surface more finely") from error
        on = np.full(1, row)
        uv = self._charts.from_user(on, own)
        foot = self._charts.values(on, uv)
        if not np.isfinite(foot).all():
            raise MeshError(
                "a node cannot be moved to its surface", entity=(2, tag), location=x.tolist(), remedy="mesh it more finely"
            )
        return uv[0], foot[0]
