"""How much elements of order p differ from the straight ones, as a function of their nodes, with a barrier at det J = 0.

With x_u, x_v the derivatives of an element divided by the lengths of those of the straight quad at the same place, n the normal
of the straight quad and d = n . (x_u times x_v), the energy is

    mean over places  (|x_u|^2 + |x_v|^2) / (2 chi(d))  +  mean over coefficients  (1 + c^2) / (2 chi(c))

where the places are those that determine the Jacobian, and c its Bernstein coefficients on the whole element over the Jacobian in
the middle of the straight one: where all of them are positive, so is the Jacobian [1]_.  The first part is 1 where the
element has right angles and the lengths of the straight one.  chi(d) = (d + sqrt(d^2 + eps^2)) / 2 is positive everywhere and
close to d where d is [2]_, so that elements that are turned over can be the start.

References
----------
.. [1] A. Johnen, J.-F. Remacle, C. Geuzaine, "Geometrical validity of curvilinear finite elements", Journal of Computational
   Physics 233, 2013, 359-372.
.. [2] V. Garanzha, I. Kaporin, L. Kudryavtseva, F. Protais, N. Ray, D. Sokolov, "Foldover-free maps in 50 lines of code", ACM
   Transactions on Graphics 40(4), 2021, equation (5).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..records import Float
from .jacobians import jacobian_matrices, quad_normals

__all__ = ["ShapeEnergy"]


@dataclass(frozen=True)
class ShapeEnergy:
    """The energy of m elements.

    Attributes
    ----------
    normals : (m, 3), middle : (m,) float64
        Unit normals of the straight quads, and their Jacobian in the middle.
    lengths : (2, m, s) float64
        Lengths of the derivatives of the straight quads at the places.
    along, across : ((p + 1)^2, s) float64
        From nodes to derivatives at the places.
    coefficients : (s, k) float64
        From Jacobians there to Bernstein coefficients.
    """

    normals: Float
    middle: Float
    lengths: Float
    along: Float
    across: Float
    coefficients: Float

    @classmethod
    def of_straight(cls, corners: Float, order: int) -> ShapeEnergy:
        """For quads with `corners` (m, 4, 3), all corners of which have a positive Jacobian."""
        ((along, across, coefficients),) = jacobian_matrices(order, 1)
        normals = quad_normals(corners)
        area = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
        u = (np.arange(order + 1) / order)[None, :, None, None]
        low = (1 - u) * corners[:, None, None, 0] + u * corners[:, None, None, 1]
        high = (1 - u) * corners[:, None, None, 3] + u * corners[:, None, None, 2]
        v = np.swapaxes(u, 1, 2)
        straight = ((1 - v) * low + v * high).reshape(len(corners), -1, 3)
        lengths = np.stack([np.linalg.norm(np.einsum("mkc,ks->msc", straight, d), axis=2) for d in (along, across)])
        return cls(normals, 0.5 * np.linalg.norm(area, axis=1), lengths, along, across, coefficients)

    def least(self, nodes: Float) -> Float:
        """Least Bernstein coefficient (m,) of elements with `nodes` (m, (p + 1)^2, 3), over the Jacobian in the middle of the
        straight ones; Gmsh's "minSJ"."""
        return self._parts(nodes)[3].min(axis=1)

    def lowest(self, nodes: Float) -> float:
        """The least argument of chi."""
        _, _, d, c = self._parts(nodes)
        return float(min(d.min(), c.min()))

    def _parts(self, nodes: Float) -> tuple[Float, Float, Float, Float]:
        """Derivatives (m, s, 3) over lengths, Jacobians (m, s) of them, and Bernstein coefficients (m, k) over the middle's."""
        a = np.einsum("mkc,ks->msc", nodes, self.along) / self.lengths[0][..., None]
        b = np.einsum("mkc,ks->msc", nodes, self.across) / self.lengths[1][..., None]
        d = np.einsum("msc,mc->ms", np.cross(a, b), self.normals)
        c = (d * self.lengths[0] * self.lengths[1]) @ self.coefficients / self.middle[:, None]
        return a, b, d, c

    def value(self, nodes: Float, eps: float) -> tuple[float, Float]:
        """Energy of all elements with `nodes` (m, (p + 1)^2, 3), and its gradient, of the same shape."""
        a, b, d, c = self._parts(nodes)
        chi, slope = _chi(d, eps)
        size = np.einsum("msc,msc->ms", a, a) + np.einsum("msc,msc->ms", b, b)
        by_d = -0.5 * size * slope / chi**2 / d.shape[1]
        barrier, c_slope = _chi(c, eps)
        by_c = (c / barrier - 0.5 * (1 + c * c) * c_slope / barrier**2) / c.shape[1]
        by_d += (by_c @ self.coefficients.T) * self.lengths[0] * self.lengths[1] / self.middle[:, None]
        n = self.normals[:, None]
        by_a = a / chi[..., None] / d.shape[1] + by_d[..., None] * np.cross(b, n)
        by_b = b / chi[..., None] / d.shape[1] + by_d[..., None] * np.cross(n, a)
        gradient = np.einsum("msc,ks->mkc", by_a / self.lengths[0][..., None], self.along)
        gradient += np.einsum("msc,ks->mkc", by_b / self.lengths[1][..., None], self.across)
        energy = np.sum(0.5 * size / chi) / d.shape[1] + np.sum(0.5 * (1 + c * c) / barrier) / c.shape[1]
        return float(energy), gradient


def _chi(d: Float, eps: float) -> tuple[Float, Float]:
    """chi and its derivative."""
    root = np.sqrt(d * d + eps * eps)
    # without cancellation where d is negative
    chi = np.where(d > 0, 0.5 * (d + root), 0.5 * eps * eps / (root - np.minimum(d, 0.0)))
    return chi, chi / root
