"""A cross field with given singularities, in closed form:

    u(z) = prod ((z - a_i) / |z - a_i|)^(d_i / 4),

the cross of angle ``sum d_i / 4 arg(z - a_i)``, with the index d_i / 4 at every a_i (formula (2) of "Quadrilateral mesh of
non-simply connected domain and non-planar surfaces from a given cross-field").

The rotation within a triangle is exact.  Between two edge midpoints arg(z - a_i) changes by an angle in (-pi, pi), taken from
the cross and dot product of the two differences; the sum is never wrapped.  So any d_i is right, however large,
and every index is exactly where its point is: at a vertex, or in the triangle around the point.  (The midpoints' triangle is
a quarter of the whole one; for a point in one of the other quarters the formula puts the index at that corner.  It stays there
at an interior vertex and goes back to the triangle at a boundary vertex, where it would be lost.)

A point outside the face adds to the degree along the boundary loops only.

A curved face has no such formula: there the field is the smoothest one with these singularities (`prescribed`), at vertices of
the background mesh that were put there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from ..errors import FieldError
from ..records import CrossField, Float, Int
from .plane import Plane, extent, plane_of

if TYPE_CHECKING:
    from ..field.edge_frames import EdgeFrames
    from ..field.surface_mesh import SurfaceMesh

__all__ = ["Singularities"]

Complex = npt.NDArray[np.complex128]

#: a singularity nearer to the boundary, or to an edge midpoint, than this (times the extent of the face) is on it
_TOUCH = 1e-9
#: a point farther from a face's plane than this (times the extent of the face) is none of the face's
_OFF_PLANE = 1e-6
#: the same for a curved face; and the greatest sine of the angle between the way to its foot and the normal there
_OFF_SURFACE = 0.02
_FOOT = 0.4


@dataclass(frozen=True, eq=False)
class Singularities:
    """The field of formula (2).

    Parameters
    ----------
    positions : (k, 2) or (k, 3) array_like
        In the user's coordinates.  With two coordinates, or a third one of NaN, a point is on the face whatever its height.
        A point beside the plane of a face does not act on that face.  On a curved face three coordinates are needed; it takes
        the points that are nearer to it than to other faces, and than a hundredth of its size.
    quarters : (k,) array_like of int
        Indices in quarter turns, of any sign and size.  Those of equal points add up.

    Raises
    ------
    FieldError
        For wrong shapes, coordinates that are not finite and indices that are not whole.
    """

    positions: Float
    quarters: Int

    def __init__(self, positions: Sequence[Sequence[float]] | Float, quarters: Sequence[int] | Int) -> None:
        p, q = _array(positions, "positions"), _array(quarters, "indices")
        if p.size == 0:
            p = p.reshape(0, 3)
        if p.ndim != 2 or p.shape[1] not in (2, 3):
            raise FieldError(f"singularities have positions of shape {p.shape}", remedy="give two or three coordinates for each")
        if q.shape != (len(p),):
            raise FieldError(f"{len(p)} singularities have indices of shape {q.shape}", remedy="give one index for each")
        if p.shape[1] == 2:
            p = np.concatenate([p, np.full((len(p), 1), np.nan)], axis=1)
        wrong = ~np.isfinite(p[:, :2]).all(axis=1) | np.isinf(p[:, 2])
        if np.any(wrong):
            raise FieldError(f"singularity {np.flatnonzero(wrong)[0] + 1} has coordinates that are no finite numbers")
        wrong = ~(np.isfinite(q) & (np.abs(q) < 2**31) & (q == np.rint(q)))
        if np.any(wrong):
            i = np.flatnonzero(wrong)[0]
            raise FieldError(
                f"a singularity has the index {q[i]:g}", location=_known(p[i]), remedy="give whole quarter turns (1 for 1/4)"
            )
        object.__setattr__(self, "positions", p)
        object.__setattr__(self, "quarters", np.rint(q).astype(np.int64))

    def points(self) -> Float:
        """(k, 3) the different positions, in the order of their first appearance."""
        comparable = np.nan_to_num(self.positions, nan=np.inf)
        first = np.unique(comparable, axis=0, return_index=True)[1]
        return self.positions[np.sort(first)]

    def on(self, frames: EdgeFrames) -> CrossField:
        """The field on a face, its rotation exact.

        Raises
        ------
        FieldError
            For a singularity on the boundary, for one of two coordinates on a face that is upright or curved, and for indices on
            a closed face that do not add up.
        """
        from ..field.smooth import wrap

        if frames.curved:
            from .prescribed import prescribed_field

            return prescribed_field(frames.surface, self._at_vertices(frames), frames.face)
        plane = plane_of(frames, "a field of given singularities")
        near = extent(frames.points)
        point, quarters = self._on_plane(plane, near, frames.face)
        mesh, vertices = frames.surface, plane.complex(frames.points)
        _check_boundary(mesh, vertices, point, _TOUCH * near, frames.face, plane)
        middle = vertices[mesh.edges].mean(axis=1)
        for i in range(len(point)):
            point[i] = _beside(mesh, vertices, middle, point[i], _TOUCH * near)
        angle = np.zeros(len(middle))
        rotation = np.zeros(mesh.triangles.shape)
        for a, d in zip(point, quarters.tolist()):
            angle += 0.25 * d * np.angle(middle - a)
            at = (middle - a)[mesh.triangle_edges]
            turn = np.angle(np.roll(at, -1, axis=1) * np.conj(at))
            rotation += 0.25 * d * turn
            _keep_from_boundary(mesh, vertices - a, turn, d, rotation)
        along = np.angle(frames.x @ plane.axes[0] + 1j * (frames.x @ plane.axes[1]))
        return CrossField(wrap(angle - along), rotation)

    def _at_vertices(self, frames: EdgeFrames) -> Int:
        """(n,) indices at the vertices of a curved face."""
        mesh = frames.surface
        marked = ~mesh.boundary_vertex if frames.marked is None else frames.marked
        out = np.zeros(len(mesh.points), np.int64)
        rows = np.flatnonzero(marked)
        if not len(rows) or mesh.vertex_normal is None:
            return out
        size = extent(frames.points)
        for place, quarters in zip(self.positions, self.quarters.tolist(), strict=True):
            if np.isnan(place[2]):
                remedy = "give three coordinates"
                raise FieldError("a singularity has two coordinates on a curved face", entity=(2, frames.face), remedy=remedy)
            off = place - frames.points[rows]
            best = int(np.argmin(np.linalg.norm(off, axis=1)))
            away = float(np.linalg.norm(off[best]))
            # the vertex is the foot of the point
            beside = float(np.linalg.norm(np.cross(off[best], mesh.vertex_normal[rows[best]])))
            near = _FOOT * away + _OFF_PLANE * size if frames.marked is not None else np.inf
            if away <= _OFF_SURFACE * size and beside <= near:
                out[rows[best]] += quarters
        return out

    def _on_plane(self, plane: Plane, size: float, face: int) -> tuple[Complex, Int]:
        """Complex coordinates and indices of the points that act on a face."""
        p = self.positions.copy()
        lifted = np.isnan(p[:, 2])
        if np.any(lifted):
            if abs(plane.normal[2]) < 1e-6:
                raise FieldError(
                    "a singularity has two coordinates on an upright face",
                    entity=(2, face),
                    location=p[lifted][0, :2].tolist(),
                    remedy="give three coordinates",
                )
            p[lifted, 2] = 0.0
            p[lifted, 2] = -plane.height(p[lifted]) / plane.normal[2]
        there = np.abs(plane.height(p)) <= _OFF_PLANE * size
        return plane.complex(p[there]), self.quarters[there]


def _array(values: object, what: str) -> Float:
    try:
        return np.asarray(values, float)
    except (TypeError, ValueError):
        raise FieldError(f"the {what} of singularities are no numbers", remedy="give an array of numbers") from None


def _known(position: Float) -> list[float]:
    return position[np.isfinite(position)].tolist()


def _check_boundary(mesh: SurfaceMesh, vertices: Complex, point: Complex, near: float, face: int, plane: Plane) -> None:
    """Raise FieldError for a singularity on a boundary edge."""
    a, b = vertices[mesh.edges[mesh.boundary_edge]].T
    along = b - a
    for p in point:
        t = np.clip(((p - a) * np.conj(along)).real / np.abs(along) ** 2, 0.0, 1.0)
        if np.abs(p - a - t * along).min() <= near:
            raise FieldError(
                "a singularity lies on the boundary",
                entity=(2, face),
                location=(plane.origin + p.real * plane.axes[0] + p.imag * plane.axes[1]).tolist(),
                remedy="give it as a boundary index",
            )


def _beside(mesh: SurfaceMesh, vertices: Complex, middle: Complex, a: np.complex128, near: float) -> np.complex128:
    """`a`, or if it is at an edge midpoint (where the field is wanted) a point next to it in the edge's first triangle."""
    e = int(np.argmin(np.abs(middle - a)))
    if abs(middle[e] - a) > near:
        return a
    t = mesh.edge_half_edges[e, 0] // 3
    return np.complex128(middle[e] + 1e-3 * (vertices[mesh.triangles[t]].mean() - middle[e]))


def _keep_from_boundary(mesh: SurfaceMesh, z: Complex, turn: Float, d: int, rotation: Float) -> None:
    """Give the index of a point in a corner at the boundary, beside the midpoints' triangle, to the triangle; in place.

    `z` (n,) are the vertices seen from the point, `turn` (m, 3) the turns of arg between edge midpoints.  Seen from a point in
    the corner at vertex k, the midpoints of the edges k - 1 and k turn clockwise.
    """
    from ..field.singularities import QUARTER

    corner = z[mesh.triangles]
    inside = np.flatnonzero(((np.conj(corner) * np.roll(corner, -1, axis=1)).imag >= 0.0).all(axis=1))
    for t in inside[:1]:
        lost = mesh.boundary_vertex[mesh.triangles[t]] & (np.roll(turn[t], 1) < 0.0)
        rotation[t] += d * QUARTER * np.roll(lost, -1)
