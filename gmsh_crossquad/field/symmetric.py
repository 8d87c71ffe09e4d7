"""Parts and shifts of symmetric or Hermitian sparse matrices, on their arrays.

SciPy's own slices, sums and conversions take longer than the factorisation of the matrix where a face has some hundred triangles:
each checks and converts all its arguments.  What is computed here is the same to the last bit.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from ..records import Float, Int

__all__ = ["part", "shifted"]


def part(matrix: sp.csr_matrix, rows: Int) -> sp.csc_matrix:
    """The rows and columns `rows` (k,), increasing, of a matrix without double entries that is its own adjoint."""
    n = matrix.shape[0]
    number = np.full(n, -1, matrix.indices.dtype)
    number[rows] = np.arange(len(rows))
    row = np.repeat(number, np.diff(matrix.indptr))
    column = number[matrix.indices]
    kept = (row >= 0) & (column >= 0)
    start = np.zeros(len(rows) + 1, matrix.indices.dtype)
    np.cumsum(np.bincount(row[kept], minlength=len(rows)), out=start[1:])
    return sp.csc_matrix((matrix.data[kept].conj(), column[kept], start), (len(rows), len(rows)))


def shifted(matrix: sp.csc_matrix, shift: Float, scale: float = 1.0) -> sp.csc_matrix:
    """``diag(shift) + scale matrix`` for a matrix whose diagonal is stored."""
    data = scale * matrix.data
    column = np.repeat(np.arange(matrix.shape[1]), np.diff(matrix.indptr))
    diagonal = np.flatnonzero(matrix.indices == column)
    assert len(diagonal) == len(shift)
    data[diagonal] = shift + data[diagonal]
    return sp.csc_matrix((data, matrix.indices, matrix.indptr), matrix.shape)
