"""The figures of the paper: every check of validation/paper must hold (no pictures are drawn)."""

import importlib
import sys
from pathlib import Path

import numpy as np
import pytest

FOLDER = Path(__file__).resolve().parent.parent / "validation" / "paper"
FIGURES = sorted(p.stem for p in FOLDER.glob("fig*.py"))


@pytest.fixture(scope="module", autouse=True)
def scripts():
    sys.path.insert(0, str(FOLDER))
    yield
    sys.path.remove(str(FOLDER))


def failed(checks):
    return [line for line in checks.lines if not line[3]]


def test_every_figure_is_here():
    plane = ["fig01", "fig03", "fig04", "fig07", "fig08", "fig09", "fig10", "fig12", "fig13", "fig14"]
    assert [*plane, "fig15", "fig17", "fig20"] == FIGURES
    assert {p.stem.split("_")[0] for p in FOLDER.glob("fig*.geo")} == set(FIGURES) - {"fig17"}  # its model is an example


@pytest.mark.parametrize("name", FIGURES)
def test_figure(name):
    if name == "fig15":
        pytest.importorskip("potpourri3d")
    some = {"fig20": [("bump", "sphere")]}  # the others are examples, which are meshed elsewhere
    checks = importlib.import_module(name).run(*some.get(name, []))
    assert len(checks.lines) >= 5
    assert not failed(checks)


def test_exact_disc():
    checks = importlib.import_module("disc").run((1.6, 0.8))
    assert len(checks.lines) == 3
    assert not failed(checks)


def test_stereographic_projection_keeps_angles():
    sphere = importlib.import_module("sphere")
    chart = sphere.Chart(np.array([0.0, 0.6, 0.8]), np.array([1.0, 0.0, 0.0]))
    z = np.array([0j, 1 + 0j, 0.3 - 1.7j, -2 + 1j])
    points = chart.lift(z)
    assert np.linalg.norm(points, axis=1) == pytest.approx(np.ones(4))
    assert points[0] == pytest.approx(chart.centre)
    assert chart.flat(points) == pytest.approx(z)
    along, across = (chart.directions(z, np.full(4, turn)) for turn in (1 + 0j, 1j))
    step = 1e-6
    assert (chart.lift(z + step) - points) / np.linalg.norm(chart.lift(z + step) - points, axis=1)[:, None] == pytest.approx(
        along, abs=1e-5
    )
    assert np.cross(along, across) == pytest.approx(points)  # a quarter turn, counter-clockwise from outside
    assert chart.arms(points, along + across) == pytest.approx(np.full(4, (1 + 1j) / np.sqrt(2)))


def square_parts(turn, sharp):
    """Parts of the unit square for one interior point of index +1/4 at (0.4, 0.45), all crosses turned by `turn`."""
    separatrices = importlib.import_module("separatrices")
    u = separatrices.formula([(0.4, 0.45)], [1])
    rim = np.array([0, 0.5, 1, 1 + 0.5j, 1 + 1j, 0.5 + 1j, 1j, 0.5j], complex)
    return separatrices.parts(lambda z: u(z) * np.exp(4j * turn), [rim], [0.4 + 0.45j], [0.01], sharp)


def test_corners_of_parts_are_counted():
    # rays at 0, 120 and 240 degrees; corners of the square count where they have one quad
    all_sharp = [0j, 1 + 0j, 1 + 1j, 1j]
    assert square_parts(0.0, []).corners == [3, 3, 3]
    assert square_parts(0.0, all_sharp).corners == [4, 4, 5]
    assert square_parts(0.0, all_sharp[1:]).corners == [4, 4, 4]


def test_crosses_turned_by_a_quarter_have_the_same_parts():
    plain, turned = square_parts(0.0, []), square_parts(np.pi / 2, [])
    for a, b in zip(plain.separatrices, turned.separatrices):
        assert a[-1] == pytest.approx(b[-1], abs=1e-9)


@pytest.mark.parametrize("quarters", [-4, -1, 1, 2, 3])
def test_number_of_rays(quarters):
    separatrices = importlib.import_module("separatrices")
    u = separatrices.formula([(0.0, 0.0), (3.0, 1.0)], [quarters, 1])
    rays = np.sort(separatrices.rays(u, 0j, 0.01))
    assert len(rays) == 4 - quarters
    gaps = np.diff(np.append(rays, rays[0] + 2 * np.pi))
    assert np.abs(gaps - 2 * np.pi / (4 - quarters)).max() < 0.02
    assert separatrices.winding(u, np.exp(2j * np.pi * np.arange(400) / 400)) == pytest.approx(quarters / 4)
