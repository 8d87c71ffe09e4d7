"""The connection Laplacian of cross fields on curved surfaces.

The cross at the midpoint of edge k is ``z_k = exp(4 i theta_k)``, its angle measured from the edge's own direction.  In a
triangle, laid into the plane, that edge has the direction ``d_k``, and the energy is the Dirichlet energy of
``z_k exp(4 i d_k)``:

    E = 1/2 sum over corners of w |z_{k+1} - exp(4 i (d_k - d_{k+1})) z_k|^2,

with the weights of `operators`.  Nothing but lengths and angles enters.  The Hermitian matrix is held as a real symmetric one,
real and imaginary part of an edge side by side.  Among the edges inside a component with boundary it is positive definite; on
a closed component too, unless the parallel transport of crosses around every loop is the identity, as on the surface of a cube.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from ..records import Float, Int
from .operators import FieldOperators, factor
from .symmetric import part, shifted

__all__ = ["ConnectionOperators"]


@dataclass(frozen=True)
class ConnectionOperators:
    """What diffuses crosses on a curved surface.

    Parameters
    ----------
    scalar : FieldOperators
        Of the same mesh.
    """

    scalar: FieldOperators

    @cached_property
    def free(self) -> Int:
        """Edges that are not on the boundary."""
        return np.flatnonzero(~self.scalar.mesh.boundary_edge)

    @cached_property
    def stiffness(self) -> sp.csr_matrix:
        """(2 e, 2 e) stiffness matrix; rows ``2 i`` and ``2 i + 1`` are the real and imaginary part of edge i."""
        mesh = self.scalar.mesh
        d = 4.0 * mesh.edge_direction
        turn = (d - np.roll(d, -1, axis=1)).ravel()
        w, n = self.scalar.weight.ravel(), 2 * len(mesh.edges)
        c, s = -w * np.cos(turn), -w * np.sin(turn)
        i = 2 * mesh.triangle_edges.ravel()
        j = 2 * np.roll(mesh.triangle_edges, -1, axis=1).ravel()
        rows = [i, i + 1, j, j + 1, j, j, j + 1, j + 1, i, i, i + 1, i + 1]
        columns = [i, i + 1, j, j + 1, i, i + 1, i, i + 1, j, j + 1, j, j + 1]
        values = [w, w, w, w, c, -s, s, c, c, s, -s, c]
        entries = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))
        return sp.coo_matrix(entries, (n, n)).tocsr()

    @cached_property
    def _inner(self) -> sp.csc_matrix:
        return part(self.stiffness, _pairs(self.free))

    def apply(self, z: Float) -> Float:
        """(e, 2) stiffness times z (e, 2)."""
        out: Float = (self.stiffness @ z.ravel()).reshape(-1, 2)
        return out

    def load(self, z: Float) -> Float:
        """(f, 2) what the boundary values of z (e, 2) add to the right-hand side of the free edges."""
        boundary = np.zeros_like(z)
        boundary[self.scalar.fixed] = z[self.scalar.fixed]
        return -self.apply(boundary)[self.free]

    def shifted(self, shift: Float, scale: float = 1.0) -> Solver:
        """Factors of ``diag(shift) + scale K`` among the free edges; `shift` (f,) is one number per edge."""
        return Solver(shifted(self._inner, np.repeat(shift, 2), scale))


class Solver:
    """A factored matrix of interleaved real and imaginary parts."""

    def __init__(self, matrix: sp.csc_matrix) -> None:
        self._factors = factor(matrix)

    def solve(self, right: Float) -> Float:
        """Solution (f, 2) for a right-hand side (f, 2)."""
        out: Float = self._factors.solve(right.ravel()).reshape(-1, 2)
        return out


def _pairs(rows: Int) -> Int:
    return np.stack([2 * rows, 2 * rows + 1], axis=1).ravel()
