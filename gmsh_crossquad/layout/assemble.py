"""The T-mesh of finished traces: nodes, arcs, and the four-sided patches between them.

The nodes are the seeds, the T-junctions, the ends of traces at the boundary, and the beginnings of branches.  Around every node
the order of the arcs and the quads between them are known without any coordinate; `patches` walks around them.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..errors import LayoutError
from ..field.surface_mesh import SurfaceMesh
from ..records import AlignedField, FaceMesh, FaceTMesh, Float, Int
from .crossing import AROUND, ONE, on_left
from .patches import Half, Ring, patches
from .trace import Trace
from .trace_mesh import TraceMesh

__all__ = ["Source", "assemble"]

Source = tuple[int, int, int]
"""A trace, and the range of its crossings that an arc runs through; the trace is -1 for an arc along the boundary."""


@dataclass
class _Graph:
    """Nodes and arcs under construction; `row` and `fraction` place a boundary node."""

    position: list[Float] = field(default_factory=list)
    vertex: list[int] = field(default_factory=list)
    row: list[int] = field(default_factory=list)
    fraction: list[float] = field(default_factory=list)
    arcs: list[tuple[int, int]] = field(default_factory=list)
    polyline: list[Float] = field(default_factory=list)
    loop: list[int] = field(default_factory=list)
    source: list[Source] = field(default_factory=list)

    def node(self, position: Float, vertex: int = -1, row: int = -1, fraction: float = 0.0) -> int:
        self.position.append(position)
        self.vertex.append(vertex)
        self.row.append(row)
        self.fraction.append(fraction)
        return len(self.position) - 1

    def arc(self, start: int, end: int, between: Float, loop: int = -1, source: Source = (-1, 0, 0)) -> int:
        self.arcs.append((start, end))
        self.source.append(source)
        self.polyline.append(np.concatenate([self.position[start][None], between, self.position[end][None]]))
        self.loop.append(loop)
        return len(self.arcs) - 1


def assemble(
    mesh: FaceMesh, surface: SurfaceMesh, aligned: AlignedField, tracing: TraceMesh, seeds: list[int], traces: list[Trace]
) -> tuple[FaceTMesh, list[Source]]:
    """The T-mesh of finished traces, and where each of its arcs comes from.

    Parameters
    ----------
    mesh, surface, aligned, tracing
        Of one face.
    seeds : list of int
        Background vertices in order.
    traces : list of Trace
        Those of the seeds in the order of their ports, then branches.

    Raises
    ------
    LayoutError
        If a patch is not four-sided, or the layout falls apart.
    """
    graph = _Graph()
    for v in seeds:
        graph.node(mesh.points[v], v, int(np.flatnonzero(mesh.boundary[:, 0] == v)[0]) if surface.boundary_vertex[v] else -1)
    at_seed = {v: i for i, v in enumerate(seeds)}
    points = [_points(tracing, trace) for trace in traces]
    ends = [_end_node(graph, tracing, trace, points) for trace in traces]
    starts = [_start_node(graph, tracing, trace, points) if trace.start else at_seed[trace.seed] for trace in traces]

    ways: dict[int, list[Half]] = {}  # arcs that leave a seed or a T-junction, in order
    stems: list[Half] = []
    for number, (place, end, junctions) in enumerate(zip(points, ends, _junctions(traces, ends, starts))):
        node, segment = starts[number], 0
        for next_segment, _, rank, junction in [*junctions, (len(place) - 2, 0.0, 0, end)]:
            stop = next_segment + (rank >= 0)  # a branch begins at a crossing, which is no inner point of an arc then
            arc = graph.arc(node, junction, place[segment + 1 : stop], source=(number, segment, stop - 1))
            ways.setdefault(node, []).append((arc, 1))
            if junction != end:
                ways.setdefault(junction, []).append((arc, -1))
            node, segment = junction, next_segment
        stems.append((arc, -1))
    walls = _boundary_arcs(graph, mesh, surface)

    rings: list[Ring] = []
    for node, v in enumerate(seeds):
        around = ways.get(node, [])
        if surface.boundary_vertex[v]:
            rings.append([(h, 1) for h in [walls[node][0], *around]] + [(walls[node][1], 0)])
        else:
            rings.append([(h, 1) for h in around])
    for trace, stem, end in zip(traces, stems, ends):
        if trace.host is None or trace.last is None:
            rings.append([(walls[end][0], 1), (stem, 1), (walls[end][1], 0)])
        else:
            rings.append(_junction(ways[end], stem, on_left(trace.host, trace.last.a)))
    branches = [(trace, start) for trace, start in zip(traces, starts) if trace.start]
    for trace, node in branches:
        if node in walls:
            rings.append([(walls[node][0], 1), (ways[node][0], 1), (walls[node][1], 0)])
        else:
            assert trace.start is not None
            rings.append(_junction(ways[node][:2], ways[node][2], trace.start.left))
    cells = patches(rings, graph.position)

    arcs = np.array(graph.arcs, np.int64).reshape(-1, 2)
    vertex = np.array(graph.vertex, np.int64)
    beside = np.array(seeds + [trace.seed for trace in traces] + [trace.seed for trace, _ in branches], np.int64)
    _check_euler(mesh, surface, beside, arcs, cells)
    tmesh = FaceTMesh(
        face=mesh.face,
        position=np.array(graph.position).reshape(-1, mesh.points.shape[1]),
        vertex=vertex,
        index=np.where(vertex >= 0, aligned.index[vertex], 0),
        half_edge=np.array(graph.row, np.int64),
        half_edge_fraction=np.array(graph.fraction),
        arcs=arcs,
        length=np.array([float(np.linalg.norm(np.diff(p, axis=0), axis=1).sum()) for p in graph.polyline]),
        polyline=tuple(graph.polyline),
        loop=np.array(graph.loop, np.int64),
        patches=cells,
    )
    return tmesh, graph.source


def _junction(through: list[Half], stem: Half, left: bool) -> Ring:
    """Arcs around a T-junction: those of the trace through it, back and onward, and a stem on its left or right."""
    if len(through) != 2:
        raise LayoutError("a separatrix ends where no other one passes", remedy="another field or a finer background may help")
    back, onward = through
    if left:
        return [(onward, 1), (stem, 1), (back, 2)]
    return [(onward, 2), (back, 1), (stem, 1)]


def _points(tracing: TraceMesh, trace: Trace) -> Float:
    """Seed and crossings of a trace (the last one only on paper if it ends inside a triangle)."""
    start = trace.start
    first = tracing.points[trace.seed] if start is None else tracing.point(start.half_edge, start.place / ONE)
    out: Float = np.array([first, *(tracing.point(h, place / ONE) for h, place in trace.crossings)])
    return out


def _start_node(graph: _Graph, tracing: TraceMesh, trace: Trace, points: list[Float]) -> int:
    """Node where a branch begins: at the boundary, or the crossing of its host."""
    start = trace.start
    assert start is not None
    if start.host >= 0:
        return graph.node(points[start.host][start.crossing + 1])
    low, high = tracing.span[start.half_edge]
    fraction = low + start.place / ONE * (high - low)
    return graph.node(np.array(tracing.point(start.half_edge, start.place / ONE)), -1, tracing.row[start.half_edge], fraction)


def _end_node(graph: _Graph, tracing: TraceMesh, trace: Trace, points: list[Float]) -> int:
    """Node at the end of a trace."""
    host = trace.host
    if host is None:
        h, place = trace.crossings[-1]
        low, high = tracing.span[h]
        return graph.node(np.array(tracing.point(h, place / ONE)), -1, tracing.row[h], low + place / ONE * (high - low))
    a, b = points[host.trace][host.segment : host.segment + 2]
    return graph.node((1.0 - trace.along) * a + trace.along * b)


def _junctions(traces: list[Trace], ends: list[int], starts: list[int]) -> list[list[tuple[int, float, int, int]]]:
    """T-junctions on every trace in order, each (segment, fraction of it, rank, node); the rank of a branch is -1.

    Stems on the same side of one chord are ordered by their entries into the triangle, exactly; fractions only interleave the
    two sides.
    """
    sides: dict[tuple[int, int, bool], list[tuple[int, float, int]]] = {}
    for trace, end in zip(traces, ends):
        host, own = trace.host, trace.last
        if host is None or own is None:
            continue
        left = on_left(host, own.a)
        key = (host.a - own.a if left else own.a - host.a) % AROUND
        sides.setdefault((host.trace, host.segment, left), []).append((key, trace.along, end))
    out: list[list[tuple[int, float, int, int]]] = [[] for _ in traces]
    for (host_trace, segment, _), group in sides.items():
        reached = 0.0
        for rank, (_, along, end) in enumerate(sorted(group)):
            reached = max(reached, along)
            out[host_trace].append((segment, reached, rank, end))
    for trace, node in zip(traces, starts):
        if trace.start and trace.start.host >= 0:
            out[trace.start.host].append((trace.start.crossing + 1, 0.0, -1, node))
    return [sorted(junctions) for junctions in out]


def _boundary_arcs(graph: _Graph, mesh: FaceMesh, surface: SurfaceMesh) -> dict[int, tuple[Half, Half]]:
    """Add the arcs along the boundary; returns for every boundary node the arcs that leave it, onward and back."""
    row_of = np.full(len(mesh.points), -1, np.int64)
    row_of[mesh.boundary[:, 0]] = np.arange(len(mesh.boundary))
    place = {int(r): (number, rank) for number, v in enumerate(surface.loops) for rank, r in enumerate(row_of[v].tolist())}
    on_loop: list[list[tuple[int, float, int]]] = [[] for _ in surface.loops]
    for node, (row, fraction) in enumerate(zip(graph.row, graph.fraction)):
        if row >= 0:
            number, rank = place[row]
            on_loop[number].append((rank, fraction, node))
    onward: dict[int, Half] = {}
    back: dict[int, Half] = {}
    for number, (vertices, nodes) in enumerate(zip(surface.loops, on_loop)):
        nodes.sort()
        for (rank, _, node), (next_rank, fraction, next_node) in zip(nodes, nodes[1:] + nodes[:1]):
            stop = next_rank + (fraction > 0.0)
            if (next_rank, fraction) <= (rank, graph.fraction[node]):
                stop += len(vertices)
            between = mesh.points[vertices[np.arange(rank + 1, stop) % len(vertices)]]
            arc = graph.arc(node, next_node, between, number)
            onward[node], back[next_node] = (arc, 1), (arc, -1)
    return {node: (onward[node], back[node]) for node in onward}


def _check_euler(
    mesh: FaceMesh,
    surface: SurfaceMesh,
    nodes: Int,
    arcs: Int,
    cells: tuple[tuple[tuple[Half, ...], ...], ...],
) -> None:
    """Euler characteristic of the T-mesh against the face's, component by component; `nodes` holds a vertex beside every node."""
    component = surface.components[nodes]
    count = len(surface.component_euler)
    euler = np.bincount(component, minlength=count) - np.bincount(component[arcs[:, 0]], minlength=count)
    euler += np.bincount(component[[arcs[cell[0][0][0], 0] for cell in cells]], minlength=count)
    wrong = np.flatnonzero(euler != surface.component_euler)
    if len(wrong):
        raise LayoutError(
            "the layout of a part of a face falls apart",
            location=mesh.points[np.flatnonzero(surface.components == wrong[0])[0]],
            remedy="another size, or a finer background mesh, may help",
        )
