"""Figure 8: a disc with 1/4, 1/4, 1/4 on its rim and one 1/4 inside (top), with 1/4, 1/4, -1/4 and three (bottom)."""

from study import Checks, check_boundary, check_mesh, check_places, check_sum, main, model, solve, text

TOP = [(0.1, 0.05)]
BOTTOM = [(0.05, 0.35), (-0.45, -0.35), (0.3, -0.45)]


def run() -> Checks:
    checks = Checks("8")
    for name, points in (("top", TOP), ("bottom", BOTTOM)):
        with model(f"fig08_{name}") as path:
            study = solve(path, field=text(points, [1] * len(points)))
        check_sum(checks, study, 1, name)
        check_mesh(checks, study, name)
        check_boundary(checks, study, name)
        check_places(checks, study, points, name)

        def draw(study=study):
            from drawing import scene

            return scene(study)

        checks.scenes[f"fig08_{name}"] = draw
    return checks


if __name__ == "__main__":
    main(run)
