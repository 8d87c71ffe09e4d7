"""Figure 13: NACA 0012 in a box with two interior points of -1/4, behind the trailing edge and in front of the leading edge."""

from study import Checks, Study, check_boundary, check_mesh, check_places, check_sum, main, model, solve, text

PLACES = {"behind": [(1.35, 0.35), (1.35, -0.3)], "in_front": [(-0.3, 0.2), (-0.3, -0.2)]}


def signature(study: Study) -> list[list[tuple[int, int]]]:
    """The curves on the four sides of every block, in an order that does not depend on numbering."""
    layout = study.result.layout
    return sorted(sorted((k, layout.edges[e].curve or 0) for k, (e, _) in enumerate(b.sides)) for b in layout.blocks)


def run() -> Checks:
    checks = Checks("13")
    layouts = []
    for name, points in PLACES.items():
        with model("fig13") as path:
            study = solve(path, field=text(points, [-1, -1]))
        tail = [q for z, q in study.boundary_indices() if abs(z - 1) < 1e-9]
        checks.equal(f"{name}: index of the trailing edge in quarter turns", [-2], tail)
        check_sum(checks, study, 0, name)
        check_mesh(checks, study, name)
        check_boundary(checks, study, name)
        check_places(checks, study, points, name)
        layouts.append(signature(study))

        def draw(study=study):
            from drawing import scene

            return scene(study)

        checks.scenes[f"fig13_{name}"] = draw
    touching = [sum(any(c in (1, 2) for _, c in block) for block in blocks) for blocks in layouts]
    checks.holds("the layouts", "different", f"{touching[0]} and {touching[1]} blocks at the airfoil", layouts[0] != layouts[1])
    return checks


if __name__ == "__main__":
    main(run)
