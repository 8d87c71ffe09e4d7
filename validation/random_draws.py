"""Meshes random domains with random boundary indices and random singularities of formula (2), and prints what became of them.

    python validation/random_draws.py [number of draws, 200] [first seed, 0] > table.md

Every draw must give an aligned field with the very singularities that were asked for, nearly all a mesh of
convex quads (where those of 1/2 and more are split), and the others an error of one line.
"""

from __future__ import annotations

import os
import sys
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from validation.domains import FAMILIES, Draw, draw

SIZE = 0.04
NEAR = 1e-6


@dataclass(frozen=True)
class Outcome:
    """What became of a draw.

    Attributes
    ----------
    seed : int
    family : str
    aligned : bool
        The aligned field has the singularities that were asked for and no others.
    quality : float
        Least scaled Jacobian; -1 where there is no mesh of quads.
    error : str
    notes : tuple of str
    """

    seed: int
    family: str
    aligned: bool = False
    quality: float = -1.0
    error: str = ""
    notes: tuple[str, ...] = ()


def outcome(seed: int) -> Outcome:
    """Align and mesh the draw with this seed."""
    import gmsh

    import gmsh_crossquad as cq
    from gmsh_crossquad.source.formula import Singularities

    if not gmsh.isInitialized():
        gmsh.initialize(interruptible=False, readConfigFiles=False)
        gmsh.option.setNumber("General.Terminal", 0)
    case = draw(seed)
    gmsh.clear()
    with TemporaryDirectory() as folder:
        path = Path(folder) / "draw.geo"
        path.write_text(case.geo)
        gmsh.open(str(path))
    options: dict[str, Any] = {
        "field": Singularities(case.positions, np.array(case.quarters, np.int64)),
        "boundary_index": {tag: Fraction(quarters, 4) for tag, quarters in case.indices.items()},
    }
    aligned = False
    try:
        aligned = _as_asked(case, cq.cross_field(SIZE, **options))
        result = cq.mesh(SIZE, **options)
    except cq.CrossQuadError as error:
        return Outcome(seed, case.family, aligned, error=str(error))
    kinds = gmsh.model.mesh.getElements(2)[0].tolist()
    quality = result.quality.min_scaled_jacobian if kinds == [3] and result.quality.conforming else -1.0
    return Outcome(seed, case.family, aligned, quality, notes=result.notes)


def _as_asked(case: Draw, field: Any) -> bool:
    """Whether a field has the singularities of a case, and no others."""
    found = [(complex(s.point[0], s.point[1]), s.index) for s in field.singularities]
    for place, quarters in zip(case.positions, case.quarters, strict=True):
        same = [s for s in found if s[1] == quarters and abs(s[0] - complex(*place)) < NEAR]
        if len(same) != 1:
            return False
        found.remove(same[0])
    return not found


def report(outcomes: list[Outcome]) -> None:
    """Print the tables."""
    meshed = [o for o in outcomes if o.quality > 0]
    print("# Random draws\n")
    print(f"{len(outcomes)} draws, {sum(o.aligned for o in outcomes)} aligned as asked for, {len(meshed)} meshed.\n")
    print(
        "| family | draws | aligned | meshed | pairs added | split | least quality | median |\n|---|---|---|---|---|---|---|---|"
    )
    for family in FAMILIES:
        rows = [o for o in outcomes if o.family == family]
        good = [o.quality for o in rows if o.quality > 0]
        counts = [sum(any(word in note for note in o.notes) for o in rows) for word in ("was added", "was split")]
        numbers = [len(rows), sum(o.aligned for o in rows), len(good), *counts]
        ends = f"{min(good):.2f} | {np.median(good):.2f}" if good else " | "
        print(f"| {family} | {' | '.join(map(str, numbers))} | {ends} |")
    errors = Counter(o.error or "quads that are not convex" for o in outcomes if o.quality <= 0)
    if errors:
        print("\n| draws | error |\n|---|---|")
        for text, count in errors.most_common():
            print(f"| {count} | {text} |")


def main() -> None:
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    first = int(sys.argv[2]) if len(sys.argv) > 2 else 0
    with ProcessPoolExecutor() as pool:
        report(list(pool.map(outcome, range(first, first + count), chunksize=5)))


if __name__ == "__main__":
    main()
