"""Fields that cannot be used: each gives one line that says why, or is mended as documented; never a wrong mesh."""

from pathlib import Path

import gmsh
import meshio
import numpy as np
import pytest

import gmsh_crossquad as cq
from gmsh_crossquad.source.samples import Samples

L = Path(__file__).resolve().parent.parent / "geo" / "l_shape.geo"


def turned(points, angle=0.2):
    """Crosses that are good on the L: all turned by one angle."""
    return np.tile([np.cos(angle), np.sin(angle), 0.0], (len(points), 1))


def changed(points, where, value):
    out = turned(points)
    out[where(points)] = value
    return out


def nearest(points, x, y):
    out = np.zeros(len(points), bool)
    out[np.argmin(np.hypot(points[:, 0] - x, points[:, 1] - y))] = True
    return out


def angles(function):
    return lambda p: function(p[:, 0], p[:, 1])


def fails(points):
    raise ZeroDivisionError("by zero")


FUNCTIONS = {
    "one NaN": (
        lambda p: changed(p, lambda q: nearest(q, 0.5, 0.5), np.nan),
        "1 values that are no finite numbers.*surface 1 at",
    ),
    "one infinity": (lambda p: changed(p, lambda q: nearest(q, 0.5, 0.5), np.inf), "1 values that are no finite numbers"),
    "NaN everywhere": (lambda p: p * np.nan, r"\d+ values that are no finite numbers"),
    "zero everywhere": (lambda p: 0 * p, "surface 1"),
    "zero along a curve": (lambda p: changed(p, lambda q: np.abs(q[:, 0] - 0.5) < 0.06, 0.0), "surface 1"),
    "normal to the face": (lambda p: np.tile([0.0, 0.0, 1.0], (len(p), 1)), "surface 1"),
    "four components": (lambda p: np.ones((len(p), 4)), r"values of shape \(\d+, 4\)"),
    "one value too few": (lambda p: turned(p)[1:], r"values of shape \(\d+, 3\) for \d+ places"),
    "a scalar": (lambda p: 1.0, r"values of shape \(\) for \d+ places"),
    "nothing": (lambda p: None, "the field"),
    "words": (lambda p: ["left"] * len(p), "no real numbers"),
    "complex numbers": (lambda p: np.ones(len(p)) * 1j, "no real numbers"),
    "ragged rows": (lambda p: [[1.0, 0.0]] * (len(p) - 1) + [[1.0]], "the field"),
    "an exception": (fails, "ZeroDivisionError.*by zero"),
    "noise": (lambda p: np.random.default_rng(1).uniform(0, np.pi / 2, len(p)), "surface 1"),
    "a jump along a curve": (angles(lambda x, y: np.where(x > 0.5, 0.0, np.pi / 4)), "surface 1"),
    "much too fast": (angles(lambda x, y: 300 * x), "surface 1"),
    "a wrong degree": (angles(lambda x, y: 0.25 * np.arctan2(y - 0.31, x - 0.33)), r"add up to \+5/4 where chi = 1 is needed"),
    "turns around a point outside": (angles(lambda x, y: np.arctan2(y + 0.4, x + 0.4)), None),
}

TEXTS = {
    "no form": ("harmonic", "the field 'harmonic' is none: write smooth"),
    "a singularity too many": ("singularities:(0.3,0.3):1", r"add up to \+5/4 where chi = 1 is needed.*add one interior -1/4"),
    "a singularity on the boundary": ("singularities:(0,0.3):1,(0.3,0.3):-1", "on the boundary.*boundary index"),
    "half a quarter": ("singularities:(0.3,0.3):0.5", "whole numbers"),
    "not closed": ("singularities:(0.3,0.3:1", "cannot be read"),
    "mode zero": ("eigenmode:0", "is none"),
    "a mode too high": ("eigenmode:100000", "too coarse for eigenmode 100000"),
    "no such view": ("view:77", "77"),
    "no such file": ("nowhere.vtu", "no such file 'nowhere.vtu'"),
    "no such module": ("nowhere_at_all:f", "nowhere_at_all"),
    "no such function": ("math:nowhere", "nowhere"),
    "no function": ("math:pi", "pi"),
    "no such surface": ("7=eigenmode:2", "surface 7, which is not meshed"),
    "a negative core": ("smooth:-0.1", "no positive number"),
}


def grid(low=-1.0, high=3.0, n=25):
    x, y = np.meshgrid(np.linspace(low, high, n), np.linspace(low, high, n))
    points = np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1)
    k = np.arange(n * n).reshape(n, n)
    return points, np.stack([k[:-1, :-1], k[:-1, 1:], k[1:, 1:], k[1:, :-1]], axis=-1).reshape(-1, 4)


def with_bad(value, rows=slice(300, 301)):
    points, cells = grid()
    values = turned(points)
    values[rows] = value
    return points, cells, values, "direction"


def half():
    points, cells = grid(-1.0, 0.5)
    return points, cells, turned(points), "direction"


def rough():
    points, cells = grid()
    return points, cells, np.random.default_rng(2).uniform(0, np.pi / 2, len(points)), "angle"


def isotropic():
    points, cells = grid()
    return points, cells, np.tile([1.0, 1.0, 1.0, 0.0, 0.0, 0.0], (len(points), 1)), "tensor"


def lopsided():
    points, cells = grid()
    return points, cells, np.tile([1.0, 2.0, 0, 0.0, 3.0, 0, 0, 0, 0], (len(points), 1)), "tensor"


SAMPLES = {
    "NaN": (lambda: with_bad(np.nan), "finite"),
    "infinity": (lambda: with_bad(np.inf), "finite"),
    "zero everywhere": (lambda: with_bad(0.0, slice(None)), "."),
    "zero on a strip": (lambda: with_bad(0.0, slice(200, 300)), "."),
    "normal": (lambda: with_bad([0.0, 0.0, 1.0], slice(None)), "."),
    "another domain": (lambda: (grid(10.0, 12.0)[0], *with_bad(1.0)[1:]), r"covers only 0(\.0)? %"),
    "half the domain": (half, r"covers only \d+(\.\d)? % of the background points, surface 1 at"),
    "noise": (rough, "coarse"),
    "isotropic": (isotropic, "."),
    "not symmetric": (lopsided, "symmetric"),
    "too few values": (lambda: (*grid(), turned(grid()[0])[:-3], "direction"), "shape"),
    "no cells": (lambda: (grid()[0], np.zeros((0, 3), int), turned(grid()[0]), "direction"), "."),
    "cells without points": (lambda: (grid()[0], grid()[1] + 300, turned(grid()[0]), "direction"), "."),
    "places that are no numbers": (lambda: (grid()[0] * np.nan, *with_bad(1.0)[1:]), "."),
    "another kind": (lambda: (*grid(), turned(grid()[0]), "spinor"), "kind"),
}


@pytest.fixture(autouse=True)
def session(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    gmsh.initialize(readConfigFiles=False)
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.open(str(L))
    yield
    gmsh.finalize()


def refused(message, **options):
    with pytest.raises(cq.CrossQuadError, match=message) as caught:
        cq.mesh(size=0.2, **options)
    line = str(caught.value)
    assert "\n" not in line and len(line) > 15
    assert caught.value.exit_status in (1, 2)
    assert len(gmsh.model.mesh.getNodes()[0]) == 0
    return line


def good(result):
    assert result.quality.conforming and result.quality.inverted == 0 and result.quality.quads > 10


def test_there_are_enough():
    assert len(FUNCTIONS) + len(TEXTS) + len(SAMPLES) + 5 >= 40


@pytest.mark.parametrize("name", FUNCTIONS)
def test_functions(name):
    function, message = FUNCTIONS[name]
    if message is None:
        good(cq.mesh(size=0.2, field=function))
    else:
        refused(message, field=function)


@pytest.mark.parametrize("name", TEXTS)
def test_texts(name):
    text, message = TEXTS[name]
    refused(message, field=text)


@pytest.mark.parametrize("name", SAMPLES)
def test_samples(name):
    make, message = SAMPLES[name]
    with pytest.raises(cq.CrossQuadError, match=message) as caught:
        cq.mesh(size=0.2, field=Samples(*make()))
    assert "\n" not in str(caught.value)
    assert len(gmsh.model.mesh.getNodes()[0]) == 0


def test_files(tmp_path):
    (tmp_path / "empty.vtu").write_text("")
    (tmp_path / "words.vtu").write_text("no mesh at all")
    meshio.Mesh([[0, 0, 0], [1, 0, 0]], [("line", [[0, 1]])], point_data={"v": np.ones((2, 3))}).write("lines.vtu")
    points, cells = grid()
    meshio.Mesh(points, [("quad", cells)]).write("bare.vtu")
    for name, message in (
        ("empty", "is empty"), ("words", "cannot be read"), ("lines", "no triangles or quadrangles"), ("bare", "no array"),
    ):  # fmt: skip
        with pytest.raises(cq.CrossQuadError, match=message) as caught:
            cq.mesh(size=0.2, field=f"{name}.vtu")
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "index, message",
    [
        ({1: "1/3"}, "quarter turns"),
        ({1: "1/2"}, "no room for a block, point 1"),
        ({1: float("nan")}, "quarter turns"),
        ({77: "1/4"}, "77"),
        ({(1, 9): "1/4"}, "9"),
    ],
)
def test_indices(index, message):
    refused(message, boundary_index=index)


def test_a_single_place_without_direction_is_filled():
    good(cq.mesh(size=0.2, field=lambda p: changed(p, lambda q: nearest(q, 0.5, 0.5), 0.0)))
