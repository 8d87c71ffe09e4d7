"""Glue the T-meshes of all faces along the CAD curves they share.

Every T-node that any face puts on a curve cuts the curve; the *pieces* between consecutive T-nodes are the arcs that all
faces at the curve share.  A boundary arc of one face's T-mesh becomes a run of pieces.  After gluing, a model with many
faces, curves with three faces and embedded curves (used twice by one face) is one T-mesh like that of a single face.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..errors import LayoutError
from ..records import FaceMesh, FaceTMesh, Float, Int, Model, TMesh

__all__ = ["glue"]

Run = list[tuple[int, int]]


@dataclass
class _Arcs:
    """Global arcs under construction."""

    ends: list[tuple[int, int]]
    length: list[float]
    polyline: list[Float]
    curve: list[int]
    start: list[float]

    def add(self, a: int, b: int, length: float, polyline: Float, curve: int = -1, start: float = 0.0) -> int:
        self.ends.append((a, b))
        self.length.append(length)
        self.polyline.append(polyline)
        self.curve.append(curve)
        self.start.append(start)
        return len(self.ends) - 1


def glue(model: Model, meshes: Sequence[FaceMesh], tmeshes: Sequence[FaceTMesh]) -> TMesh:
    """One T-mesh of the whole model.

    Parameters
    ----------
    model : Model
    meshes, tmeshes : one per face, in the order of ``model.faces``

    Returns
    -------
    TMesh

    Raises
    ------
    LayoutError
        A boundary arc of a face does not match the pieces of its curves (an invariant of the tracer).
    """
    n_cad = len(model.vertices)
    position: list[Float] = list(model.vertices)
    on_curve: list[list[tuple[float, int]]] = [[] for _ in model.curves]
    node_curve: dict[int, tuple[int, float]] = {}
    critical: set[int] = set(range(n_cad))
    pinned: list[int] = []
    quads_at: dict[tuple[int, int], int] = {}
    node_maps: list[Int] = []

    for f, (mesh, tmesh) in enumerate(zip(meshes, tmeshes)):
        world = model.faces[f].world(tmesh.position)
        boundary_vertex = np.zeros(len(mesh.points), bool)
        boundary_vertex[mesh.boundary.ravel()] = True
        to_global = np.empty(len(tmesh.position), np.int64)
        sector_index = {int(v): int(i) for v, i in zip(tmesh.vertex, tmesh.index) if v >= 0}
        for node in range(len(tmesh.position)):
            v, h = int(tmesh.vertex[node]), int(tmesh.half_edge[node])
            if v >= 0 and mesh.vertex[v] >= 0:
                to_global[node] = mesh.vertex[v]
                continue
            to_global[node] = len(position)
            position.append(world[node])
            if h >= 0:
                c = int(mesh.boundary_curve[h])
                s0, s1 = mesh.boundary_arclength[h]
                s = float(s0 + tmesh.half_edge_fraction[node] * (s1 - s0))
                on_curve[c].append((s, int(to_global[node])))
                node_curve[int(to_global[node])] = (c, s)
            if v >= 0:
                if mesh.seed[v] >= 0:
                    pinned.append(int(to_global[node]))
                critical.add(int(to_global[node]))
                quads_at[f, int(to_global[node])] = (2 if boundary_vertex[v] else 4) - int(tmesh.index[node])
        for v in np.flatnonzero(mesh.vertex >= 0).tolist():
            key = (f, int(mesh.vertex[v]))
            quads_at[key] = quads_at.get(key, 0) + (2 if boundary_vertex[v] else 4) - sector_index.get(v, 0)
        node_maps.append(to_global)

    arcs = _Arcs([], [], [], [], [])
    pieces = tuple(_cut_curve(model, c, on_curve[c], arcs) for c in range(len(model.curves)))
    patches: list[tuple[tuple[tuple[int, int], ...], ...]] = []
    patch_face: list[int] = []
    loops: list[tuple[int, tuple[int, ...]]] = []
    for f, (mesh, tmesh) in enumerate(zip(meshes, tmeshes)):
        arc_map = _face_arcs(model, f, mesh, tmesh, node_maps[f], pieces, arcs, loops)
        for sides in tmesh.patches:
            patches.append(tuple(_side(arc_map, side) for side in sides))
            patch_face.append(f)

    n = len(position)
    cad_vertex = np.full(n, -1, np.int64)
    cad_vertex[:n_cad] = np.arange(n_cad)
    curve = np.full(n, -1, np.int64)
    curve_arclength = np.zeros(n)
    for node, (c, s) in node_curve.items():
        curve[node], curve_arclength[node] = c, s
    is_pinned = np.zeros(n, bool)
    is_pinned[pinned] = True
    is_critical = np.zeros(n, bool)
    is_critical[list(critical)] = True
    return TMesh(
        position=np.array(position),
        cad_vertex=cad_vertex,
        curve=curve,
        curve_arclength=curve_arclength,
        critical=is_critical,
        pinned=is_pinned,
        quads_at=quads_at,
        arcs=np.array(arcs.ends, np.int64).reshape(-1, 2),
        length=np.array(arcs.length),
        polyline=tuple(arcs.polyline),
        arc_curve=np.array(arcs.curve, np.int64),
        arc_start=np.array(arcs.start),
        pieces=pieces,
        patches=tuple(patches),
        patch_face=np.array(patch_face, np.int64),
        loops=tuple(loops),
        euler=np.array([uncut_euler(m) for m in meshes], np.int64),
    )


def _reverse(run: Run) -> Run:
    return [(arc, -way) for arc, way in reversed(run)]


def _side(arc_map: list[Run], side: tuple[tuple[int, int], ...]) -> tuple[tuple[int, int], ...]:
    """A side of a face's patch in global arcs."""
    return tuple(x for arc, way in side for x in (arc_map[arc] if way > 0 else _reverse(arc_map[arc])))


def _cut_curve(model: Model, c: int, nodes: list[tuple[float, int]], arcs: _Arcs) -> tuple[int, ...]:
    """Cut curve `c` at its T-nodes; returns its pieces in order."""
    curve = model.curves[c]
    stops = [(0.0, curve.start), *sorted(nodes), (curve.length, curve.end)]
    out = []
    for (sa, a), (sb, b) in itertools.pairwise(stops):
        inner = np.flatnonzero((curve.arclength > sa) & (curve.arclength < sb))
        ends = np.array([sa, sb])
        ends_xyz = np.stack([np.interp(ends, curve.arclength, curve.points[:, k]) for k in range(3)], axis=1)
        polyline = np.concatenate([ends_xyz[:1], curve.points[inner], ends_xyz[1:]])
        out.append(arcs.add(a, b, sb - sa, polyline, c, sa))
    return tuple(out)


def _face_arcs(
    model: Model,
    f: int,
    mesh: FaceMesh,
    tmesh: FaceTMesh,
    to_global: Int,
    pieces: tuple[tuple[int, ...], ...],
    arcs: _Arcs,
    loops: list[tuple[int, tuple[int, ...]]],
) -> list[Run]:
    """Global runs of all arcs of one face; appends the face's loops."""
    out: list[Run] = [[] for _ in tmesh.length]
    for a in np.flatnonzero(tmesh.loop < 0).tolist():
        p, q = to_global[tmesh.arcs[a]].tolist()
        out[a] = [(arcs.add(p, q, float(tmesh.length[a]), model.faces[f].world(tmesh.polyline[a])), 1)]

    run_of, walks = _walks(mesh, pieces)
    where: dict[tuple[int, int], tuple[int, int]] = {}
    for w, walk in enumerate(walks):
        loops.append((f, tuple(arc for _, arc, _ in walk)))
        for i, (run, arc, way) in enumerate(walk):
            where[run, arcs.ends[arc][0 if way > 0 else 1]] = (w, i)
    for a in np.flatnonzero(tmesh.loop >= 0).tolist():
        keys = [(int(run_of[tmesh.half_edge[n]]), int(to_global[n])) for n in tmesh.arcs[a].tolist()]
        if any(k not in where for k in keys) or where[keys[0]][0] != where[keys[1]][0]:
            raise LayoutError(
                "a boundary arc of the layout does not match its curve",
                entity=(2, model.faces[f].tag),
                remedy="another size or a finer background mesh may help",
            )
        (w, i), (_, j) = where[keys[0]], where[keys[1]]
        walk, count = walks[w], len(walks[w])
        steps = (j - i) % count or count
        out[a] = [walk[(i + k) % count][1:] for k in range(steps)]
    return out


def _walks(mesh: FaceMesh, pieces: tuple[tuple[int, ...], ...]) -> tuple[Int, list[list[tuple[int, int, int]]]]:
    """Run of every boundary half-edge, and per loop the pieces (run, arc, way) in the loop's order.

    A run is a passage along a whole curve.
    """
    following = {int(a): row for row, a in enumerate(mesh.boundary[:, 0].tolist())}
    run_of = np.full(len(mesh.boundary), -1, np.int64)
    walks: list[list[tuple[int, int, int]]] = []
    n_runs = 0
    for first in range(len(mesh.boundary)):
        if run_of[first] >= 0 or mesh.vertex[mesh.boundary[first, 0]] < 0:
            continue
        walk: list[tuple[int, int, int]] = []
        row = first
        while run_of[row] < 0:
            if mesh.vertex[mesh.boundary[row, 0]] >= 0:
                c = int(mesh.boundary_curve[row])
                forward = mesh.boundary_arclength[row, 1] > mesh.boundary_arclength[row, 0]
                walk += [(n_runs, arc, 1 if forward else -1) for arc in (pieces[c] if forward else pieces[c][::-1])]
                n_runs += 1
            run_of[row] = n_runs - 1
            row = following[int(mesh.boundary[row, 1])]
        walks.append(walk)
    if (run_of < 0).any():
        raise LayoutError("a boundary loop of the background mesh has no CAD vertex")
    return run_of, walks


def uncut_euler(mesh: FaceMesh) -> int:
    """Euler characteristic of a face mesh after closing its cuts along embedded curves."""
    n_triangle_edges = 3 * len(mesh.triangles)
    interior_edges = (n_triangle_edges - len(mesh.boundary)) // 2
    sides = {
        (int(c), round(min(s0, s1), 12)) for c, (s0, s1) in zip(mesh.boundary_curve.tolist(), mesh.boundary_arclength.tolist())
    }
    boundary_points: set[tuple[int, float]] = set()
    on_boundary = np.zeros(len(mesh.points), bool)
    for (a, _), c, (s, _) in zip(mesh.boundary.tolist(), mesh.boundary_curve.tolist(), mesh.boundary_arclength.tolist()):
        on_boundary[a] = True
        v = int(mesh.vertex[a])
        boundary_points.add((-1, float(v)) if v >= 0 else (c, round(s, 12)))
    n_points = int((~on_boundary).sum()) + len(boundary_points)
    return n_points - (interior_edges + len(sides)) + len(mesh.triangles)
