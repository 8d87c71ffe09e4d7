"""Do the indices that are wanted fit the domain, and if not, what is the least change that makes them fit?

On every component all indices, inside and on the boundary, add up to chi (Poincaré–Hopf; eq. (8) to (11), and with the degrees
along the loops (16) and (17)).  A field whose interior indices miss that by e quarter turns cannot be aligned.  The least change
is e quarter turns, either

- of one boundary vertex, whose sector gets e blocks fewer: the one where ``(n pi/2 - b)^2 / b`` (b opening angle, n blocks) grows
  least, or
- of |e| new interior singularities of index +-1/4, each where there is most room.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import FieldError
from ..records import Bool, Float, Int
from .clearance import Clearance
from .singularities import QUARTER, move_index, shortest_path
from .surface_mesh import SurfaceMesh

__all__ = ["Incompatible", "Misfit", "add_singularities", "change_boundary", "misfits", "quarter_text"]


@dataclass(frozen=True)
class Misfit:
    """Indices of a component that do not add up.

    Attributes
    ----------
    component : int
    found, needed : int
        Sum of all indices and 4 chi, in quarter turns.
    euler : int
        chi.
    interior, boundary : tuple of (vertex, quarter turns)
        The indices that are not zero.
    corner : tuple of (vertex, quarter turns) or None
        The boundary vertex that could be changed, and the index that would fit.
    eases : bool
        Whether that index fits the vertex's opening angle at least as well as its own.
    """

    component: int
    found: int
    needed: int
    euler: int
    interior: tuple[tuple[int, int], ...]
    boundary: tuple[tuple[int, int], ...]
    corner: tuple[int, int] | None
    eases: bool


class Incompatible(FieldError):
    """Raised with the `Misfit`; `place` says where a vertex is, for a list of them."""

    def __init__(self, misfit: Misfit, points: Float) -> None:
        self.misfit = misfit
        self.points = points
        m = misfit
        super().__init__(
            f"the indices add up to {quarter_text(m.found)} instead of chi = {m.euler}",
            remedy=f"change them by {quarter_text(m.needed - m.found)} in all",
        )


def quarter_text(quarters: int) -> str:
    """Quarter turns as a reduced fraction with sign: 1 -> +1/4, -2 -> -1/2, 4 -> +1, 0 -> 0."""
    if quarters % 4 == 0:
        return f"{quarters // 4:+d}" if quarters else "0"
    return f"{quarters // 2:+d}/2" if quarters % 2 == 0 else f"{quarters:+d}/4"


def misfits(mesh: SurfaceMesh, interior_index: Int, boundary_index: Int, changeable: Bool) -> list[Misfit]:
    """The components whose indices do not add up.

    Parameters
    ----------
    mesh : SurfaceMesh
    interior_index, boundary_index : (n,) int64
        Quarter turns; the first is read at interior, the second at boundary vertices.
    changeable : (n,) bool
        Boundary vertices whose index may be changed.
    """
    index = np.where(mesh.boundary_vertex, boundary_index, interior_index)
    euler = mesh.component_euler
    total = np.bincount(mesh.components, index, len(euler)).astype(np.int64)
    out = []
    for c in np.flatnonzero(total != 4 * euler).tolist():
        here = mesh.components == c
        excess = int(4 * euler[c] - total[c])
        lists = [
            tuple((int(v), int(index[v])) for v in np.flatnonzero(here & (mesh.boundary_vertex == side) & (index != 0)))
            for side in (False, True)
        ]
        corner, eases = _corner(mesh, boundary_index, here & changeable & mesh.boundary_vertex, excess)
        out.append(Misfit(c, int(total[c]), int(4 * euler[c]), int(euler[c]), lists[0], lists[1], corner, eases))
    return out


def _corner(mesh: SurfaceMesh, boundary_index: Int, changeable: Bool, excess: int) -> tuple[tuple[int, int] | None, bool]:
    """The boundary vertex that takes `excess` quarter turns at least cost with its new index, and whether the cost falls."""
    v = np.flatnonzero(changeable & (boundary_index + excess <= 1))
    if not len(v):
        return None, False
    quads, angle = 2 - boundary_index[v], mesh.angle_sum[v]
    cost = ((quads - excess) * QUARTER - angle) ** 2 / angle - (quads * QUARTER - angle) ** 2 / angle
    best = int(np.argmin(cost))
    return (int(v[best]), int(boundary_index[v[best]] + excess)), bool(cost[best] <= 0.0)


def change_boundary(boundary_index: Int, misfit: Misfit) -> Int:
    """Copy of `boundary_index` (n,) with the vertex `misfit.corner` changed."""
    assert misfit.corner is not None
    out = boundary_index.copy()
    out[misfit.corner[0]] = misfit.corner[1]
    return out


def add_singularities(mesh: SurfaceMesh, clearance: Clearance, rotation: Float, misfit: Misfit) -> tuple[Float, list[int]]:
    """Make a field fit by new interior singularities of +-1/4, moved in from the boundary.

    Parameters
    ----------
    mesh : SurfaceMesh
    clearance : Clearance
        Of the same mesh.
    rotation : (m, 3) float64
        Without singular triangles.
    misfit : Misfit

    Returns
    -------
    (m, 3) float64, list of int
        The new rotation and the new singular vertices.

    Raises
    ------
    FieldError
        If the component has too few interior vertices.
    """
    out = rotation.copy()
    inside = ~mesh.boundary_vertex & (mesh.components == misfit.component)
    taken = [v for v, _ in misfit.interior]
    excess = misfit.needed - misfit.found
    added: list[int] = []
    for _ in range(abs(excess)):
        free = np.flatnonzero(inside)
        free = free[~np.isin(free, taken)]
        if not len(free):
            raise FieldError("there is no room for another singularity", remedy="use a finer background mesh")
        room = clearance.distance(mesh.points[free])[0]
        for v in taken:
            room = np.minimum(room, 0.5 * np.linalg.norm(mesh.points[free] - mesh.points[v], axis=1))
        v = int(free[np.argmax(room)])
        path = shortest_path(mesh, [v], mesh.boundary_vertex, inside, len(mesh.points))
        move_index(mesh, out, path[::-1], 1 if excess > 0 else -1)
        taken.append(v)
        added.append(v)
    return out, added
