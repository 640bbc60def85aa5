"""How a problem is solved: `Ipopt` and its options, and the statuses a solve can end with."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum
from typing import Any

from multimodal_to.errors import InputError
from multimodal_to.solving import linear_solvers


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


_ROUGH_PUSH = 0.1
"""How far the start guess is moved inside its bounds, in solver units and as a share of their distance."""


_WARM_PUSH = 1e-6
"""The same for an answer to start from, which touches its bounds."""


_BARRIER_TOLERANCE = 50.0
"""How loosely a barrier problem is solved before the next: in multiples of its parameter; IPOPT's own is 10."""


class Phase(Enum):
    """What a run of the solver starts from, and with which Hessian."""

    ROUGH = "rough"
    """From a start guess, without the curvature of the rows."""
    EXACT = "exact"
    """From where the rough phase ended."""
    WARM = "warm"
    """From the answer of a problem much like this one, with little of the barrier left."""


@dataclass(frozen=True, kw_only=True)
class Ipopt:
    """IPOPT: a monotone barrier on exact derivatives, in two phases.

    The rough phase leaves the curvature of the rows out of the Hessian. What is left is convex, so that a step takes
    one factorisation and is long, and a start guess that meets hardly any row becomes a motion that nearly meets them.
    The exact phase goes on from there.

    Raises:
        InputError: an option is out of its range, or there is no linear solver of that name.
    """

    tolerance: float = 1e-4  # on the scaled optimality conditions
    violation_tolerance: float = 1e-7  # on the rows, in solver units
    max_iterations: int = 1000
    time_limit: float = math.inf  # wall time [s]
    rough_iterations: int = 20
    objective_scale: float = 1e-4
    """What the objective is multiplied by: it brings weights of 1e4 to 1e7, as the paper has them, near one.

    An objective that weighs more keeps the steps short until the rows are met; one that weighs less leaves the contacts
    where the start guess has them.
    """
    barrier_start: float = 0.1
    barrier_warm: float = 1e-3  # where a solve that starts from an answer begins
    linear_solver: str = linear_solvers.AUTO
    """What factorises, one of `linear_solvers.LINEAR_SOLVERS`: by default an HSL solver that works, or MUMPS."""
    hsl_library: str = ""  # file of the HSL library; empty: looked for

    def __post_init__(self) -> None:
        linear_solvers.check(self.linear_solver, self.hsl_library)
        for name in self.__dataclass_fields__:
            value = getattr(self, name)
            if not isinstance(value, str) and not value > 0:
                raise InputError(f"{name} is {value}; expected a positive number")

    def options(self, iterations: int, seconds: float, phase: Phase) -> dict[str, Any]:
        """Return IPOPT's own options for a phase within a budget.

        Raises:
            SolverError: the linear solver is not here, or does not work.
        """
        options: dict[str, Any] = {
            "print_level": 0,
            "sb": "yes",
            **linear_solvers.choose(self.linear_solver, self.hsl_library).options(),
            "fast_step_computation": "yes",
            "mu_strategy": "monotone",
            "barrier_tol_factor": _BARRIER_TOLERANCE,
            "mu_init": self.barrier_warm if phase is Phase.WARM else self.barrier_start,
            "tol": self.tolerance,
            "constr_viol_tol": self.violation_tolerance,
            "compl_inf_tol": 1.0,  # in units of the cost, whose size is a million
            "max_iter": min(iterations, self.rough_iterations) if phase is Phase.ROUGH else iterations,
            "nlp_scaling_method": "none",  # rows and variables come with their scales
            "obj_scaling_factor": self.objective_scale,
            "honor_original_bounds": "yes",
        }
        if math.isfinite(seconds):
            options["max_wall_time"] = seconds
        if phase is Phase.ROUGH:
            options |= dict.fromkeys(("bound_push", "bound_frac"), _ROUGH_PUSH)
        if phase is Phase.WARM:
            options |= dict.fromkeys(("bound_push", "bound_frac", "slack_bound_push", "slack_bound_frac"), _WARM_PUSH)
        return options

    @staticmethod
    def status(return_status: str) -> Status:
        """Return the status for what IPOPT says."""
        return _IPOPT_STATUS.get(return_status, Status.FAILED)
