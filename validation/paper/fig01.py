"""Figure 1: the smooth field on a domain with a curved boundary."""

from study import Checks, check_mesh, check_sum, main, model, solve


def run() -> Checks:
    checks = Checks("1")
    with model("fig01") as path:
        study = solve(path)
    check_sum(checks, study, 1)
    check_mesh(checks, study)

    def draw():
        from drawing import scene

        return scene(study)

    checks.scenes["fig01"] = draw
    return checks


if __name__ == "__main__":
    main(run)
