"""Is the model one that can be meshed?

Everything that would make later stages fail obscurely is reported here: faces without area, in several parts or with a
boundary that crosses or touches itself, corners without an angle, embedded entities outside their face.  Boundaries
that do not close and faces that are not planar are found on reading.
"""

from __future__ import annotations

import numpy as np

from ..errors import GeometryError
from ..records import Face, Float, Model
from .intersect import contacts
from .loops import polygon, signed_area
from .tangents import end_directions, sector_angles

__all__ = ["validate"]

NO_WIDTH = 1e-9  # of the face's size
SHARPEST = np.radians(0.5)
PARTING = np.radians(1.0)  # of the chords of curves that touch in a corner
SAME = 1e-9  # of the model
ON_CURVE = 1e-6  # of the model: the accuracy of the samples
LIPS = 1e-6  # of the model: lips of a crack that are drawn twice


def validate(model: Model) -> None:
    """Check a model.

    Parameters
    ----------
    model : Model

    Raises
    ------
    GeometryError
        With the entity, the place and what to do.
    """
    if not model.faces:
        raise GeometryError("no surfaces in the model", remedy="add a surface, for example a Plane Surface of a Curve Loop")
    for curve in model.curves:
        if curve.length <= SAME:
            place = _user(model, curve.points[0])
            raise GeometryError("the curve has no length", entity=(1, curve.tag), location=place, remedy="remove it")
    for row, face in enumerate(model.faces):
        _check_counts(model, face)
        if face.curved:
            continue  # Gmsh's triangulation of it is checked instead
        flat = {c: face.local(model.curves[c].points) for c in _curves(face)}
        _check_area(model, face, flat)
        angles = sector_angles(model, row)
        _check_contacts(model, face, flat, angles)
        _check_parts(face, flat)
        _check_corners(model, row, angles)
        _check_embedded(model, face, flat)


def _user(model: Model, point: Float) -> list[float]:
    """A scaled point in the user's coordinates."""
    return (model.origin + model.scale * np.asarray(point)).tolist()


def _curves(face: Face) -> list[int]:
    return list(dict.fromkeys([c for loop in face.loops for c, _ in loop] + list(face.embedded_curves)))


def _check_counts(model: Model, face: Face) -> None:
    """The boundary of a quad mesh has an even number of edges: 4 Q = 2 E_inside + E_boundary, embedded curves counting twice."""
    counts = [model.curves[c].spacing for loop in face.loops for c, _ in loop]
    total = sum(len(spacing) - 1 for spacing in counts if spacing is not None)
    if total % 2 and all(spacing is not None for spacing in counts):
        raise GeometryError(
            f"the Transfinite counts of the boundary sum up to {total} edges, an odd number, which no quad mesh has",
            entity=(2, face.tag),
            remedy="change one of the Transfinite Curve counts by one or leave it out",
        )


def _check_area(model: Model, face: Face, flat: dict[int, Float]) -> None:
    points = np.concatenate([flat[c] for loop in face.loops for c, _ in loop] or [np.zeros((1, 2))])
    spread = np.linalg.svd(points - points.mean(0), compute_uv=False) / np.sqrt(len(points))
    if len(spread) < 2 or spread[1] <= NO_WIDTH * spread[0]:
        place = _user(model, face.world(points[:1])[0])
        raise GeometryError("the face has no area", entity=(2, face.tag), location=place, remedy="remove it or move its points")


def _check_parts(face: Face, flat: dict[int, Float]) -> None:
    outer = sum(signed_area(polygon(loop, flat)) > 0 for loop in face.loops)
    if outer != 1:
        remedy = "make a surface of each part" if outer else "check its curve loops"
        raise GeometryError(f"the face has {outer} outer boundaries", entity=(2, face.tag), remedy=remedy)


def _lips(model: Model, face: Face, angles: tuple[Float, ...]) -> set[tuple[int, int]]:
    """Pairs of curves that lie on each other because they are the two lips of a crack.

    They follow each other in a loop around a tip with an angle of 2 pi, the next ones before and after them likewise.
    """
    lips = set()
    for loop, corner in zip(face.loops, angles):
        for i in np.flatnonzero(corner > 2 * np.pi - SHARPEST):
            for k in range(len(loop) // 2):
                (a, sa), (b, sb) = loop[(i - 1 - k) % len(loop)], loop[(i + k) % len(loop)]
                p, q = model.curves[a], model.curves[b]
                share = np.arange(0.5, 8.0) / 8
                other = share if sa != sb else 1.0 - share
                if np.abs(p.at(share * p.length) - q.at(other * q.length)).max() > LIPS:
                    break
                lips.add((min(a, b), max(a, b)))
    return lips


def _check_contacts(model: Model, face: Face, flat: dict[int, Float], angles: tuple[Float, ...]) -> None:
    rows = list(flat)
    lips = _lips(model, face, angles)
    mouths = {v: v for c in rows for v in (model.curves[c].start, model.curves[c].end)}
    for a, b in sorted(lips):  # the lips of a crack may start in different vertices at one place
        for v in (model.curves[a].start, model.curves[a].end):
            for w in (model.curves[b].start, model.curves[b].end):
                if np.linalg.norm(model.vertices[v] - model.vertices[w]) <= LIPS:
                    mouths[max(v, w)] = min(v, w)
    ends = [(mouths[model.curves[c].start], mouths[model.curves[c].end]) for c in rows]
    for contact in contacts([flat[c] for c in rows], ends):
        a, b = rows[contact.first], rows[contact.second]
        if (min(a, b), max(a, b)) in lips:
            continue
        tags = sorted((model.curves[a].tag, model.curves[b].tag))
        what = f"curve {tags[0]} touches or crosses itself" if a == b else f"curves {tags[0]} and {tags[1]} touch or cross"
        place = _user(model, face.world(contact.point[None])[0])
        remedy = "give them a common point there, or move them apart"
        raise GeometryError(what, entity=(2, face.tag), location=place, remedy=remedy)


def _check_corners(model: Model, row: int, angles: tuple[Float, ...]) -> None:
    face = model.faces[row]
    for loop, corner in zip(face.loops, angles):
        for i in np.flatnonzero(corner < SHARPEST):
            c, sign = loop[i]
            if _parting(model, face, loop[i], loop[i - 1]) > PARTING:
                continue  # a cusp: the curves touch in the corner and part
            _too_sharp(model, model.curves[c].start if sign > 0 else model.curves[c].end, float(corner[i]))
    if not face.embedded_curves:
        return
    directions = end_directions(model, row)
    there: dict[int, list[tuple[float, bool]]] = {}
    for (c, end), angle in directions.items():
        vertex = model.curves[c].end if end else model.curves[c].start
        there.setdefault(vertex, []).append((angle, c in face.embedded_curves))
    for vertex, ends in there.items():
        ends.sort()
        for (a, inner_a), (b, inner_b) in zip(ends, ends[1:] + ends[:1]):
            gap = (b - a) % (2 * np.pi)
            if len(ends) > 1 and (inner_a or inner_b) and min(gap, 2 * np.pi - gap) < SHARPEST:
                _too_sharp(model, vertex, min(gap, 2 * np.pi - gap))


def _parting(model: Model, face: Face, leaving: tuple[int, int], arriving: tuple[int, int]) -> float:
    """Angle between the chords of two curves from their common corner to the same arc length, half of the shorter curve."""
    curves = [model.curves[c] for c, _ in (leaving, arriving)]
    reach = 0.5 * min(curve.length for curve in curves)
    starts = (leaving[1] > 0, arriving[1] < 0)
    chords = []
    for curve, start in zip(curves, starts):
        s = np.array([0.0, reach] if start else [curve.length, curve.length - reach])
        chords.append(np.diff(face.local(curve.at(s)), axis=0)[0])
    a, b = chords
    return float(abs(np.arctan2(a[0] * b[1] - a[1] * b[0], a @ b)))


def _too_sharp(model: Model, vertex: int, angle: float) -> None:
    tag = int(model.vertex_tags[vertex])
    raise GeometryError(
        f"the corner of {np.degrees(angle):.3g} degrees is too sharp",
        entity=(0, tag) if tag >= 0 else None,
        location=_user(model, model.vertices[vertex]),
        remedy=f"open it to more than {np.degrees(SHARPEST):g} degrees",
    )


def _check_embedded(model: Model, face: Face, flat: dict[int, Float]) -> None:
    boundary = [polygon(loop, flat) for loop in face.loops]
    for c in face.embedded_curves:
        curve = model.curves[c]
        middle = flat[c][len(flat[c]) // 2]
        if not _inside(middle, boundary):
            place = _user(model, curve.points[len(curve.points) // 2])
            raise GeometryError("the embedded curve is outside its surface", entity=(1, curve.tag), location=place)
    for k, v in enumerate(face.embedded_points):
        wrong = _misplaced(model, face, flat, boundary, face.embedded_points[:k], v)
        if wrong:
            tag, place = int(model.vertex_tags[v]), _user(model, model.vertices[v])
            raise GeometryError(f"the embedded point {wrong}", entity=(0, tag), location=place, remedy="move or remove it")


def _misplaced(
    model: Model, face: Face, flat: dict[int, Float], boundary: list[Float], before: tuple[int, ...], vertex: int
) -> str:
    """What is wrong with an embedded point, empty where nothing is."""
    place = model.vertices[vertex]
    point = face.local(place[None])[0]
    for w in before:
        if np.linalg.norm(place - model.vertices[w]) <= SAME:
            return f"coincides with point {model.vertex_tags[w]}"
    for c, line in flat.items():
        if _distance(point, line) <= ON_CURVE:
            return f"lies on curve {model.curves[c].tag} without being a point of it"
    off_plane = abs(float((place - face.origin) @ np.cross(face.axes[0], face.axes[1])))
    return "" if off_plane <= ON_CURVE and _inside(point, boundary) else "is outside its surface"


def _distance(point: Float, line: Float) -> float:
    """Distance of a point from a polyline."""
    a, d = line[:-1], np.diff(line, axis=0)
    t = np.clip(((point - a) * d).sum(1) / (d**2).sum(1), 0.0, 1.0)
    return float(np.sqrt((((a + t[:, None] * d) - point) ** 2).sum(1).min()))


def _inside(point: Float, boundary: list[Float]) -> bool:
    """Even-odd rule with a ray in the direction of the first axis."""
    inside = False
    for p in boundary:
        q = np.roll(p, -1, axis=0)
        rows = np.flatnonzero((p[:, 1] > point[1]) != (q[:, 1] > point[1]))
        x = p[rows, 0] + (point[1] - p[rows, 1]) * (q[rows, 0] - p[rows, 0]) / (q[rows, 1] - p[rows, 1])
        inside ^= bool((x > point[0]).sum() % 2)
    return inside
