"""Figure 14: three materials, a square plate with a circular hole and in it two half-discs: conforming, physical groups kept."""

import gmsh
import numpy as np
from study import Checks, check_mesh, main, model, solve

INTERFACES = {5: {1, 2}, 6: {1, 3}, 7: {2, 3}}


def run() -> Checks:
    checks = Checks("14")
    with model("fig14") as path:
        before = sorted((d, gmsh.model.getPhysicalName(d, t)) for d, t in gmsh.model.getPhysicalGroups())
        study = solve(path)
        after = sorted((d, gmsh.model.getPhysicalName(d, t)) for d, t in gmsh.model.getPhysicalGroups())
    mesh, records = study.result.mesh, study.result.stages.model
    checks.equal("physical groups", before, after)
    faces = [f.tag for f in records.faces]
    for row, curve in enumerate(records.curves):
        if curve.tag in INTERFACES:
            chain = mesh.curve_nodes[row]
            pairs = {tuple(sorted(p)) for p in zip(chain[:-1].tolist(), chain[1:].tolist())}
            users: dict[tuple[int, ...], set[int]] = {p: set() for p in pairs}
            for quad, face in zip(mesh.quads.tolist(), mesh.quad_face.tolist()):
                for a, b in zip(quad, [*quad[1:], quad[0]]):
                    key = (min(a, b), max(a, b))
                    if key in users:
                        users[key].add(faces[face])
            shared = sum(u == INTERFACES[curve.tag] for u in users.values())
            what = f"edges of curve {curve.tag} that are edges of quads of surfaces {sorted(INTERFACES[curve.tag])}"
            checks.equal(what, len(pairs), shared)
    for field, euler in zip(study.result.field, (0, 1, 1)):
        checks.equal(f"sum of indices on surface {field.face}", 4 * euler, int(np.sum(field.index)))
    check_mesh(checks, study)

    def draw():
        from drawing import scene

        return scene(study)

    checks.scenes["fig14"] = draw
    return checks


if __name__ == "__main__":
    main(run)
