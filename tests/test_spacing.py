import models
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gmsh_crossquad.cad.spacing import GROWTH, curve_spacing, face_sizes
from gmsh_crossquad.options import MeshOptions

BUILDERS = {
    "square": models.square,
    "l_shape": models.l_shape,
    "disc": models.disc,
    "annulus": models.annulus,
    "plate": lambda: models.plate_with_holes([(0.5, 0.3, 0.2), (0.8, 0.8, 0.05)]),
    "thin gap": lambda: models.plate_with_holes([(0.5, 0.2002, 0.2)]),
    "crack": models.square_with_crack,
    "checkerboard": models.checkerboard,
    "tiny edge": lambda: models.polygon([(0, 0), (1, 0), (1, 0.5), (1.0, 0.50001), (1, 1), (0, 1)]),
    "needle": lambda: models.wedge(0.05),
}


def spacing(model, factor=1.0):
    return curve_spacing(model, MeshOptions(background=factor))


@pytest.mark.parametrize("name", BUILDERS)
def test_nodes_are_ordered_and_graded(name):
    model = BUILDERS[name]()
    sizes = face_sizes(model, MeshOptions())
    for curve, s in zip(model.curves, spacing(model), strict=True):
        step = np.diff(s)
        assert s[0] == 0.0 and s[-1] == curve.length
        assert (step > 0).all()
        assert step.max() <= 1.01 * sizes.max()
        assert len(step) >= (8 if curve.closed else 1)
        ratio = step[1:] / step[:-1]
        assert np.all(np.maximum(ratio, 1 / ratio) < 1.0 + 2.0 * GROWTH)


@pytest.mark.parametrize("name", ["disc", "annulus", "plate"])
def test_turning_per_segment_is_bounded(name):
    model = BUILDERS[name]()
    for curve, s in zip(model.curves, spacing(model), strict=True):
        if curve.closed:
            assert 360.0 / (len(s) - 1) < 24.0


@pytest.mark.parametrize("gap", [1e-1, 1e-2, 1e-3, 1e-4])
def test_a_gap_is_resolved_where_it_is_and_only_there(gap):
    model = models.plate_with_holes([(0.5, 0.2 + gap, 0.2)])
    nodes = spacing(model)
    bottom = nodes[0] * model.scale
    step, middle = np.diff(bottom), 0.5 * (bottom[1:] + bottom[:-1])
    near = np.abs(middle - 0.5) < 0.5 * gap + step
    assert step[near].min() < gap
    # away from it the spacing grows with the distance
    far = np.abs(middle - 0.5) > 0.3
    assert step[far].min() > 0.015
    assert sum(map(len, nodes)) < 1500


def test_neck_between_two_holes():
    model = models.plate_with_holes([(0.3, 0.5, 0.1995), (0.7, 0.5, 0.1995)])
    nodes = spacing(model)
    steps = [np.diff(nodes[c]).min() * model.scale for c in (4, 5)]
    assert max(steps) < 1e-3
    assert np.diff(nodes[0]).min() * model.scale > 1e-2


def test_nothing_outside_the_face_counts_as_a_gap():
    # a slit from outside, 1e-3 wide: its walls face each other through the outside
    slit = models.polygon([(0, 0), (1, 0), (1, 0.4995), (0.3, 0.4995), (0.3, 0.5005), (1, 0.5005), (1, 1), (0, 1)])
    nodes = spacing(slit)
    wall = np.diff(nodes[2]) * slit.scale
    assert np.median(wall) > 0.01


def test_reentrant_corner_and_crack_tip_are_finer():
    model = models.l_shape()
    nodes = spacing(model)
    step = np.diff(nodes[2])
    assert step[-1] < 0.75 * step.max()
    crack = models.square_with_crack()
    step = np.diff(spacing(crack)[4])
    assert step[0] < 0.75 * np.diff(spacing(crack)[0]).max()


def test_smooth_chain_of_short_lines_has_one_segment_each():
    assert all(len(s) == 2 for s in spacing(models.regular(720)))


@settings(deadline=None, max_examples=15)
@given(st.floats(0.0, 6.3), st.floats(1e-6, 1e6))
def test_motion_and_scale_do_not_matter(angle, size):
    plain = models.plate_with_holes([(0.5, 0.3, 0.25)])
    ring = np.array([(0, 0), (1, 0), (1, 1), (0, 1)]) * size
    scaled = models.plate_with_holes([(0.5 * size, 0.3 * size, 0.25 * size)], width=size, height=size)
    assert ring.max() == size
    for other in (models.moved(plain, angle), scaled):
        for a, b in zip(spacing(plain), spacing(other), strict=True):
            assert abs(len(a) - len(b)) <= 2


def test_many_faces_share_the_effort():
    few, many = models.checkerboard(1), models.checkerboard(12)
    few_nodes, many_nodes = (sum(len(s) - 1 for s in spacing(m)) for m in (few, many))
    assert many_nodes < 144 * 4 * 8
    assert few_nodes > 80


def test_number_of_nodes_is_bounded():
    walls = models.polygon([(0, 0), (1, 0), (1, 1e-4), (0, 1e-4)])
    assert sum(map(len, spacing(walls))) < 12_000
