"""`Ipopt`: how a problem is solved by default."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from enum import Enum
from typing import Any

import casadi as cs
import numpy as np

from multimodal_to.adam.spatial import Array
from multimodal_to.arguments import check_fields
from multimodal_to.errors import InputError, SolverError
from multimodal_to.native.stage_solver import KktStructure
from multimodal_to.ocp.problem import EagerRows, Problem
from multimodal_to.ocp.transcription import Nlp
from multimodal_to.solving import linear_solvers, machine, stages
from multimodal_to.solving.solver import Ending, StartPoint, Watch
from multimodal_to.solving.status import Status

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


_NEAR = 0.1
"""How near to its limit a lazy row may be where a pass begins that leaves it out, in solver units."""


_BARRIER_TOLERANCE = 50.0
"""How loosely a barrier problem is solved before the next: in multiples of its parameter; IPOPT's own is 10."""


class Pass(Enum):
    """A run of IPOPT: what it starts from, and with which Hessian."""

    ROUGH = "rough"
    """From a start guess, without the curvature of the rows."""
    EXACT = "exact"
    """From where the rough pass ended."""
    WARM = "warm"
    """From the answer of a problem much like this one, with little of the barrier left."""


@dataclass(frozen=True, kw_only=True)
class Ipopt:
    """IPOPT: a monotone barrier on exact derivatives, in two passes.

    The rough pass leaves the curvature of the rows out of the Hessian. What is left is convex, so that a step takes
    one factorisation and is long, and a start guess that meets hardly any row becomes a motion that nearly meets them.
    The exact pass goes on from there.

    The rough pass has all rows. Where it ends far from the limits of all lazy rows, as an answer of before may be, the
    pass that follows leaves these out. Where its answer misses one, a further exact pass goes on with all rows.

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
    barrier_warm: float = 1e-4  # where a solve that starts from an answer begins
    linear_solver: str = linear_solvers.AUTO
    """What factorises, one of `linear_solvers.LINEAR_SOLVERS`: by default the native library's `"stages"`, or MUMPS."""
    hsl_library: str = ""  # file of the HSL library; empty: looked for

    def __post_init__(self) -> None:
        check_fields(self)
        linear_solvers.check(self.linear_solver, self.hsl_library)
        for name in self.__dataclass_fields__:
            value = getattr(self, name)
            if not isinstance(value, str) and not value > 0:
                raise InputError(f"{name} is {value}; expected a positive number")

    def options(self, iterations: int, seconds: float, which: Pass) -> dict[str, Any]:
        """Return IPOPT's own options for a pass within a budget.

        Args:
            iterations: the most that are left.
            seconds: the most that are left [s].
            which: the pass.

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
            "mu_init": self.barrier_warm if which is Pass.WARM else self.barrier_start,
            "tol": self.tolerance,
            "constr_viol_tol": self.violation_tolerance,
            "compl_inf_tol": 1.0,  # in units of the cost, whose size is a million
            "max_iter": min(iterations, self.rough_iterations) if which is Pass.ROUGH else iterations,
            "nlp_scaling_method": "none",  # rows and variables come with their scales
            "obj_scaling_factor": self.objective_scale,
            "honor_original_bounds": "yes",
        }
        if math.isfinite(seconds):
            options["max_wall_time"] = seconds
        if which is Pass.ROUGH:
            options |= dict.fromkeys(("bound_push", "bound_frac"), _ROUGH_PUSH)
        if which is Pass.WARM:
            options |= dict.fromkeys(("bound_push", "bound_frac", "slack_bound_push", "slack_bound_frac"), _WARM_PUSH)
        return options

    @staticmethod
    def status(return_status: str) -> Status:
        """Return the status for what IPOPT says."""
        return _IPOPT_STATUS.get(return_status, Status.FAILED)

    @property
    def facts(self) -> dict[str, Any]:
        """Return the linear solver that factorises.

        Raises:
            SolverError: the linear solver is not here, or does not work.
        """
        return {"linear_solver": linear_solvers.choose(self.linear_solver, self.hsl_library).name}

    def run(self, problem: Problem, start: StartPoint, watch: Watch) -> Ending:
        """Minimise in the passes that the start needs; limits are for all of them together.

        Args:
            problem: that is solved.
            start: where to start.
            watch: called with every iterate.

        Raises:
            SolverError: IPOPT could not be run, or its linear solver is not here.
        """
        started, iterations, x, solver = time.perf_counter(), 0, start.x, self
        facts: dict[str, Any] = {}
        passes, answered = list(_passes(start)), False
        while passes:
            which = passes[0]
            whole = which is Pass.ROUGH or answered or problem.misses_lazy_rows(x, -_NEAR)
            posed = _Posed.of(problem, None if whole else problem.eager)
            seconds = max(self.time_limit - (time.perf_counter() - started), 1e-3)
            options = solver.options(max(self.max_iterations - iterations, 1), seconds, which)
            with stages.offered(options, posed.structure, start.kept) as structured:
                with nullcontext() if structured else machine.memory_kept():
                    end, statistics = _run(posed, x, options, _Watcher(posed, watch, iterations, which))
                failure = stages.failure(structured, str(statistics["return_status"]))
            if failure:  # the same pass once more; how far this one got is not always known
                solver = replace(self, linear_solver=linear_solvers.MUMPS)
                facts = {"linear_solver": linear_solvers.MUMPS, "linear_solver_refused": failure}
                continue
            iterations += int(statistics["iter_count"])
            x = end
            passes.pop(0)
            message = str(statistics["return_status"])
            status = self.status(message)
            if status in (Status.TIME_LIMIT, Status.STOPPED) or iterations >= self.max_iterations:
                break
            if status.solved and not posed.whole and problem.misses_lazy_rows(x, self.violation_tolerance):
                answered = True
                passes.append(Pass.EXACT)
        return Ending(
            x=x,
            status=status,
            iterations=iterations,
            message=message,
            label=which.value,
            tolerance=self.violation_tolerance,
            statistics=statistics,
            facts=facts,
        )


def _passes(start: StartPoint) -> tuple[Pass, ...]:
    """Return the passes from a start: what no solve has made feasible goes on in the pass that it was in."""
    if start.record is None:
        return Pass.ROUGH, Pass.EXACT
    if start.record.get("feasible") is not False:
        return (Pass.WARM,)
    return (Pass.ROUGH, Pass.EXACT) if start.label == Pass.ROUGH.value else (Pass.EXACT,)


@dataclass(frozen=True, eq=False)
class _Posed:
    """What IPOPT is given of a problem: with all rows, or without the lazy ones."""

    costs: Nlp  # its costs
    rows: Nlp  # its rows, and the curvature of both
    lower: Array  # of x
    upper: Array
    row_lower: Array  # of its rows
    row_upper: Array
    structure: KktStructure
    whole: bool

    @classmethod
    def of(cls, problem: Problem, eager: EagerRows | None) -> _Posed:
        """Return it for a problem, with `eager` rows alone or with all rows."""
        rows, some = (problem.nlp, slice(None)) if eager is None else (eager.nlp, eager.index)
        bounds = problem.lower, problem.upper, problem.row_lower[some], problem.row_upper[some]
        structure = stages.structure(stages.variable_knots(problem), *bounds)
        return cls(problem.nlp, rows, *bounds, structure=structure, whole=eager is None)


@machine.one_blas_thread()
def _run(posed: _Posed, x: Array, ipopt_options: dict[str, Any], watcher: _Watcher) -> tuple[Array, dict[str, Any]]:
    """Run IPOPT once from x; return where it ended, answer or not, and its statistics."""
    costs, rows, symbol = posed.costs, posed.rows, cs.MX.sym("x", posed.lower.size)
    options: dict[str, Any] = {
        "print_time": False,
        "no_nlp_grad": True,  # for the multipliers of parameters, of which there are none
        "calc_lam_p": False,
        "record_time": True,
        "error_on_fail": False,
        "show_eval_warnings": False,  # IPOPT takes a shorter step where a row is no number
        "jac_g": rows.jacobian,
        "grad_f": costs.gradient,
        "hess_lag": costs.cost_hessian if watcher.which is Pass.ROUGH else rows.hessian,
        "iteration_callback": watcher,
        "ipopt": ipopt_options,
    }
    functions = {"x": symbol, "f": costs.objective(symbol), "g": rows.rows(symbol)}
    try:
        solver = cs.nlpsol("solver", "ipopt", functions, options)  # goes with its memory when this solve ends
        ended = solver(x0=x, lbx=posed.lower, ubx=posed.upper, lbg=posed.row_lower, ubg=posed.row_upper)
    except RuntimeError as error:
        raise watcher.error or SolverError(f"the solver did not run: {error}") from error
    if watcher.error is not None:
        raise watcher.error
    statistics = dict(solver.stats())
    if watcher.stopped:
        statistics["return_status"] = "User_Requested_Stop"  # also where a second Ctrl-C broke an evaluation off
    return np.array(ended["x"]).ravel(), statistics


_SHOWN = tuple(cs.nlpsol_out(index) for index in range(cs.nlpsol_n_out()))
"""What CasADi shows of an iterate, in its order."""


class _Watcher(cs.Callback):  # type: ignore[misc]
    """CasADi's iteration callback: shows every iterate to `watch`, and stops the pass when asked."""

    def __init__(self, posed: _Posed, watch: Watch, iteration: int, which: Pass) -> None:
        cs.Callback.__init__(self)
        self._posed, self._watch, self._iteration = posed, watch, iteration
        self.which, self.stopped = which, False
        self.error: Exception | None = None
        self.construct("watcher")

    def get_n_in(self) -> int:
        return int(cs.nlpsol_n_out())

    def get_n_out(self) -> int:
        return 1

    def get_name_in(self, index: int) -> str:
        return str(cs.nlpsol_out(index))

    def get_sparsity_in(self, index: int) -> cs.Sparsity:
        variables = self._posed.lower.size
        rows = self._posed.row_lower.size
        sizes = {"f": 1, "x": variables, "lam_x": variables, "g": rows, "lam_g": rows, "lam_p": 0}
        return cs.Sparsity.dense(sizes.get(cs.nlpsol_out(index), 0), 1)

    def has_eval_buffer(self) -> bool:
        return True

    def eval_buffer(self, arguments: Sequence[Any], results: Sequence[Any]) -> int:
        try:
            self.stopped = self._show(arguments)
        except KeyboardInterrupt:  # the second Ctrl-C
            self.stopped = True
        except Exception as error:  # it is raised once the solver has returned
            self.error, self.stopped = error, True
        np.frombuffer(results[0])[0] = float(self.stopped)
        return 0

    def _show(self, arguments: Sequence[Any]) -> bool:
        x, objective, rows = (np.array(np.frombuffer(arguments[_SHOWN.index(name)])) for name in ("x", "f", "g"))
        self._iteration += 1
        return self._watch(
            x,
            iteration=self._iteration - 1,
            rows=rows if self._posed.whole else None,
            objective=float(objective[0]),
            label=self.which.value,
        )
