"""Mixed-integer linear programs, by HiGHS (Huangfu, Hall, Math. Program. Comput. 10, 2018).

    min c.x,  lower <= A x <= upper,  0 <= x_j <= u_j,  x_j integer where told

The solver is the one of `scipy.optimize.milp`; called directly it is there in 0.01 s instead of 0.07 s.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..errors import LayoutError
from ..records import Bool, Float

if TYPE_CHECKING:
    import scipy.sparse as sp

__all__ = ["Solution", "solve"]


@dataclass(frozen=True)
class Solution:
    """Outcome of `solve`.

    Attributes
    ----------
    x : (n,) float64 or None
        None if nothing feasible was found.
    cost : float
    infeasible : bool
        True if there is no solution; False with `x` None: none was found within the limits.
    """

    x: Float | None
    cost: float
    infeasible: bool


def solve(
    cost: Float,
    matrix: sp.csr_array,
    lower: Float,
    upper: Float,
    most: Float,
    integer: Bool,
    *,
    gap: float = 1e-2,
    nodes: int = 20_000,
    seconds: float = 60.0,
) -> Solution:
    """Solve a program.

    Parameters
    ----------
    cost : (n,) float64
    matrix : (m, n) sparse
    lower, upper : (m,) float64
        Bounds of the rows; may be infinite.
    most : (n,) float64
        Upper bounds of the columns; may be infinite.
    integer : (n,) bool
    gap, nodes, seconds : float, int, float
        Relative gap at which to stop, and limits.

    Raises
    ------
    LayoutError
        HiGHS refuses the program.
    """
    import highspy
    from highspy._core import _Highs

    program = highspy.HighsLp()
    program.num_row_, program.num_col_ = matrix.shape
    program.col_cost_ = np.asarray(cost, float)
    program.col_lower_ = np.zeros(len(cost))
    program.col_upper_ = np.asarray(most, float)
    program.row_lower_ = np.asarray(lower, float)
    program.row_upper_ = np.asarray(upper, float)
    program.integrality_ = [highspy.HighsVarType.kInteger if i else highspy.HighsVarType.kContinuous for i in integer.tolist()]
    program.a_matrix_.format_ = highspy.MatrixFormat.kRowwise
    program.a_matrix_.num_row_, program.a_matrix_.num_col_ = matrix.shape
    program.a_matrix_.start_ = matrix.indptr.astype(np.int32)
    program.a_matrix_.index_ = matrix.indices.astype(np.int32)
    program.a_matrix_.value_ = matrix.data.astype(float)
    highs = _Highs()  # what `highspy.Highs` wraps; the wrapper prints a banner before it can be silenced
    options = {"output_flag": False, "threads": 1, "mip_rel_gap": gap, "mip_max_nodes": nodes, "time_limit": seconds}
    for name, value in options.items():
        highs.setOptionValue(name, value)
    if highs.passModel(program) == highspy.HighsStatus.kError or highs.run() == highspy.HighsStatus.kError:
        raise LayoutError("HiGHS does not take the integer program of the layout", remedy="report this model")
    if highs.getInfo().primal_solution_status != int(highspy.SolutionStatus.kSolutionStatusFeasible):
        return Solution(None, np.inf, highs.getModelStatus() == highspy.HighsModelStatus.kInfeasible)
    return Solution(np.array(highs.getSolution().col_value), float(highs.getInfo().objective_function_value), False)
