"""The Crouzeix–Raviart Laplacian on edge midpoints, factored once.

One unknown per edge; in a triangle the unknowns of edges k and k + 1 meet at vertex k + 1 with weight ``2 cot(angle there)``, so
that ``1/2 sum w (x_{k+1} - x_k)^2`` is exactly the Dirichlet energy of the piecewise linear (per triangle) function.  Values on
boundary edges are prescribed; in a component without boundary, where only a constant is free, x is 0 on its first edge.  Every
problem of the field stage is one of

    min over x of 1/2 sum over corners of w (x_{k+1} - x_k + r)^2,    x given on those edges,

with one and the same symmetric positive definite matrix.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spl

from ..records import Float, Int
from .surface_mesh import SurfaceMesh
from .symmetric import part, shifted

__all__ = ["FieldOperators", "factor"]


def factor(matrix: sp.csc_matrix) -> Any:
    """Factor a symmetric positive definite sparse matrix; ``.solve(rhs)`` of the result takes (n,) or (n, k)."""
    return spl.splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})


@dataclass(frozen=True)
class FieldOperators:
    """Stiffness matrix, its factors and the solves that all field stages share.

    Parameters
    ----------
    mesh : SurfaceMesh
    """

    mesh: SurfaceMesh

    @cached_property
    def weight(self) -> Float:
        """(m, 3) weight of the corner between edges k and k + 1 of every triangle."""
        return 2.0 / np.tan(np.roll(self.mesh.corner_angle, -1, axis=1))

    @cached_property
    def free(self) -> Int:
        """Interior edges, but for one of every component without boundary."""
        unknown = ~self.mesh.boundary_edge
        closed = self.mesh.component_closed
        if np.any(closed):
            part = self.mesh.components[self.mesh.edges[:, 0]]
            unknown[np.unique(part, return_index=True)[1][closed]] = False
        return np.flatnonzero(unknown)

    @cached_property
    def fixed(self) -> Int:
        """Boundary edges."""
        return np.flatnonzero(self.mesh.boundary_edge)

    @cached_property
    def stiffness(self) -> sp.csr_matrix:
        """(e, e) stiffness matrix."""
        i = self.mesh.triangle_edges.ravel()
        j = np.roll(self.mesh.triangle_edges, -1, axis=1).ravel()
        w, n = self.weight.ravel(), len(self.mesh.edges)
        rows, cols = np.concatenate([i, j, i, j]), np.concatenate([i, j, j, i])
        return sp.coo_matrix((np.concatenate([w, w, -w, -w]), (rows, cols)), (n, n)).tocsr()

    @cached_property
    def inner(self) -> sp.csc_matrix:
        """The stiffness among the free edges."""
        return part(self.stiffness, self.free)

    @cached_property
    def _factors(self) -> Any:
        return factor(self.inner)

    def apply(self, z: Float) -> Float:
        """(e, k) stiffness times z (e, k)."""
        out: Float = self.stiffness @ z
        return out

    def load(self, z: Float) -> Float:
        """(f, k) what the boundary values of z (e, k) add to the right-hand side of the free edges."""
        boundary = np.zeros_like(z)
        boundary[self.fixed] = z[self.fixed]
        out: Float = -(self.stiffness @ boundary)[self.free]
        return out

    def shifted(self, shift: Float, scale: float = 1.0) -> Any:
        """Factors of ``diag(shift) + scale * inner`` for a `shift` (f,)."""
        return factor(shifted(self.inner, shift, scale))

    def difference(self, x: Float) -> Float:
        """(m, 3) value on edge k + 1 minus value on edge k."""
        y = x[self.mesh.triangle_edges]
        return np.roll(y, -1, axis=1) - y

    def divergence(self, r: Float) -> Float:
        """(e,) adjoint of `difference` with the weights: ``sum_corners w r difference(x) = x @ divergence(r)``."""
        flow = self.weight * r
        pull = (np.roll(flow, 1, axis=1) - flow).ravel()
        return np.bincount(self.mesh.triangle_edges.ravel(), pull, len(self.mesh.edges)).astype(np.float64)

    def solve(self, boundary_values: Float, correction: Float | None = None) -> Float:
        """Minimise ``1/2 sum w (difference(x) + correction)^2`` with `x` given on the boundary.

        Parameters
        ----------
        boundary_values : (e,) or (e, k) float64
            Only the entries of boundary edges are read.
        correction : (m, 3) or (k, m, 3) float64, optional
            The same for all columns, or one for each.

        Returns
        -------
        (e,) or (e, k) float64
        """
        x = np.zeros_like(boundary_values)
        x[self.fixed] = boundary_values[self.fixed]
        right = -(self.stiffness @ x)[self.free]
        if correction is not None:
            load = [-self.divergence(r)[self.free] for r in correction.reshape(-1, *self.weight.shape)]
            right += load[0] if right.ndim == 1 else np.stack(load, axis=1)
        x[self.free] = self._factors.solve(right)
        return x

    def energy(self, rotation: Float) -> float:
        """Dirichlet energy ``1/2 integral |grad theta|^2`` of a field with this rotation (m, 3) between edges."""
        return 0.5 * float(np.sum(self.weight * rotation * rotation))
