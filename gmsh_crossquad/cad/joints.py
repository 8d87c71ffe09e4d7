"""Smooth joints: curves of the CAD across which two faces go on as one surface, so that no mesh need follow them.

Two faces with the unit normals n1, n2 and the directions k1 t, k2 t in which their boundaries run along a common curve (the face
on the left) point into the faces with n1 x k1 t and n2 x k2 t.  The joint is smooth where these are opposite:

    -(k1 k2) n1 . n2 >= cos(angle)    everywhere on the curve.

A fold, where both faces lie on the same side, has the other sign.  The normals are those of the CAD at samples of the curve.  The
signs k are not to be had from Gmsh: the directions that it gives for the boundary of a face of OpenCASCADE are all right or all
wrong, where the face is a reversed one (in 21 of 51 models of solids up to two thirds of them).  So the faces are triangulated
coarsely once; the triangles always had the side of the CAD's normal, and one of them on each curve tells.

Faces that hang together by smooth joints are a group.  Its parts are turned to one side; a group that has only one side (a band
with a twist) is left as it was.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import gmsh
import numpy as np

from ..errors import MeshError
from ..records import Float
from . import session

__all__ = ["Group", "smooth_joints"]

SAMPLES = np.concatenate([[1e-3], (np.arange(15) + 0.5) / 15, [1 - 1e-3]])
ON_SURFACE = 1e-5  # of the model
PER_TURN = 8.0
LARGEST, SMALLEST = 0.25, 1e-3  # of the model
OPTIONS: dict[str, float] = {
    "General.AbortOnError": 0,
    "General.Terminal": 0,
    "Mesh.Algorithm": 5,
    "Mesh.AlgorithmSwitchOnFailure": 1,
    "Mesh.ElementOrder": 1,
    "Mesh.IgnorePeriodicity": 1,
    "Mesh.MeshOnlyVisible": 1,
    "Mesh.MeshOnlyEmpty": 0,
    "Mesh.MeshSizeExtendFromBoundary": 1,
    "Mesh.MeshSizeFactor": 1,
    "Mesh.MeshSizeFromCurvature": PER_TURN,
    "Mesh.MeshSizeFromPoints": 0,
    "Mesh.RecombineAll": 0,
    "Mesh.SubdivisionAlgorithm": 0,
}
TRIANGLE = 2


@dataclass(frozen=True)
class Group:
    """Faces that are one surface.

    Attributes
    ----------
    tags : tuple of int
        The one that the surface is named and oriented after first.
    turned : tuple of bool
        Whether a face's normal is opposite to that of the first.
    signed : tuple of int
        Tags of the curves that bound the faces, each as often as it does, negative where the boundary runs against it.
    ignored : tuple of int
        Tags of the joints.
    """

    tags: tuple[int, ...]
    turned: tuple[bool, ...]
    signed: tuple[int, ...]
    ignored: tuple[int, ...]


def smooth_joints(
    signs: Mapping[int, Sequence[int]], ranges: Mapping[int, tuple[float, float]], kept: set[int], angle: float, scale: float
) -> tuple[Group, ...]:
    """Groups of faces of the current Gmsh model; its mesh stays as it is.

    Parameters
    ----------
    signs : mapping of int -> sequence of int
        Gmsh's signed curve tags of every face.
    ranges : mapping of int -> (float, float)
        Bounds of the parameters of the curves that may be joints.
    kept : set of int
        Curves that must be followed.
    angle : float
        Greatest angle between the normals, radians.
    scale : float
        Size of the model, in the user's units.
    """
    faces: dict[int, list[int]] = {}
    for face, curves in signs.items():
        for c in curves:
            faces.setdefault(abs(c), []).append(face)
    pairs = {c: (f[0], f[1]) for c, f in faces.items() if len(f) == 2 and f[0] != f[1] and c in ranges and c not in kept}
    belongs = _surface_groups()
    pairs = {c: (a, b) for c, (a, b) in pairs.items() if belongs.get(a) == belongs.get(b)}
    cosines = {c: _cosines(c, pair, ranges[c], scale) for c, pair in pairs.items()}
    limit = np.cos(angle)
    near = {c: k for c, k in cosines.items() if (k >= limit).all() or (k <= -limit).all()}
    if not near:
        return ()
    side = _sides(sorted({f for c in near for f in pairs[c]}), signs, scale)
    runs = {(f, abs(c)): side[f] * (1 if c > 0 else -1) for f in side for c in signs[f]}
    joints = {}
    for c, k in near.items():
        a, b = pairs[c]
        if a in side and b in side and (-runs[a, c] * runs[b, c] * k >= limit).all():
            joints[c] = a, b
    return tuple(_groups(joints, runs, signs, side))


def _surface_groups() -> dict[int, frozenset[int]]:
    """Physical surfaces that hold each face."""
    out: dict[int, set[int]] = {}
    for dim, group in gmsh.model.getPhysicalGroups(2):
        for f in gmsh.model.getEntitiesForPhysicalGroup(dim, group).tolist():
            out.setdefault(abs(f), set()).add(group)
    return {f: frozenset(groups) for f, groups in out.items()}


def _cosines(curve: int, pair: tuple[int, int], bounds: tuple[float, float], scale: float) -> Float:
    """Cosines between the CAD normals of two faces at samples of their common curve; 0 where there are none."""
    t = bounds[0] + SAMPLES * (bounds[1] - bounds[0])
    normals = []
    try:
        with session.gmsh_errors("comparing normals", entity=(1, curve)):
            points = np.asarray(gmsh.model.getValue(1, curve, t)).reshape(-1, 3)
            for face in pair:
                if gmsh.model.getType(2, face).startswith("Discrete"):
                    return np.zeros(1)
                uv = gmsh.model.reparametrizeOnSurface(1, curve, t, face)
                off = np.asarray(gmsh.model.getValue(2, face, uv)).reshape(-1, 3) - points
                if not np.abs(off).max() <= ON_SURFACE * scale:
                    return np.zeros(1)
                normals.append(np.asarray(gmsh.model.getNormal(face, uv)).reshape(-1, 3))
    except MeshError:  # the curve is followed then
        return np.zeros(1)
    out: Float = np.einsum("nc,nc->n", *normals)
    size = np.linalg.norm(normals[0], axis=1) * np.linalg.norm(normals[1], axis=1)
    good = np.isfinite(out) & (size > 0.5)
    return np.where(good, out / np.where(good, size, 1.0), 0.0)


def _sides(faces: Sequence[int], signs: Mapping[int, Sequence[int]], scale: float) -> dict[int, int]:
    """1 for the faces whose curves have the right signs, -1 for those where all are wrong; the others are left out."""
    out: dict[int, int] = {}
    snapshot = session.MeshSnapshot.take()
    sizes = {"Mesh.MeshSizeMax": LARGEST * scale, "Mesh.MeshSizeMin": SMALLEST * scale}
    try:
        with session.options(**OPTIONS, **sizes), _shown(faces):
            with session.gmsh_errors("looking at the sides of faces"):
                gmsh.model.mesh.clear()
                gmsh.model.mesh.generate(2)
            for face in faces:
                votes = _votes(face, signs[face])
                if votes and abs(sum(votes)) == len(votes):
                    out[face] = votes[0]
    except MeshError:
        return {}
    finally:
        snapshot.restore()
    return out


def _votes(face: int, signed: Sequence[int]) -> list[int]:
    """For every curve that bounds a face once, 1 where its sign is that of the triangles on its left."""
    nodes = np.asarray(gmsh.model.mesh.getElementsByType(TRIANGLE, face)[1], np.int64).reshape(-1, 3)
    half = set(map(tuple, np.stack([nodes, np.roll(nodes, -1, axis=1)], axis=2).reshape(-1, 2).tolist()))
    count = Counter(abs(c) for c in signed)
    out = []
    for c in signed:
        edges = np.asarray(gmsh.model.mesh.getElementsByType(1, abs(c))[1], np.int64).reshape(-1, 2)
        if count[abs(c)] != 1 or not len(edges):
            continue
        a, b = edges[len(edges) // 2].tolist()
        if ((a, b) in half) != ((b, a) in half):
            out.append(1 if ((a, b) in half) == (c > 0) else -1)
    return out


@contextmanager
def _shown(faces: Sequence[int]) -> Iterator[None]:
    """Show these faces and their curves only."""
    shown = {(2, f) for f in faces}
    shown |= {(1, abs(c)) for f in faces for _, c in gmsh.model.getBoundary([(2, f)], combined=False, oriented=False)}
    with session.visible(shown):
        yield


def _groups(
    joints: Mapping[int, tuple[int, int]],
    runs: Mapping[tuple[int, int], int],
    signs: Mapping[int, Sequence[int]],
    side: Mapping[int, int],
) -> Iterator[Group]:
    """The components of the faces, each turned to one side."""
    beside: dict[int, list[tuple[int, int]]] = {}
    for c, (a, b) in joints.items():
        beside.setdefault(a, []).append((c, b))
        beside.setdefault(b, []).append((c, a))
    turn: dict[int, int] = {}
    for first in sorted(beside):
        if first in turn:
            continue
        turn[first], found, one_sided = 1, [first], False
        for f in found:
            for c, g in beside[f]:
                wanted = -turn[f] * runs[f, c] * runs[g, c]
                if g not in turn:
                    turn[g] = wanted
                    found.append(g)
                one_sided |= turn[g] != wanted
        if one_sided:
            continue
        size = {f: _size(f) for f in found}
        head = max(sorted(found), key=size.__getitem__)
        tags = (head, *(f for f in sorted(found) if f != head))
        own = {f: turn[f] * turn[head] for f in tags}
        inner = sorted({c for f in tags for c, _ in beside[f]})
        signed = tuple(c * side[f] * own[f] for f in tags for c in signs[f] if abs(c) not in set(inner))
        yield Group(tags, tuple(own[f] < 0 for f in tags), signed, tuple(inner))


def _size(face: int) -> float:
    """Area of a face of OpenCASCADE, else the square of its box's diagonal."""
    if (2, face) in gmsh.model.occ.getEntities(2):
        return float(gmsh.model.occ.getMass(2, face))
    box = np.array(gmsh.model.getBoundingBox(2, face))
    return float(((box[3:] - box[:3]) ** 2).sum())
