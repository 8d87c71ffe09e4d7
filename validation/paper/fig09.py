"""Figure 9: two boundary and two interior points of 1/4 (top), three and one (bottom)."""

from separatrices import formula
from study import Checks, check_boundary, check_mesh, check_places, check_sum, four, main, model, solve, text

TOP = [(0.35, 0.2), (-0.35, 0.2)]
BOTTOM = [(0.1, 0.1)]


def run() -> Checks:
    checks = Checks("9")
    for name, points in (("top", TOP), ("bottom", BOTTOM)):
        with model(f"fig09_{name}") as path:
            study = solve(path, field=text(points, [1] * len(points)))
        check_sum(checks, study, 1, name)
        unaligned = study.parts(formula(points, [1] * len(points)), 0.01)
        aligned = study.parts(study.power(aligned=True))
        if name == "top":
            four(checks, f"{name}: parts of the unaligned field with four corners", unaligned, False)
        four(checks, f"{name}: parts of the aligned field with four corners", aligned, True)
        check_mesh(checks, study, name)
        check_boundary(checks, study, name)
        check_places(checks, study, points, name)

        def draw(study=study, unaligned=unaligned, aligned=aligned):
            from drawing import parts_panel, scene

            return scene(study, parts_panel(unaligned, study, "unaligned"), parts_panel(aligned, study, "aligned"))

        checks.scenes[f"fig09_{name}"] = draw
    return checks


if __name__ == "__main__":
    main(run)
