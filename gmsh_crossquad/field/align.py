"""Rotate a cross field until it is aligned with the boundary, by as little as possible or until it is as smooth as can be.

The aligned field is ``theta + x`` with one unknown x per edge.  Along a boundary loop, the domain on the left, it turns at
vertex v by ``K_v - (pi/2) q_v`` (K_v = pi minus the angle, q_v the wanted index); summed over the loop this must equal what
the field does:

1. The *defect* ``D_i = target_i - degree_i`` (quarter turns) of a hole vanishes after moving D_i quarter turns of index along a
   path from it to the outer loop (an integer cocycle in `rotation`).  All defects of a component add up to 0, or the
   wanted indices contradict Poincaré–Hopf.
2. x is then known on every boundary edge up to one constant per loop, a multiple ``m_i pi/2`` (0 on the outer loop), and
   inside it minimises ``1/2 sum w (difference(x) + r)^2``.  With r = the rotation of the given field and the cocycles the
   result is harmonic: the smoothest field with these singularities.  With r = the cocycles alone x is the least rotation, and
   the given field is kept: one that is aligned already comes out as it went in.  A component without boundary has no
   condition; on a surface of any genus x is single-valued, so that the field keeps its homotopy class.
3. The integers m minimise the same energy, ``1/2 (pi/2)^2 m'Am + (pi/2) g.m`` with ``A_ij = int grad a_i . grad a_j`` for a_i
   harmonic, 1 on loop i and 0 on the others, and g the flux with m = 0: the rounded real minimum, then single steps while
   they help.

The result has the same interior indices, to the last integer.  The rotation is x = phi + psi: psi vanishes on the boundary and
carries the cocycles, its period around hole i is ``+ (pi/2) D_i``; phi is harmonic.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ..errors import LayoutError
from ..records import AlignedField, CrossField, Float, Int
from .operators import FieldOperators
from .singularities import (
    QUARTER,
    check_poincare_hopf,
    corner_rotation,
    move_index,
    shortest_path,
    to_integer,
    triangle_index,
    vertex_index,
)
from .smooth import wrap
from .surface_mesh import SurfaceMesh

__all__ = ["Aligner", "Rotated", "align", "closest", "with_parts"]

_TOLERANCE = 1e-6


@dataclass(frozen=True)
class _Loop:
    """A boundary loop: its vertices, the edge that leaves each, its component, and whether it is that component's first."""

    vertices: Int
    edges: Int
    component: int
    outer: bool


class Rotated(NamedTuple):
    """A field that was rotated onto the boundary.

    Attributes
    ----------
    field : CrossField
    periods : (loops,) int64
        The integers m.
    x : (e,) float64
        The angle of the rotation.
    closed : (m, 3) float64
        The rotation of the given field and the cocycles.
    """

    field: CrossField
    periods: Int
    x: Float
    closed: Float


def _loops(mesh: SurfaceMesh) -> list[_Loop]:
    edge = mesh.triangle_edges.ravel()
    seen: set[int] = set()
    out = []
    for vertices in mesh.loops:
        c = int(mesh.components[vertices[0]])
        out.append(_Loop(vertices, edge[mesh.outgoing_boundary[vertices]], c, c not in seen))
        seen.add(c)
    return out


class Aligner:
    """Aligns fields of one mesh with one set of boundary indices; loops and harmonic functions are found once.

    Parameters
    ----------
    mesh : SurfaceMesh
    operators : FieldOperators
    boundary_index : (n,) int64
        Wanted index of every boundary vertex in quarter turns (interior entries are not read).
    """

    def __init__(self, mesh: SurfaceMesh, operators: FieldOperators, boundary_index: Int) -> None:
        self.mesh = mesh
        self.operators = operators
        self.boundary_index = np.where(mesh.boundary_vertex, boundary_index, 0)
        self.loops = _loops(mesh)
        self.turning = mesh.curvature - QUARTER * self.boundary_index
        self.holes = [i for i, loop in enumerate(self.loops) if not loop.outer]
        self._basis: tuple[Float, Float] | None = None

    @property
    def rims(self) -> list[Int]:
        """The loops that limit the clearance of singularities, as vertices: holes in the plane, all loops on curved surfaces."""
        plane = self.mesh.points.shape[1] == 2
        return [loop.vertices for loop in self.loops if not (plane and loop.outer)]

    def close(self, rotation: Float) -> Float:
        """Copy of `rotation` (m, 3) whose degree along every loop is what the boundary indices ask for."""
        out = rotation.copy()
        through = corner_rotation(self.mesh, rotation)
        defect = to_integer(
            np.array([np.sum(self.turning[p.vertices] - through[p.vertices]) for p in self.loops]) / QUARTER,
            "the degree of the cross field along a boundary loop",
            np.array([self.mesh.points[p.vertices[0]] for p in self.loops]),
        )
        components = np.array([loop.component for loop in self.loops], np.int64)
        total = np.bincount(components, defect)
        if np.any(total != 0):
            raise LayoutError(
                f"boundary indices and singularities do not fit together (off by {int(total[total != 0][0])} quarter turns)",
                remedy="change the prescribed singularities or boundary indices (Poincaré–Hopf)",
            )
        inside = ~self.mesh.boundary_vertex
        for i in self.holes:
            if defect[i] == 0:
                continue
            outer = next(p for p in self.loops if p.outer and p.component == self.loops[i].component)
            target = np.zeros(len(self.mesh.points), bool)
            target[outer.vertices] = True
            path = shortest_path(self.mesh, self.loops[i].vertices.tolist(), target, inside, len(self.mesh.points))
            if not path:
                raise LayoutError(
                    "no path of edges leads from a hole to the outer boundary",
                    location=self.mesh.points[self.loops[i].vertices[0]],
                    remedy="use a finer background mesh",
                )
            move_index(self.mesh, out, path, int(defect[i]))
        return out

    def solve(self, theta: Float, closed: Float, correction: Float) -> Float:
        """(e,) rotation x that aligns `theta` (e,) with m = 0, for a rotation (m, 3) that went through `close`."""
        through = corner_rotation(self.mesh, closed)
        boundary = np.zeros(len(self.mesh.edges))
        for loop in self.loops:
            v, e = loop.vertices, loop.edges
            step = self.turning[v] - through[v]
            boundary[e] = -wrap(theta[e[:1]]) + np.concatenate([[0.0], np.cumsum(step[1:])])
        return self.operators.solve(boundary, correction)

    def flux(self, rotation: Float) -> Float:
        """(loops,) closed integral of the normal derivative of the angle around every loop."""
        reaction = self.operators.divergence(rotation)
        return np.array([np.sum(reaction[loop.edges]) for loop in self.loops])

    def harmonic(self) -> tuple[Float, Float]:
        """(e, holes) functions that are 1 on one hole and 0 on all other loops, and their (holes, holes) energies A."""
        if self._basis is None:
            one = np.zeros((len(self.mesh.edges), len(self.holes)))
            for column, i in enumerate(self.holes):
                one[self.loops[i].edges, column] = 1.0
            basis = self.operators.solve(one)
            self._basis = basis, one.T @ (self.operators.stiffness @ basis)
        return self._basis

    def rotate(self, field: CrossField, kept: Float | None = None) -> Rotated:
        """The aligned field with the interior indices of `field`.

        Parameters
        ----------
        field : CrossField
            Without singular triangles.
        kept : (m, 3) float64, optional
            The part of its rotation that is kept; by default nothing is, and the result is harmonic.
        """
        closed = self.close(field.rotation)
        correction = closed if kept is None else closed - kept
        x = self.solve(field.theta, closed, correction)
        periods = np.zeros(len(self.loops), np.int64)
        if self.holes:
            basis, energy = self.harmonic()
            flux = self.flux(correction + self.operators.difference(x))
            m = closest(energy, -flux[self.holes] / QUARTER)
            if np.any(m):
                x = x + QUARTER * (basis @ m)
            periods[self.holes] = m
        rotation = closed + self.operators.difference(x)
        return Rotated(CrossField(wrap(field.theta + x), rotation), periods, x, closed)

    def finish(self, rotated: Rotated, given: CrossField) -> AlignedField:
        """Check an aligned field, collect its indices and tell what turned the `given` one."""
        mesh, field = self.mesh, rotated.field
        index = to_integer(vertex_index(mesh, field.rotation), "the index of a vertex", mesh.points)
        wrong = np.flatnonzero(mesh.boundary_vertex & (index != self.boundary_index))
        residual = float(np.abs(wrap(field.theta[self.operators.fixed])).max(initial=0.0))
        angle = field.theta[mesh.triangle_edges] + mesh.edge_direction
        drift = float(np.abs(wrap(np.roll(angle, -1, axis=1) - angle - field.rotation)).max())
        if len(wrong) or residual > _TOLERANCE or drift > _TOLERANCE or np.any(triangle_index(field.rotation)):
            raise LayoutError(
                f"the cross field could not be aligned ({len(wrong)} wrong indices, residual {max(residual, drift):.3g})",
                location=mesh.points[wrong[0]] if len(wrong) else None,
                remedy="use a finer background mesh",
            )
        check_poincare_hopf(mesh, index)
        cocycle = rotated.closed - given.rotation
        psi = self.operators.solve(np.zeros(len(mesh.edges)), cocycle) if np.any(cocycle) else np.zeros(len(mesh.edges))
        return AlignedField(
            field, index, rotated.periods, self.flux(field.rotation), residual, given=given, phi=rotated.x - psi, psi=psi
        )


def closest(energy: Float, right: Float) -> Int:
    """Integers m (k,) with small ``1/2 m'Am - right.m``: the rounded real minimum, improved by single steps."""
    m = np.rint(np.linalg.solve(energy, right)).astype(np.int64)
    slope = energy @ m - right
    for _ in range(100 + 10 * len(m)):
        gain = 0.5 * np.diag(energy) - np.abs(slope)
        i = int(np.argmin(gain))
        if gain[i] > -1e-9 * energy[i, i]:
            break
        step = -int(np.sign(slope[i]))
        m[i] += step
        slope += step * energy[:, i]
    return m


def with_parts(operators: FieldOperators, aligned: AlignedField, given: CrossField) -> AlignedField:
    """`aligned` with `given` and the phi and psi that lead from it, also where singularities have moved."""
    x = wrap(aligned.field.theta - given.theta)
    turn = aligned.field.rotation - given.rotation - operators.difference(x)
    psi = operators.solve(np.zeros(len(x)), QUARTER * np.rint(turn / QUARTER))
    return replace(aligned, given=given, phi=x - psi, psi=psi)


def align(
    mesh: SurfaceMesh, operators: FieldOperators, field: CrossField, boundary_index: Int, given: CrossField | None = None
) -> AlignedField:
    """Align a cross field with the boundary.

    Parameters
    ----------
    mesh : SurfaceMesh
    operators : FieldOperators
        Of the same mesh.
    field : CrossField
        Singularities at interior vertices (see `snap_to_vertices`); need not be aligned.
    boundary_index : (n,) int64
        Wanted index of every boundary vertex in quarter turns.
    given : CrossField, optional
        Keep this field (from which `field` differs by moves of indices) and rotate it as little as possible; by default the
        result is harmonic.

    Returns
    -------
    AlignedField
        Same interior indices as `field`; aligned to rounding error.

    Raises
    ------
    LayoutError
        If the wanted indices contradict Poincaré–Hopf or the result fails its checks.
    """
    aligner = Aligner(mesh, operators, boundary_index)
    inside = ~mesh.boundary_vertex
    before = to_integer(vertex_index(mesh, field.rotation)[inside], "the index of an interior vertex", mesh.points[inside])
    rotated = aligner.rotate(field, None if given is None else given.rotation)
    result = aligner.finish(rotated, field if given is None else given)
    changed = mesh.points[inside][result.index[inside] != before]
    if len(changed):
        raise LayoutError("alignment changed a singularity", location=changed[0], remedy="report the model")
    return result
