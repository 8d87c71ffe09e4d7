"""Figure 12: two holes, and two interior points of index -1/2."""

from fig10 import check_defects
from separatrices import formula
from study import Checks, check_mesh, check_places, check_sum, four, main, model, solve, text

POINTS, QUARTERS = [(0.03, 0.55), (-0.02, -0.5)], [-2, -2]


def run() -> Checks:
    checks = Checks("12")
    with model("fig12") as path:
        study = solve(path, field=text(POINTS, QUARTERS))
    check_sum(checks, study, -1)
    check_defects(checks, study, POINTS, QUARTERS)
    unaligned, aligned = study.parts(formula(POINTS, QUARTERS), 0.01), study.parts(study.power(aligned=True))
    four(checks, "parts of the unaligned field with four corners", unaligned, False)
    four(checks, "parts of the aligned field with four corners", aligned, True)
    check_mesh(checks, study)
    check_places(checks, study, POINTS)

    def draw():
        from drawing import parts_panel, scene

        return scene(study, parts_panel(unaligned, study, "unaligned"), parts_panel(aligned, study, "aligned"))

    checks.scenes["fig12"] = draw
    return checks


if __name__ == "__main__":
    main(run)
