"""The best iterate of a solve, kept while it runs, in memory and in a checkpoint file."""

from __future__ import annotations

import math
import os
import time
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from multimodal_to.adam.spatial import Array
from multimodal_to.errors import OutputError
from multimodal_to.ocp.problem import Problem
from multimodal_to.solving.motion import motion
from multimodal_to.solving.record import Kind, to_json
from multimodal_to.solving.solver import FEASIBLE

CHECKPOINT_EVERY = 5.0
"""Least time between two checkpoints [s], but for the first feasible iterate, which is written at once."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Candidate:
    """An iterate, with what makes it better or worse than another."""

    x: Array
    iteration: int
    label: str  # as in `Watch`
    objective: float
    violation: float  # the largest, in solver units

    @property
    def feasible(self) -> bool:
        """Return whether every row and bound holds within `FEASIBLE`."""
        return self.violation <= FEASIBLE

    @property
    def finite(self) -> bool:
        """Return whether rows, bounds and objective are numbers."""
        return math.isfinite(self.violation) and math.isfinite(self.objective)

    def better_than(self, other: Candidate) -> bool:
        """Return whether to keep this one: of feasible iterates the lowest objective, else the least violation."""
        if self.feasible and other.feasible:
            return self.objective < other.objective
        return self.violation < other.violation


class Best:
    """The best iterate of a solve so far; it is shown every one."""

    def __init__(self, problem: Problem, checkpoint: Checkpoint | None = None) -> None:
        self._problem, self._checkpoint = problem, checkpoint
        self._best: Candidate | None = None

    def seed(self, x: Array, label: str) -> None:
        """Keep what a solve starts from, so that it ends with nothing worse."""
        self._keep(self._evaluated(x, 0, label))

    def show(self, x: Array, rows: Array, objective: float, iteration: int, label: str) -> None:
        """Keep an iterate, with its rows g(x), if it is better than the one kept, and see to the checkpoint.

        Args:
            x: all variables, in solver units.
            rows: g(x), in solver units.
            objective: f(x).
            iteration: its number in the solve.
            label: as in `Watch`.
        """
        violation = self._problem.scaled_violation(x, rows)
        self._keep(Candidate(x=x, iteration=iteration, label=label, objective=objective, violation=violation))
        if self._checkpoint is not None and self._best is not None:
            self._checkpoint.update(self._problem, self._best, iteration)

    def end(self, x: Array, iteration: int, label: str, *, answer: bool) -> Candidate:
        """Return what a solve ends with: the solver's last x if that is an answer, else the best iterate.

        Args:
            x: the solver's last variables, in solver units.
            iteration: its number in the solve.
            label: as in `Watch`.
            answer: whether the solver calls it one.
        """
        last = self._evaluated(x, iteration, label)
        self._keep(last)
        return last if answer or self._best is None else self._best

    def _evaluated(self, x: Array, iteration: int, label: str) -> Candidate:
        violation = self._problem.scaled_violation(x, self._problem.rows_at(x))
        objective = sum(self._problem.costs(x).values())
        return Candidate(x=x, iteration=iteration, label=label, objective=objective, violation=violation)

    def _keep(self, new: Candidate) -> None:
        if new.finite and (self._best is None or new.better_than(self._best)):
            self._best = new


class Checkpoint:
    """A trajectory file of the best iterate so far, whole at any moment."""

    def __init__(self, path: str | os.PathLike[str], environment: Mapping[str, Any]) -> None:
        self._path, self._environment = Path(path), environment
        self._started = self._written_at = time.perf_counter()
        self._written: Candidate | None = None

    def update(self, problem: Problem, best: Candidate, iterations: int) -> None:
        """Write what is kept if it is new and time has passed, or if it is the first feasible one.

        A file that cannot be written is a warning, once: the solve is worth more than its checkpoint.

        Args:
            problem: that is solved.
            best: the best iterate so far.
            iterations: of the solve so far.
        """
        now, first_feasible = time.perf_counter(), best.feasible and not (self._written and self._written.feasible)
        if best is self._written or (now - self._written_at < CHECKPOINT_EVERY and not first_feasible):
            return
        try:
            motion(problem, best.x, self._record(problem, best, iterations)).save(self._path)
        except OutputError as error:
            if not math.isinf(self._written_at):
                warnings.warn(f"the solve goes on without a checkpoint: {error}", stacklevel=2)
            self._written_at = math.inf
            return
        self._written, self._written_at = best, time.perf_counter()

    def _record(self, problem: Problem, best: Candidate, iterations: int) -> str:
        return to_json(
            kind=Kind.CHECKPOINT,
            status="running",
            message="",
            iterations=iterations,
            solve_time=time.perf_counter() - self._started,
            objective=best.objective,
            costs=problem.costs(best.x),
            violations=problem.largest_violations(best.x),
            iteration=best.iteration,
            feasible=best.feasible,
            **{"pass": best.label},
            **self._environment,
        )
