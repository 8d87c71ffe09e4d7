"""The picture of a result as plain arrays: panels of coloured cells, lines and markers, for any drawing library.

Everything is turned into the view's frame (x right, y up, z to the viewer).  A planar model is looked at along its normal,
any other one from the corner that shows most of its outside, and lit.  Colours are those of Okabe and Ito, which colour-blind
people can tell apart; singularities also differ in shape.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ..quality import inner_nodes
from ..records import Float, Int

if TYPE_CHECKING:
    from ..block_layout import Layout
    from ..face_field import FaceField
    from .subject import Subject

__all__ = ["Lines", "Markers", "Panel", "Scene", "build_field_scene", "build_scene"]

BLUE, VERMILLION, INK, GREY = (0, 114, 178), (213, 94, 0), (30, 34, 40), (150, 158, 168)
DARK = (84, 92, 104)
PAPER = (246, 247, 249)
TINTS = ((86, 180, 233), (230, 159, 0), (0, 158, 115), (204, 121, 167), (240, 228, 66), (213, 94, 0), (0, 114, 178))
WORST = 0.3
"""Scaled Jacobian that gets the full warning colour."""
VIEW = np.array([1.0, -1.4, 0.9])
"""From where a model that is not plane is looked at, but for signs."""
LIGHT = np.array([-0.35, 0.45, 0.82])
"""Unit vector to the light, in the view's frame."""
AMBIENT = 0.55
"""Brightness of cells that the light grazes."""
CROSSES = 30
"""Crosses along the longer side of a picture."""
LAYERS, CURVED_LAYERS = 12, 48
"""Triangles that are looked at for the one that holds a place of the picture, in a plane and a curved face."""
LIFT = 0.1
"""Distance of crosses from the faces, over that between crosses."""


@dataclass(frozen=True)
class Lines:
    """Segments (k, 2, 3) of one colour (red, green, blue, 0 to 255) and width in points."""

    segments: Float
    colour: tuple[int, int, int]
    width: float


@dataclass(frozen=True)
class Markers:
    """Points (k, 3) drawn as discs or, if `square`, squares of `size` points."""

    points: Float
    colour: tuple[int, int, int]
    size: float
    square: bool = False


@dataclass(frozen=True)
class Panel:
    """One drawing: cells (m, 3 or 4) over points (n, 3) with colours (m, 3), lines and markers on top."""

    title: str
    points: Float
    cells: Int
    colours: Int
    lines: tuple[Lines, ...]
    markers: tuple[Markers, ...] = ()


@dataclass(frozen=True)
class Scene:
    """Panels with a common extent: (low, high) corners, (2, 2)."""

    panels: tuple[Panel, ...]
    extent: Float


def _frame(areas: Float) -> tuple[Float, bool]:
    """The view of a surface whose triangles have the area vectors (m, 3).

    Returns
    -------
    (3, 3) float64, bool
        Rows: right, up, towards the viewer; and whether the surface is plane.
    """
    size = np.linalg.norm(areas, axis=1)
    mean = areas[np.argmax(size)] / size.max()
    flat = bool(np.all(np.abs(areas @ mean) >= 0.999 * size))
    if flat:
        view = mean * (1.0 if mean[np.argmax(np.abs(mean))] > 0 else -1.0)
    else:  # of the corners, that from which most of the outside is seen; the first unless another one is clearly better
        corners = VIEW * np.array([[a, b, c] for c in (1, -1) for a, b in ((1, 1), (1, -1), (-1, -1), (-1, 1))])
        corners /= np.linalg.norm(VIEW)
        seen = np.maximum(areas @ corners.T, 0.0).sum(axis=0)
        view = corners[0] if seen[0] > 0.95 * seen.max() else corners[np.argmax(seen)]
    up = np.array([0.0, 0.0, 1.0]) if abs(view[2]) < 0.9 else np.array([0.0, 1.0, 0.0])
    right = np.cross(up, view)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(view, right), view]), flat


def _area_vectors(points: Float, cells: Int) -> Float:
    """(m, 3) area vectors of triangles or quadrangles."""
    corner = points[cells]
    if cells.shape[1] == 4:
        return 0.5 * np.cross(corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1])
    return 0.5 * np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])


def _lit(colours: Int, points: Float, cells: Int, flat: bool) -> Int:
    """Colours (m, 3) of cells over points in the view's frame, lit from the viewer's upper left; as they are on a plane."""
    if flat:
        return colours
    area = _area_vectors(points, cells)
    size = np.linalg.norm(area, axis=1)
    slope = np.abs(area @ LIGHT) / np.where(size > 0.0, size, 1.0)
    return np.rint(colours * (AMBIENT + (1.0 - AMBIENT) * slope)[:, None]).astype(np.int64)


def _polyline_segments(lines: Iterable[Float]) -> Float:
    parts = [np.stack([p[:-1], p[1:]], axis=1) for p in lines]
    return np.concatenate(parts) if parts else np.zeros((0, 2, 3))


def _block_colours(layout: Layout) -> Int:
    """A light tint (b, 3) for every block, different from its neighbours' where seven tints are enough."""
    around: dict[int, list[int]] = {}
    for i, block in enumerate(layout.blocks):
        for edge, _ in block.sides:
            around.setdefault(edge, []).append(i)
    chosen = np.full(len(layout.blocks), -1, np.int64)
    for i, block in enumerate(layout.blocks):
        taken = {int(chosen[j]) for edge, _ in block.sides for j in around[edge]}
        free = [k for k in range(len(TINTS)) if k not in taken]
        chosen[i] = free[0] if free else i % len(TINTS)
    return (0.45 * np.array(TINTS)[chosen] + 0.55 * 255).astype(np.int64)


def _quality_colours(value: Float) -> Int:
    """From pale blue (1) to vermillion (`WORST` and below)."""
    bad = np.minimum(np.maximum((1.0 - value) / (1.0 - WORST), 0.0), 1.0)[:, None]
    return ((1 - bad) * np.array([228, 240, 249]) + bad * np.array(VERMILLION)).astype(np.int64)


def _crosses(fields: Sequence[FaceField], cell: float, frame: Float) -> Float:
    """Arms (k, 2, 3) of crosses at the points of a square grid, on what of each face is nearest to the viewer there.

    At a point with barycentric coordinates l the fourth power of the cross is ``sum_k (1 - 2 l_opposite(k)) u_k``, from its
    values u_k at the three edges of the triangle (Crouzeix-Raviart interpolation), in the plane of the triangle.
    """
    from ..spatial import cKDTree

    out = [np.zeros((0, 2, 3))]
    for f in fields:
        flat = f.points @ frame[:2].T
        low, high = np.floor(flat.min(axis=0) / cell), np.ceil(flat.max(axis=0) / cell)
        axes = [(np.arange(a, b) + 0.5) * cell for a, b in zip(low, high, strict=True)]
        grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
        corner = flat[f.triangles]
        many = min(CURVED_LAYERS if f.curved else LAYERS, len(corner))
        near = cKDTree(corner.mean(axis=1)).query(grid, k=many)[1].reshape(len(grid), -1)
        c = corner[near]
        area = _area(c[:, :, 0], c[:, :, 1], c[:, :, 2])
        p = np.broadcast_to(grid[:, None], c[:, :, 0].shape)
        weight = np.stack([_area(c[:, :, (k + 1) % 3], c[:, :, (k + 2) % 3], p) for k in range(3)], axis=-1)
        weight = np.divide(weight, area[..., None], out=np.full(weight.shape, -1.0), where=area[..., None] != 0.0)
        inside = weight.min(axis=-1) >= 0.0
        rows = np.flatnonzero(inside.any(axis=1))
        depth = np.einsum("gkc,gkc->gk", weight[rows], (f.points @ frame[2])[f.triangles[near[rows]]])
        column = (np.where(inside[rows], depth, -np.inf) if f.curved else inside[rows]).argmax(axis=1)
        triangle, weight = near[rows, column], weight[rows, column]
        x, y = (a[triangle] for a in f.triangle_axes)
        arms = f.directions[f.surface.triangle_edges[triangle]]
        fourth = (np.einsum("gkc,gc->gk", arms, x) + 1j * np.einsum("gkc,gc->gk", arms, y)) ** 4
        value = (fourth * (1 - 2 * np.roll(weight, 1, axis=1))).sum(axis=1)
        angle = np.angle(value)[:, None] / 4
        first = np.cos(angle) * x + np.sin(angle) * y
        second = np.cross(f.triangle_normals[triangle], first)
        place = np.einsum("gk,gkc->gc", weight, f.points[f.triangles[triangle]])
        place = place + LIFT * cell * frame[2]  # in front of the surface, which may bend towards the arms
        out += [np.stack([place - 0.36 * cell * arm, place + 0.36 * cell * arm], axis=1) for arm in (first, second)]
    return np.concatenate(out)


def _area(a: Float, b: Float, c: Float) -> Float:
    """Twice the signed area of triangles in the plane."""
    u, v = b - a, c - a
    return u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]


def _spots(points: Float, index: Int) -> tuple[Markers, ...]:
    """Discs where fewer than four meet, squares where more do."""
    out = []
    for few, colour in ((True, VERMILLION), (False, BLUE)):
        chosen = points[(index > 0) if few else (index < 0)]
        if len(chosen):
            out.append(Markers(chosen, colour, 8.0, not few))
    return tuple(out)


def _count(n: int, what: str) -> str:
    return f"{n:,} {what}" + ("" if n == 1 else "s")


def build_scene(result: Subject) -> Scene:
    """The three panels of a result: cross field, block layout, mesh.

    Parameters
    ----------
    result : Subject

    Returns
    -------
    Scene
    """
    mesh, layout, quality = result.mesh, result.layout, result.quality
    frame, plane = _frame(_area_vectors(mesh.points, mesh.quads))
    points = mesh.points @ frame.T
    low, high = points.min(axis=0), points.max(axis=0)
    cell = float((high - low)[:2].max()) / CROSSES
    outline = _polyline_segments(e.points @ frame.T for e in layout.edges if e.curve is not None)
    inner = _polyline_segments(e.points @ frame.T for e in layout.edges if e.curve is None)
    start, end = mesh.quads, np.roll(mesh.quads, -1, axis=1)
    keep = (start < end).ravel()
    grid = np.stack([points[start.ravel()[keep]], points[end.ravel()[keep]]], axis=1)
    sign = np.array([s.index for s in result.singularities], np.int64)
    spots = _spots(np.array([s.point for s in result.singularities]).reshape(-1, 3) @ frame.T, sign)
    valence = np.bincount(mesh.quads.ravel(), minlength=len(points))
    inside = np.flatnonzero(inner_nodes(mesh) & (valence > 0))
    corners = _spots(points[inside], 4 - valence[inside])
    tints = _block_colours(layout)
    fields = result.field
    offset = np.cumsum([0, *(len(f.points) for f in fields)])
    ground = np.concatenate([f.points for f in fields]) @ frame.T
    triangles = np.concatenate([f.triangles + o for f, o in zip(fields, offset[:-1], strict=True)])
    flat = np.tile(np.array(PAPER), (len(triangles), 1))
    order = np.unique(mesh.quad_block, return_inverse=True)[1]
    panels = (
        Panel(
            f"cross field: {(sign > 0).sum()} singularities of +¼, {(sign < 0).sum()} of −¼",
            ground,
            triangles,
            _lit(flat, ground, triangles, plane),
            (Lines(_crosses(fields, cell, frame) @ frame.T, BLUE, 1.1), Lines(outline, INK, 2.0)),
            spots,
        ),
        Panel(
            f"layout: {_count(quality.blocks, 'block')}",
            points,
            mesh.quads,
            _lit(tints[order], points, mesh.quads, plane),
            (Lines(inner, INK, 1.2), Lines(outline, INK, 2.0)),
            corners,
        ),
        Panel(
            f"mesh: {_count(quality.quads, 'quad')}, scaled Jacobian min {quality.min_scaled_jacobian:.2f}, "
            f"mean {quality.mean_scaled_jacobian:.2f}",
            points,
            mesh.quads,
            _lit(_quality_colours(result.quad_quality), points, mesh.quads, plane),
            (Lines(grid, GREY if plane else DARK, 0.5), Lines(inner, BLUE, 1.0), Lines(outline, INK, 1.8)),
        ),
    )
    return Scene(panels, np.stack([low[:2], high[:2]]))


def build_field_scene(faces: Sequence[FaceField]) -> Scene:
    """Two panels: the given cross field, and the aligned one with its singularities inside and on the boundary.

    Parameters
    ----------
    faces : sequence of FaceField

    Returns
    -------
    Scene
    """
    frame, plane = _frame(np.concatenate([_area_vectors(f.points, f.triangles) for f in faces]))
    offset = np.cumsum([0, *(len(f.points) for f in faces)])
    ground = np.concatenate([f.points for f in faces]) @ frame.T
    triangles = np.concatenate([f.triangles + o for f, o in zip(faces, offset[:-1], strict=True)])
    paper = _lit(np.tile(np.array(PAPER), (len(triangles), 1)), ground, triangles, plane)
    low, high = ground.min(axis=0), ground.max(axis=0)
    cell = float((high - low)[:2].max()) / CROSSES
    boundary = [f.edges[f.surface.boundary_edge] for f in faces]
    outline = Lines(np.concatenate([f.points[b] for f, b in zip(faces, boundary, strict=True)]) @ frame.T, INK, 2.0)
    rows = [np.flatnonzero(f.index) for f in faces]
    places = np.concatenate([f.points[r] for f, r in zip(faces, rows, strict=True)]) @ frame.T
    index = np.concatenate([f.index[r] for f, r in zip(faces, rows, strict=True)])
    inside = np.concatenate([~np.isin(r, b) for r, b in zip(rows, boundary, strict=True)])
    count = [int(np.sum(index[inside] * sign > 0)) for sign in (1, -1)]
    panels = []
    for title, fields, spots in (
        ("given field", [replace(f, directions=f.given) for f in faces], ()),
        (f"aligned field: {count[0]} singularities of positive, {count[1]} of negative index", faces, _spots(places, index)),
    ):
        crosses = Lines(_crosses(fields, cell, frame) @ frame.T, BLUE, 1.1)
        panels.append(Panel(title, ground, triangles, paper, (crosses, outline), spots))
    return Scene(tuple(panels), np.stack([low[:2], high[:2]]))
