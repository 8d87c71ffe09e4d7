"""From an aligned cross field to the T-mesh of one face.

Every patch must have four corners, and the Euler characteristic of the T-mesh must be that of the face (`assemble`).

A boundary loop that no separatrix touches gets a port at its CAD vertex (an annulus has no seed at all), and a closed component
without singularities, which is a torus, one at a vertex.  On a curved face patches that bend much in both directions are divided
(`bends`, `divide`).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..errors import LayoutError
from ..field.surface_mesh import SurfaceMesh, surface_of
from ..records import AlignedField, Bool, FaceMesh, FaceTMesh
from .assemble import assemble
from .divide import Divider
from .ports import fan
from .trace import Growth
from .trace_mesh import TraceMesh, trace_mesh

__all__ = ["trace_face"]


def trace_face(mesh: FaceMesh, aligned: AlignedField, extra_ports: Sequence[int] = ()) -> FaceTMesh:
    """Cut a face into four-sided patches.

    Parameters
    ----------
    mesh : FaceMesh
        Of any number of components; every boundary loop has a CAD vertex.
    aligned : AlignedField
        Of that mesh.
    extra_ports : sequence of int, optional
        Further vertices where a block corner is wanted.

    Returns
    -------
    FaceTMesh
        Every patch has four sides.

    Raises
    ------
    LayoutError
        If an index leaves no room for a block, a separatrix does not end, or a patch is not four-sided.
    """
    surface = surface_of(mesh)
    seed = mesh.port | (aligned.index != 0)
    seed[list(extra_ports)] = True
    loop = np.full(len(mesh.points), -1, np.int64)
    for number, vertices in enumerate(surface.loops):
        loop[vertices] = number
    steps = 2000 + 50 * int(np.sqrt(len(mesh.triangles)))
    for _ in range(len(surface.loops) + len(surface.component_euler) + 1):
        tracing = trace_mesh(mesh, surface, aligned, seed)
        at = _half_edges_at(tracing)
        seeds = np.flatnonzero(seed).tolist()
        growth = Growth(tracing, steps)
        traces = growth.run([(v, fan(tracing, at[v], int(aligned.index[v]))) for v in seeds])
        touched = set(loop[seed].tolist())
        touched |= {int(loop[mesh.boundary[tracing.row[t.crossings[-1][0]], 0]]) for t in traces if t.host is None}
        missing = _missing_ports(mesh, surface, seed, touched)
        if not missing:
            tmesh, sources = assemble(mesh, surface, aligned, tracing, seeds, traces)
            if mesh.points.shape[1] == 3:
                divider = Divider(mesh, growth)
                while divider.divide(tmesh, sources):
                    tmesh, sources = assemble(mesh, surface, aligned, tracing, seeds, traces)
            return tmesh
        seed[missing] = True
    raise LayoutError("a boundary loop stays without a block corner", location=mesh.points[missing[0]])


def _half_edges_at(tracing: TraceMesh) -> list[int]:
    """A half-edge that starts at every vertex; on the boundary the boundary half-edge."""
    start = np.array(tracing.start)
    out = np.full(len(tracing.points), -1, np.int64)
    out[start] = np.arange(len(start))
    wall = np.flatnonzero(np.array(tracing.wall) >= 0)
    out[start[wall]] = wall
    result: list[int] = out.tolist()
    return result


def _missing_ports(mesh: FaceMesh, surface: SurfaceMesh, seed: Bool, touched: set[int]) -> list[int]:
    """CAD vertices of untouched loops: one per loop, but a single one in a component without any seed; any vertex if closed."""
    served = set(surface.components[seed].tolist())
    out: list[int] = []
    for number, vertices in enumerate(surface.loops):
        component = int(surface.components[vertices[0]])
        if number in touched or (component not in served and any(surface.components[v] == component for v in out)):
            continue
        cad = vertices[mesh.vertex[vertices] >= 0]
        if not len(cad):
            raise LayoutError("a boundary loop of the background mesh has no CAD vertex", location=mesh.points[vertices[0]])
        out.append(int(cad[0]))
    bounded = {int(surface.components[vertices[0]]) for vertices in surface.loops}
    closed = set(range(len(surface.component_euler))) - bounded - served
    return out + [int(np.flatnonzero(surface.components == c)[0]) for c in sorted(closed)]
