"""Curved faces against mathematics: Poincaré-Hopf with Gaussian curvature, an exact field, and the octant of a sphere.

    python validation/curved.py      # writes curved.md; exit status 1 if a check fails

1. On analytic surfaces of Gmsh (one face each) the aligned cross field has indices that add up to the Euler characteristic chi,
   which is known from the shape.  Two sums of real numbers are looked at, with angles measured here, from the coordinates of the
   triangles: the curvature, 2 pi less the angles at a vertex inside and pi less them on the boundary, must add up to 2 pi chi
   (Gauss-Bonnet); and (curvature - turn of the cross around the vertex) / (pi/2) must be a whole number at every vertex inside.
2. A spherical cap is a disc to stereographic projection, which keeps angles, and harmonic functions harmonic: the aligned field
   of least energy with given singular points is the image of that of the disc,
   ``theta = sum d_k / 4 [arg(z - a_k) + arg(R^2 - conj(a_k) z)]``.
3. The octant of a sphere has three corners of 1/4, so one point of 1/4 inside and three blocks there.
"""

from __future__ import annotations

import math
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import gmsh
import numpy as np

import gmsh_crossquad as cq
from gmsh_crossquad.cad.files import write_mesh
from gmsh_crossquad.cad.session import guest
from gmsh_crossquad.judge import check_task

HERE = Path(__file__).resolve().parent
TURN = 2 * math.pi
#: singular points of the cap, in the plane of the projection from its top
POINTS, FACTORS = [(0.8, 0.3), (-0.5, 0.7), (-0.7, -0.5), (0.3, -0.8)], (1.6, 0.8, 0.4)
#: radius around singular points, and part of the cap's radius: the error is taken outside and inside
CORE, INSIDE = 0.3, 0.95
CAP = math.radians(81)
#: of quads on the octant; the least scaled Jacobian that they may have (three equal angles: sin 120 degrees = .866)
SIZES, LEAST = (0.2, 0.1, 0.05, 0.02), 0.86


@contextmanager
def geometry(make: Callable[[], object]) -> Iterator[None]:
    """A new current Gmsh model."""
    with guest():
        gmsh.option.setNumber("General.Verbosity", 1)
        gmsh.model.add("surface")
        try:
            make()
            gmsh.model.occ.synchronize()
            yield
        finally:
            gmsh.model.remove()


def _keep(*tags: int) -> None:
    """Remove everything but these faces."""
    occ = gmsh.model.occ
    occ.remove(occ.getEntities(3))
    occ.remove([(2, t) for _, t in occ.getEntities(2) if t not in tags], recursive=True)


def sphere(*angles: float, holes: int = 0) -> None:
    """The unit sphere between two latitudes and over a longitude, with round holes on the x and y axes."""
    occ = gmsh.model.occ
    occ.addSphere(0, 0, 0, 1, 1, *angles)
    if not holes:
        _keep(1)
        return
    bars = [(3, occ.addCylinder(0, 0, 0, 2 * math.cos(a), 2 * math.sin(a), 0, 0.35)) for a in TURN * np.arange(holes) / 4 + 0.4]
    faces = occ.cut([(2, 1)], bars, removeObject=False)[0]
    _keep(*(t for _, t in faces))


def torus(turn: float = TURN) -> None:
    """A torus, or a part of it."""
    gmsh.model.occ.addTorus(0, 0, 0, 1, 0.4, 1, turn)
    _keep(1)


def holed_torus() -> None:
    """A torus with a round hole in its outside."""
    occ = gmsh.model.occ
    occ.addTorus(0, 0, 0, 1, 0.4, 1)
    bar = occ.addCylinder(math.cos(1), math.sin(1), 0, math.cos(1), math.sin(1), 0, 0.2)
    faces = occ.cut([(2, 1)], [(3, bar)], removeObject=False)[0]
    _keep(*(t for _, t in faces))


def cylinder() -> None:
    """The side of a cylinder."""
    gmsh.model.occ.addCylinder(0, 0, 0, 0, 0, 2, 1, 1)
    _keep(1)


def cone(top: float) -> None:
    """The side of a cone, whole or cut off."""
    gmsh.model.occ.addCone(0, 0, 0, 0, 0, 1.5, 1, top, 1)
    _keep(1)


def saddle() -> None:
    """z = (x^2 - y^2) / 2 over a square, as a Bézier surface."""
    occ = gmsh.model.occ
    # control points of a quadratic: blossoms of x^2 at (-1, -1), (-1, 1), (1, 1)
    square = (1.0, -1.0, 1.0)
    points = [occ.addPoint(x - 1, y - 1, (square[x] - square[y]) / 2) for y in range(3) for x in range(3)]
    occ.addBezierSurface(points, 3)


def bump() -> None:
    """A B-spline surface over a square with a bump."""
    n = 9
    x = np.linspace(-1, 1, n)
    height = [[0.8 if max(abs(i - 4), abs(j - 4)) < 2 else 0.0 for i in range(n)] for j in range(n)]
    points = [gmsh.model.occ.addPoint(x[i], x[j], height[j][i]) for j in range(n) for i in range(n)]
    gmsh.model.occ.addBSplineSurface(points, n)


def helicoid() -> None:
    """A strip that turns once around an axis: its lines sweep along a helix."""
    occ = gmsh.model.occ
    n = 24
    for k, radius in enumerate((0.3, 1.0)):
        angle = TURN * np.arange(n + 1) / n
        points = [occ.addPoint(radius * math.cos(a), radius * math.sin(a), 0.25 * a) for a in angle]
        occ.addWire([occ.addBSpline(points)], 1 + k)
    occ.addThruSections([1, 2], 1, makeSolid=False, makeRuled=True)


#: name: (how it is made, Euler characteristic)
SURFACES: dict[str, tuple[Callable[[], object], int]] = {
    "sphere": (sphere, 2),
    "hemisphere": (lambda: sphere(0.0), 1),
    "octant of a sphere": (lambda: sphere(0.0, math.pi / 2, math.pi / 2), 1),
    "zone of a sphere": (lambda: sphere(-0.5, 0.9), 0),
    "sphere with three holes": (lambda: sphere(holes=3), -1),
    "torus": (torus, 0),
    "half of a torus": (lambda: torus(math.pi), 0),
    "torus with a hole": (holed_torus, -1),
    "side of a cylinder": (cylinder, 0),
    "side of a cone": (lambda: cone(0.0), 1),
    "side of a truncated cone": (lambda: cone(0.4), 0),
    "saddle": (saddle, 1),
    "B-spline bump": (bump, 1),
    "helicoid": (helicoid, 1),
}


def angles(corner: np.ndarray) -> np.ndarray:
    """Angles (m, 3) of triangles (m, 3, 3) at their corners."""
    ahead, back = np.roll(corner, -1, axis=1) - corner, np.roll(corner, 1, axis=1) - corner
    return np.arctan2(np.linalg.norm(np.cross(ahead, back), axis=2), np.sum(ahead * back, axis=2))


def poincare_hopf(make: Callable[[], object]) -> tuple[int, int, float, float, float]:
    """(triangles, vertices - edges + triangles, sum of indices, error of the total curvature in turns, of the indices)."""
    with geometry(make):
        (field,) = cq.cross_field().faces
    triangles, n = field.triangles, len(field.points)
    ends = np.sort(np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    edges, count = np.unique(ends, axis=0, return_counts=True)
    rim = np.zeros(n, bool)
    rim[edges[count == 1]] = True
    euler = len(np.unique(triangles)) - len(edges) + len(triangles)
    around = np.bincount(triangles.ravel(), angles(field.points[triangles]).ravel(), n)
    curvature = np.where(rim, math.pi, TURN) - around
    # rotation k passes the corner k + 1
    turn = np.bincount(np.roll(triangles, -1, axis=1).ravel(), field.rotation.ravel(), n)
    quarters = (curvature - turn) / (math.pi / 2)
    off = np.abs(quarters - field.index)[~rim].max()
    total = math.fsum(curvature.tolist())
    return len(triangles), euler, float(field.index.sum()) / 4, abs(total - TURN * euler) / TURN, float(off)


def cap() -> None:
    """The part of the unit sphere around its top."""
    sphere(math.pi / 2 - CAP)


def exact_errors(factor: float) -> tuple[int, float, float, float]:
    """(triangles, mean edge, greatest and mean error in radians) for a factor on the background's edge length."""
    a = np.array([complex(*p) for p in POINTS])
    n = 1 + np.abs(a / 2) ** 2
    places = np.stack([a.real / n, a.imag / n, (2 - n) / n], axis=1)
    text = "singularities:" + ",".join("({:.17g},{:.17g},{:.17g}):1".format(*p) for p in places)
    with geometry(cap):
        (field,) = cq.cross_field(field=text, background=factor).faces
    # from the midpoints of chords to the sphere, and from there to the plane: places z and the images of the crosses' arms
    p = field.places / np.linalg.norm(field.places, axis=1)[:, None]
    d = field.directions - np.sum(field.directions * p, axis=1)[:, None] * p
    z, up = 2 * (p[:, 0] + 1j * p[:, 1]) / (1 + p[:, 2]), 1 + p[:, 2]
    arm = (d[:, 0] + 1j * d[:, 1]) * up - (p[:, 0] + 1j * p[:, 1]) * d[:, 2]
    radius = 2 * math.tan(CAP / 2)

    def theta(z: np.ndarray) -> np.ndarray:
        return sum(np.angle(z - b) + np.angle(radius**2 - np.conj(b) * z) for b in a) / 4

    angle = np.angle(arm) - theta(z) + theta(np.array(radius + 0j))
    error = np.abs(angle - math.pi / 2 * np.rint(angle / (math.pi / 2)))
    error = error[(np.abs(z[:, None] - a).min(axis=1) > CORE) & (np.abs(z) < INSIDE * radius)]
    edge = np.linalg.norm(np.diff(field.points[field.edges], axis=1), axis=2).mean()
    return len(field.triangles), float(edge), float(error.max()), float(error.mean())


def octant(size: float) -> tuple[int, int, list[int], float, float, float, list[str]]:
    """(quads, blocks, valences of irregular nodes inside, least and mean scaled Jacobian, distance from the middle, faults)."""
    with geometry(SURFACES["octant of a sphere"][0]), tempfile.TemporaryDirectory() as folder:
        result = cq.mesh(size=size)
        mesh, model = f"{folder}/a.msh", f"{folder}/a.brep"
        write_mesh(mesh)
        gmsh.write(model)
        current = gmsh.model.getCurrent()
        faults = check_task({"mesh": mesh, "model": model, "verbose": False}, lambda _: None)["faults"]
        _forget_others(current)
    quads, points = result.mesh.quads, result.mesh.points
    valence = np.bincount(quads.ravel(), minlength=len(points))
    valence[np.concatenate([*result.mesh.curve_nodes, result.mesh.vertex_node])] = 4
    odd = np.flatnonzero(valence != 4)
    corner = points[quads]
    normal = np.cross(corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1])
    ahead, back = np.roll(corner, -1, axis=1) - corner, np.roll(corner, 1, axis=1) - corner
    sine = np.einsum("qkc,qc->qk", np.cross(ahead, back), normal / np.linalg.norm(normal, axis=1)[:, None])
    jacobian = (sine / np.linalg.norm(ahead, axis=2) / np.linalg.norm(back, axis=2)).min(axis=1)
    off = np.linalg.norm(np.abs(points[odd]) - 1 / math.sqrt(3), axis=1).max(initial=0.0)
    blocks = len(np.unique(result.mesh.quad_block))
    return len(quads), blocks, valence[odd].tolist(), float(jacobian.min()), float(jacobian.mean()), float(off), faults


def _forget_others(current: str) -> None:
    """Remove all models but one."""
    for name in gmsh.model.list():
        if name != current:
            gmsh.model.setCurrent(name)
            gmsh.model.remove()
    gmsh.model.setCurrent(current)


def report() -> tuple[list[str], bool]:
    """The tables of curved.md, and whether all checks hold."""
    good = True

    def cell(text: str, holds: bool) -> str:
        nonlocal good
        good &= bool(holds)
        return text if holds else f"**{text}**"

    lines = [
        "| surface | triangles | chi | sum of indices | curvature: error in turns | indices: error in quarters |",
        "|---|" + "---|" * 5,
    ]
    for name, (make, chi) in SURFACES.items():
        count, euler, index, total, whole = poincare_hopf(make)
        row = [cell(f"{euler}", euler == chi), cell(f"{index:g}", index == chi)]
        row += [cell(f"{x:.0e}", x < 1e-12) for x in (total, whole)]
        lines.append(" | ".join([f"| {name}", f"{count}", *row]) + " |")
        print(lines[-1], flush=True)
    lines += [
        "",
        "| cap: triangles | mean edge h | greatest error (< h^2) | mean error | order of the mean |",
        "|---|" + "---|" * 4,
    ]
    before: tuple[float, float] | None = None
    for factor in FACTORS:
        count, h, most, mean = exact_errors(factor)
        order = math.nan if before is None else math.log(before[1] / mean) / math.log(before[0] / h)
        last = "" if before is None else cell(f"{order:.2f}", 1.7 < order < 2.5)
        lines.append(f"| {count} | {h:.4f} | {cell(f'{most:.1e}', most < h * h)} | {mean:.1e} | {last} |")
        before = h, mean
    lines += [
        "",
        "| octant: size | quads | blocks | irregular nodes inside (quads) | scaled Jacobian min (>= .86), mean | faults |",
        "|---|" + "---|" * 5,
    ]
    for size in SIZES:
        quads, blocks, odd, least, mean, _, faults = octant(size)
        row = [f"{quads}", cell(f"{blocks}", blocks == 3), cell(f"{len(odd)} ({', '.join(map(str, odd))})", odd == [3])]
        row += [f"{cell(f'{least:.4f}', least >= LEAST)}, {mean:.4f}", cell("; ".join(faults) or "none", not faults)]
        lines.append(" | ".join([f"| {size:g}", *row]) + " |")
    return lines, good


def main() -> int:
    lines, good = report()
    summary = (__doc__ or "").split("\n\n", 2)[2].strip()
    (HERE / "curved.md").write_text("\n".join(["# Curved faces against mathematics", "", summary, "", *lines, ""]))
    print("\n".join(lines))
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
