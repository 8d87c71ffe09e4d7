"""CAD curves as dense polylines.

A curve is bisected in its parameter until every segment deviates from the curve by less than `DEVIATION` of the model
and turns by less than `TURNING`.  With m the curve's point at the middle parameter of the segment (a, b), the
deviation is the distance of m from the chord and the turning twice the angle between (a, m) and (m, b).  All middle
points are kept, which divides the turning by two and the deviation by four.  Straight lines get three points; the
number that arcs of circles need is known after the first samples.
"""

from __future__ import annotations

import gmsh
import numpy as np

from ..errors import GeometryError
from ..records import Float, Int
from .session import gmsh_errors

__all__ = ["evaluate", "refine", "sample"]

DEVIATION = 1e-6  # of the model, for the final samples
TURNING = np.radians(2.0)  # per final segment
SHORTEST = 1e-5  # of the model: at a kink the bisection ends here
MAX_SAMPLES = 2000
ALIKE = 1e-2  # arcs of circles have one deviation everywhere
FIRST_SEGMENTS = {"Line": 2, "Circle": 16, "Ellipse": 16}
OTHER_SEGMENTS = 64


def evaluate(tag: int, parameters: Float) -> Float:
    """Points (n, 3) of curve `tag` in the user's coordinates at `parameters` (n,)."""
    with gmsh_errors("evaluating", entity=(1, tag)):
        return np.asarray(gmsh.model.getValue(1, tag, np.ascontiguousarray(parameters))).reshape(-1, 3)


def sample(tag: int, kind: str) -> tuple[Float, Float]:
    """First, coarse samples of a curve.

    Parameters
    ----------
    tag : int
        Gmsh tag of the curve.
    kind : str
        Gmsh type of the curve.

    Returns
    -------
    parameters : (n,) float64
    points : (n, 3) float64
        In the user's coordinates.  A discrete curve has those of its mesh nodes.

    Raises
    ------
    GeometryError
        Where the curve cannot be evaluated.
    """
    if kind.startswith("Discrete"):
        return _mesh_chain(tag)
    lo, hi = gmsh.model.getParametrizationBounds(1, tag)
    if len(lo) != 1 or not (np.isfinite([lo[0], hi[0]]).all() and lo[0] < hi[0]):
        raise GeometryError("the curve has no parametrization", entity=(1, tag), remedy="remove it or draw it again")
    parameters = np.linspace(lo[0], hi[0], FIRST_SEGMENTS.get(kind, OTHER_SEGMENTS) + 1)
    points = evaluate(tag, parameters)
    if not np.isfinite(points).all():
        raise GeometryError("the curve has no finite points", entity=(1, tag), remedy="remove it or draw it again")
    return parameters, points


def _mesh_chain(tag: int) -> tuple[Float, Float]:
    """Nodes of a discrete curve in order; the parameter counts the segments."""
    with gmsh_errors("reading the mesh of", entity=(1, tag)):
        types, _, nodes = gmsh.model.mesh.getElements(1, tag)
    lines = [n.reshape(-1, gmsh.model.mesh.getElementProperties(int(t))[3])[:, :2].astype(np.int64) for t, n in zip(types, nodes)]
    if not lines:
        raise GeometryError("the discrete curve has no mesh", entity=(1, tag), remedy="open the CAD model instead")
    chain = _order_segments(np.concatenate(lines), tag)
    points = np.array([gmsh.model.mesh.getNode(int(n))[0] for n in chain])
    return np.arange(len(chain), dtype=float), points


def _order_segments(lines: Int, tag: int) -> list[int]:
    """Nodes of a chain of segments in order (a closed one repeats its first node)."""
    follower = dict(zip(lines[:, 0].tolist(), lines[:, 1].tolist()))
    heads = sorted(set(lines[:, 0].tolist()) - set(lines[:, 1].tolist()))
    chain = [heads[0] if heads else int(lines[0, 0])]
    for _ in range(len(lines)):
        if chain[-1] not in follower:
            break
        chain.append(follower[chain[-1]])
    if len(heads) > 1 or len(follower) != len(lines) or len(chain) != len(lines) + 1:
        raise GeometryError("the discrete curve is no simple chain", entity=(1, tag), remedy="split it where it branches")
    return chain


def _error(a: Float, m: Float, b: Float) -> tuple[Float, Float, Float]:
    """Deviation and turning of segments (a, b) with middle points m, and the greater distance of m from the ends."""
    chord, first, second = b - a, m - a, b - m
    size, one, two = (np.sqrt((v**2).sum(1)) for v in (chord, first, second))
    along = (first * second).sum(1)
    normal = np.sqrt(np.maximum((one * two) ** 2 - along**2, 0.0))
    deviation = np.divide(normal, size, out=np.maximum(one, two), where=size > 0)
    return deviation, np.arctan2(normal, along), np.maximum(one, two)


def refine(tag: int, kind: str, parameters: Float, points: Float, scale: float) -> tuple[Float, Float]:
    """Bisect the first samples of a curve until they stand for it.

    Parameters
    ----------
    tag : int
    kind : str
    parameters : (n,) float64; points : (n, 3) float64
        From `sample`.
    scale : float
        Size of the model.

    Returns
    -------
    parameters : (m,) float64; points : (m, 3) float64
    """
    if kind == "Line" or kind.startswith("Discrete"):
        return parameters, points
    if kind in ("Circle", "Ellipse"):
        deviation, turning, _ = _error(points[:-2:2], points[1:-1:2], points[2::2])
        if np.ptp(deviation) <= ALIKE * deviation.max():
            finer = max(np.sqrt(0.25 * deviation.max() / (DEVIATION * scale)), 0.5 * turning.max() / TURNING, 1.0)
            return _uniform(tag, parameters, points, finer)
    check = np.ones(len(parameters) - 1, bool)
    for _ in range(24):
        rows = np.flatnonzero(check)
        if len(rows) == 0 or len(parameters) + len(rows) > MAX_SAMPLES:
            break
        middle = 0.5 * (parameters[rows] + parameters[rows + 1])
        new = evaluate(tag, middle)
        deviation, turning, reach = _error(points[rows], new, points[rows + 1])
        bad = ((deviation > 4 * DEVIATION * scale) | (turning > TURNING)) & (reach > SHORTEST * scale)
        parameters = np.insert(parameters, rows + 1, middle)
        points = np.insert(points, rows + 1, new, axis=0)
        check = np.zeros(len(parameters) - 1, bool)
        at = rows[bad] + np.flatnonzero(bad)  # the first half of a segment that was split after `at` earlier ones
        check[at] = check[at + 1] = True
    return parameters, points


def _uniform(tag: int, parameters: Float, points: Float, finer: float) -> tuple[Float, Float]:
    """Replace all segments, which are alike, by `finer` times as many; the ends stay as they are."""
    count = min((len(parameters) - 1) * int(np.ceil(finer)), MAX_SAMPLES - 1)
    parameters = np.linspace(parameters[0], parameters[-1], count + 1)
    return parameters, np.concatenate([points[:1], evaluate(tag, parameters[1:-1]), points[-1:]])
