"""What the structured linear solver is told of a problem: which variable is of which knot."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from multimodal_to.adam.spatial import Array
from multimodal_to.native.stage_solver import KktStructure
from multimodal_to.ocp.problem import Problem

OF_NO_KNOT = -1
"""What stands for the knot of a variable of the whole horizon, as Δt."""


def variable_knots(problem: Problem) -> NDArray[np.int32]:
    """Return the knot of each variable of a problem, and `OF_NO_KNOT` of Δt."""
    knots = np.repeat(np.arange(problem.scenario.knots + 1), problem.layout.size)
    return np.append(knots, OF_NO_KNOT).astype(np.int32)


def structure(
    knots: NDArray[np.int32], lower: Array, upper: Array, row_lower: Array, row_upper: Array
) -> KktStructure:
    """Return the structure of IPOPT's KKT matrix.

    IPOPT leaves out variables with equal bounds; rows with equal bounds are equations, all others have a slack.

    Args:
        knots: of each variable, `OF_NO_KNOT` for those of the whole horizon.
        lower: bounds of the variables.
        upper: likewise.
        row_lower: bounds of the rows.
        row_upper: likewise.
    """
    equalities = int((row_lower == row_upper).sum())
    return KktStructure(
        knots=int(knots.max(initial=0)) + 1,
        variable_knots=knots[lower < upper],
        inequalities=row_lower.size - equalities,
        equalities=equalities,
    )
