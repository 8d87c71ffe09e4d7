"""Figures 10 and 11: formula (2) on a domain with a hole.  Its degrees meet (16) but not (17); psi moves them, and phi aligns.

With the domain on the left of every loop the degree that the indices on the boundary ask for is 1 - sum I on the outer loop and
-1 - sum I around a hole; the field has its winding number.  The defect D is the difference in quarter turns.
"""

import numpy as np
from separatrices import formula, winding
from study import Checks, Study, check_boundary, check_mesh, check_places, check_sum, four, main, model, solve, text

import gmsh_crossquad as cq
from gmsh_crossquad.field.smooth import wrap

POINTS, QUARTERS = [(0.7, 0.6), (-0.55, 0.45), (-0.35, -0.5), (0.5, -0.6)], [-1, -1, -1, -1]
HOLE = (0.1, 0.05)


def fine(loop):
    return np.interp(np.arange(20 * len(loop)) / 20, np.arange(len(loop) + 1), np.append(loop, loop[0]))


def period(study: Study, loop: int) -> float:
    """Turn of psi along a boundary loop, its jumps included: the turn of v less those of u and of phi."""
    mesh, aligned = study.surface, study.result.stages.fields[0]
    phi = aligned.phi[mesh.triangle_edges]
    turn = aligned.field.rotation - aligned.given.rotation - (np.roll(phi, -1, axis=1) - phi)
    at = np.bincount(mesh.triangles.ravel(), np.roll(turn, 1, axis=1).ravel(), len(mesh.points))
    return float(at[mesh.loops[loop]].sum())


def check_defects(checks: Checks, study: Study, points, quarters) -> list[int]:
    """The defects before, (16), (17), and the periods of psi that remove them; the defects in quarter turns."""
    u, mesh, index = formula(points, quarters), study.surface, study.face.index
    degree = [winding(u, fine(loop)) for loop in study.loops()]
    needed = [(1 if k == 0 else -1) - index[loop].sum() / 4 for k, loop in enumerate(mesh.loops)]
    checks.close("(16): sum of the degrees of u = sum of its indices inside", sum(quarters) / 4, sum(degree), 1e-9)
    defects = [round(4 * (a - b)) for a, b in zip(needed, degree)]
    pairs = ", ".join(f"{d:g}/{n:g}" for d, n in zip(np.round(degree, 9) + 0.0, needed))
    checks.holds("(17): degree of u / degree needed on every loop", "not met", pairs, any(defects))
    checks.equal("sum of the defects D", 0, sum(defects))
    for k in range(1, len(defects)):
        checks.close(
            f"period of psi around hole {k}, + (pi/2) D, D = {defects[k]:+d}", np.pi / 2 * defects[k], period(study, k), 1e-9
        )
    checks.close("psi on the boundary", 0.0, float(np.abs(study.face.psi[mesh.boundary_edge]).max()), 1e-12)
    return defects


def run() -> Checks:
    checks = Checks("10, 11")
    with model("fig10") as path:
        study = solve(path, field=text(POINTS, QUARTERS))
        other = cq.cross_field(field=text([*POINTS, HOLE], [*QUARTERS, 4]))
    check_sum(checks, study, 0)
    check_defects(checks, study, POINTS, QUARTERS)
    # an index +1 in the hole gives u the right degrees: psi has nothing to do, and the aligned field is the same
    checks.close("psi with an index of +1 in the hole", 0.0, float(np.abs(other.faces[0].psi).max()), 1e-12)
    off = np.abs(wrap(other.faces[0].theta - study.face.theta))
    near = np.abs(study.face.places[:, None, :2] - np.array(POINTS)).max(axis=2).min(axis=1) < 0.1
    checks.holds(
        "difference of both aligned fields (away from singular points)",
        "< 0.02",
        f"{off[~near].max():.4f}",
        off[~near].max() < 0.02,
    )
    unaligned, aligned = study.parts(formula(POINTS, QUARTERS), 0.01), study.parts(study.power(aligned=True))
    four(checks, "parts of the unaligned field with four corners", unaligned, False)
    four(checks, "parts of the aligned field with four corners", aligned, True)
    check_mesh(checks, study)
    check_boundary(checks, study)
    check_places(checks, study, POINTS)

    def draw():
        from drawing import parts_panel, scene

        return scene(study, parts_panel(unaligned, study, "unaligned"), parts_panel(aligned, study, "aligned"))

    checks.scenes["fig10"] = draw
    return checks


if __name__ == "__main__":
    main(run)
