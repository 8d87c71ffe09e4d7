"""Prints what meshing costs: start-up, a million quads against Gmsh's own binary write, alignment against one factorisation, and
models of many blocks and of many curved faces.

    python validation/benchmark.py > table.md
    python validation/benchmark.py assemblies  # one of the tables

Times are CPU seconds (one thread), the least of several runs; every row has a process of its own.  Machines differ: compare
within a run, above all the ratio to the time that Gmsh takes to write the same mesh to a binary .msh file.
"""

import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

HERE = Path(__file__).resolve()
GEO = HERE.parent.parent / "geo"
RUNS = 3
SIZES = (0.0195, 0.00617, 0.001932)  # 10^4, 10^5, 10^6 quads on the plate with a hole
HOLES = (1, 2, 4, 6, 8)  # per side
COPIES = (1, 10, 32, 100)  # of a part with ten faces
TRIANGLES = (0.38, 0.12)  # factors on the background of a plate with five holes: 10^4 and 10^5 triangles


def child(*arguments: str) -> tuple[dict, float]:
    """Run this script in a new process: what it printed, and its CPU seconds."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    out = subprocess.run([sys.executable, str(HERE), *arguments], check=True, capture_output=True, text=True).stdout
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return json.loads(out.splitlines()[-1]) if out.strip() else {}, seconds


def command(*arguments: str) -> float:
    """CPU seconds of a program."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(arguments, check=True, capture_output=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def table(title: str, head: tuple[str, ...], rows: list[tuple]) -> None:
    print(f"\n## {title}\n")
    print(f"| {' | '.join(head)} |\n|{'---|' * len(head)}")
    for row in rows:
        print("| " + " | ".join(f"{x:.3f}" if isinstance(x, float) else str(x) for x in row) + " |")


def start_up() -> None:
    def code(text: str) -> float:
        return min(command(sys.executable, "-c", text) for _ in range(2 * RUNS))

    program = (sys.executable, "-m", "gmsh_crossquad")
    in_cpu_seconds = (
        "import sys, time; time.perf_counter = time.process_time; from gmsh_crossquad.cli import main; main(sys.argv[1:])"
    )
    with tempfile.TemporaryDirectory() as folder:
        arguments = ("mesh", str(GEO / "plate_hole.geo"), "-o", f"{folder}/out.msh", "--size", "0.06")
        mesh = (sys.executable, "-c", in_cpu_seconds, *arguments)
        runs = [
            (command(*mesh), subprocess.run(mesh, check=True, capture_output=True, text=True).stdout) for _ in range(2 * RUNS)
        ]
    work = [{line.split()[0]: float(line.split()[1]) for line in text.splitlines()[:-2]} for _, text in runs]
    whole = min(seconds for seconds, _ in runs)
    stages = min(sum(v for k, v in w.items() if k not in ("start", "load")) for w in work)
    rows = [
        ("Python alone", code("pass")),
        ("... with NumPy and Gmsh", code("import numpy, gmsh")),
        ("... with scipy.sparse.linalg and csgraph", code("import numpy, gmsh, scipy.sparse.linalg, scipy.sparse.csgraph")),
        ("... with `gmsh_crossquad.mesh`", code("from gmsh_crossquad import mesh")),
        ("`gmsh-crossquad --version`", min(command(*program, "--version") for _ in range(RUNS))),
        ("`gmsh-crossquad mesh`, 1,000 quads, whole", whole),
        ("... of that start-up: all but the stages", whole - stages),
    ]
    table("Start-up", ("what", "CPU s"), rows)


def plate(size: str) -> None:
    """Mesh the plate with a hole; prints the times as JSON."""
    import gmsh

    import gmsh_crossquad as cq

    gmsh.initialize(readConfigFiles=False)
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.option.setNumber("Mesh.Binary", 1)
    gmsh.open(str(GEO / "plate_hole.geo"))
    cq.mesh(size=0.1)  # everything is loaded
    best: dict[str, float] = {}
    with tempfile.TemporaryDirectory() as folder:
        for _ in range(RUNS):
            gmsh.model.mesh.clear()
            start = time.process_time()
            result = cq.mesh(size=float(size))
            whole = time.process_time()
            gmsh.write(f"{folder}/out.msh")
            write = time.process_time() - whole
            bytes_ = os.path.getsize(f"{folder}/out.msh")
            quality = time.process_time()
            q = result.quality
            seconds = {"fill": result.timings["fill"], "put": result.timings["put"], "whole": whole - start, "write": write}
            seconds["quality"] = time.process_time() - quality
            best = {k: min(v, best.get(k, v)) for k, v in seconds.items()}
    assert q.conforming and q.inverted == 0
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (2**20 if sys.platform != "darwin" else 2**30)
    print(json.dumps(best | {"quads": q.quads, "min": q.min_scaled_jacobian, "peak": peak, "megabytes": bytes_ / 1e6}))


def million() -> None:
    rows = []
    for size in SIZES:
        r, _ = child("plate", str(size))
        rows.append(
            (f"{r['quads']:,}", r["fill"], r["put"], r["whole"], r["write"], f"{r['whole'] / r['write']:.1f}", r["quality"])
            + (f"{r['peak']:.2f}", f"{r['min']:.2f}")
        )
    head = ("quads", "fill", "put", "whole", "write", "whole / write", "quality", "peak GB", "min SJ")
    table("A plate with a hole", head, rows)


def align(factor: str) -> None:
    """Align a field with 20 singularities on a plate with five holes; prints the times as JSON."""
    import gmsh
    import numpy as np

    from gmsh_crossquad.cad.background import background_meshes
    from gmsh_crossquad.cad.read import read_model
    from gmsh_crossquad.field.align import align as aligned
    from gmsh_crossquad.field.corners import boundary_indices
    from gmsh_crossquad.field.operators import FieldOperators
    from gmsh_crossquad.field.smooth import edge_angle, from_angles
    from gmsh_crossquad.field.surface_mesh import SurfaceMesh
    from gmsh_crossquad.options import MeshOptions

    gmsh.initialize(readConfigFiles=False)
    gmsh.option.setNumber("General.Terminal", 0)
    occ = gmsh.model.occ
    holes = [(2, occ.addDisk(x, y, 0, 0.1, 0.1)) for x, y in ((0.3, 0.3), (0.7, 0.7), (1.1, 0.35), (1.5, 0.65), (1.8, 0.3))]
    occ.cut([(2, occ.addRectangle(0, 0, 0, 2, 1))], holes)
    occ.synchronize()
    options = MeshOptions(background=float(factor))
    mesh = background_meshes(read_model(options), options)[0]
    best = {"factor": float("inf"), "align": float("inf")}
    for _ in range(RUNS):
        surface = SurfaceMesh(mesh.points, mesh.triangles)
        operators = FieldOperators(surface)
        operators.inner  # noqa: B018
        start = time.process_time()
        operators._factors  # noqa: B018
        best["factor"] = min(best["factor"], time.process_time() - start)
        surface = SurfaceMesh(mesh.points, mesh.triangles)
        inside = np.flatnonzero(~surface.boundary_vertex)
        places = mesh.points[surface.edges].mean(axis=1), mesh.points[inside[:: len(inside) // 20][:20]]
        z, a = (p @ np.array([1, 1j]) for p in places)
        angle = -0.25 * np.angle(z[:, None] - a).sum(axis=1) + 0.3 * np.sin(3 * z.real)
        field = from_angles(surface, angle - edge_angle(surface))
        operators = FieldOperators(surface)
        start = time.process_time()
        result = aligned(surface, operators, field, boundary_indices(mesh), field)
        best["align"] = min(best["align"], time.process_time() - start)
    print(json.dumps(best | {"triangles": len(mesh.triangles), "residual": result.residual}))


def alignment() -> None:
    rows = []
    for factor in TRIANGLES:
        r, _ = child("align", str(factor))
        ratio = f"{r['align'] / r['factor']:.1f}"
        rows.append((f"{r['triangles']:,}", r["factor"], r["align"], ratio, f"{r['residual']:.0e}"))
    head = ("triangles", "one factorisation", "alignment, with its factorisation", "ratio", "residual")
    table("Aligning a field on a plate with five holes", head, rows)


def perforated(n: str) -> None:
    """Mesh a plate with n x n holes in two materials; prints the times as JSON."""
    import gmsh

    import gmsh_crossquad as cq

    gmsh.initialize(readConfigFiles=False)
    gmsh.option.setNumber("General.Terminal", 0)
    occ, k = gmsh.model.occ, int(n)
    best = float("inf")
    for run in range(RUNS):
        gmsh.model.add(f"perforated {run}")
        halves = [(2, occ.addRectangle(0, 0, 0, k / 2, k)), (2, occ.addRectangle(k / 2, 0, 0, k / 2, k))]
        holes = [(2, occ.addDisk(i + 0.47, j + 0.53, 0, 0.15, 0.15)) for i in range(k) for j in range(k)]
        occ.cut(occ.fragment(halves, [])[0], holes)
        occ.synchronize()
        start = time.process_time()
        result = cq.mesh(size=0.05)
        best = min(best, time.process_time() - start)
        gmsh.model.remove()
    q = result.quality
    slow = sorted(result.timings.items(), key=lambda item: -item[1])[:3]
    stages = ", ".join(f"{name} {seconds:.2f}" for name, seconds in slow)
    print(json.dumps({"blocks": q.blocks, "quads": q.quads, "seconds": best, "min": q.min_scaled_jacobian, "stages": stages}))


def blocks() -> None:
    rows = []
    for n in HOLES:
        r, _ = child("perforated", str(n))
        rows.append((f"{n * n}", r["blocks"], f"{r['quads']:,}", r["seconds"], f"{r['min']:.2f}", r["stages"]))
    table("Many blocks: plates of two materials with holes", ("holes", "blocks", "quads", "CPU s", "min SJ", "slowest"), rows)


def assembly(copies: str) -> None:
    """Mesh copies of a block with four rounded edges (six plane faces, four quarter cylinders); prints the times as JSON."""
    import gmsh

    import gmsh_crossquad as cq

    gmsh.initialize(readConfigFiles=False)
    gmsh.option.setNumber("General.Terminal", 0)
    occ = gmsh.model.occ
    occ.addBox(0, 0, 0, 1, 1, 1)
    occ.synchronize()
    cq.mesh(size=0.3)  # everything is loaded
    gmsh.clear()
    block = occ.addBox(0, 0, 0, 2, 1, 0.6)
    occ.synchronize()
    height = {
        tag: gmsh.model.getBoundingBox(1, tag)[5] - gmsh.model.getBoundingBox(1, tag)[2] for _, tag in gmsh.model.getEntities(1)
    }
    part = occ.fillet([block], [tag for tag, h in height.items() if h > 0.5], [0.25])
    for k in range(1, int(copies)):
        occ.translate(occ.copy(part), 3.0 * (k % 10), 2.0 * (k // 10), 0)
    occ.synchronize()
    faces = len(gmsh.model.getEntities(2))
    start = time.process_time()
    result = cq.mesh(size=0.1)
    seconds = time.process_time() - start
    q = result.quality
    assert q.conforming and q.inverted == 0
    slow = sorted(result.timings.items(), key=lambda item: -item[1])[:6]
    stages = ", ".join(f"{name} {1e3 * t / faces:.1f}" for name, t in slow)
    numbers = {"faces": faces, "blocks": q.blocks, "quads": q.quads, "min": q.min_scaled_jacobian}
    print(json.dumps(numbers | {"seconds": seconds, "stages": stages}))


def assemblies() -> None:
    rows = []
    for n in COPIES:
        r, _ = child("assembly", str(n))
        each = f"{1e3 * r['seconds'] / r['faces']:.0f}"
        rows.append((f"{r['faces']:,}", r["blocks"], f"{r['quads']:,}", r["seconds"], each, f"{r['min']:.2f}", r["stages"]))
    head = ("faces", "blocks", "quads", "CPU s", "ms a face", "min SJ", "slowest, ms a face")
    table("Many curved faces: copies of a block with rounded edges", head, rows)


TABLES = (start_up, million, alignment, blocks, assemblies)

if __name__ == "__main__":
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    if len(sys.argv) == 3:
        time.perf_counter = time.process_time  # stages in CPU seconds
        {"plate": plate, "perforated": perforated, "align": align, "assembly": assembly}[sys.argv[1]](sys.argv[2])
    elif len(sys.argv) == 2:
        {f.__name__: f for f in TABLES}[sys.argv[1]]()
    else:
        print("# Benchmark\n\n    python validation/benchmark.py\n\nCPU seconds, the least of several runs (see the script).")
        for make in TABLES:
            make()
