"""`Solver`: the protocol that `solve` asks of whatever minimises a problem; `Ipopt` keeps it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

from multimodal_to.adam.spatial import Array
from multimodal_to.ocp.problem import Problem
from multimodal_to.solving.stages import KeptStages
from multimodal_to.solving.status import Status
from multimodal_to.values import Value

FEASIBLE = 1e-5
"""Greatest violation of a feasible iterate, in solver units: 1e-5 m, rad, N m and so on, and 5e-4 N."""


@dataclass(frozen=True, kw_only=True, eq=False)
class StartPoint(Value):
    """Where a solver starts."""

    x: Array  # all variables, in solver units, within their bounds
    record: Mapping[str, Any] | None = None
    """How the motion behind x was solved, as its file says; None where x is the start guess."""
    kept: KeptStages | None = None
    """What `Ipopt` keeps of its linear solver from solve to solve; None where nothing is kept."""

    @property
    def label(self) -> str:
        """Return the label of the iterate that the file keeps, as in `Watch`; empty where there is none."""
        record = self.record or {}
        return str(record.get("pass", record.get("phase", "")))  # older files say phase


class Watch(Protocol):
    """What a solver calls with each iterate; a true answer asks it to stop."""

    def __call__(
        self,
        x: Array,
        *,
        iteration: int,
        rows: Array | None = None,
        objective: float | None = None,
        label: str = "",
    ) -> bool:
        """Take note of an iterate.

        Args:
            x: all variables, in solver units.
            iteration: its number, counted over the whole solve.
            rows: g(x) in solver units, where the solver has it at hand.
            objective: f(x), where the solver has it at hand.
            label: what the solver calls the part of its work that the iterate is of; a file keeps it, and a solve that
                goes on from that file finds it in `StartPoint.label`.
        """
        ...


@dataclass(frozen=True, kw_only=True, eq=False)
class Ending(Value):
    """What a solver ends with."""

    x: Array  # all variables, in solver units, answer or not
    status: Status  # in the solver's own opinion; `solve` looks at the violations itself
    iterations: int
    message: str = ""  # the solver's own words
    label: str = ""  # as in `Watch`
    tolerance: float = FEASIBLE  # greatest violation of an answer, in solver units
    statistics: Mapping[str, Any] = field(default_factory=dict)  # whatever the solver has to say of its work
    facts: Mapping[str, Any] = field(default_factory=dict)  # what a record says otherwise than `Solver.facts`


class Solver(Protocol):
    """What minimises `nlp.objective(x)` for `lower` ≤ x ≤ `upper` and `row_lower` ≤ `nlp.rows(x)` ≤ `row_upper`."""

    @property
    def facts(self) -> Mapping[str, Any]:
        """Return what a record says of the solver, by name: its options, versions of its libraries."""
        ...

    def run(self, problem: Problem, start: StartPoint, watch: Watch) -> Ending:
        """Minimise, and return where that ended.

        Args:
            problem: with its exact derivatives, in `problem.nlp`.
            start: where to start.
            watch: to be called with every iterate; the best one is kept and written to the checkpoint.

        Raises:
            SolverError: the solver could not be run.
        """
        ...
