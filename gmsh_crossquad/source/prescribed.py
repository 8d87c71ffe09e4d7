"""The smoothest cross field with prescribed singularities on a curved surface: a trivial connection.

A field of crosses turns by ``rotation[t, k]`` from edge to edge (Crouzeix–Raviart).  Its indices are known sums of these, in
which the Gaussian curvature counts: all of them add up to 4 chi quarter turns, with those that a boundary takes up.  So the field
with wanted indices is any field, some of whose quarter turns have been moved along edge paths, made smooth:

1. The smooth field has its own singularities.  What it has too much at one vertex goes where it is missing, or to the boundary,
   on the shortest path.
2. Then its angles x change by the solution of ``min sum w (difference(x) + rotation)^2``, free on the boundary, and on surfaces
   with handles the free integers around these are the closest ones (as in `align`).

This is the trivial connection of Crane, Desbrun and Schröder [1]_ with edges in place of triangles.  Being free on the boundary
it is orthogonal to every harmonic function, so the field that `align` makes of it is the harmonic one that is aligned, of least
energy.  A component without boundary leaves one angle open: it is that in which the crosses half-way between neighbouring
singular points follow the lines between these best (on a sphere with singular points at the corners of a cube, its edges).

References
----------
.. [1] K. Crane, M. Desbrun, P. Schröder, "Trivial connections on discrete surfaces", Computer Graphics Forum 29(5), 2010.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..errors import FieldError
from ..field.align import closest
from ..field.compatibility import quarter_text
from ..field.handles import handle_loops
from ..field.operators import FieldOperators, factor
from ..field.singularities import move_index, shortest_path, singular_vertices, snap_to_vertices
from ..field.smooth import smooth_field, wrap
from ..field.surface_mesh import SurfaceMesh
from ..records import CrossField, Float, Int

__all__ = ["FreeOperators", "handle_cocycles", "prescribed_field", "with_indices"]

#: singular points are neighbours up to this multiple of the distance of the nearest
_NEIGHBOURS = 1.25
#: greatest height of the surface over the line between neighbours, over their distance
_HEIGHT = 0.4


class FreeOperators:
    """The least-energy problem without conditions on the boundary; one edge of every component is held.

    Parameters
    ----------
    operators : FieldOperators
    """

    def __init__(self, operators: FieldOperators) -> None:
        self.operators = operators
        mesh = operators.mesh
        held = np.unique(mesh.components[mesh.edges[:, 0]], return_index=True)[1]
        self.free = np.setdiff1d(np.arange(len(mesh.edges)), held)
        self._factors: Any = factor(operators.stiffness[self.free][:, self.free].tocsc())

    def smoothed(self, rotation: Float) -> Float:
        """(e,) the x for which ``rotation + difference(x)`` has least energy."""
        x = np.zeros(len(self.operators.mesh.edges))
        x[self.free] = self._factors.solve(-self.operators.divergence(rotation)[self.free])
        return x

    def least(self, rotation: Float, cocycles: list[Float], step: int) -> tuple[Float, Float]:
        """The rotation of least energy of those that differ by angles and whole numbers of cocycles.

        Parameters
        ----------
        rotation : (m, 3) float64
        cocycles : list of (m, 3) float64
            Of one quarter turn each.
        step : int
            The numbers are multiples of this.

        Returns
        -------
        (m, 3) float64, (e,) float64
            The rotation, and the angle by which the field turns.
        """
        difference = self.operators.difference
        x = self.smoothed(rotation)
        if cocycles:
            turned = [self.smoothed(c) for c in cocycles]
            parts = [step * (c + difference(y)) for c, y in zip(cocycles, turned, strict=True)]
            now = rotation + difference(x)
            energy = np.array([[np.sum(self.operators.weight * p * q) for q in parts] for p in parts])
            m = closest(energy, np.array([-np.sum(self.operators.weight * p * now) for p in parts]))
            for number, c, y in zip(m.tolist(), cocycles, turned, strict=True):
                rotation, x = rotation + number * step * c, x + number * step * y
        return rotation + difference(x), x


def prescribed_field(mesh: SurfaceMesh, index: Int, face: int) -> CrossField:
    """The smoothest cross field with the given indices.

    Parameters
    ----------
    mesh : SurfaceMesh
        Curved.
    index : (n,) int64
        Quarter turns at the interior vertices.
    face : int
        Gmsh tag, for errors.

    Returns
    -------
    CrossField
        Not aligned with the boundary.

    Raises
    ------
    FieldError
        If the indices of a component without boundary do not add up to 4 chi.
    """
    operators = FieldOperators(mesh)
    theta, rotation = with_indices(mesh, operators, index, face)
    rotation, x = FreeOperators(operators).least(rotation, handle_cocycles(mesh), 1)
    theta = theta + x
    for c in np.flatnonzero(mesh.component_closed).tolist():
        theta = _turned(
            mesh, theta, np.flatnonzero((index != 0) & (mesh.components == c)), mesh.components[mesh.edges[:, 0]] == c
        )
    return CrossField(wrap(theta), rotation)


def handle_cocycles(mesh: SurfaceMesh) -> list[Float]:
    """Rotations (m, 3) that move one quarter turn around a handle: they change no index."""
    out = []
    for loop in handle_loops(mesh):
        out.append(np.zeros(mesh.triangles.shape))
        move_index(mesh, out[-1], loop, 1)
    return out


def with_indices(mesh: SurfaceMesh, operators: FieldOperators, index: Int, face: int) -> tuple[Float, Float]:
    """Angles (e,) and rotation (m, 3) of a field that has the given indices at its interior vertices; not smooth.

    Raises
    ------
    FieldError
        As `prescribed_field`.
    """
    euler = mesh.component_euler
    inside = ~mesh.boundary_vertex
    found = np.bincount(mesh.components[inside], index[inside], len(euler)).astype(np.int64)
    wrong = np.flatnonzero(mesh.component_closed & (found != 4 * euler))
    if len(wrong):
        c = int(wrong[0])
        missing = int(4 * euler[c] - found[c])
        raise FieldError(
            f"the indices of a closed surface add up to {quarter_text(int(found[c]))} where chi = {euler[c]} is needed",
            entity=(2, face),
            remedy=f"change them by {quarter_text(missing)} in all ({abs(missing)} singularities of {'+-'[missing < 0]}1/4)",
        )
    start = smooth_field(mesh, operators)
    rotation = snap_to_vertices(mesh, start.rotation)
    excess = np.where(inside, -index, 0)
    vertices, own = singular_vertices(mesh, rotation)
    excess[vertices] += own
    for v in np.flatnonzero(excess).tolist():
        while excess[v]:
            sign = int(np.sign(excess[v]))
            target = (excess * sign < 0) | mesh.boundary_vertex
            path = shortest_path(mesh, [v], target, inside, len(mesh.points))
            end = path[-1]
            amount = sign * min(abs(int(excess[v])), abs(int(excess[end])) if inside[end] else abs(int(excess[v])))
            move_index(mesh, rotation, path, amount)
            excess[v] -= amount
            if inside[end]:
                excess[end] += amount
    return start.theta, rotation


def _turned(mesh: SurfaceMesh, theta: Float, spots: Int, own: Any) -> Float:
    """Angles `theta` (e,) turned on the edges `own` (e,) so that crosses follow the lines between neighbouring `spots`."""
    from ..spatial import cKDTree

    if len(spots) < 2 or mesh.edge_normal is None:
        return theta
    p = mesh.points[spots]
    apart = np.linalg.norm(p[:, None] - p[None], axis=2)
    np.fill_diagonal(apart, np.inf)
    near = apart.min(axis=1)
    i, j = np.nonzero(np.triu(apart <= _NEIGHBOURS * np.minimum(near[:, None], near[None])))
    rows = np.flatnonzero(own)
    middle = mesh.points[mesh.edges[rows]].mean(axis=1)
    height, found = map(np.asarray, cKDTree(middle).query(0.5 * (p[i] + p[j])))
    good = height <= _HEIGHT * apart[i, j]
    i, j, edge = i[good], j[good], rows[found[good]]
    x = (mesh.points[mesh.edges[edge, 1]] - mesh.points[mesh.edges[edge, 0]]) / mesh.edge_length[edge][:, None]
    y = np.cross(mesh.edge_normal[edge], x)
    line = p[j] - p[i]
    wanted = np.arctan2(np.einsum("kc,kc->k", line, y), np.einsum("kc,kc->k", line, x))
    total = np.exp(4j * (wanted - theta[edge])).sum()
    turn = 0.25 * np.angle(total) if abs(total) > 1e-9 else 0.0
    return np.where(own, theta + turn, theta)
