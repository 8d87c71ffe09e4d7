import numpy as np
import pytest

from gmsh_crossquad.field.corners import boundary_indices, default_index

from .models import background, l_shape, square_with_crack


@pytest.mark.parametrize(
    ("degrees", "quads"),
    [(1, 1), (30, 1), (44, 1), (45, 1), (60, 1), (90, 1), (134, 1), (135, 2), (136, 2), (180, 2), (224, 2), (225, 3), (270, 3)]
    + [(314, 3), (315, 4), (360, 4)],
)
def test_number_of_quads(degrees, quads):
    assert default_index(np.array([np.radians(degrees)]))[0] == 2 - quads


@pytest.mark.parametrize("degrees", [135, 225, 315])
def test_half_way_cases_do_not_depend_on_rounding_errors(degrees):
    angle = np.radians(degrees) + np.linspace(-1e-9, 1e-9, 21)
    assert len(np.unique(default_index(angle))) == 1


def test_corners_of_an_l():
    mesh = background(l_shape(), 0.1)[0]
    index = boundary_indices(mesh)
    assert sorted(index[index != 0]) == [-1, 1, 1, 1, 1, 1]


def test_crack_tips_have_four_quads():
    mesh = background(square_with_crack(), 0.1)[0]
    index = boundary_indices(mesh)
    assert sorted(index[index != 0]) == [-2, -2, 1, 1, 1, 1]
