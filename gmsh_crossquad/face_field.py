"""The cross field of a face as the user sees it: in the model's coordinates, with the parts that it is made of."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from .field.surface_mesh import SurfaceMesh, surface_of
from .records import AlignedField, FaceMesh, Float, Int, Model

__all__ = ["FaceField", "Singularity", "face_field", "singularities_of"]


@dataclass(frozen=True)
class Singularity:
    """A point where the cross field turns by a multiple of a quarter.

    Attributes
    ----------
    point : (3,) float64
    index : int
        Quarter turns: +1 where three blocks meet, -1 where five do.
    face : int
        Gmsh tag of the CAD face.
    """

    point: Float
    index: int
    face: int

    @property
    def valence(self) -> int:
        """Number of blocks around it."""
        return 4 - self.index


@dataclass(frozen=True)
class FaceField:
    """The cross field of one CAD face.

    The aligned field v is the given field u turned by phi and psi; at every edge ``v = u + phi + psi`` modulo a quarter turn.

    Attributes
    ----------
    face : int
        Gmsh tag.
    points : (n, 3) float64; triangles : (m, 3) int64
        Background mesh.
    edges : (e, 2) int64
        Its edges, lower vertex first.
    places : (e, 3) float64
        Their midpoints, where the crosses sit.
    directions, given : (e, 3) float64
        Unit vector of one arm of every cross of v and of u; the others are at quarter turns about `normal`.
    normal : (3,) float64, on a curved face (e, 3)
        Unit normal, of a curved face at every edge.
    phi, psi : (e,) float64
        Radians.  psi vanishes on the boundary and has jumps of quarter turns; phi has none.
    theta : (e,) float64
        Angle of v from the edge, modulo a quarter turn.
    rotation : (m, 3) float64
        Rotation of v from edge k to edge k + 1 of every triangle; all integers live here.
    index : (n,) int64
        Index of v at every vertex in quarter turns; 0 where it is regular, at boundary vertices 2 minus the number of blocks.
    periods : (loops,) int64
        Free integer of every boundary loop in quarter turns (0 for the first).
    flux : (loops,) float64
        Closed integral of the normal derivative of the angle of v around every loop.
    residual : float
        Greatest misalignment on the boundary, radians.
    seeds : (k, 3) float64
        Singular points that are vertices of the background because the user set them.
    """

    face: int
    points: Float
    triangles: Int
    edges: Int
    places: Float
    directions: Float
    given: Float
    normal: Float
    phi: Float
    psi: Float
    theta: Float
    rotation: Float
    index: Int
    periods: Int
    flux: Float
    residual: float
    seeds: Float

    @property
    def curved(self) -> bool:
        """Whether the face has another normal at every edge."""
        return self.normal.ndim == 2

    @property
    def normals(self) -> Float:
        """(e, 3) unit normals at the edges."""
        return np.broadcast_to(self.normal, self.directions.shape)

    @cached_property
    def surface(self) -> SurfaceMesh:
        """The background mesh with its topology."""
        return SurfaceMesh(self.points, self.triangles)

    @cached_property
    def triangle_arms(self) -> Float:
        """(m, 3) unit vector of one arm of the cross in every triangle: its fourth power is the mean over the three edges."""
        edges = self.surface.triangle_edges
        if self.curved:
            x, y = self.triangle_axes
            arms = self.directions[edges]
            fourth = (np.einsum("tkc,tc->tk", arms, x) + 1j * np.einsum("tkc,tc->tk", arms, y)) ** 4
        else:
            x = self.directions[0]
            y = np.cross(self.normal, x)
            fourth = ((self.directions @ x + 1j * (self.directions @ y)) ** 4)[edges]
        angle = np.angle(fourth.sum(axis=1)) / 4
        return np.cos(angle)[:, None] * x + np.sin(angle)[:, None] * y

    @property
    def triangle_normals(self) -> Float:
        """(m, 3) unit normals of the triangles."""
        own = self.surface.triangle_normal if self.curved else None
        return np.broadcast_to(self.normal, (len(self.triangles), 3)) if own is None else own

    @property
    def triangle_axes(self) -> tuple[Float, Float]:
        """Unit vectors (m, 3) along the first side of every triangle, and a quarter turn counter-clockwise of it."""
        a, b = self.points[self.triangles[:, 0]], self.points[self.triangles[:, 1]]
        x = (b - a) / np.linalg.norm(b - a, axis=1)[:, None]
        return x, np.cross(self.triangle_normals, x)

    @property
    def summary(self) -> str:
        """One line: singularities, flux around the holes, misalignment."""
        inside = singularities_of(self)
        count = {sign: sum(s.index * sign > 0 for s in inside) for sign in (1, -1)}
        flux = ", ".join(f"{f:.3g}" for f in self.flux[1:])
        around = f", flux around holes {flux}" if flux else ""
        return (
            f"surface {self.face}: {len(self.triangles)} triangles, singularities {count[1]} of positive and {count[-1]} of "
            f"negative index{around}, misaligned by {self.residual:.1g}"
        )


def face_field(model: Model, mesh: FaceMesh, aligned: AlignedField) -> FaceField:
    """The field of a face in the user's coordinates."""
    face = model.faces[mesh.face]
    surface = surface_of(mesh)
    a, b = mesh.points[surface.edges[:, 0]], mesh.points[surface.edges[:, 1]]
    own = surface.edge_normal if face.curved else None
    normal = face.normal if own is None else own

    def world(local: Float) -> Float:
        out: Float = model.origin + model.scale * face.world(local)
        return out

    def arms(theta: Float) -> Float:
        if own is not None:
            x = (b - a) / surface.edge_length[:, None]
            return np.cos(theta)[:, None] * x + np.sin(theta)[:, None] * np.cross(own, x)
        angle = np.arctan2(b[:, 1] - a[:, 1], b[:, 0] - a[:, 0]) + theta
        out: Float = np.stack([np.cos(angle), np.sin(angle)], axis=1) @ face.axes
        return out

    return FaceField(
        face=face.tag,
        points=world(mesh.points),
        triangles=mesh.triangles,
        edges=surface.edges,
        places=world(0.5 * (a + b)),
        directions=arms(aligned.field.theta),
        given=arms(aligned.given.theta),
        normal=normal,
        phi=aligned.phi,
        psi=aligned.psi,
        theta=aligned.field.theta,
        rotation=aligned.field.rotation,
        index=aligned.index,
        periods=aligned.periods,
        flux=aligned.flux,
        residual=aligned.residual,
        seeds=world(mesh.points[mesh.seed >= 0]),
    )


def singularities_of(field: FaceField) -> list[Singularity]:
    """The singularities inside a face."""
    boundary = np.zeros(len(field.points), bool)
    boundary[field.edges[field.surface.boundary_edge].ravel()] = True
    rows = np.flatnonzero(~boundary & (field.index != 0))
    return [Singularity(field.points[v], int(field.index[v]), field.face) for v in rows.tolist()]
