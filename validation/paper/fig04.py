"""Figure 4: formula (2) on a domain with a smooth boundary, where the indices inside must add up to 1."""

import numpy as np
from separatrices import formula, winding
from study import Checks, check_mesh, check_places, check_sum, four, main, model, refused, solve, text

POINTS = [(-0.61, -0.64), (-0.65, 0.29), (0.23, -0.67), (0.71, 0.73)]
QUARTERS = [1, 1, 1, 1]


def run() -> Checks:
    checks = Checks("4")
    with model("fig04") as path:
        more = text([*POINTS, (0.1, 0.1)], [*QUARTERS, 1])
        refused(checks, "with a fifth 1/4", "add up to +5/4 where chi = 1", field=more)
        study = solve(path, field=text(POINTS, QUARTERS))
    u = formula(POINTS, QUARTERS)
    rim = study.loops()[0]
    fine = np.interp(np.arange(20 * len(rim)) / 20, np.arange(len(rim) + 1), np.append(rim, rim[0]))
    checks.close("degree of u along the boundary", 1.0, winding(u, fine), 1e-9)
    check_sum(checks, study, 1)
    unaligned, aligned = study.parts(u), study.parts(study.power(aligned=True))
    four(checks, "parts of the unaligned field with four corners", unaligned, False)
    four(checks, "parts of the aligned field with four corners", aligned, True)
    check_mesh(checks, study)
    check_places(checks, study, POINTS)

    def draw():
        from drawing import parts_panel, scene

        return scene(study, parts_panel(unaligned, study, "unaligned"), parts_panel(aligned, study, "aligned"))

    checks.scenes["fig04"] = draw
    return checks


if __name__ == "__main__":
    main(run)
