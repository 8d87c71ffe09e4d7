"""The exact aligned field of the unit disc, and how fast formula (2), rotated by phi, comes to it on Gmsh's triangles:

    theta = sum d_k / 4 [arg(z - a_k) + arg(1 - conj(a_k) z)].

The error is taken a little away from the rim and from singular points.  The background's points on the rim are on the sampled
curve, within 1e-6 of the model's size of the circle: the directions of boundary edges are off by up to 1.2e-4, and not by less on
finer backgrounds.
"""

from itertools import pairwise

import numpy as np
from study import Checks, main, model, text

import gmsh_crossquad as cq
from gmsh_crossquad.field.smooth import wrap

POINTS, QUARTERS = [(0.5, 0.1), (-0.1, 0.55), (-0.5, -0.2), (0.15, -0.6), (-0.2, 0.1), (0.2, -0.15)], [1, 1, 1, 1, 1, -1]
FACTORS = (1.6, 0.8, 0.4)
#: radius around singular points, and of the disc: the error is taken outside and inside
CORE, INSIDE = 0.15, 0.95


def errors(factors=FACTORS) -> list[tuple[int, float, float, float]]:
    """(triangles, mean edge, greatest and mean error in radians) for factors on the background's edge length."""
    a = np.array([complex(*p) for p in POINTS])
    out = []
    for factor in factors:
        with model("disc"):
            field = cq.cross_field(background=factor, field=text(POINTS, QUARTERS)).faces[0]
        z = field.places[:, 0] + 1j * field.places[:, 1]
        exact = sum(d / 4 * (np.angle(z - p) + np.angle(1 - np.conj(p) * z)) for p, d in zip(a, QUARTERS))
        error = np.abs(wrap(np.angle(field.directions[:, 0] + 1j * field.directions[:, 1]) - exact))
        error = error[(np.abs(z[:, None] - a).min(axis=1) > CORE) & (np.abs(z) < INSIDE)]
        edge = np.linalg.norm(np.diff(field.points[field.edges], axis=1), axis=2).mean()
        out.append((len(field.triangles), float(edge), float(error.max()), float(error.mean())))
    return out


def run(factors=FACTORS) -> Checks:
    checks = Checks("exact disc")
    rows = errors(factors)
    for n, h, most, mean in rows:
        checks.holds(f"{n} triangles, mean edge {h:.4f}: greatest error (mean {mean:.1e})", "< h^2", f"{most:.2e}", most < h * h)
    for (_, h, e, m), (_, g, f, k) in pairwise(rows):
        order, mean = (float(np.log(p / q) / np.log(h / g)) for p, q in ((e, f), (m, k)))
        checks.holds(f"order from h = {h:.4f} to {g:.4f} (of the mean {mean:.2f})", "about 2", f"{order:.2f}", 1.7 < order < 2.5)
    return checks


if __name__ == "__main__":
    main(run)
