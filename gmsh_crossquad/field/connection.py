"""The connection Laplacian of cross fields on curved surfaces.

The cross at the midpoint of edge k is ``z_k = exp(4 i theta_k)``, its angle measured from the edge's own direction.  In a
triangle, laid into the plane, that edge has the direction ``d_k``, and the energy is the Dirichlet energy of
``z_k exp(4 i d_k)``:

    E = 1/2 sum over corners of w |z_{k+1} - exp(4 i (d_k - d_{k+1})) z_k|^2,

with the weights of `operators`.  Nothing but lengths and angles enters.  The Hermitian matrix is positive definite among the
edges inside a component with boundary; on a closed component too, unless the parallel transport of crosses around every loop is
the identity, as on the surface of a cube.  As a complex matrix it is factored in half the time of the real one with twice as
many rows, or less (1.4 instead of 4.5 ms with 1,000 edges, 0.41 instead of 0.85 s with 66,000).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from ..records import Float, Int
from .operators import FieldOperators, factor
from .symmetric import part, shifted

__all__ = ["ConnectionOperators"]

Complex = npt.NDArray[np.complex128]


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
        """(e, e) complex Hermitian stiffness matrix."""
        mesh = self.scalar.mesh
        d = 4.0 * mesh.edge_direction
        w, n = self.scalar.weight.ravel().astype(complex), len(mesh.edges)
        turned = -w * np.exp(1j * (d - np.roll(d, -1, axis=1)).ravel())
        i, j = mesh.triangle_edges.ravel(), np.roll(mesh.triangle_edges, -1, axis=1).ravel()
        entries = np.concatenate([w, w, turned, turned.conj()])
        return sp.coo_matrix((entries, (np.concatenate([i, j, j, i]), np.concatenate([i, j, i, j]))), (n, n)).tocsr()

    @cached_property
    def _inner(self) -> sp.csc_matrix:
        return part(self.stiffness, self.free)

    def apply(self, z: Float) -> Float:
        """(e, 2) stiffness times z (e, 2)."""
        return _split(np.asarray(self.stiffness @ _joined(z), complex))

    def load(self, z: Float) -> Float:
        """(f, 2) what the boundary values of z (e, 2) add to the right-hand side of the free edges."""
        boundary = np.zeros_like(z)
        boundary[self.scalar.fixed] = z[self.scalar.fixed]
        return -self.apply(boundary)[self.free]

    def shifted(self, shift: Float, scale: float = 1.0) -> Solver:
        """Factors of ``diag(shift) + scale K`` among the free edges; `shift` (f,) is one number per edge."""
        return Solver(shifted(self._inner, shift, scale))


class Solver:
    """A factored complex matrix, for numbers given by real and imaginary part."""

    def __init__(self, matrix: sp.csc_matrix) -> None:
        self._factors = factor(matrix)

    def solve(self, right: Float) -> Float:
        """Solution (f, 2) for a right-hand side (f, 2)."""
        return _split(self._factors.solve(_joined(right)))


def _joined(z: Float) -> Complex:
    return np.ascontiguousarray(z).view(complex).ravel()


def _split(z: Complex) -> Float:
    return z.view(float).reshape(-1, 2)
