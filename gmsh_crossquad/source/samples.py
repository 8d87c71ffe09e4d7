"""A cross field from values on the points or cells of a surface mesh, the face's own or any other.

A value becomes an arm of the cross in space.  In the tangent frame of a mesh triangle an arm of angle a is the complex number
exp(4 i a), which is the same for all four arms; between the corners it is interpolated linearly, and the arm that it stands for
is projected on the tangent plane of the face.  On a mesh that is bent, arms are projected on the tangent planes of the corners
first, so that a part of them that is normal to the surface does not count.  Two arms are added in this form.  A symmetric tensor
is interpolated as it is: its deviator in the frame, ``(T_xx - T_yy)/2 + i T_xy``, has twice the angle of its principal axes.

Values on cells are averaged to the points first, weighted by area: the field is then continuous, and it does not matter on
which side of an edge a midpoint is taken to be.

A corner without direction (zero, normal to the face, isotropic) takes the mean of the other corners in each of its triangles.
This is done for single points and for those at the boundary of the mesh.  Places a little outside the mesh, up to half the
longest edge of a triangle, take the value of the nearest point, since both meshes are polygons where the CAD is round.
Everything else that is wrong with the values is an error.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Literal

import numpy as np
import numpy.typing as npt

from ..errors import FieldError
from ..records import Bool, CrossField, Float, Int
from .cells import linear_triangles
from .checks import COARSE_SHARE, COARSE_TURN, JUMP_TURN, LONGEST_JUMP, check_turns, fill_gaps, largest_cluster
from .locate import Locator, Places
from .plane import angle_arms, extent
from .power import CANCELLED, ZERO, averaged, unit_power
from .sample_mesh import check_finite, mesh_cells, mesh_points
from .values import Kind, checked_values

if TYPE_CHECKING:
    from ..field.edge_frames import EdgeFrames

__all__ = ["Samples"]

Complex = npt.NDArray[np.complex128]

#: least cosine between the normals of a node and of its triangle where there is no crease
_SMOOTH = 0.85


@dataclass(frozen=True, eq=False)
class Samples:
    """Values on the points or cells of a surface mesh.

    Parameters
    ----------
    positions : (n, 2) or (n, 3) array_like
        Points of the mesh, in the user's coordinates.
    cells : (m, k) array_like of int, or a sequence of such
        Triangles (k = 3, 6) or quadrangles (k = 4, 8, 9).
    values : array_like
        One row per point, or per cell in the order of `cells`; see `checked_values` for the shapes.
    kind : {"direction", "directions", "angle", "tensor"}
        What a value is: one arm of the cross; two arms; the angle of an arm, in radians from the x axis (on a plane other than
        xy from the projected x axis, about the normal whose last coordinate is positive); a symmetric tensor, whose principal
        directions are the arms.
    where : {"points", "cells"}

    Raises
    ------
    FieldError
        For a mesh without cells and for values of the wrong shape, that are not finite or all zero.
    """

    positions: Float
    triangles: Int
    cell: Int
    values: Float
    kind: Kind
    where: Literal["points", "cells"]

    def __init__(
        self,
        positions: npt.ArrayLike,
        cells: npt.ArrayLike | Sequence[npt.ArrayLike],
        values: npt.ArrayLike,
        kind: Kind,
        where: Literal["points", "cells"] = "points",
    ) -> None:
        points = mesh_points(positions)
        blocks = mesh_cells(cells, len(points))
        triangles, cell = linear_triangles(blocks)
        if where not in ("points", "cells"):
            raise FieldError(f"the values of the field are on {where!r}", remedy="they must be on points or cells")
        count = len(points) if where == "points" else sum(len(b) for b in blocks)
        checked = checked_values(values, kind, count)
        check_finite(checked, points, blocks, where)
        side = points[triangles]
        area = np.linalg.norm(np.cross(side[:, 1] - side[:, 0], side[:, 2] - side[:, 0]), axis=1)
        longest = np.linalg.norm(np.roll(side, -1, axis=1) - side, axis=2).max(axis=1)
        thick = area > 1e-12 * longest**2
        if not np.any(thick):
            raise FieldError("the mesh of the field has no area", remedy="give triangles or quadrangles")
        if kind != "angle" and not np.any(checked):
            raise FieldError("the field is zero everywhere", remedy="give it a direction")
        for name, value in (
            ("positions", points),
            ("triangles", triangles[thick]),
            ("cell", cell[thick]),
            ("values", checked),
            ("kind", kind),
            ("where", where),
        ):
            object.__setattr__(self, name, value)

    def points(self) -> Float:
        """None: (0, 3)."""
        return np.zeros((0, 3))

    @cached_property
    def locator(self) -> Locator:
        """Finds places in the mesh; made once for all faces."""
        return Locator(self.positions[self.triangles])

    @cached_property
    def _node(self) -> Int:
        """(n,) the same number for points at the same position."""
        step = 1e-9 * extent(self.positions)
        key = np.rint((self.positions - self.positions.min(axis=0)) / step).astype(np.int64)
        return np.unique(key, axis=0, return_inverse=True)[1].reshape(-1)

    @cached_property
    def _rim(self) -> Bool:
        """(nodes,) True on the boundary of the mesh (nodes of sides that have one triangle)."""
        nodes = self._node[self.triangles]
        pair = np.sort(np.stack([nodes, np.roll(nodes, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
        count = self._node.max() + 1
        side, times = np.unique(pair[:, 0] * count + pair[:, 1], return_counts=True)
        single = side[times == 1]
        out = np.zeros(count, bool)
        out[single // count] = out[single % count] = True
        return out

    def on(self, frames: EdgeFrames) -> CrossField:
        """The field at the edge midpoints of a face.

        Raises
        ------
        FieldError
            If it does not cover the face, or is undefined or too coarse there.
        """
        from ..field.smooth import from_angles

        found = self.locator.find(frames.places, frames.normal)
        self._check_cover(frames, found)
        used, row = np.unique(found.triangle, return_inverse=True)
        x, y, value, defined = self._powers(frames, used)
        self._check_gaps(frames, used, defined)
        order = 2 if self.kind == "tensor" else 4
        self._check_coarse(frames, used, value ** (4 // order), defined)
        at = np.sum(found.weight * value[row], axis=1)
        good = np.abs(at) > CANCELLED * np.abs(value).max()
        angle = np.angle(at) / order
        arm = np.cos(angle)[:, None] * x[row] + np.sin(angle)[:, None] * y[row]
        theta = fill_gaps(frames, frames.angles(arm), good)
        return check_turns(frames, from_angles(frames.surface, theta))

    def _arms(self, frames: EdgeFrames) -> Float:
        """Values on points: arms (n, a, 3), or tensors (n, 3, 3)."""
        values = self.values
        if self.kind == "angle":
            values = angle_arms(frames, values)[:, None]
        return values if self.where == "points" else averaged(values[self.cell], self.triangles, self.positions)

    def _powers(self, frames: EdgeFrames, used: Int) -> tuple[Float, Float, Complex, Bool]:
        """Tangent axes (u, 3), powers (u, 3) at the corners, and which of these are defined, of the triangles `used`."""
        corner = self.positions[self.triangles[used]]
        x = corner[:, 1] - corner[:, 0]
        x /= np.linalg.norm(x, axis=1)[:, None]
        y = np.cross(self.locator.normal[used], x)
        values = self._arms(frames)
        own = values[self.triangles[used]]
        largest = float(np.abs(values).max())
        if self.kind == "tensor":
            a = np.einsum("ui,ukij,uj->uk", x, own, x)
            b = np.einsum("ui,ukij,uj->uk", y, own, y)
            value = 0.5 * (a - b) + 1j * np.einsum("ui,ukij,uj->uk", x, own, y)
            return x, y, value, np.abs(value) > ZERO * largest
        if self._bent:
            normal = self._corner_normals(used)[:, :, None]
            own = own - np.sum(own * normal, axis=3, keepdims=True) * normal
        value, defined = unit_power(own, x[:, None], y[:, None], largest)
        mean = np.where(defined, value, 0.0).sum(axis=1)
        mean /= np.maximum(np.abs(mean), CANCELLED)
        return x, y, np.where(defined, value, mean[:, None]), defined

    @cached_property
    def _bent(self) -> bool:
        """Whether the mesh is not plane."""
        return bool(np.abs(self.locator.normal @ self.locator.normal[0]).min() < 1.0 - 1e-12)

    @cached_property
    def _node_normals(self) -> Float:
        """(nodes, 3) normals at the nodes: every corner between edges a and b counts with a x b / (|a|^2 |b|^2)."""
        p = self.positions[self.triangles]
        edge = np.roll(p, -1, axis=1) - p
        square = np.sum(edge**2, axis=2, keepdims=True)
        corner = np.cross(edge, -np.roll(edge, 1, axis=1)) / (square * np.roll(square, 1, axis=1))
        node, count = self._node[self.triangles].ravel(), self._node.max() + 1
        return np.stack([np.bincount(node, c, count) for c in corner.reshape(-1, 3).T], axis=1)

    def _corner_normals(self, used: Int) -> Float:
        """(u, 3, 3) unit normals at the corners of triangles: those of the nodes, at creases those of the triangles."""
        own = np.repeat(self.locator.normal[used][:, None], 3, axis=1)
        normal = self._node_normals[self._node[self.triangles[used]]]
        length = np.linalg.norm(normal, axis=2, keepdims=True)
        smooth = np.sum(normal * own, axis=2, keepdims=True) > _SMOOTH * length
        return np.where(smooth & (length > 0.0), normal / np.where(length > 0.0, length, 1.0), own)

    def _check_cover(self, frames: EdgeFrames, found: Places) -> None:
        missed = found.triangle < 0
        if np.any(missed):
            # rounded down: 100 % would be no reason for an error
            raise FieldError(
                f"the field covers only {np.floor(1000 * (1 - missed.mean())) / 10:.1f} % of the background points",
                entity=(2, frames.face),
                location=frames.places[np.flatnonzero(missed)[0]],
                remedy="give a field on the whole face (this is the first point that it misses)",
            )

    def _check_gaps(self, frames: EdgeFrames, used: Int, defined: Bool) -> None:
        """Refuse neighbouring undefined points inside the mesh, and triangles without any value."""
        node = self._node[self.triangles[used]]
        if not np.any(defined):
            remedy = "it is normal to the face, isotropic or zero everywhere"
            raise FieldError("the field has no direction on the face", entity=(2, frames.face), remedy=remedy)
        inside = ~defined & ~self._rim[node]
        bad = (inside.sum(axis=1) > 1) | ~defined.any(axis=1)
        if np.any(bad):
            t = np.flatnonzero(bad)[0]
            k = np.flatnonzero(~defined[t])[0]
            raise FieldError(
                "the field has no direction (zero, normal to the face or isotropic) along a curve or in a region",
                entity=(2, frames.face),
                location=self.positions[self.triangles[used[t], k]],
                remedy="give it a direction there",
            )

    def _check_coarse(self, frames: EdgeFrames, used: Int, power: Complex, defined: Bool) -> None:
        """Refuse cells that turn the cross too much to tell which way, where they are many or make up a curve."""
        both = defined & np.roll(defined, -1, axis=1)
        turn = np.where(both, np.abs(np.angle(np.roll(power, -1, axis=1) * np.conj(power))) / 4, 0.0).max(axis=1)
        share = float((turn > COARSE_TURN).mean())
        if share > COARSE_SHARE:
            raise FieldError(
                f"the field turns by more than 36 degrees within {100 * share:.0f} % of its cells",
                entity=(2, frames.face),
                remedy="its mesh is too coarse for its singularities: give it on a finer one",
            )
        curve = largest_cluster(self._node[self.triangles[used]], turn > JUMP_TURN)
        if curve.sum() > LONGEST_JUMP:
            raise FieldError(
                "the field jumps by 45 degrees along a curve",
                entity=(2, frames.face),
                location=self.locator.centroid[used[curve][0]].tolist(),
                remedy="give a smoother field, or give it on a finer mesh",
            )
