"""Figure 20: other curved geometries: saddle, bump on a plate, pipe elbow, half torus, sphere with a hole, B-spline blade."""

from typing import NamedTuple

from study import Checks, Study, check_faces, check_mesh, main, model, solve


class Shape(NamedTuple):
    """A file, and the Euler characteristics of its faces."""

    file: str
    euler: tuple[int, ...]


SHAPES = {
    "saddle": Shape("saddle", (1,)),
    "bump": Shape("fig20_bump", (1, 0)),
    "elbow": Shape("pipe_elbow", (0, 0, 0)),
    "half torus": Shape("half_torus", (0,)),
    "sphere": Shape("fig20_sphere", (1,)),
    "blade": Shape("blade", (1, 1)),
}


def run(names=tuple(SHAPES)) -> Checks:
    checks = Checks("20")
    studies: dict[str, Study] = {}
    for name in names:
        with model(SHAPES[name].file) as path:
            studies[name] = solve(path)
        check_mesh(checks, studies[name], name)
        check_faces(checks, studies[name], list(SHAPES[name].euler), name)
    for row, some in (("upper", list(studies)[:3]), ("lower", list(studies)[3:])):

        def draw(some=some):
            from drawing import gallery

            return gallery({name: studies[name] for name in some})

        checks.scenes[f"fig20_{row}"] = draw
    return checks


if __name__ == "__main__":
    main(run)
