"""From the current Gmsh model to the `Model` record.

The user's model and mesh are only read.  Wanted are the faces in physical surfaces where there are any, else all.
Coordinates are scaled by the box of the curve samples (Gmsh's own box is loose for OpenCASCADE shapes), so that the
same tolerances hold from nanometres to megametres.
"""

from __future__ import annotations

import gmsh
import numpy as np

from ..errors import GeometryError
from ..options import MeshOptions
from ..records import Curve, Face, Float, Model
from .collapsed import check_contacts, needed_vertices, without_joints, without_points
from .curved_face import curved_face, merged_face, seams
from .joints import Group, smooth_joints
from .knots import untie
from .loops import boundary_loops
from .periodic import linked
from .physical import group_names, group_tags, physical_points
from .plane import face_plane
from .raw_curves import RawCurve, Vertices, degenerate, read_curve
from .sample import refine
from .session import gmsh_errors
from .tangents import cad_tangents
from .transfinite import transfinite_parameters

__all__ = ["read_model"]

CONVEX = ("Line", "Circle", "Ellipse")  # cannot meet themselves
NEARLY_FLAT = 1e-2  # height over extent of the boundary of a plane surface that is meshed as a curved one


def read_model(options: MeshOptions) -> Model:
    """Read the current Gmsh model.

    Parameters
    ----------
    options : MeshOptions

    Returns
    -------
    Model

    Raises
    ------
    GeometryError
        No surfaces, a plane face that is not planar, a boundary that does not close.
    MeshError
        Where Gmsh fails on an entity.
    """
    with gmsh_errors("reading the model"):
        tags = _wanted_faces()
        signs = {f: [c for _, c in gmsh.model.getBoundary([(2, f)], combined=False, oriented=True)] for f in tags}
        bounds = {f: [abs(c) for c in signs[f]] for f in tags}
        embedded = {f: gmsh.model.mesh.getEmbedded(2, f) for f in tags}
    for f in tags:
        if not bounds[f] and gmsh.model.getType(2, f) == "Discrete surface":
            remedy = "gmsh.model.mesh.classifySurfaces() and createGeometry() make faces of triangles"
            raise GeometryError("the surface has no boundary curve", entity=(2, f), remedy=remedy)
    inside = {f: [c for d, c in embedded[f] if d == 1 and c not in bounds[f]] for f in tags}
    curve_tags = list(dict.fromkeys(c for f in tags for c in bounds[f] + inside[f]))
    vertices = Vertices()
    raw = [read_curve(c, vertices) for c in curve_tags]
    points = {f: [vertices.cad(p) for d, p in embedded[f] if d == 0] for f in tags}
    lo, hi = _box([r.points for r in raw])
    scale = float(np.linalg.norm(hi - lo))
    if not scale > 0:
        raise GeometryError("the surface has no extent", entity=(2, tags[0]), remedy="remove it")
    for r in raw:
        r.parameters, r.points = refine(r.tag, r.kind, r.parameters, r.points, scale)
        if r.kind not in CONVEX and not degenerate(r, scale):
            tied = r.points
            r.parameters, r.points = untie(r.parameters, r.points, scale)
            r.untied = r.points is not tied
    lo, hi = _box([r.points for r in raw])
    origin, scale = 0.5 * (lo + hi), float(np.linalg.norm(hi - lo))
    kept, twins = without_points([r for r in raw if not degenerate(r, scale)], vertices, points, scale)
    planes = _planes(tags, signs, {r.tag: r.points for r in kept}, origin, scale)
    needed = {abs(int(c)) for d, t in gmsh.model.getPhysicalGroups(1) for c in gmsh.model.getEntitiesForPhysicalGroup(d, t)}
    needed |= {c for f in tags for c in inside[f]}
    left = seams(bounds, [f for f in tags if planes[f] is None], needed)
    if left or len(kept) < len(raw):
        kept = [r for r in kept if r.tag not in left]
        check_contacts(vertices, raw, kept, bounds, points)
        vertices, points = needed_vertices(vertices, kept, points)
    spacing = transfinite_parameters(
        {r.tag: float(np.sqrt((np.diff(r.points, axis=0) ** 2).sum(1)).sum()) for r in kept},
        [r.tag for r in kept if r.ends[0] == r.ends[1]],
        {r.tag: r.kind for r in kept},
    )
    groups: tuple[Group, ...] = ()
    if options.feature_angle is not None:
        ranges = {r.tag: (float(r.parameters[0]), float(r.parameters[-1])) for r in kept if r.tag not in spacing}
        groups = smooth_joints(signs, ranges, needed, np.radians(options.feature_angle), scale)
        kept, vertices, points = without_joints(groups, kept, vertices, points)
    curves = tuple(_curve(r, origin, scale, spacing.get(r.tag)) for r in kept)
    row = {c.tag: i for i, c in enumerate(curves)}
    place = np.array(vertices.points).reshape(-1, 3)
    faces = []
    part_of = {f: group for group in groups for f in group.tags}
    tags = [f for f in tags if f not in part_of or f == part_of[f].tags[0]]
    for f in tags:
        if f in part_of:
            frames = [planes[p] for p in part_of[f].tags]
            held = [row[c] for p in part_of[f].tags for c in inside[p] if c in row]
            faces.append(merged_face(part_of[f], frames, held, points[f], curves, row, scale))
            continue
        bound, embed = [c for c in signs[f] if abs(c) in row], [row[c] for c in inside[f] if c in row]
        plane = planes[f]
        if plane is None:
            faces.append(curved_face(f, bound, embed, points[f], curves, row, scale))
        else:
            faces.append(_face(f, bound, embed, points[f], curves, row, place, plane))
    groups_of, in_groups = group_names(2), group_tags(2)
    asked = physical_points() | {vertices.tags[p] for f in tags for p in points[f]}
    asked |= {kept_tag for tag, kept_tag in twins.items() if tag in asked}
    twin_rows = [(tag, vertices.tags.index(kept_tag)) for tag, kept_tag in sorted(twins.items()) if kept_tag in vertices.tags]
    return Model(
        name=gmsh.model.getCurrent(),
        origin=origin,
        scale=scale,
        vertex_tags=np.array(vertices.tags, np.int64),
        vertices=(place - origin) / scale,
        vertex_ports=np.array([t in asked for t in vertices.tags], bool),
        curves=curves,
        faces=tuple(faces),
        notes=_notes(kept, groups, len(twin_rows)),
        point_names=tuple((p, name) for p, names in group_names(0).items() for name in names),
        face_names=tuple(tuple(groups_of.get(f, ())) for f in tags),
        face_groups=tuple(tuple(sorted({g for t in face.tags for g in in_groups.get(t, ())})) for face in faces),
        ignored_curves=tuple(sorted(c for group in groups for c in group.ignored)),
        vertex_twins=tuple(twin_rows),
    )


def _notes(kept: list[RawCurve], groups: tuple[Group, ...], twins: int) -> tuple[str, ...]:
    """What the user should know about the model."""
    notes = [f"curve {r.tag} crosses itself; the tiny loop was cut off" for r in kept if r.untied]
    if twins:
        notes.append(f"{twins} curve{'s' if twins > 1 else ''} without length: the ends became one node")
    if linked():
        notes.append("the mesh is not periodic; periodic links of the model are taken off")
    ignored = sum(len(group.ignored) for group in groups)
    if ignored:
        notes.append(f"{ignored} smooth curve{'s were' if ignored > 1 else ' was'} not followed")
    return tuple(notes)


def _wanted_faces() -> list[int]:
    """Tags of the faces to mesh, ascending."""
    if not gmsh.model.getEntities():
        gmsh.model.occ.synchronize()
        gmsh.model.geo.synchronize()
    groups = gmsh.model.getPhysicalGroups(2)
    tags = {abs(int(f)) for d, t in groups for f in gmsh.model.getEntitiesForPhysicalGroup(d, t)}
    tags = tags or {int(f) for _, f in gmsh.model.getEntities(2)}
    tags = {f for f in tags if not gmsh.model.getType(2, f).startswith("Partition")}  # parts of a mesh, not of the geometry
    if not tags:
        raise GeometryError("no surfaces in the model", remedy="add a surface, for example a Plane Surface of a Curve Loop")
    return sorted(tags)


def _box(points: list[Float]) -> tuple[Float, Float]:
    if not points:
        raise GeometryError("no curves in the model", remedy="draw the boundary of its surfaces")
    return np.min([p.min(0) for p in points], 0), np.max([p.max(0) for p in points], 0)


def _curve(raw: RawCurve, origin: Float, scale: float, spacing: Float | None) -> Curve:
    points = (raw.points - origin) / scale
    arclength = np.concatenate([[0.0], np.cumsum(np.sqrt((np.diff(points, axis=0) ** 2).sum(1)))])
    if spacing is not None:
        spacing = np.interp(spacing, raw.parameters, arclength)
    # the CAD's derivative at an end may be that of a loop that was cut off
    tangents = None if raw.untied else cad_tangents(raw.tag, raw.kind, raw.parameters, points)
    return Curve(raw.tag, raw.ends[0], raw.ends[1], points, raw.parameters, arclength, spacing, tangents)


def _planes(
    tags: list[int], signs: dict[int, list[int]], points: dict[int, Float], origin: Float, scale: float
) -> dict[int, tuple[Float, Float] | None]:
    """Frames of the plane faces, None for curved ones; `points` are the samples of all curves of any length."""
    out: dict[int, tuple[Float, Float] | None] = {}
    for f in tags:
        bound = [(points[abs(c)][:: 1 if c > 0 else -1] - origin) / scale for c in signs[f] if abs(c) in points]
        plane = gmsh.model.getType(2, f) == "Plane"
        if plane and not bound:
            raise GeometryError("the surface has no boundary of any length", entity=(2, f), remedy="remove it")
        out[f] = face_plane(f, bound, origin, scale) if bound else None
        if plane and out[f] is None and _height(np.concatenate(bound)) > NEARLY_FLAT:
            place = origin + scale * np.concatenate(bound).mean(axis=0)
            remedy = "use a Surface instead of a Plane Surface, or draw its boundary in a plane"
            raise GeometryError("the plane surface is not planar", entity=(2, f), location=place, remedy=remedy)
    return out


def _height(points: Float) -> float:
    """Extent of points across their best plane, over that along it."""
    spread = (points - points.mean(axis=0)) @ np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2].T
    extent = np.ptp(spread, axis=0)
    return float(extent[2] / max(extent[0], np.finfo(float).tiny))


def _face(
    tag: int,
    signed: list[int],
    inside: list[int],
    points: list[int],
    curves: tuple[Curve, ...],
    row: dict[int, int],
    place: Float,
    plane: tuple[Float, Float],
) -> Face:
    """The record of a plane face; `place` holds the vertices in the user's coordinates."""
    rows = [row[abs(c)] for c in signed]
    centre, axes = plane
    face = Face(tag, centre, axes, ())
    flat = {r: face.local(curves[r].points) for r in dict.fromkeys(rows)}
    loops, both = boundary_loops(rows, curves, flat, tag, place)
    embedded = tuple(dict.fromkeys([*both, *inside]))
    on_curves = {v for c in [*rows, *embedded] for v in (curves[c].start, curves[c].end)}
    free = tuple(p for p in dict.fromkeys(points) if p not in on_curves)
    return Face(tag, centre, axes, loops, embedded, free)
