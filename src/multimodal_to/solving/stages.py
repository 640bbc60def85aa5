"""The structured linear solver: what it is told of a problem, and how IPOPT comes to it."""

from __future__ import annotations

import ctypes
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multimodal_to import native
from multimodal_to.adam.spatial import Array
from multimodal_to.native.stage_solver import KktStructure, StageSolver
from multimodal_to.ocp.problem import Problem

OF_NO_KNOT = -1
"""What stands for the knot of a variable of the whole horizon, as Δt."""


def variable_knots(problem: Problem) -> NDArray[np.int32]:
    """Return the knot of each variable of a problem, and `OF_NO_KNOT` of Δt."""
    knots = np.repeat(np.arange(problem.scenario.knots + 1), problem.layout.size)
    return np.append(knots, OF_NO_KNOT).astype(np.int32)


def structure(knots: NDArray[np.int32], lower: Array, upper: Array, row_lower: Array, row_upper: Array) -> KktStructure:
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


class KeptStages:
    """The structured solver of a problem, kept from solve to solve for as long as its matrix has the same structure.

    What it found out about the matrix stays, and so does its memory.
    """

    def __init__(self) -> None:
        self._solver: StageSolver | None = None
        self._structure: KktStructure | None = None

    def of(self, library: ctypes.CDLL, structure: KktStructure) -> StageSolver:
        """Return the solver of a structure: the one that is there if it is of that structure, else a new one.

        A solver that refused a matrix is replaced as well.
        """
        known = self._solver
        if known is None or self._structure is None or known.refusal or not structure.equals(self._structure):
            self.close()
            self._solver, self._structure = StageSolver(library, structure), structure
        assert self._solver is not None
        return self._solver

    def close(self) -> None:
        """Give the memory back."""
        if self._solver is not None:
            self._solver.close()
        self._solver = self._structure = None


@contextmanager
def offered(
    options: Mapping[str, Any], structure: KktStructure, kept: KeptStages | None = None
) -> Iterator[StageSolver | None]:
    """Let the solve of IPOPT that begins in this thread use the structured solver, where its options ask for it.

    Args:
        options: of IPOPT.
        structure: of its KKT matrix.
        kept: where the solver of the solve before is, and where this one stays; else it goes when the solve ends.

    Yields:
        The solver, or None where the options ask for another one.
    """
    library = native.library()
    if library is None or options.get("hsllib") != library._name:
        yield None
        return
    if kept is not None:
        solver = kept.of(library, structure)
        with solver.announced():
            yield solver
        return
    with StageSolver(library, structure) as solver, solver.announced():
        yield solver


def failure(solver: StageSolver | None, status: str) -> str:
    """Return in one sentence why a solve has to be done again with another linear solver; nothing where it has not.

    Args:
        solver: that was offered.
        status: how the solve ended, in IPOPT's words.
    """
    if solver is None:
        return ""
    if not solver.refusal and status in _NOT_TAKEN and not solver.counts.factorisations:
        return f"IPOPT did not take the native library for an HSL one ({status})"
    return solver.refusal


_NOT_TAKEN = ("Dynamic_Library_Failure", "Invalid_Option", "Unrecoverable_Exception", "Internal_Error")
"""How IPOPT ends where it cannot load a linear solver."""
