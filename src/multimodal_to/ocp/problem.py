"""`Problem`: a scenario for a robot as an optimal control problem on CasADi's `Opti`, with a name for each part."""

from __future__ import annotations

from dataclasses import dataclass, field

import casadi as cs
import numpy as np
from numpy.typing import NDArray

from multimodal_to.adam.spatial import Array
from multimodal_to.arguments import checked
from multimodal_to.models.robot import Robot
from multimodal_to.models.state import State
from multimodal_to.ocp.formulation import Formulation
from multimodal_to.ocp.parameters import Parameters
from multimodal_to.ocp.transcription import Nlp
from multimodal_to.ocp.variables import Layout
from multimodal_to.scenarios.scenario import Scenario
from multimodal_to.trajectory import QUANTITIES, Trajectory, row_units
from multimodal_to.trajectory.resampling import regrid
from multimodal_to.trajectory.sameness import refuse_other_robot
from multimodal_to.values import Value


@dataclass(frozen=True, kw_only=True, eq=False)
class RowSet(Value):
    """The rows of one term on the whole horizon, as far as they are in g."""

    index: NDArray[np.int64]  # into g
    knots: NDArray[np.int64]  # that each is of; for rows over an interval its end
    components: NDArray[np.str_]  # which of the term's rows at a knot, as `l_sole_1 z`
    units: NDArray[np.str_]  # of each row
    scale: Array  # own unit per solver unit, of each row

    def joined(self, other: RowSet) -> RowSet:
        """Return these rows and others of the same name."""
        return RowSet(
            **{
                name: np.concatenate([getattr(self, name), getattr(other, name)])
                for name in ("index", "knots", "components", "units", "scale")
            }
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class BoundSet(RowSet):
    """The rows of one term on the whole horizon that are bounds of single variables; `index` is into x."""

    lower: Array  # of x, in solver units
    upper: Array

    def missed_at(self, x: Array) -> Array:
        """Return by how much each row is missed at x, in solver units."""
        return missed(x[self.index], self.lower, self.upper)


@dataclass(frozen=True, eq=False)
class EagerRows(Value):
    """The rows of a problem that are not lazy."""

    nlp: Nlp  # with these rows alone; its costs are those of the problem
    index: NDArray[np.int64]  # into g


@dataclass(frozen=True, kw_only=True, eq=False)
class Problem(Value):
    """A scenario for a robot as an `Opti` problem, with the names of its variables, rows and costs.

    x stacks the knots' variables, knot by knot, and Δt, all divided by their scales. Problems of the same robot,
    scenario and formulation are equal; another process, or a copy, builds it again from these.
    """

    robot: Robot
    scenario: Scenario
    formulation: Formulation
    layout: Layout
    opti: cs.Opti
    nlp: Nlp
    eager: EagerRows | None = None  # None: no row is lazy
    lower: Array  # of x
    upper: Array
    box_lower: Array  # of x, without the terms that are bounds
    box_upper: Array
    row_lower: Array  # of g
    row_upper: Array
    rows: dict[str, RowSet]
    bound_rows: dict[str, BoundSet]  # terms, or parts of them, that are bounds of variables
    cost_names: tuple[str, ...]  # in the order of nlp.costs; a name may occur more than once
    guess: Array  # of x
    parameters: Parameters = field(repr=False)  # what the terms have read
    initial: State | None = field(repr=False, default=None)  # that a motion with a given start starts in
    scale: Array = field(repr=False)  # of x

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Problem) and self._asked() == other._asked()

    def __hash__(self) -> int:
        return hash(self._asked())

    def _asked(self) -> tuple[Robot, Scenario, Formulation]:
        return self.robot, self.scenario, self.formulation

    @property
    def taped(self) -> bool:
        """Return whether all functions that were asked for so far are evaluated by tapes."""
        return self.nlp.taped and (self.eager is None or self.eager.nlp.taped)

    @checked
    def misses_lazy_rows(self, x: Array, within: float) -> bool:
        """Return whether a lazy row is missed at x.

        Args:
            x: all variables, in solver units.
            within: by more than this, in solver units; less than zero asks for a distance from the limits.
        """
        if self.eager is None:
            return False
        beyond = np.maximum(self.row_lower - (g := self.rows_at(x)), g - self.row_upper)
        beyond[self.eager.index] = -np.inf
        return bool((beyond > within).any())

    @checked
    def start_from(self, trajectory: Trajectory) -> Array:
        """Return x for a motion of the same robot: at equal shares of its duration, moved within the bounds.

        Raises:
            InputError: it is a motion of another robot, or of other contact points or jets.
        """
        refuse_other_robot(trajectory, self.robot, what="the motion to start from")
        knots = self.scenario.knots
        motion = regrid(trajectory, knots, self.formulation.rule.name)
        values = np.vstack([getattr(motion, name) for name in self.layout.rows])
        rho = self.layout.rows["base_quaternion_xyzw"]
        if values[rho, 0] @ (self.guess * self.scale)[rho] < 0.0:  # −ρ is the same attitude; the problem has one
            values[rho] *= -1.0
        x = np.append(values.ravel(order="F"), trajectory.duration / knots) / self.scale
        return np.clip(x, self.lower, self.upper)

    @checked
    def rows_at(self, x: Array) -> Array:
        """Return g(x), in solver units."""
        given, rows = np.ascontiguousarray(x, dtype=float), np.empty(self.row_lower.size)
        if rows.size:
            buffer, evaluate = self.nlp.rows.buffer()  # a call with arrays copies them number by number
            buffer.set_arg(0, given.data)
            buffer.set_res(0, rows.data)
            evaluate()
        return rows

    @checked
    def scaled_violation(self, x: Array, g: Array) -> float:
        """Return the largest violation of all rows g = g(x) and bounds, in solver units."""
        rows = missed(g, self.row_lower, self.row_upper).max(initial=0.0)
        return float(max(rows, missed(x, self.lower, self.upper).max(initial=0.0)))

    @checked
    def largest_violations(self, x: Array, g: Array | None = None) -> dict[str, float]:
        """Return by how much each set of rows, and each variable's bounds, are missed at x, in their own units.

        Args:
            x: all variables, in solver units.
            g: the rows at x where they are known already.
        """
        amounts = missed(self.rows_at(x) if g is None else g, self.row_lower, self.row_upper)
        report = {name: float((amounts[rows.index] * rows.scale).max()) for name, rows in self.rows.items()}
        for name, bounds in self.bound_rows.items():
            report[name] = max(report.get(name, 0.0), float((bounds.missed_at(x) * bounds.scale).max()))
        outside = missed(x, self.box_lower, self.box_upper) * self.scale
        for name, values in self.layout.read_horizon(outside).items():
            report[f"bounds of {name}"] = float(values.max(initial=0.0))
        report["bounds of interval"] = float(outside[-1])
        return report

    @checked
    def costs(self, x: Array) -> dict[str, float]:
        """Return each named cost's share of the objective at x, in the scenario's weights."""
        report = dict.fromkeys(self.cost_names, 0.0)
        for name, value in zip(self.cost_names, np.array(self.nlp.costs(x)).ravel(), strict=True):
            report[name] += float(value)
        return report

    @checked
    def unit_at(self, name: str, x: Array, g: Array | None = None) -> str:
        """Return the unit of a violation that `largest_violations` names: that of its worst row.

        Args:
            name: of a set of rows, or of the bounds of a variable.
            x: all variables, in solver units.
            g: the rows at x where they are known already.
        """
        if rows := self.rows.get(name):
            values = self.rows_at(x) if g is None else g
            amounts = missed(values[rows.index], self.row_lower[rows.index], self.row_upper[rows.index]) * rows.scale
            return str(rows.units[int(amounts.argmax())])
        if bounds := self.bound_rows.get(name):
            return str(bounds.units[int((bounds.missed_at(x) * bounds.scale).argmax())])
        variable = name.removeprefix("bounds of ")
        if not (units := self.variable_units(variable)):
            return self.unit(name)
        outside = missed(x, self.box_lower, self.box_upper) * self.scale
        return units[int(self.layout.read_horizon(outside)[variable].max(axis=1).argmax())]

    @checked
    def variable_units(self, variable: str) -> tuple[str, ...]:
        """Return the unit of each row of a variable at a knot; none for the interval."""
        return row_units(QUANTITIES[variable], self.robot) if variable in QUANTITIES else ()

    @checked
    def unit(self, name: str) -> str:
        """Return the unit of a violation that `largest_violations` names, or all of its rows' units."""
        if rows := self.rows.get(name) or self.bound_rows.get(name):
            return ", ".join(dict.fromkeys(rows.units.tolist()))
        variable = name.removeprefix("bounds of ")
        return ", ".join(dict.fromkeys(self.variable_units(variable))) or "s"


def missed(values: Array, lower: Array, upper: Array) -> Array:
    """Return by how much values are below or above their limits, else zero; what is not a number stays none.

    Args:
        values: of any shape.
        lower: of the same shape, or one that broadcasts to it.
        upper: likewise.
    """
    return np.maximum(np.maximum(lower - values, values - upper), 0.0)
