"""Figures 17, 18, 19: a quarter of a sphere; parts of the unaligned field are not four-sided, those of the aligned one are.

The field is formula (2) in the plane of a stereographic projection, which keeps angles; it is given as directions in space.
"""

import numpy as np
from separatrices import formula, winding
from sphere import Chart, on_sphere
from study import Checks, check_boundary, check_faces, check_mesh, check_sum, four, main, model, solve

POINTS, QUARTERS = [(0.35, 0.45), (-0.55, -0.15)], [1, 1]
CHART = Chart(np.array([0.0, 1.0, 1.0]) / np.sqrt(2), np.array([1.0, 0.0, 0.0]))


def directions(points):
    """An arm of every cross."""
    z = CHART.flat(points)
    return CHART.directions(z, np.exp(0.25j * np.angle(formula(POINTS, QUARTERS)(z))))


def run() -> Checks:
    checks = Checks("17, 18, 19")
    with model("quarter_sphere") as path:
        study = on_sphere(solve(path, field=directions), CHART)
    check_sum(checks, study, 1)
    u = formula(POINTS, QUARTERS)
    checks.close("degree of u along the boundary, the sum of its indices", 0.5, winding(u, study.loops()[0]), 1e-9)
    off = max(min(abs(z - complex(*p)) for p in POINTS) for z, _ in study.singular())
    edge = float(study.surface.edge_length.max())
    checks.holds("distance of singular points from those of the formula", f"< {edge:.2f}, an edge", f"{off:.3f}", off < edge)
    unaligned, aligned = study.parts(u, 0.01), study.parts(study.power(aligned=True))
    four(checks, "parts of the unaligned field with four corners", unaligned, False)
    four(checks, "parts of the aligned field with four corners", aligned, True)
    check_mesh(checks, study)
    check_boundary(checks, study)
    check_faces(checks, study, [1])

    def draw():
        from drawing import parts_panel, scene

        return scene(study, parts_panel(unaligned, study, "unaligned"), parts_panel(aligned, study, "aligned"))

    checks.scenes["fig17"] = draw
    return checks


if __name__ == "__main__":
    main(run)
