"""`solve`: run a solver on a problem, and say by name what came out."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import casadi as cs
import numpy as np

from multimodal_to.adam.spatial import Array
from multimodal_to.errors import SolverError
from multimodal_to.ocp.problem import Problem
from multimodal_to.solving import machine
from multimodal_to.solving.best import FEASIBLE, Best, Checkpoint
from multimodal_to.solving.interrupts import Interrupts
from multimodal_to.solving.misses import Miss, misses
from multimodal_to.solving.motion import motion
from multimodal_to.solving.record import Kind, to_json
from multimodal_to.solving.solvers import Ipopt, Phase, Status
from multimodal_to.trajectory import Trajectory


@dataclass(frozen=True, kw_only=True)
class Iterate:
    """Where a solve stands."""

    iteration: int
    objective: float
    worst: str  # name of the rows or bounds with the largest violation
    violation: float  # in its own unit
    unit: str
    elapsed: float  # [s]


@dataclass(frozen=True, kw_only=True, eq=False)
class Solution:
    """What a solve ended with: its verdict by name, and the trajectory.

    Without an answer the trajectory is the best iterate: of those that are feasible within `best.FEASIBLE` the one with
    the lowest objective, and while none is, the one with the least violation.
    """

    status: Status
    solver_message: str
    trajectory: Trajectory
    objective: float
    costs: dict[str, float]  # by name; they add up to the objective
    violations: dict[str, float]  # largest by name, recomputed from the problem, in their own units
    units: dict[str, str] = field(repr=False)  # of the violations
    iterations: int
    iteration: int  # that the trajectory is from, as `progress` counts; a restoration shows some of IPOPT's twice
    feasible: bool
    misses: tuple[Miss, ...] = field(repr=False)  # families of rows and bounds that are not met, the worst first
    solve_time: float  # wall time in the solver [s]
    statistics: dict[str, Any] = field(repr=False)  # the solver's own, `compiled`, `threads` and `versions`

    @property
    def largest_violation(self) -> tuple[str, float, str]:
        """Return name, size and unit of the largest violation."""
        name = max(self.violations, key=self.violations.__getitem__)
        return name, self.violations[name], self.units[name]


Progress = Callable[[Iterate], bool]
"""Called at every iteration; a true answer stops the solve."""


def solve(
    problem: Problem,
    solver: Ipopt | None = None,
    progress: Progress | None = None,
    *,
    start: Trajectory | None = None,
    checkpoint: str | os.PathLike[str] | None = None,
) -> Solution:
    """Solve a problem from its start guess, or from a motion.

    A rough phase without the rows' curvature finds a motion that nearly meets the rows; from it the exact one finds
    the answer. Ctrl-C stops the solve as `progress` may, and what is returned is its best iterate.

    Args:
        problem: from `build`.
        solver: by default `Ipopt()`; its limits are for all solves together.
        progress: told of every iteration; it may stop the solve by returning True.
        start: the answer of a problem much like this one, with any number of knots, which needs no rough phase; or the
            checkpoint of an unfinished solve, to go on from the phase it was in.
        checkpoint: a trajectory file to keep the best iterate in while the solve runs; it stays there.

    Raises:
        InputError: the start is a motion of another robot.
        TrajectoryError: what the start says of how it was solved is no JSON object.
        SolverError: the solver could not be run, or its linear solver is not here.
    """
    solver = solver or Ipopt()
    started, iterations = time.perf_counter(), 0
    x = problem.guess if start is None else problem.start_from(start)
    phases = _phases(start)
    environment = _environment(problem, solver)
    best = Best(problem, None if checkpoint is None else Checkpoint(checkpoint, environment))
    if start is not None:
        best.seed(x, phases[0])
    status, message, statistics = Status.FAILED, "", dict[str, Any]()
    for phase in phases:
        seconds = max(solver.time_limit - (time.perf_counter() - started), 1e-3)
        left = max(solver.max_iterations - iterations, 1)
        options = solver.options(left, seconds, phase)
        watcher = _Watcher(problem, best, progress, started, iterations, phase)
        try:
            x, statistics = _run(problem, x, options, watcher, phase)
        except SolverError as error:
            if not best.seen:
                raise
            status, message = Status.FAILED, str(error)  # what was found is kept
            break
        iterations += int(statistics["iter_count"])
        message = str(statistics["return_status"])
        status = Ipopt.status(message)
        if status in (Status.TIME_LIMIT, Status.STOPPED) or iterations >= solver.max_iterations:
            break
    end = best.end(x, iterations, phase, answer=status.solved)
    if status.solved and end.violation > max(FEASIBLE, solver.violation_tolerance):  # whatever the solver says
        status, end = Status.FAILED, best.end(x, iterations, phase, answer=False)
    violations, costs = problem.largest_violations(end.x), problem.costs(end.x)
    facts: dict[str, Any] = {
        "iterations": iterations,
        "iteration": end.iteration,
        "feasible": end.feasible,
        "objective": sum(costs.values()),
        "costs": costs,
        "violations": violations,
        "solve_time": time.perf_counter() - started,
    }
    solve_json = to_json(
        kind=Kind.ANSWER,
        status=status.value,
        message=message,
        phase=end.phase.value,
        **facts,
        **environment,
    )
    return Solution(
        status=status,
        solver_message=message,
        trajectory=motion(problem, end.x, solve_json),
        **facts,
        misses=misses(problem, end.x, FEASIBLE),
        units={name: problem.unit(name) for name in violations},
        statistics=statistics | environment,
    )


def _environment(problem: Problem, solver: Ipopt) -> dict[str, Any]:
    """Return what the answer depends on beside what is asked."""
    options = solver.options(solver.max_iterations, solver.time_limit, Phase.EXACT)
    with machine.one_blas_thread():
        threads = machine.threads()
    return {
        "linear_solver": options["linear_solver"],
        "compiled": problem.nlp.compiled,
        "threads": threads,
        "versions": machine.versions(),
    }


def _phases(start: Trajectory | None) -> tuple[Phase, ...]:
    """Return the phases from a start: what no solve has made feasible goes on in the phase that it was in."""
    record = {} if start is None else start.solve_record()
    if start is None or (record.get("feasible") is False and record.get("phase") == Phase.ROUGH.value):
        return Phase.ROUGH, Phase.EXACT
    return (Phase.EXACT,) if record.get("feasible") is False else (Phase.WARM,)


@machine.one_blas_thread()
@machine.memory_kept()
def _run(
    problem: Problem, x: Array, ipopt_options: dict[str, Any], watcher: _Watcher, phase: Phase
) -> tuple[Array, dict[str, Any]]:
    """Run IPOPT once from x; return where it ended, answer or not, and its statistics."""
    opti = problem.opti.copy()  # goes with its solver and memory when this solve ends
    options: dict[str, Any] = {
        "print_time": False,
        "record_time": True,
        "detect_simple_bounds": True,
        "jac_g": problem.nlp.jacobian,
        "grad_f": problem.nlp.gradient,
        "hess_lag": problem.nlp.cost_hessian if phase is Phase.ROUGH else problem.nlp.hessian,
        "iteration_callback": watcher,
    }
    opti.solver("ipopt", options, ipopt_options)
    opti.set_initial(opti.x, x)
    failure: RuntimeError | None = None
    with watcher.interrupts:
        try:
            opti.solve_limited()
        except RuntimeError as error:  # how Opti says that there is no solution, and everything else
            failure = error
    if watcher.error is not None:
        raise watcher.error
    try:
        statistics = dict(opti.debug.stats())
    except RuntimeError:  # no solver has run
        raise SolverError(f"the solver did not run: {failure}") from failure
    _check_bounds(problem, statistics)
    if watcher.interrupts.asked:
        statistics["return_status"] = "User_Requested_Stop"  # also where a second Ctrl-C broke an evaluation off
    return np.array(opti.debug.value(opti.x)).ravel(), statistics


def _check_bounds(problem: Problem, statistics: dict[str, Any]) -> None:
    """Make sure that CasADi took the bounds, and nothing but the bounds, out of the rows.

    The derivative functions are those of the remaining rows; were others left, the solver would work on wrong ones.
    """
    found = np.array(statistics["detect_simple_bounds_is_simple"], dtype=bool)
    expected = np.arange(found.size) < problem.lower.size
    if not np.array_equal(found, expected):
        raise SolverError(f"CasADi took {found.sum()} rows for bounds, where {expected.sum()} are")


class _Watcher(cs.Callback):  # type: ignore[misc]
    """CasADi's iteration callback: shows every iterate to `best`, tells `progress`, and stops the solve when asked."""

    def __init__(
        self, problem: Problem, best: Best, progress: Progress | None, started: float, iteration: int, phase: Phase
    ) -> None:
        cs.Callback.__init__(self)
        self._problem, self._best, self._progress = problem, best, progress
        self._started, self._iteration, self._phase = started, iteration, phase
        self._rows_first: bool | None = None
        self.interrupts = Interrupts()
        self.error: Exception | None = None
        self.construct("watcher")

    def get_n_in(self) -> int:
        return int(cs.nlpsol_n_out())

    def get_n_out(self) -> int:
        return 1

    def get_name_in(self, index: int) -> str:
        return str(cs.nlpsol_out(index))

    def get_sparsity_in(self, index: int) -> cs.Sparsity:
        variables = self._problem.lower.size
        rows = variables + self._problem.row_lower.size  # Opti counts the bounds among them
        sizes = {"f": 1, "x": variables, "lam_x": variables, "g": rows, "lam_g": rows, "lam_p": 0}
        return cs.Sparsity.dense(sizes.get(cs.nlpsol_out(index), 0), 1)

    def eval(self, arguments: list[Any]) -> list[int]:
        try:
            return [int(self._watch(arguments) or self.interrupts.asked)]
        except KeyboardInterrupt:  # the second Ctrl-C
            return [1]
        except Exception as error:  # it is raised once the solver has returned
            self.error = error
            return [1]

    def _watch(self, arguments: list[Any]) -> bool:
        values = dict(zip((cs.nlpsol_out(index) for index in range(len(arguments))), arguments, strict=True))
        x, objective, iteration = values["x"].full().ravel(), float(values["f"]), self._iteration
        rows = self._rows(x, values["g"])
        self._iteration += 1
        self._best.show(x, rows, objective, iteration, self._phase)
        if self._progress is None:
            return False
        violations = self._problem.largest_violations(x, rows)
        worst = max(violations, key=violations.__getitem__)
        return bool(
            self._progress(
                Iterate(
                    iteration=iteration,
                    objective=objective,
                    worst=worst,
                    violation=violations[worst],
                    unit=self._problem.unit(worst),
                    elapsed=time.perf_counter() - self._started,
                )
            )
        )

    def _rows(self, x: Array, g: cs.DM) -> Array:
        """Return the rows at x, without evaluating them again where CasADi hands them over.

        With bounds taken out of g, it leaves the rows in the first places of g and nothing in the others. That is not
        documented, so it is looked at in the first iterate.
        """
        if self._rows_first is False:
            return self._problem.rows_at(x)
        first: Array = g[: self._problem.row_lower.size].full().ravel()
        if self._rows_first is None:
            self._rows_first = np.allclose(first, self._problem.rows_at(x), rtol=0.0, atol=1e-9)
        return first if self._rows_first else self._problem.rows_at(x)
