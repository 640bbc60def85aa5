"""How a problem is solved: `Ipopt` and its options, and the statuses a solve can end with."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum
from typing import Any

from multimodal_to.errors import InputError


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
    Status.STOPPED: "stopped on request; the last iterate is no answer",
    Status.INFEASIBLE: "the rows with the largest violation contradict each other; relax what they ask for",
    Status.FAILED: "the solver gave up; look at the largest violations and at the scenario's numbers",
}

_IPOPT_STATUS = {
    "Solve_Succeeded": Status.OPTIMAL,
    "Solved_To_Acceptable_Level": Status.ACCEPTABLE,
    "Feasible_Point_Found": Status.ACCEPTABLE,
    "Maximum_Iterations_Exceeded": Status.ITERATION_LIMIT,
    "Maximum_WallTime_Exceeded": Status.TIME_LIMIT,
    "Maximum_CpuTime_Exceeded": Status.TIME_LIMIT,
    "User_Requested_Stop": Status.STOPPED,
    "Infeasible_Problem_Detected": Status.INFEASIBLE,
}


_WARM_PUSH = 1e-8


@dataclass(frozen=True, kw_only=True)
class Ipopt:
    """IPOPT with MUMPS: a monotone barrier on exact derivatives.

    Raises:
        InputError: an option is out of its range.
    """

    tolerance: float = 1e-4  # on the scaled optimality conditions
    violation_tolerance: float = 1e-7  # on the rows, in solver units
    max_iterations: int = 1000
    time_limit: float = math.inf  # wall time [s]
    slack_cost: float = 7.5
    """What 1 N m of slack costs in the solver's eyes in the first solve of a schedule: the scale of the objective.

    With an objective that weighs more, the barrier gives way to it and feasibility takes hundreds of iterations.
    """
    barrier_start: float = 0.1
    barrier_restart: float = 1e-4  # where a solve that starts from the last one's answer begins

    def __post_init__(self) -> None:
        for name in self.__dataclass_fields__:
            if not getattr(self, name) > 0:
                raise InputError(f"{name} is {getattr(self, name)}; expected a positive number")

    def options(self, slack_weight: float, iterations: int, seconds: float, *, warm: bool) -> dict[str, Any]:
        """Return IPOPT's own options for a solve within a budget; a warm one starts from an answer."""
        options: dict[str, Any] = {
            "print_level": 0,
            "sb": "yes",
            "linear_solver": "mumps",
            "mumps_pivtol": 1e-8,
            "mu_strategy": "monotone",
            "mu_init": self.barrier_restart if warm else self.barrier_start,
            "tol": self.tolerance,
            "constr_viol_tol": self.violation_tolerance,
            "compl_inf_tol": 1.0,  # in units of the cost, whose size is a million
            "max_iter": iterations,
            "nlp_scaling_method": "none",  # rows and variables come with their scales
            "obj_scaling_factor": self.slack_cost / slack_weight,
            "honor_original_bounds": "yes",
        }
        if math.isfinite(seconds):
            options["max_wall_time"] = seconds
        if warm:  # an answer touches its bounds; don't push it away from them
            options |= dict.fromkeys(("bound_push", "bound_frac", "slack_bound_push", "slack_bound_frac"), _WARM_PUSH)
        return options

    @staticmethod
    def status(return_status: str) -> Status:
        """Return the status for what IPOPT says."""
        return _IPOPT_STATUS.get(return_status, Status.FAILED)
