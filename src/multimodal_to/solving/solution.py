"""`solve`: run a solver on a problem, and say by name what came out."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from multimodal_to.adam.spatial import Array
from multimodal_to.arguments import checked
from multimodal_to.errors import SolverError
from multimodal_to.native import instruction_set
from multimodal_to.ocp.problem import Problem
from multimodal_to.solving import machine
from multimodal_to.solving.best import Best, Checkpoint
from multimodal_to.solving.interrupts import Interrupts
from multimodal_to.solving.ipopt import Ipopt
from multimodal_to.solving.motion import motion
from multimodal_to.solving.record import Kind, to_json
from multimodal_to.solving.solver import FEASIBLE, Ending, Solver, StartPoint
from multimodal_to.solving.status import Status
from multimodal_to.solving.violations import Violation, unmet
from multimodal_to.trajectory import Trajectory
from multimodal_to.values import Value


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
class Solution(Value):
    """What a solve ended with: its verdict by name, and the trajectory.

    Without an answer the trajectory is the best iterate: of those that are feasible within `FEASIBLE` the one with
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
    unmet: tuple[Violation, ...] = field(repr=False)  # terms and bounds that are not met, the worst first
    solve_time: float  # wall time in the solver [s]
    statistics: dict[str, Any] = field(repr=False)  # the solver's own, and what the answer depends on

    @property
    def largest_violation(self) -> tuple[str, float, str]:
        """Return name, size and unit of the largest violation."""
        name = max(self.violations, key=self.violations.__getitem__)
        return name, self.violations[name], self.units[name]


Progress = Callable[[Iterate], bool]
"""Called at every iteration; a true answer stops the solve."""


@checked
def solve(
    problem: Problem,
    solver: Solver | None = None,
    progress: Progress | None = None,
    *,
    start: Trajectory | None = None,
    checkpoint: str | os.PathLike[str] | None = None,
) -> Solution:
    """Solve a problem from its start guess, or from a motion.

    Ctrl-C stops the solve as `progress` may, and what is returned is its best iterate.

    Args:
        problem: from `build`.
        solver: what minimises, by default `Ipopt()`; anything that keeps the protocol `Solver`.
        progress: told of every iteration; it may stop the solve by returning True.
        start: the answer of a problem much like this one, with any number of knots; or the checkpoint of an unfinished
            solve, to go on from.
        checkpoint: a trajectory file to keep the best iterate in while the solve runs; it stays there.

    Raises:
        InputError: the start is a motion of another robot.
        TrajectoryError: what the start says of how it was solved is no JSON object.
        SolverError: the solver could not be run, or its linear solver is not here.
    """
    point = StartPoint(x=problem.guess)
    if start is not None:
        point = StartPoint(x=problem.start_from(start), record=start.solve_record())
    return solve_from(problem, solver or Ipopt(), point, progress, checkpoint=checkpoint)


def solve_from(
    problem: Problem,
    solver: Solver,
    point: StartPoint,
    progress: Progress | None = None,
    *,
    checkpoint: str | os.PathLike[str] | None = None,
) -> Solution:
    """Solve a problem from values of its variables; `solve` says the rest.

    Args:
        problem: from `build`.
        solver: what minimises.
        point: where it starts.
        progress: told of every iteration; it may stop the solve by returning True.
        checkpoint: a trajectory file to keep the best iterate in while the solve runs.

    Raises:
        SolverError: the solver could not be run, or its linear solver is not here.
    """
    started = time.perf_counter()
    environment = _environment(problem, solver)
    best = Best(problem, None if checkpoint is None else Checkpoint(checkpoint, environment))
    if point.record is not None:
        best.seed(point.x, point.label)
    with Interrupts() as interrupts:
        watch = _Watch(problem, best, progress, started, interrupts)
        ending = _run(solver, problem, point, watch)
    environment |= ending.facts
    status = Status.STOPPED if interrupts.asked else ending.status
    end = best.end(ending.x, ending.iterations, ending.label, answer=status.solved)
    if status.solved and end.violation > max(FEASIBLE, ending.tolerance):  # whatever the solver says
        status, end = Status.FAILED, best.end(ending.x, ending.iterations, ending.label, answer=False)
    violations, costs = problem.largest_violations(end.x), problem.costs(end.x)
    facts: dict[str, Any] = {
        "iterations": ending.iterations,
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
        message=ending.message,
        **{"pass": end.label},
        **facts,
        **environment,
    )
    return Solution(
        status=status,
        solver_message=ending.message,
        trajectory=motion(problem, end.x, solve_json),
        **facts,
        unmet=unmet(problem, end.x, FEASIBLE),
        units={name: problem.unit_at(name, end.x) for name in violations},
        statistics={**ending.statistics, **environment},
    )


def _environment(problem: Problem, solver: Solver) -> dict[str, Any]:
    """Return what the answer depends on beside what is asked."""
    with machine.one_blas_thread():
        threads = machine.threads()
    return {
        "solver": type(solver).__name__,
        **solver.facts,
        "formulation": problem.formulation.described(),
        "native": instruction_set(),
        "taped": problem.taped,
        "threads": threads,
        "versions": machine.versions(),
    }


def _run(solver: Solver, problem: Problem, start: StartPoint, watch: _Watch) -> Ending:
    """Run a solver; where it breaks off after it has shown iterates, what was found is kept."""
    try:
        return solver.run(problem, start, watch)
    except SolverError as error:
        if not watch.seen:
            raise
        return Ending(
            x=watch.last, status=Status.FAILED, iterations=watch.iteration, message=str(error), label=watch.label
        )


class _Watch:
    """Shows every iterate to `best`, tells `progress`, and asks the solver to stop where either Ctrl-C or it does."""

    def __init__(
        self, problem: Problem, best: Best, progress: Progress | None, started: float, interrupts: Interrupts
    ) -> None:
        self._problem, self._best, self._progress = problem, best, progress
        self._started, self._interrupts = started, interrupts
        self.seen, self.last, self.iteration, self.label = 0, problem.guess, 0, ""

    def __call__(
        self,
        x: Array,
        *,
        iteration: int,
        rows: Array | None = None,
        objective: float | None = None,
        label: str = "",
    ) -> bool:
        rows = self._problem.rows_at(x) if rows is None else rows
        objective = float(self._problem.nlp.objective(x)) if objective is None else objective
        self.seen, self.last, self.iteration, self.label = self.seen + 1, x, iteration, label
        self._best.show(x, rows, objective, iteration, label)
        if self._progress is None:
            return self._interrupts.asked
        violations = self._problem.largest_violations(x, rows)
        worst = max(violations, key=violations.__getitem__)
        asked = self._progress(
            Iterate(
                iteration=iteration,
                objective=objective,
                worst=worst,
                violation=violations[worst],
                unit=self._problem.unit_at(worst, x, rows),
                elapsed=time.perf_counter() - self._started,
            )
        )
        return bool(asked) or self._interrupts.asked
