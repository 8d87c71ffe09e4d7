"""Prints the CPU seconds of the command beside those of Gmsh's quasi-structured mesher, model by model in turn.

    python validation/beside_gmsh.py ../shared/corpus/cases.csv shell-curved solid-boundary > table.md

The first argument is a list of models (name, category, file and edge length h in columns of these names), the others are
categories.  Both are whole processes on one thread, from the start of Python to the mesh in a file, run one after the other, so
that a slow or a busy machine counts for both.  Gmsh (algorithm 11) gets ``FACTOR * h``, for which it makes about as many quads as
are recorded for it in that list.  Models that one of the two does not mesh within `LIMIT` seconds are left out of the medians.
"""

import csv
import os
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

FACTOR = 1.87
LIMIT = 120
GMSH = """
import sys, gmsh
gmsh.initialize(["-noenv"], readConfigFiles=False)
gmsh.option.setNumber("General.Terminal", 0)
gmsh.option.setNumber("General.NumThreads", 1)
gmsh.open(sys.argv[1])
gmsh.option.setNumber("Mesh.Algorithm", 11)
for name in ("Min", "Max"):
    gmsh.option.setNumber("Mesh.MeshSize" + name, float(sys.argv[2]))
gmsh.model.mesh.generate(2)
if not sum(len(gmsh.model.mesh.getElementsByType(kind)[0]) for kind in (3, 16)):
    sys.exit(1)
gmsh.write(sys.argv[3])
"""


def seconds(*arguments: str) -> float | None:
    """CPU seconds of a program and its children, None where it fails or takes too long."""
    before = os.times()
    try:
        done = subprocess.run(arguments, capture_output=True, timeout=LIMIT).returncode == 0
    except subprocess.TimeoutExpired:
        return None
    after = os.times()
    return after.children_user + after.children_system - before.children_user - before.children_system if done else None


def main(cases: Path, categories: list[str]) -> None:
    with cases.open(newline="") as file:
        models = [row for row in csv.DictReader(file) if row["category"] in categories]
    both: dict[str, list[tuple[float, float]]] = {name: [] for name in categories}
    print("| model | quasi-structured | this | difference |\n|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        mesh = f"{folder}/mesh.msh"
        for row in models:
            path = str(cases.parent / row["file"])
            theirs = seconds(sys.executable, "-c", GMSH, path, str(FACTOR * float(row["h"])), mesh)
            ours = seconds(sys.executable, "-m", "gmsh_crossquad", "mesh", path, "-o", mesh, "--size", row["h"])
            shown = ["-" if t is None else f"{t:.2f}" for t in (theirs, ours)]
            if theirs is not None and ours is not None:
                both[row["category"]].append((theirs, ours))
                shown.append(f"{ours - theirs:+.2f}")
            print(f"| {row['name']} | {' | '.join(shown)} |", flush=True)
    print("\n| category | models | median quasi-structured | median this | allowed |\n|---|---|---|---|---|")
    groups = {**both, "all": [pair for pairs in both.values() for pair in pairs]}
    for name, pairs in groups.items():
        theirs, ours = (statistics.median(p[k] for p in pairs) for k in (0, 1))
        print(f"| {name} | {len(pairs)} | {theirs:.2f} | {ours:.2f} | {theirs + 1:.2f} |")


if __name__ == "__main__":
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    main(Path(sys.argv[1]), sys.argv[2:])
