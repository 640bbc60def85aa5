"""`solve`: run a solver on a problem, and say by name what came out."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import casadi as cs
import numpy as np
from numpy.typing import NDArray

from multimodal_to import machine
from multimodal_to.errors import SolverError
from multimodal_to.models.terrain import SURFACES
from multimodal_to.ocp.problem import Problem
from multimodal_to.ocp.record import Kind
from multimodal_to.ocp.record import to_json as record_json
from multimodal_to.ocp.scenario import Scenario
from multimodal_to.ocp.scenario_data import to_json
from multimodal_to.ocp.solvers import Ipopt, Phase, Status
from multimodal_to.trajectory import Trajectory

Array = NDArray[np.float64]


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
    """What a solve ended with: its verdict by name, and the trajectory."""

    status: Status
    solver_message: str
    trajectory: Trajectory
    objective: float
    costs: dict[str, float]  # by name; they add up to the objective
    violations: dict[str, float]  # largest by name, recomputed from the problem, in their own units
    units: dict[str, str] = field(repr=False)  # of the violations
    iterations: int
    solve_time: float  # wall time in the solver [s]
    statistics: dict[str, Any] = field(repr=False)  # the solver's own, `threads` and `versions`

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
) -> Solution:
    """Solve a problem from its start guess, or from a motion.

    A rough phase without the rows' curvature finds a motion that nearly meets the rows; from it the exact one finds
    the answer.

    Args:
        problem: from `build`.
        solver: by default `Ipopt()`; its limits are for all solves together.
        progress: told of every iteration; it may stop the solve by returning True.
        start: the answer of a problem much like this one, with any number of knots; without a rough phase.

    Raises:
        InputError: the start is a motion of another robot.
        SolverError: the solver could not be run.
    """
    solver = solver or Ipopt()
    started, iterations = time.perf_counter(), 0
    x = problem.guess if start is None else problem.start_from(start)
    for phase in (Phase.ROUGH, Phase.EXACT) if start is None else (Phase.WARM,):
        seconds = max(solver.time_limit - (time.perf_counter() - started), 1e-3)
        left = max(solver.max_iterations - iterations, 1)
        options = solver.options(left, seconds, phase)
        watcher = None if progress is None else _Watcher(problem, progress, started, iterations)
        with machine.one_blas_thread():
            x, statistics = _run(problem, x, options, watcher, phase)
            statistics |= {"threads": machine.threads(), "versions": machine.versions()}
        iterations += int(statistics["iter_count"])
        message = str(statistics["return_status"])
        status = Ipopt.status(message)
        if status in (Status.TIME_LIMIT, Status.STOPPED) or iterations >= solver.max_iterations:
            break
    violations, costs = problem.largest_violations(x), problem.costs(x)
    objective, seconds = sum(costs.values()), time.perf_counter() - started
    solve_json = record_json(
        kind=Kind.ANSWER, status=status.value, message=message, iterations=iterations, solve_time=seconds,
        objective=objective, costs=costs, violations=violations, linear_solver=options["linear_solver"],
        versions=statistics["versions"], threads=statistics["threads"],
    )  # fmt: skip
    return Solution(
        status=status, solver_message=message, trajectory=_trajectory(problem, x, solve_json), objective=objective,
        costs=costs, violations=violations, units={name: problem.unit(name) for name in violations},
        iterations=iterations, solve_time=seconds, statistics=statistics,
    )  # fmt: skip


def _run(
    problem: Problem, x: Array, ipopt_options: dict[str, Any], watcher: _Watcher | None, phase: Phase
) -> tuple[Array, dict[str, Any]]:
    """Run IPOPT once from x; return where it ended, answer or not, and its statistics."""
    opti = problem.opti
    options: dict[str, Any] = {
        "print_time": False,
        "detect_simple_bounds": True,
        "jac_g": problem.nlp.jacobian,
        "grad_f": problem.nlp.gradient,
        "hess_lag": problem.nlp.cost_hessian if phase is Phase.ROUGH else problem.nlp.hessian,
    }
    if watcher is not None:
        options["iteration_callback"] = watcher
    opti.solver("ipopt", options, ipopt_options)
    opti.set_initial(opti.x, x)
    failure: RuntimeError | None = None
    try:
        opti.solve_limited()
    except RuntimeError as error:  # how Opti says that there is no solution, and everything else
        failure = error
    if watcher is not None and watcher.error is not None:
        raise watcher.error
    try:
        statistics = dict(opti.debug.stats())
    except RuntimeError:  # no solver has run
        raise SolverError(f"the solver did not run: {failure}") from failure
    _check_bounds(problem, statistics)
    return np.array(opti.debug.value(opti.x)).ravel(), statistics


def _check_bounds(problem: Problem, statistics: dict[str, Any]) -> None:
    """Make sure that CasADi took the bounds, and nothing but the bounds, out of the rows.

    The derivative functions are those of the remaining rows; were others left, the solver would work on wrong ones.
    """
    found = np.array(statistics["detect_simple_bounds_is_simple"], dtype=bool)
    expected = np.arange(found.size) < problem.lower.size
    if not np.array_equal(found, expected):
        raise SolverError(f"CasADi took {found.sum()} rows for bounds, where {expected.sum()} are")


def _trajectory(problem: Problem, x: Array, solve_json: str) -> Trajectory:
    """Return the trajectory of x: the variables in their own units, and the differences that are their rates."""
    own = x * problem.scale
    values = {name: np.array(value) for name, value in problem.layout.read_horizon(own).items()}
    dt, robot = float(own[-1]), problem.robot
    time_grid: Array = dt * np.arange(problem.scenario.knots + 1, dtype=np.float64)

    def rate(name: str) -> Array:
        difference: Array = np.diff(values[name], axis=1, prepend=values[name][:, :1]) / dt
        return difference

    return Trajectory(
        robot=robot.name, scenario=problem.scenario.name, scenario_json=_kept(problem.scenario), solve_json=solve_json,
        time=time_grid, joint_names=robot.joint_names, contact_names=robot.contact_names, jet_names=robot.jet_names,
        com_acceleration=rate("com_velocity"), angular_momentum_rate=rate("angular_momentum"),
        contact_force_rates=rate("contact_forces"), thrust_acceleration=rate("thrust_rate"), **values,
    )  # fmt: skip


def _kept(scenario: Scenario) -> str:
    """Return the scenario as text; a surface of the user's own class cannot be written, and nothing is kept."""
    return to_json(scenario) if type(scenario.surface) in SURFACES.values() else ""


class _Watcher(cs.Callback):  # type: ignore[misc]
    """CasADi's iteration callback: tells `progress` where the solve stands, and stops it when asked."""

    def __init__(self, problem: Problem, progress: Progress, started: float, iteration: int) -> None:
        cs.Callback.__init__(self)
        self._problem, self._progress, self._started, self._iteration = problem, progress, started, iteration
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
            return [int(bool(self._progress(self._iterate(arguments))))]
        except Exception as error:  # it is raised once the solver has returned
            self.error = error
            return [1]

    def _iterate(self, arguments: list[Any]) -> Iterate:
        values = dict(zip((cs.nlpsol_out(index) for index in range(len(arguments))), arguments, strict=True))
        x = np.array(values["x"]).ravel()
        violations = self._problem.largest_violations(x)
        worst = max(violations, key=violations.__getitem__)
        iterate = Iterate(
            iteration=self._iteration, objective=float(values["f"]), worst=worst, violation=violations[worst],
            unit=self._problem.unit(worst), elapsed=time.perf_counter() - self._started,
        )  # fmt: skip
        self._iteration += 1
        return iterate
