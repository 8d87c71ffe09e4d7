"""Figure 7: another pair of an unaligned and an aligned field: four corners, and 1/4 and -1/4 inside."""

from separatrices import formula
from study import Checks, check_boundary, check_mesh, check_places, check_sum, four, main, model, solve, text

POINTS, QUARTERS = [(0.3, 0.3), (-0.35, -0.2)], [1, -1]


def run() -> Checks:
    checks = Checks("7")
    with model("fig07") as path:
        study = solve(path, field=text(POINTS, QUARTERS))
    check_sum(checks, study, 1)
    unaligned, aligned = study.parts(formula(POINTS, QUARTERS), 0.01), study.parts(study.power(aligned=True))
    four(checks, "parts of the unaligned field with four corners", unaligned, False)
    four(checks, "parts of the aligned field with four corners", aligned, True)
    check_mesh(checks, study)
    check_boundary(checks, study)
    check_places(checks, study, POINTS)

    def draw():
        from drawing import parts_panel, scene

        return scene(study, parts_panel(unaligned, study, "unaligned"), parts_panel(aligned, study, "aligned"))

    checks.scenes["fig07"] = draw
    return checks


if __name__ == "__main__":
    main(run)
