"""Points and curves of physical groups that are on no face which is meshed: they get elements too, as Gmsh gives them."""

from __future__ import annotations

from collections.abc import Iterator

import gmsh
import numpy as np

from ..errors import MeshError
from ..records import Float, Model

__all__ = ["evenly_spaced", "loose_curves", "loose_points"]

SAMPLES = 400
MOST_EDGES = 10_000


def loose_points(model: Model) -> list[int]:
    """Points in physical groups that bound no curve and are not in `model`."""
    known = {*model.vertex_tags.tolist(), *(tag for tag, _ in model.vertex_twins)}
    return [tag for tag in _grouped(0) if tag not in known and len(gmsh.model.getAdjacencies(0, tag)[0]) == 0]


def loose_curves(model: Model) -> list[int]:
    """Curves in physical groups that bound no face and are in no face of `model`."""
    known = {curve.tag for curve in model.curves}
    return [tag for tag in _grouped(1) if tag not in known and len(gmsh.model.getAdjacencies(1, tag)[0]) == 0]


def _grouped(dim: int) -> Iterator[int]:
    """Every entity of a dimension that is in a physical group, once."""
    seen: dict[int, None] = {}
    for _, group in gmsh.model.getPhysicalGroups(dim):
        seen.update(dict.fromkeys(gmsh.model.getEntitiesForPhysicalGroup(dim, group).tolist()))
    yield from seen


def evenly_spaced(tag: int, size: float) -> tuple[Float, Float]:
    """Parameters (n,) and points (n, 3) of a curve's nodes, evenly spaced by arc length, its ends included.

    Parameters
    ----------
    tag : int
        Of a curve of the current Gmsh model.
    size : float
        Greatest edge length, in the user's units.

    Raises
    ------
    MeshError
        The curve would have more than `MOST_EDGES` edges.
    """
    low, high = (float(x[0]) for x in gmsh.model.getParametrizationBounds(1, tag))
    t = np.linspace(low, high, SAMPLES + 1)
    points = np.asarray(gmsh.model.getValue(1, tag, t)).reshape(-1, 3)
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    n = max(int(np.ceil(s[-1] / size * (1 - 1e-9))), 1)
    if n > MOST_EDGES:
        remedy = "take it out of its Physical Curve, or give a greater size"
        raise MeshError(f"the curve, which is on no face, would have {n} edges", entity=(1, tag), remedy=remedy)
    inner = np.interp(np.linspace(0.0, s[-1], n + 1)[1:-1], s, t)
    parameters = np.concatenate([[low], inner, [high]])
    return parameters, np.asarray(gmsh.model.getValue(1, tag, parameters)).reshape(-1, 3)
