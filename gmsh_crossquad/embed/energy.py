"""The energy of a quad grid against rest lengths, its gradient and a positive definite Hessian.

Every corner of a quad is compared with a right angle between edges of their rest lengths.  With e and f the edge
vectors at the corner, divided by their rest lengths, J = (e, f), N = |e|^2 + |f|^2 and D = e x f,

    phi = h^p + lambda w,     h = N / (2 chi(D)),     w = (1 + D^2) / (2 chi(D)),
    chi(D) = (D + sqrt(eps^2 + D^2)) / 2,

where h is the regularised inverse mean ratio (shape; 1 for the ideal corner) and w the regularised area term (1 for the
ideal area).  With eps > 0 the energy is finite for turned-over corners and pushes them back; with eps = 0 it is a
barrier that no corner can cross.

phi is convex in (J, D) where chi is replaced by its tangent, thus dropping chi'' and the second derivative of D leaves
the positive semidefinite matrix

    M = 2 phi_N I + 4 phi_NN J J^T + 2 phi_ND (J c^T + c J^T) + phi_DD c c^T,      c = dD/dJ.

Corners can be left out, such as those in cusps: the other three of the quad then settle at 120 degrees.

References
----------
.. [1] V. Garanzha, I. Kaporin, L. Kudryavtseva, F. Protais, N. Ray, D. Sokolov, "Foldover-free maps in 50 lines of
   code", ACM Transactions on Graphics 40(4), 2021, equations (2)-(5).
"""

from __future__ import annotations

import numpy as np

from ..records import Bool, Float

__all__ = ["AREA_WEIGHT", "corner_areas", "corner_energy", "corner_hessian"]

AREA_WEIGHT = 0.5
"""lambda, the weight of the area term."""

PREVIOUS = (3, 0, 1, 2)
NEXT = (1, 2, 3, 0)


def _edges(x: Float, y: Float, rest: Float) -> tuple[Float, Float]:
    """Edge vectors (4, q) over their rest lengths; edge k runs from corner k to corner k + 1."""
    return (x.take(NEXT, 0) - x) / rest, (y.take(NEXT, 0) - y) / rest


def corner_areas(x: Float, y: Float, rest: Float) -> Float:
    """D of every corner (4, q): its signed area over the area at rest."""
    ex, ey = _edges(x, y, rest)
    area: Float = ex.take(PREVIOUS, 0) * ey - ey.take(PREVIOUS, 0) * ex
    return area


def _chi(area: Float, eps: float) -> tuple[Float, Float]:
    """chi(D) and its derivative, without cancellation for D < 0."""
    if eps == 0.0:
        return area, np.ones_like(area)
    root = np.sqrt(eps * eps + area * area)
    total = root + np.abs(area)
    chi = 0.5 * np.where(area > 0.0, total, eps * eps / total)
    return chi, chi / root


def _power(h: Float, power: int) -> Float:
    """h ** power by products, which is many times faster for small powers."""
    out = np.ones_like(h)
    for _ in range(power):
        out = out * h
    return out


def corner_energy(
    x: Float, y: Float, rest: Float, eps: float, power: int, without: Bool | None = None
) -> tuple[float, Float, Float]:
    """Energy of all corners and its gradient.

    Parameters
    ----------
    x, y : (4, q) float64
        Coordinates of the quads' corners in the plane of their face, counter-clockwise.
    rest : (4, q) float64
        Rest lengths of the edges; edge k runs from corner k to corner k + 1.
    eps : float
        Regularisation; 0 is the barrier.
    power : int
        p, the power on the shape term.
    without : (4, q) bool, optional
        Corners that do not count.

    Returns
    -------
    energy : float
        inf where `eps` is 0 and a corner is turned over.
    gx, gy : (4, q) float64
        Derivatives with respect to `x` and `y` (undefined if the energy is inf).
    """
    ex, ey = _edges(x, y, rest)
    fx, fy = ex.take(PREVIOUS, 0), ey.take(PREVIOUS, 0)
    area = fx * ey - fy * ex
    if without is not None:
        area = np.where(without, 1.0, area)
    if eps == 0.0 and not area.min(initial=np.inf) > 0.0:
        return np.inf, ex, ey
    square = ex * ex + ey * ey
    square = square + square.take(PREVIOUS, 0)
    chi, slope = _chi(area, eps)
    inverse = 1.0 / chi
    h = 0.5 * square * inverse
    w = 0.5 * (1.0 + area * area) * inverse
    h_power = _power(h, power - 1)
    if without is not None:
        h_power, w = np.where(without, 0.0, h_power), np.where(without, 0.0, w)
    energy = float((h_power * h).sum() + AREA_WEIGHT * w.sum())
    by_square = power * h_power * inverse  # 2 phi_N
    by_area = AREA_WEIGHT * area * inverse - slope * inverse * (power * h_power * h + AREA_WEIGHT * w)
    if without is not None:
        by_area = np.where(without, 0.0, by_area)
    both = by_square + by_square.take(NEXT, 0)
    after_x, after_y = ex.take(NEXT, 0), ey.take(NEXT, 0)
    by_after = by_area.take(NEXT, 0)
    gex = (both * ex - by_area * fy + by_after * after_y) / rest
    gey = (both * ey + by_area * fx - by_after * after_x) / rest
    return energy, gex.take(PREVIOUS, 0) - gex, gey.take(PREVIOUS, 0) - gey


def corner_hessian(x: Float, y: Float, rest: Float, eps: float, power: int, without: Bool | None = None) -> Float:
    """Positive semidefinite Hessian of every quad.

    Parameters
    ----------
    x, y, rest, eps, power, without
        As in `corner_energy`.

    Returns
    -------
    (4, 2, 4, 2, q) float64
        Rows and columns are (corner, coordinate).
    """
    ex, ey = _edges(x, y, rest)
    fx, fy = ex.take(PREVIOUS, 0), ey.take(PREVIOUS, 0)
    area = fx * ey - fy * ex
    if without is not None:
        area = np.where(without, 1.0, area)
    square = ex * ex + ey * ey + fx * fx + fy * fy
    chi, slope = _chi(area, eps)
    h = 0.5 * square / chi
    w = 0.5 * (1.0 + area * area) / chi
    tilt = slope / chi
    second = power * (power - 1) * _power(h, power - 2) if power > 1 else np.zeros_like(h)
    first = power * _power(h, power - 1)
    h_n, h_d = 0.5 / chi, -h * tilt
    n1 = 2.0 * first * h_n
    nn = 4.0 * second * h_n * h_n
    nd = 2.0 * (second * h_n * h_d - first * h_n * tilt)
    dd = second * h_d * h_d + first * 2.0 * h * tilt * tilt
    dd += AREA_WEIGHT * (1.0 / chi - 2.0 * area * tilt / chi + 2.0 * w * tilt * tilt)
    # The corner's variables are (previous edge, next edge), and D = previous x next.
    jacobian = np.stack((fx, fy, ex, ey))
    cofactor = np.stack((ey, -ex, -fy, fx))
    mixed = jacobian[:, None] * cofactor
    corner = nn * jacobian[:, None] * jacobian + nd * (mixed + mixed.swapaxes(0, 1)) + dd * cofactor[:, None] * cofactor
    for c in range(4):
        corner[c, c] += n1
    if without is not None:
        corner *= ~without
    q = x.shape[1]
    edge = np.zeros((4, 2, 4, 2, q))
    for k in range(4):
        ends = (PREVIOUS[k], k)
        for i in (0, 1):
            for j in (0, 1):
                block = corner[2 * i : 2 * i + 2, 2 * j : 2 * j + 2, k]
                edge[ends[i], :, ends[j], :] += block
    inverse = 1.0 / rest
    edge *= inverse[:, None, None, None]
    edge *= inverse[None, None, :, None]
    edge = edge.take(PREVIOUS, 0) - edge
    hessian: Float = edge.take(PREVIOUS, 2) - edge
    return hessian
