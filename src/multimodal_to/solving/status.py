"""`Status`: how a solve can end."""

from __future__ import annotations

from enum import Enum


class Status(Enum):
    """How a solve ended; `advice` says what to do about it."""

    OPTIMAL = "optimal"
    ACCEPTABLE = "acceptable"
    ITERATION_LIMIT = "iteration limit"
    TIME_LIMIT = "time limit"
    STOPPED = "stopped"
    INFEASIBLE = "infeasible"
    FAILED = "failed"

    @property
    def solved(self) -> bool:
        """Return whether the result is an answer and not only the last iterate."""
        return self in (Status.OPTIMAL, Status.ACCEPTABLE)

    @property
    def advice(self) -> str:
        """Return what to do next."""
        return _ADVICE[self]


_ADVICE = {
    Status.OPTIMAL: "nothing to do: the optimality conditions hold to the solver's tolerance",
    Status.ACCEPTABLE: "the constraints hold, optimality only loosely; look at the violations before use",
    Status.ITERATION_LIMIT: "allow more iterations, or check that the violations still fall",
    Status.TIME_LIMIT: "allow more time, or check that the violations still fall",
    Status.STOPPED: "stopped on request; what was found by then is no answer, but a solve can go on from it",
    Status.INFEASIBLE: "no motion near this one meets all rows, and the largest violation is seldom the cause; "
    "`solve --explain`, in Python `relax`, finds the rows that have to give way",
    Status.FAILED: "the solver gave up; look at the largest violations and at the scenario's numbers",
}
