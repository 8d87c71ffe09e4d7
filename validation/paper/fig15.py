"""Figures 15, 16: the frame of the vector heat method on a saddle and on a spherical cap, and a field that is given in it.

From the middle of a cap of the sphere the frame must be carried along great circles, whatever the method's time: the cap is
symmetric about its middle.  In the stereographic projection from there these directions are parallel, so the field with the
angles of formula (2) against the frame is formula (2) in the plane.
"""

import numpy as np
from separatrices import formula
from sphere import Chart, on_sphere
from study import Checks, check_faces, check_mesh, check_sum, four, main, model, refused, solve

import gmsh_crossquad as cq
from gmsh_crossquad.field.smooth import wrap
from gmsh_crossquad.source.heat_frame import HeatFrame

POINTS, QUARTERS = [(0.9, -0.7), (0.5, 0.9), (-1.1, 0.2), (-0.1, -0.2)], [1, 1, 1, 1]
CHART = Chart(np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0]))
FACTORS = (1.0, 0.4)


def angles(points):
    """Angles of the crosses against the frame."""
    return 0.25 * np.angle(formula(POINTS, QUARTERS)(CHART.flat(points)))


def off(field: cq.FaceField) -> np.ndarray:
    """Differences (e,) of the given field from formula (2)."""
    exact = angles(field.places)
    return np.abs(wrap(np.angle(CHART.arms(field.places, field.given)) - exact))


def oblique(field: cq.FaceField) -> np.ndarray:
    """Angles between the given crosses and the boundary, at its edges."""
    rim = field.surface.boundary_edge
    along = np.diff(field.points[field.edges[rim]], axis=1)[:, 0]
    arm = field.given[rim]
    return np.abs(wrap(np.arctan2(np.linalg.norm(np.cross(along, arm), axis=1), np.sum(along * arm, axis=1))))


def run() -> Checks:
    checks = Checks("15, 16")
    with model("fig15_sphere"):
        refused(checks, "the frame on a whole sphere", "zeros", field="heat-frame")
    with model("saddle") as path:
        saddle = solve(path, field="heat-frame")
    checks.equal("saddle: singular points inside, of the frame as it is", 0, len(saddle.result.singularities))
    check_mesh(checks, saddle, "saddle")
    check_faces(checks, saddle, [1], "saddle")
    errors = []
    for factor in FACTORS:
        with model("fig15_cap"):
            field = cq.cross_field(background=factor, field=HeatFrame(angles)).faces[0]
        errors.append(off(field))
        what = f"cap: greatest error of the frame, {len(field.triangles)} triangles (mean {errors[-1].mean():.1e})"
        checks.holds(what, "< 0.01", f"{errors[-1].max():.4f}", errors[-1].max() < 0.01)
    less = errors[1].mean() / errors[0].mean()
    checks.holds("cap: mean error of the finer over that of the coarser", "< 0.7", f"{less:.2f}", less < 0.7)
    with model("fig15_cap") as path:
        study = on_sphere(solve(path, field=HeatFrame(angles)), CHART)
    check_sum(checks, study, 1, "cap")
    given = np.degrees(oblique(study.face).max())
    checks.holds("cap: greatest angle of given crosses with the rim, in degrees", "> 5", f"{given:.1f}", given > 5)
    aligned = study.parts(study.power(aligned=True))
    four(checks, "cap: parts of the aligned field with four corners", aligned, True)
    check_mesh(checks, study, "cap")
    check_faces(checks, study, [1], "cap")

    def draw():
        from drawing import given_panel, parts_panel, scene

        return scene(study, given_panel(study), parts_panel(aligned, study, "aligned"))

    def draw_saddle():
        from drawing import given_panel, scene

        return scene(saddle, given_panel(saddle))

    checks.scenes["fig15"] = draw_saddle
    checks.scenes["fig16"] = draw
    return checks


if __name__ == "__main__":
    main(run)
