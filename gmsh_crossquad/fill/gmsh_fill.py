"""Fill guide quads with Gmsh's transfinite mesher, in a scratch model.

One curve per guide edge, a line or a spline through all of its nodes (the mesher takes the curve's geometry at a node's
parameter, not the node), one plane surface per guide quad.  Our nodes go on the curves, which are hidden so that
``Mesh.MeshOnlyVisible`` keeps them; then transfinite and recombine.  A count that does not fit is only a warning in Gmsh
and ends in triangles, hence the checks.

This follows the same rule as `coons` (they agree to rounding) and takes about ten times as long; it is there to check the
one against the other, and for surfaces that only Gmsh can evaluate.
"""

from __future__ import annotations

import gmsh
import numpy as np

from ..cad.session import gmsh_errors, options, scratch_model
from ..errors import MeshError
from ..records import Float, Int
from .numbering import GuideTopology
from .skeleton import Skeleton

__all__ = ["gmsh_cells"]


def gmsh_cells(quads: Int, topology: GuideTopology, skeleton: Skeleton) -> list[Float]:
    """Nodes inside all guide quads.

    Parameters
    ----------
    quads : (q, 4) int64
    topology : GuideTopology
    skeleton : Skeleton
        Planar sides of every quad.

    Returns
    -------
    list of ((ku - 1)(kv - 1), 3) float64
        Scaled; u (side 0) major.

    Raises
    ------
    MeshError
        Gmsh does not fill a cell as a grid.
    """
    with options(**{"Mesh.MeshOnlyVisible": 1}), scratch_model(), gmsh_errors("filling"):
        _curves(topology.edges, skeleton)
        _surfaces(quads, topology)
        gmsh.model.mesh.generate(2)
        pieces = skeleton.divisions[topology.quad_edges[:, :2]]
        return [_inside(q + 1, int(ku), int(kv)) for q, (ku, kv) in enumerate(pieces)]


def _curves(edges: Int, skeleton: Skeleton) -> None:
    """Hidden points and curves that carry our nodes."""
    geo, mesh = gmsh.model.geo, gmsh.model.mesh
    n = len(skeleton.vertices)
    for v, point in enumerate(skeleton.vertices.tolist()):
        geo.addPoint(*point, 0, v + 1)
    for row, point in enumerate(skeleton.inside.tolist()):
        geo.addPoint(*point, 0, n + row + 1)
    for e, (a, b) in enumerate((edges + 1).tolist()):
        inside = n + 1 + skeleton.first[e] + np.arange(skeleton.divisions[e] - 1)
        if len(inside):
            geo.addSpline([a, *inside.tolist(), b], e + 1)
        else:
            geo.addLine(a, b, e + 1)
    geo.synchronize()
    used = np.zeros(n, bool)
    used[edges] = True
    for v in np.flatnonzero(used).tolist():
        mesh.addNodes(0, v + 1, [v + 1], skeleton.vertices[v])
    for e, count in enumerate(skeleton.divisions.tolist()):
        if count > 1:
            tags = n + 1 + skeleton.first[e] + np.arange(count - 1)
            mesh.addNodes(1, e + 1, tags, skeleton.edge(e).ravel(), np.arange(1, count) / count)
    gmsh.model.setVisibility(gmsh.model.getEntities(0) + gmsh.model.getEntities(1), 0)


def _surfaces(quads: Int, topology: GuideTopology) -> None:
    """A transfinite plane surface for every quad."""
    geo, mesh = gmsh.model.geo, gmsh.model.mesh
    sign = np.where(topology.edges[topology.quad_edges, 0] == quads, 1, -1)
    for q, loop in enumerate((sign * (topology.quad_edges + 1)).tolist()):
        geo.addPlaneSurface([geo.addCurveLoop(loop)], q + 1)
    geo.synchronize()
    for q, corners in enumerate((quads + 1).tolist()):
        mesh.setTransfiniteSurface(q + 1, "Left", corners)
        mesh.setRecombine(2, q + 1)


def _inside(tag: int, ku: int, kv: int) -> Float:
    """Inner nodes of a surface that Gmsh has meshed."""
    kinds, elements, _ = gmsh.model.mesh.getElements(2, tag)
    count = {int(kind): len(e) for kind, e in zip(kinds, elements)}
    _, x, _ = gmsh.model.mesh.getNodes(2, tag)
    if count != {3: ku * kv} or len(x) != 3 * (ku - 1) * (kv - 1):
        raise MeshError(f"Gmsh did not fill guide quad {tag - 1} as a {ku} x {kv} grid", remedy="fill with NumPy")
    return np.asarray(x).reshape(-1, 3)
