"""Figures 3, 5, 6: two boundary points of index 1/4, so that the field of an eigenfunction must have degree 1/2."""

import numpy as np
from separatrices import winding
from study import Checks, check_boundary, check_mesh, check_sum, four, main, model, refused, solve


def run() -> Checks:
    checks = Checks("3, 5, 6")
    with model("fig03") as path:
        refused(checks, "first mode, one interior 1/4: sum 3/4", "add up to +3/4 where chi = 1", field="eigenmode:1")
        study = solve(path, field="eigenmode:2")
    u, v = study.power(aligned=False), study.power(aligned=True)
    rim = study.loops()[0]
    fine = np.interp(np.arange(20 * len(rim)) / 20, np.arange(len(rim) + 1), np.append(rim, rim[0]))
    middle = fine.mean()
    checks.close("degree of u along a curve inside, 1 - 2/4", 0.5, winding(u, middle + 0.85 * (fine - middle)), 1e-9)
    check_sum(checks, study, 1)
    unaligned, aligned = study.parts(u), study.parts(v)
    four(checks, "parts of the unaligned field with four corners", unaligned, False)
    four(checks, "parts of the aligned field with four corners", aligned, True)
    check_mesh(checks, study)
    check_boundary(checks, study)

    def draw():
        from drawing import parts_panel, scene

        return scene(study, parts_panel(unaligned, study, "unaligned"), parts_panel(aligned, study, "aligned"))

    checks.scenes["fig03"] = draw
    return checks


if __name__ == "__main__":
    main(run)
