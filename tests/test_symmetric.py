"""Parts and shifts of sparse matrices, against SciPy's own slices and sums."""

import numpy as np
import pytest
import scipy.sparse as sp

from gmsh_crossquad.field.symmetric import part, shifted


@pytest.mark.parametrize("unit", [1.0, 1j])
def test_parts_and_shifts_are_those_of_scipy(unit):
    random = np.random.default_rng(0)
    half = sp.random(40, 40, 0.1, random_state=0) * (1.0 + unit)
    matrix = (half + half.conj().T + sp.diags(random.uniform(1, 2, 40))).tocsr()
    rows = np.flatnonzero(random.random(40) < 0.6)
    inner, wanted = part(matrix, rows), matrix[rows][:, rows]
    assert abs(inner - wanted).max() == 0.0
    shift = random.random(len(rows))
    assert abs(shifted(inner, shift, 0.3) - (sp.diags(shift) + 0.3 * wanted)).max() == 0.0
