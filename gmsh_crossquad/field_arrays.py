"""A cross field with all its parts as arrays on quadratic triangles, and back without loss: what is in files.

The background triangles are written as quadratic ones, whose mid-side nodes are the edge midpoints: that is where the crosses of
the Crouzeix–Raviart form sit.  The corner nodes carry the mean of the midpoints around them, for drawing.

    point arrays  v, u         one arm of the aligned and of the given cross (unit vectors; the others at quarter turns)
                  phi, psi     the rotation from u to v, radians
                  index        quarter turns, at corner nodes
                  seed         1 at singular points that the user set
    cell arrays   face         Gmsh tag of the surface
                  rotation     of v, from edge k to edge k + 1: all integers of the field live here
                  normal       of the surface, of a curved one that of the triangle
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from .errors import FieldError
from .face_field import FaceField
from .field.surface_mesh import SurfaceMesh
from .records import Float, Int
from .source.power import tangent_axes

__all__ = ["CELL_ARRAYS", "POINT_ARRAYS", "field_from_arrays", "quadratic"]

POINT_ARRAYS = ("v", "u", "phi", "psi", "index", "seed")
CELL_ARRAYS = ("face", "rotation", "normal")


def quadratic(faces: Sequence[FaceField]) -> tuple[Float, Int, dict[str, Any]]:
    """Nodes (n, 3), quadratic triangles (m, 6) and the arrays of the module's table, for all faces together."""
    points, cells = [], []
    data: dict[str, list[Any]] = {name: [] for name in (*POINT_ARRAYS, *CELL_ARRAYS)}
    first = 0
    for f in faces:
        surface = f.surface
        n, e, m = len(f.points), len(f.edges), len(f.triangles)
        points += [f.points, f.places]
        cells.append(first + np.concatenate([f.triangles, n + surface.triangle_edges], axis=1))
        for name, arms in (("v", f.directions), ("u", f.given)):
            data[name] += [_at_corners(f, arms), arms]
        for name, angle in (("phi", f.phi), ("psi", f.psi)):
            data[name] += [_mean(f, angle), angle]
        data["index"] += [f.index, np.zeros(e, np.int64)]
        seed = np.zeros(n + e, np.int64)
        if len(f.seeds):
            apart = np.linalg.norm(f.points[:, None] - f.seeds[None], axis=2)
            seed[apart.argmin(axis=0)] = 1
        data["seed"].append(seed)
        data["face"].append(np.full(m, f.face))
        data["rotation"].append(f.rotation)
        data["normal"].append(np.array(f.triangle_normals))
        first += n + e
    return np.concatenate(points), np.concatenate(cells), {name: np.concatenate(parts) for name, parts in data.items()}


def field_from_arrays(points: Float, cells: Int, data: dict[str, Any]) -> tuple[FaceField, ...]:
    """What `quadratic` was made from, but for periods, flux and residual, which are left empty.

    Raises
    ------
    FieldError
        If arrays are missing or do not fit together.
    """
    missing = [name for name in (*POINT_ARRAYS, *CELL_ARRAYS) if name not in data]
    if missing:
        raise FieldError(f"the field file has no array {missing[0]!r}", remedy="write it with the field command")
    out = []
    for tag in np.unique(data["face"]).tolist():
        mine = cells[data["face"] == tag]
        corners = np.unique(mine[:, :3])
        triangles = np.searchsorted(corners, mine[:, :3])
        surface = SurfaceMesh(points[corners], triangles)
        middle = np.empty(len(surface.edges), np.int64)
        middle[surface.triangle_edges.ravel()] = mine[:, 3:].ravel()
        normals = np.asarray(data["normal"], float)[data["face"] == tag]
        around = surface.edge_normal if np.any(normals != normals[0]) else None
        normal = normals[0] if around is None else around
        a, b = points[corners][surface.edges[:, 0]], points[corners][surface.edges[:, 1]]
        x = (b - a) / np.linalg.norm(b - a, axis=1)[:, None]
        v = np.asarray(data["v"], float)[middle]
        if not np.isfinite(v).all():
            raise FieldError("the field file has values that are no numbers", entity=(2, tag))
        theta = np.arctan2(np.sum(v * np.cross(normal, x), axis=1), np.sum(v * x, axis=1))
        out.append(
            FaceField(
                face=int(tag),
                points=points[corners],
                triangles=triangles,
                edges=surface.edges,
                places=points[middle],
                directions=v,
                given=np.asarray(data["u"], float)[middle],
                normal=normal,
                phi=np.asarray(data["phi"], float)[middle],
                psi=np.asarray(data["psi"], float)[middle],
                theta=theta,
                rotation=np.asarray(data["rotation"], float)[data["face"] == tag],
                index=np.rint(data["index"][corners]).astype(np.int64),
                periods=np.zeros(0, np.int64),
                flux=np.zeros(0),
                residual=0.0,
                seeds=points[corners][np.asarray(data["seed"])[corners] != 0],
            )
        )
    return tuple(out)


def _mean(f: FaceField, values: Float) -> Float:
    """(n,) mean over the edges at every vertex."""
    ends = f.edges.ravel()
    total = np.bincount(ends, np.repeat(values, 2), len(f.points))
    out: Float = total / np.bincount(ends, minlength=len(f.points))
    return out


def _at_corners(f: FaceField, arms: Float) -> Float:
    """(n, 3) one arm at every vertex: the mean of the fourth powers around it (any arm where that vanishes)."""
    if f.surface.vertex_normal is not None and f.curved:
        return _at_curved_corners(f, arms, f.surface.vertex_normal)
    x = f.directions[0]
    y = np.cross(f.normal, x)
    fourth = (arms @ x + 1j * (arms @ y)) ** 4
    angle = np.arctan2(_mean(f, fourth.imag), _mean(f, fourth.real)) / 4
    out: Float = np.cos(angle)[:, None] * x + np.sin(angle)[:, None] * y
    return out


def _at_curved_corners(f: FaceField, arms: Float, normal: Float) -> Float:
    """The same in the tangent planes of the vertices, whose normals are (n, 3)."""
    x, y = tangent_axes(normal)
    vertex, arm = f.edges.ravel(), np.repeat(arms, 2, axis=0)
    plane = np.einsum("kc,kc->k", arm, x[vertex]) + 1j * np.einsum("kc,kc->k", arm, y[vertex])
    fourth = plane**4
    total = np.bincount(vertex, fourth.real, len(normal)) + 1j * np.bincount(vertex, fourth.imag, len(normal))
    angle = np.angle(total) / 4
    out: Float = np.cos(angle)[:, None] * x + np.sin(angle)[:, None] * y
    return out
