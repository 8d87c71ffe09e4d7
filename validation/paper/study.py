"""What the figures share: checks with expected and found values, a mesh of a model, and what is read off it."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import gmsh
import numpy as np
import numpy.typing as npt
from separatrices import Complex, Parts, Power, interpolated, parts

import gmsh_crossquad as cq
from gmsh_crossquad.cad.files import open_model, write_mesh
from gmsh_crossquad.cad.session import guest
from gmsh_crossquad.field.compatibility import quarter_text
from gmsh_crossquad.field.surface_mesh import SurfaceMesh
from gmsh_crossquad.judge import check_task
from gmsh_crossquad.quality import twins

HERE = Path(__file__).resolve().parent
Float = npt.NDArray[np.float64]
#: least scaled Jacobian of a good mesh of a curved face
LEAST = 0.6


@dataclass
class Checks:
    """The checks of a figure: (what, expected, found, good), and the scenes to draw by name."""

    figure: str
    lines: list[tuple[str, str, str, bool]] = field(default_factory=list)
    scenes: dict[str, Callable[[], Any]] = field(default_factory=dict)

    def equal(self, what: str, expected: object, found: object) -> None:
        self.lines.append((what, str(expected), str(found), expected == found))

    def close(self, what: str, expected: float, found: float, tolerance: float) -> None:
        self.lines.append((what, f"{expected:.4g}", f"{found:.4g}", abs(expected - found) <= tolerance))

    def holds(self, what: str, expected: str, found: object, good: bool) -> None:
        self.lines.append((what, expected, str(found), bool(good)))

    @property
    def good(self) -> bool:
        return all(line[3] for line in self.lines)


@contextmanager
def model(name: str) -> Iterator[str]:
    """A .geo file of this folder, or of the examples in geo/, as Gmsh's current model; yields its path."""
    path = str(next(p for p in (HERE / f"{name}.geo", HERE.parents[1] / "geo" / f"{name}.geo") if p.exists()))
    with guest():
        gmsh.option.setNumber("General.Verbosity", 1)
        open_model(path)
        try:
            yield path
        finally:
            gmsh.model.remove()


def text(points: Sequence[tuple[float, float]], quarters: Sequence[int]) -> str:
    """Formula (2) as it is written on the command line."""
    return "singularities:" + ",".join(f"({x},{y}):{q}" for (x, y), q in zip(points, quarters))


@dataclass
class Study:
    """A mesh of a model of one face or several, and what is read off it, in the plane z = 0."""

    path: str
    result: cq.MeshResult
    faults: list[str]

    def flat(self, points: Float) -> Complex:
        """Places (n,) of points (n, 3) in the plane."""
        return points[:, 0] + 1j * points[:, 1]

    def arms(self, points: Float, directions: Float) -> Complex:
        """Directions (n, 3) at points (n, 3) in the plane."""
        return directions[:, 0] + 1j * directions[:, 1]

    def lift(self, z: Complex) -> Float:
        """Points (n, 3) of places (n,) in the plane."""
        return np.stack([z.real, z.imag, 0 * z.real], axis=1)

    @property
    def face(self) -> cq.FaceField:
        return self.result.field[0]

    @property
    def surface(self) -> SurfaceMesh:
        z = self.flat(self.face.points)
        return SurfaceMesh(np.stack([z.real, z.imag], axis=1), self.face.triangles)

    def loops(self) -> list[Complex]:
        """The boundary of the first face, the domain on the left, the outer loop first."""
        z = self.flat(self.face.points)
        return [z[loop] for loop in self.surface.loops]

    def boundary_indices(self) -> list[tuple[complex, int]]:
        """Places and indices (quarter turns) of the singular boundary points of the first face."""
        f, on, z = self.face, self.surface.boundary_vertex, self.flat(self.face.points)
        return [(complex(z[v]), int(f.index[v])) for v in np.flatnonzero(on & (f.index != 0))]

    def singular(self) -> list[tuple[complex, int]]:
        """Places and indices (quarter turns) of the singular points inside."""
        found = self.result.singularities
        places = self.flat(np.array([s.point for s in found]).reshape(-1, 3))
        return [(complex(z), s.index) for z, s in zip(places, found)]

    def power(self, aligned: bool) -> Power:
        """The fourth power of the given or the aligned cross of the first face, from its background mesh."""
        places, directions = self.face.places, self.face.directions if aligned else self.face.given
        return interpolated(self.flat(places), self.arms(places, directions))

    def parts(self, power: Power, radius: float | None = None) -> Parts:
        """The parts into which the separatrices of a field with these singular points cut the first face."""
        points = [z for z, _ in self.singular()]
        ring = 2.0 * float(self.surface.edge_length.mean()) if radius is None else radius
        sharp = [z for z, q in self.boundary_indices() if q == 1]
        return parts(power, self.loops(), points, [ring] * len(points), sharp)

    def quads_at(self, z: complex) -> int:
        """Number of quads of the mesh around its node at (or nearest to) a point."""
        mesh = self.result.mesh
        node = int(np.argmin(np.abs(self.flat(mesh.points) - z)))
        return int(np.sum(mesh.quads == node))

    def irregular(self) -> list[tuple[complex, int]]:
        """Inner nodes of the mesh whose number of quads is not 4."""
        mesh = self.result.mesh
        valence = np.bincount(mesh.quads.ravel(), minlength=len(mesh.points))
        valence[np.concatenate([*mesh.curve_nodes, mesh.vertex_node])] = 4
        rows = np.flatnonzero((valence != 4) & (valence > 0))
        return [(complex(z), int(n)) for z, n in zip(self.flat(mesh.points[rows]), valence[rows])]

    def four_sided(self) -> tuple[int, int]:
        """Number of blocks with exactly four corners, and of all blocks, from the quads alone.

        A block has a corner where a quad has two edges in a row across which there is no quad of the block.  One that meets
        itself, two of its sides being the same, has none, and the Euler characteristic of a ring.
        """
        quads, block = self.result.mesh.quads, self.result.mesh.quad_block
        across = twins(quads)
        rim = ((across < 0) | (block[across // 4] != np.repeat(block, 4))).reshape(-1, 4)
        corners = np.bincount(block, (rim & np.roll(rim, 1, axis=1)).sum(axis=1))[np.unique(block)]
        good = [n == 4 or (n == 0 and _euler(quads[block == b]) == 0) for b, n in zip(np.unique(block), corners)]
        return sum(good), len(corners)

    def worst_corner(self) -> float:
        """The least scaled Jacobian: the sine of a quad's corner in the plane of its diagonals."""
        corner = self.result.mesh.points[self.result.mesh.quads]
        normal = np.cross(corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1])
        ahead, back = np.roll(corner, -1, axis=1) - corner, np.roll(corner, 1, axis=1) - corner
        sine = np.einsum("qkc,qc->qk", np.cross(ahead, back), normal / np.linalg.norm(normal, axis=1)[:, None])
        return float((sine / np.linalg.norm(ahead, axis=2) / np.linalg.norm(back, axis=2)).min())


def _euler(quads: npt.NDArray[np.int64]) -> int:
    """Vertices less edges, plus quads."""
    ends = np.stack([quads, np.roll(quads, -1, axis=1)], axis=2).reshape(-1, 2)
    return len(np.unique(quads)) - len(np.unique(np.sort(ends, axis=1), axis=0)) + len(quads)


def solve(path: str, **options: Any) -> Study:
    """Mesh the current model, write the mesh, and have it judged from the file against the model."""
    result = cq.mesh(**options)
    with tempfile.TemporaryDirectory() as folder:
        mesh = f"{folder}/a.msh"
        write_mesh(mesh)
        current = gmsh.model.getCurrent()
        faults = check_task({"mesh": mesh, "model": path, "verbose": False}, lambda _: None)["faults"]
        for name in gmsh.model.list():
            if name != current:
                gmsh.model.setCurrent(name)
                gmsh.model.remove()
        gmsh.model.setCurrent(current)
    return Study(path, result, faults)


def check_mesh(checks: Checks, study: Study, name: str = "") -> None:
    """What every aligned field must pass: its mesh is pure, conforming, in four-sided blocks around its singularities."""
    lead = f"{name}: " if name else ""
    good, blocks = study.four_sided()
    checks.equal(
        f"{lead}faults of the mesh (pure quads, conforming, on the boundary, groups kept)", "none", _listed(study.faults)
    )
    checks.holds(f"{lead}blocks with four sides", "all", f"{good} of {blocks}", good == blocks)
    wanted = sorted(s.valence for s in study.result.singularities)
    checks.equal(f"{lead}valences 4 - 4 I inside", wanted, sorted(v for _, v in study.irregular()))
    residual = max(f.residual for f in study.result.field)
    checks.holds(f"{lead}misalignment of the field on the boundary", "< 1e-9", f"{residual:.0e}", residual < 1e-9)


def check_boundary(checks: Checks, study: Study, name: str = "") -> None:
    """The number of quads at every singular boundary point."""
    lead = f"{name}: " if name else ""
    points = study.boundary_indices()
    wanted = [2 - q for _, q in points]
    checks.equal(f"{lead}quads 2 - 4 I at the singular boundary points", wanted, [study.quads_at(z) for z, _ in points])


def check_places(checks: Checks, study: Study, points: Sequence[tuple[float, float]], name: str = "") -> None:
    """The mesh is irregular exactly where the singular points are."""
    lead = f"{name}: " if name else ""
    found = [z for z, _ in study.irregular()]
    off = max(min(abs(complex(*p) - z) for z in found) for p in points)
    checks.holds(f"{lead}distance of irregular nodes from the given points", "< 1e-9", f"{off:.0e}", off < 1e-9)


def check_sum(checks: Checks, study: Study, euler: int, name: str = "") -> None:
    """Poincaré-Hopf."""
    lead = f"{name}: " if name else ""
    inside = [q for _, q in study.singular()]
    on = [q for _, q in study.boundary_indices()]
    lists = (" ".join(quarter_text(q) for q in some) or "none" for some in (inside, on))
    found = f"{sum(inside + on) / 4:g} (inside {next(lists)}; boundary {next(lists)})"
    checks.holds(f"{lead}sum of indices", str(euler), found, sum(inside + on) == 4 * euler)


def check_faces(checks: Checks, study: Study, euler: Sequence[int], name: str = "") -> None:
    """Poincaré-Hopf on every face, and the shape of the quads."""
    lead = f"{name}: " if name else ""
    found = [int(f.index.sum()) / 4 for f in study.result.field]
    texts = [", ".join(f"{x:g}" for x in some) for some in (euler, found)]
    checks.holds(f"{lead}sum of indices (every face)", *texts, found == list(euler))
    worst = study.worst_corner()
    checks.holds(f"{lead}least scaled Jacobian", f"> {LEAST:g}", f"{worst:.2f}", worst > LEAST)


def refused(checks: Checks, what: str, expected: str, **options: Any) -> None:
    """The error of a field whose indices do not fit."""
    try:
        cq.cross_field(**options)
        message = "accepted"
    except cq.FieldError as error:
        message = str(error).split(" (inside")[0]
    checks.holds(what, f"refused: {expected}", message, expected in message)


def four(checks: Checks, what: str, found: Parts, expected: bool) -> None:
    """Whether all parts have four corners."""
    corners = found.corners
    strange = sum(c != 4 for c in corners)
    checks.holds(
        what, "all" if expected else "not all", f"{len(corners) - strange} of {len(corners)}", (strange == 0) == expected
    )


def _listed(words: Sequence[str]) -> str:
    return "; ".join(words) or "none"


def main(*figures: Callable[[], Checks]) -> None:
    """Run figures, print their checks, draw their pictures; exit status 1 if a check fails."""
    from drawing import write

    good = True
    for figure in figures:
        checks = figure()
        print(f"figure {checks.figure}")
        for what, expected, found, ok in checks.lines:
            print(f"  {'ok  ' if ok else 'FAIL'} {what}: expected {expected}, found {found}")
        for name, scene in checks.scenes.items():
            write(scene(), HERE / f"{name}.png")
        good &= checks.good
    sys.exit(0 if good else 1)
