import sys

import numpy as np
import pytest

from gmsh_crossquad.errors import FieldError, InputError
from gmsh_crossquad.field.smooth import edge_angle, wrap
from gmsh_crossquad.source.function import Function, load_function

from .field_meshes import annulus, at, disc, grid, middles
from .source_frames import drift, frames_of, inner_indices


def error(mesh, field, angle):
    return np.abs(wrap(field.theta + edge_angle(mesh) - angle)).max()


def test_directions_and_angles():
    mesh = annulus()
    exact = np.angle(middles(mesh))
    for f in (
        lambda p: p,
        lambda p: p[:, :2],
        lambda p: (p[:, :2] * 7).tolist(),
        lambda p: np.arctan2(p[:, 1], p[:, 0]),
        lambda p: np.column_stack([-p[:, 1], p[:, 0], 5 + 0 * p[:, 0]]),
    ):
        field = Function(f).on(frames_of(mesh))
        assert error(mesh, field, exact) < 1e-12
        assert drift(mesh, field) < 1e-12


def test_places_are_in_the_users_coordinates():
    mesh = grid(4, 3)
    seen = []
    frames = frames_of(mesh, np.array([[0.0, 1, 0], [0, 0, 1.0]]), (1.0, 2.0, 3.0), 0.5)
    field = Function(lambda p: seen.append(p) or p * 0 + [0, 3, 4]).on(frames)
    assert np.allclose(
        seen[0], [1, 2, 3] + 0.5 * np.column_stack([0 * middles(mesh).real, middles(mesh).real, middles(mesh).imag])
    )
    assert error(mesh, field, np.arctan2(4, 3)) < 1e-12


def test_a_function_cannot_change_the_mesh():
    mesh = grid(4, 3)
    frames = frames_of(mesh)
    before = frames.places.copy()

    def f(p):
        p *= 0
        return p + 1

    Function(f).on(frames)
    assert np.array_equal(frames.places, before)


@pytest.mark.parametrize("d", [1, -1])
def test_singularities(d):
    mesh = disc(20, 60)
    a = complex(*mesh.points[at(mesh, 0.31, 0.2)])
    field = Function(lambda p: d / 4 * np.angle(p[:, 0] + 1j * p[:, 1] - a)).on(frames_of(mesh))
    triangles, vertices = inner_indices(mesh, field)
    assert not np.any(triangles)
    assert {int(v): int(vertices[v]) for v in np.flatnonzero(vertices)} == {at(mesh, a.real, a.imag): d}


@pytest.mark.parametrize("boundary", [True, False])
def test_a_single_place_without_direction_is_filled(boundary):
    mesh = disc(8, 24)
    e = np.flatnonzero(mesh.boundary_edge == boundary)[5]

    def f(p):
        out = np.tile([1.0, 0.3, 0.0], (len(p), 1))
        out[e] = 0
        return out

    assert error(mesh, Function(f).on(frames_of(mesh)), np.arctan(0.3)) < 1e-12


def test_a_field_that_is_zero_on_the_boundary_is_used():
    mesh = grid(8, 8)
    field = Function(lambda p: np.prod(np.sin(p[:, :2] * np.pi / 8), axis=1)[:, None] * [1.0, 0.2]).on(frames_of(mesh))
    assert error(mesh, field, np.arctan(0.2)) < 1e-12


def raising(p):
    raise ValueError("no\nfield  here")


REFUSALS = {
    "raises": (raising, "raised ValueError: no field here, surface 1: it gets points"),
    "None": (lambda p: None, r"no real numbers|shape \(\)"),
    "one value": (lambda p: [1.0, 0.0], r"shape \(2,\) for \d+ places"),
    "too few": (lambda p: p[1:], r"shape \(\d+, 3\) for \d+ places"),
    "four columns": (lambda p: np.ones((len(p), 4)), r"shape \(\d+, 4\)"),
    "ragged": (lambda p: [[1, 2, 3]] * (len(p) - 1) + [[1, 2]], "no real numbers"),
    "words": (lambda p: ["x"] * len(p), "no real numbers"),
    "complex": (lambda p: p[:, 0] + 1j, "no real numbers"),
    "NaN": (lambda p: np.where(p[:, :1] > 4, np.nan, p + 1), "gives .* values that are no finite numbers, first, surface 1 at"),
    "infinite angle": (lambda p: np.where(p[:, 0] > 4, np.inf, 1.0), "no finite numbers"),
    "zero": (lambda p: 0 * p, "undefined everywhere"),
    "normal": (lambda p: 0 * p + [0, 0, 1.0], "undefined everywhere"),
    "zero on a curve": (
        lambda p: np.where(np.abs(p[:, :1] - 4) < 0.6, 0.0, 1.0) * [1, 0, 0],
        "along a curve or in a region, surface 1",
    ),
    "zero in a region": (lambda p: np.where(p[:, :1] > 4, 0.0, 1.0) * [1, 0, 0], "along a curve or in a region"),
    "noise": (lambda p: np.random.default_rng(0).uniform(0, 7, len(p)), "within .* % of the background triangles"),
    "jump": (
        lambda p: np.where(p[:, 0] > 4.1, np.pi / 4 - 1e-3 * np.sin(9 * p[:, 1]), 0.0),
        "jumps by 45 degrees along a curve, surface 1 at",
    ),
}


@pytest.mark.parametrize("name", REFUSALS)
def test_bad_functions_are_refused(name):
    function, words = REFUSALS[name]
    with pytest.raises(FieldError, match=words) as caught:
        Function(function).on(frames_of(grid(16, 16)))
    assert "\n" not in str(caught.value)


def test_functions_by_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "my_cross_fields.py").write_text("number = 3\nclass A:\n    @staticmethod\n    def f(p):\n        return p\n")
    (tmp_path / "my_broken_module.py").write_text("1 / 0\n")
    (tmp_path / "my_needy_module.py").write_text("import there_is_no_such_module\n")
    before = list(sys.path)
    assert load_function("my_cross_fields:A.f")(5) == 5
    assert load_function("math:hypot")(3, 4) == 5
    for name, words in (
        ("my_missing_module:f", "there is no module 'my_missing_module'"),
        ("my_cross_fields.sub:f", "my_cross_fields"),
        ("my_cross_fields:g", "module 'my_cross_fields' has no function 'g'"),
        ("my_cross_fields:number", "'my_cross_fields:number' is no function"),
        ("my_broken_module:f", "cannot be imported: ZeroDivisionError: division by zero"),
        ("my_needy_module:f", "cannot be imported: ModuleNotFoundError: No module named 'there_is_no_such_module'"),
    ):
        with pytest.raises(InputError, match=words):
            load_function(name)
    assert sys.path == before
