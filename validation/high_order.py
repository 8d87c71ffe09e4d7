"""Prints how good elements of order 2 and 3 are: least quality, Jacobian, and distance of their nodes from the CAD.

    python validation/high_order.py part.step=2.5 geo/disc.geo ... > table.md

A number after "=" is the size.  Qualities are the least that Gmsh's `getElementQualities` gives: "minSICN", "minSJ", and
"minDetJac", over the median of its "maxDetJac".  Distances are those of the nodes of high order from the point of their curve
at their parameter, or from the one that Gmsh's `getClosestPoint` finds on their face, over the diagonal of the model.  (On
built-in splines that function is far off.)  Every model has a process of its own, and two minutes of CPU.
"""

import json
import os
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

HERE = Path(__file__).resolve()
SECONDS = 120
MOST = 2_000  # nodes of an entity whose distance is measured
KINDS = {2: 10, 3: 36}


def distance(gmsh, np, order: int) -> float:
    """Greatest distance of nodes that no corner of an element is."""
    far = 0.0
    for dim in (1, 2):
        for _, tag in gmsh.model.getEntities(dim):
            if gmsh.model.getType(dim, tag).startswith("Discrete"):
                continue
            types, _, nodes = gmsh.model.mesh.getElements(dim, tag)
            if not len(types):
                continue
            corners = np.unique(nodes[0].reshape(-1, (order + 1) ** dim)[:, : 2 * dim])
            own, x, t = gmsh.model.mesh.getNodes(dim, tag, returnParametricCoord=dim == 1)
            new = np.flatnonzero(~np.isin(own, corners))
            new = new[:: 1 + len(new) // MOST]
            x = x.reshape(-1, 3)[new]
            if len(x):
                near = gmsh.model.getValue(1, tag, t[new]) if dim == 1 else gmsh.model.getClosestPoint(2, tag, x.ravel())[0]
                near = near.reshape(-1, 3)
                far = max(far, float(np.linalg.norm(near - x, axis=1).max()))
    return far


def measure(path: str, size: str, order: str) -> None:
    """Mesh a model; prints the numbers as JSON."""
    import gmsh
    import numpy as np

    import gmsh_crossquad as cq

    resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS))
    gmsh.initialize(readConfigFiles=False)
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.open(path)
    start = time.process_time()
    try:
        result = cq.mesh(float(size) if size else None, order=int(order), incomplete=False)
    except cq.CrossQuadError as error:
        print(json.dumps({"error": str(error)}))
        return
    whole = time.process_time() - start
    kind = KINDS[int(order)]
    tags = gmsh.model.mesh.getElementsByType(kind)[0]
    least = {name: float(gmsh.model.mesh.getElementQualities(tags, name).min()) for name in ("minSICN", "minSJ", "minDetJac")}
    least["minDetJac"] /= float(np.median(gmsh.model.mesh.getElementQualities(tags, "maxDetJac")))
    box = gmsh.model.getBoundingBox(-1, -1)
    diagonal = float(np.linalg.norm(np.subtract(box[3:], box[:3])))
    straight = [note.split(" elements")[0] for note in result.notes if "turned over" in note]
    out = {"faces": len(result.face_tags), "quads": len(result.mesh.quads), "linear": result.quality.min_scaled_jacobian}
    out |= {"straight": straight[0] if straight else "0", "far": distance(gmsh, np, int(order)) / diagonal}
    print(json.dumps(out | least | {"whole": whole, "order": result.timings["order"]}))


def child(path: str, size: str, order: int) -> dict:
    """The numbers of a model, from a process of its own."""
    arguments = [sys.executable, str(HERE), "--measure", path, size, str(order)]
    run = subprocess.run(arguments, capture_output=True, text=True)
    lines = run.stdout.splitlines()
    if run.returncode in (-signal.SIGXCPU, -signal.SIGKILL):
        return {"error": f"not done in {SECONDS} s of CPU"}
    if run.returncode or not lines:
        return {"error": (run.stderr.splitlines() or [f"status {run.returncode}"])[-1]}
    return json.loads(lines[-1])


def main(models: list[str]) -> None:
    print("# Elements of order 2 and 3\n\n    python validation/high_order.py MODEL=SIZE ...\n")
    head = ("model", "order", "faces", "quads", "min SJ, order 1", "min SICN", "min SJ", "min det J", "made straighter")
    print(f"| {' | '.join((*head, 'off the CAD', 'CPU s (raising)'))} |")
    print(f"|{'---|' * 11}")
    for model in models:
        path, _, size = model.partition("=")
        for order in KINDS:
            r = child(path, size, order)
            if "error" in r:
                print(f"| {Path(path).stem} | {order} | {r['error'].replace('|', '/')} |", flush=True)
                continue
            row = (Path(path).stem, order, r["faces"], f"{r['quads']:,}", f"{r['linear']:.3f}", f"{r['minSICN']:.3f}")
            row += (f"{r['minSJ']:.3f}", f"{r['minDetJac']:.0e}", r["straight"], f"{r['far']:.0e}")
            print("| " + " | ".join(str(x) for x in row) + f" | {r['whole']:.1f} ({r['order']:.2f}) |", flush=True)


if __name__ == "__main__":
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    if sys.argv[1:2] == ["--measure"]:
        time.perf_counter = time.process_time  # stages in CPU seconds
        measure(*sys.argv[2:])
    else:
        main(sys.argv[1:])
