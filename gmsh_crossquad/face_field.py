"""The cross field of a face as the user sees it: in the model's coordinates, with the parts that it is made of."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .field.surface_mesh import SurfaceMesh
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
    normal : (3,) float64
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
    surface = SurfaceMesh(mesh.points, mesh.triangles)
    a, b = mesh.points[surface.edges[:, 0]], mesh.points[surface.edges[:, 1]]
    along = np.arctan2(b[:, 1] - a[:, 1], b[:, 0] - a[:, 0])

    def world(local: Float) -> Float:
        out: Float = model.origin + model.scale * face.world(local)
        return out

    def arms(theta: Float) -> Float:
        angle = along + theta
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
        normal=np.cross(face.axes[0], face.axes[1]),
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
    boundary[field.edges[SurfaceMesh(field.points, field.triangles).boundary_edge].ravel()] = True
    rows = np.flatnonzero(~boundary & (field.index != 0))
    return [Singularity(field.points[v], int(field.index[v]), field.face) for v in rows.tolist()]
