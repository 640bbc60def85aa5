"""`build`: a robot, a scenario and a formulation become a `Problem` on CasADi's `Opti`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import casadi as cs
import numpy as np
from numpy.typing import NDArray

from multimodal_to.adam.spatial import Array
from multimodal_to.errors import FormulationError, ScenarioError, listed
from multimodal_to.models.robot import Posture, Robot
from multimodal_to.ocp import compiled
from multimodal_to.ocp.boundary import set_boundary
from multimodal_to.ocp.formulation import Formulation
from multimodal_to.ocp.guess import standing_posture, start_guess
from multimodal_to.ocp.parameters import Parameters
from multimodal_to.ocp.stages import Held, NamedStage, collect
from multimodal_to.ocp.transcription import Nlp, assemble
from multimodal_to.ocp.variables import Bounds, Layout, ranges
from multimodal_to.scenarios.scenario import Scenario, Start, Terminal
from multimodal_to.trajectory import QUANTITIES, Trajectory
from multimodal_to.trajectory.resampling import resample
from multimodal_to.trajectory.sameness import refuse_other_robot


@dataclass(frozen=True, kw_only=True, eq=False)
class RowSet:
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


@dataclass(frozen=True, kw_only=True, eq=False)
class Problem:
    """A scenario for a robot as an `Opti` problem, with the names of its variables, rows and costs.

    x stacks the knots' variables, knot by knot, and Δt, all divided by their scales.
    """

    robot: Robot
    scenario: Scenario
    formulation: Formulation
    layout: Layout
    opti: cs.Opti
    nlp: Nlp
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
    scale: Array = field(repr=False)  # of x

    def start_from(self, trajectory: Trajectory) -> Array:
        """Return x for a motion of the same robot: at equal shares of its duration, moved within the bounds.

        Raises:
            InputError: it is a motion of another robot, or of other contact points or jets.
        """
        refuse_other_robot(trajectory, self.robot, what="the motion to start from")
        knots = self.scenario.knots
        motion = resample(trajectory, np.linspace(trajectory.time[0], trajectory.time[-1], knots + 1))
        values = np.vstack([getattr(motion, name) for name in self.layout.rows])
        x = np.append(values.ravel(order="F"), trajectory.duration / knots) / self.scale
        return np.clip(x, self.lower, self.upper)

    def rows_at(self, x: Array) -> Array:
        """Return g(x), in solver units."""
        return np.array(self.nlp.rows(x)).ravel()

    def scaled_violation(self, x: Array, g: Array) -> float:
        """Return the largest violation of all rows g = g(x) and bounds, in solver units."""
        rows = missed(g, self.row_lower, self.row_upper).max(initial=0.0)
        return float(max(rows, missed(x, self.lower, self.upper).max(initial=0.0)))

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

    def costs(self, x: Array) -> dict[str, float]:
        """Return each named cost's share of the objective at x, in the scenario's weights."""
        report = dict.fromkeys(self.cost_names, 0.0)
        for name, value in zip(self.cost_names, np.array(self.nlp.costs(x)).ravel(), strict=True):
            report[name] += float(value)
        return report

    def unit(self, name: str) -> str:
        """Return the unit of a violation that `largest_violations` names."""
        if rows := self.rows.get(name) or self.bound_rows.get(name):
            return ", ".join(dict.fromkeys(rows.units.tolist()))
        variable = name.removeprefix("bounds of ")
        return QUANTITIES[variable].unit if variable in QUANTITIES else "s"


def build(robot: Robot, scenario: Scenario, formulation: Formulation | None = None) -> Problem:
    """Return the problem of a scenario for a robot; nothing is solved but the start posture.

    Args:
        robot: whose motion it is.
        scenario: the task.
        formulation: what the problem is made of; by default `Formulation.paper()`.

    Raises:
        ScenarioError: the scenario contradicts itself or does not fit the robot.
        FormulationError: a term does not return what it has to, or is not a number at the start guess.
    """
    formulation = formulation or Formulation.paper()
    robot, standing = prepared(robot, scenario)
    outline = formulate(robot, scenario, standing, formulation)
    layout = outline.layout
    nlp = assemble([named.stage for named in outline.stages], layout.size, scenario.knots)

    scale = np.append(np.tile(layout.scale, scenario.knots + 1), formulation.interval_scale)
    lower, upper, box_lower, box_upper = (
        np.append(np.concatenate([side[name] for name in layout.rows]).ravel(order="F"), limit) / scale
        for bounds in (outline.bounds, outline.box)
        for side, limit in ((bounds.lower, scenario.interval_min), (bounds.upper, scenario.interval_max))
    )
    row_lower, row_upper, rows = _row_bounds(outline.stages)
    middle = 0.5 * (scenario.interval_min + scenario.interval_max)
    guess = np.append(start_guess(robot, scenario, standing, layout).ravel(order="F"), middle) / scale
    problem = Problem(
        robot=robot,
        scenario=scenario,
        formulation=formulation,
        layout=layout,
        opti=_opti(nlp, lower, upper, row_lower, row_upper),
        nlp=nlp,
        lower=lower,
        upper=upper,
        box_lower=box_lower,
        box_upper=box_upper,
        row_lower=row_lower,
        row_upper=row_upper,
        rows=rows,
        bound_rows=_bound_sets(outline.held, layout),
        cost_names=tuple(name for named in outline.stages for name in named.cost_names),
        guess=np.clip(guess, lower, upper),
        scale=scale,
    )
    _refuse_no_numbers(problem, outline.stages)
    return problem


def precompile(robot: Robot, scenario: Scenario, formulation: Formulation | None = None) -> tuple[Path, ...]:
    """Compile the derivatives of a scenario's problem, for every later `build` of one like it; return their files.

    Takes a C compiler some ten seconds; an iteration of the solver then takes a seventh less. Alike are problems with
    the same robot, ground, weights and terms, whatever their targets and numbers of knots.

    Args:
        robot: whose motion it is.
        scenario: the task.
        formulation: what the problem is made of; by default `Formulation.paper()`.

    Raises:
        ScenarioError: the scenario contradicts itself or does not fit the robot.
        FormulationError: a term does not return what it has to.
        SolverError: there is no C compiler, or it refuses.
        OutputError: the folder of compiled derivatives cannot be written to.
    """
    robot, standing = prepared(robot, scenario)
    outline = formulate(robot, scenario, standing, formulation or Formulation.paper())
    repeated = [named.stage for named in outline.stages if named.stage.repeats > 1]
    return compiled.compile_functions(function for stage in repeated for function in stage.derivatives())


@dataclass(frozen=True, kw_only=True, eq=False)
class Outline:
    """A problem before anything is derived: variables with their bounds, and rows and costs by stage."""

    layout: Layout
    bounds: Bounds
    box: Bounds  # without the terms that are bounds
    stages: list[NamedStage]
    held: list[Held]  # the rows that are bounds

    def terms_that_hold(self, variable: str, row: int, knot: int) -> tuple[str, ...]:
        """Return the names of the terms that are bounds of one row of a variable at a knot.

        Args:
            variable: name of the variable.
            row: which of its rows.
            knot: which knot.
        """
        return tuple(
            some.term for some in self.held if (some.variable, some.row) == (variable, row) and knot in some.knots
        )


def formulate(robot: Robot, scenario: Scenario, standing: Posture, formulation: Formulation) -> Outline:
    """Return the outline of a problem.

    Args:
        robot: with the jets that the scenario uses.
        scenario: the task.
        standing: posture in which the motion starts or, if it starts in the air, that it is pulled to.
        formulation: what the problem is made of.

    Raises:
        ScenarioError: what the start or the end holds is outside its range.
        FormulationError: a term does not return what it has to, or contradicts the start or the end.
    """
    layout = Layout.of(robot, formulation.variables)
    box = ranges(robot, scenario, layout)
    bounds = box.copy()
    stages, held = collect(formulation, Parameters.of(robot, scenario, standing), layout, bounds)
    set_boundary(box, robot, scenario, standing)
    try:
        set_boundary(bounds, robot, scenario, standing)
    except ScenarioError as error:  # without the terms it fits, as the line before has shown
        terms = dict.fromkeys(some.term for some in held if str(error).startswith(f"{some.variable}[{some.row}]"))
        raise FormulationError(f"the term '{listed(terms)}' contradicts the start or the end: {error}") from error
    return Outline(layout=layout, bounds=bounds, box=box, stages=stages, held=held)


def missed(values: Array, lower: Array, upper: Array) -> Array:
    """Return by how much values are below or above their limits, else zero; what is not a number stays none.

    Args:
        values: of any shape.
        lower: of the same shape, or one that broadcasts to it.
        upper: likewise.
    """
    return np.maximum(np.maximum(lower - values, values - upper), 0.0)


def prepared(robot: Robot, scenario: Scenario) -> tuple[Robot, Posture]:
    """Return the robot with the jets that a scenario uses, and the posture in which it stands.

    Raises:
        ScenarioError: the scenario does not fit the robot.
    """
    if not scenario.jets:
        robot = robot.with_jets(())
    if not robot.contacts:
        raise ScenarioError(f"{robot.name} has no contact points to stand on")
    for group in scenario.weights.joint_velocities:
        robot.group_indices(group)
    return robot, _standing(robot, scenario)


def _standing(robot: Robot, scenario: Scenario) -> Posture:
    """Return the posture in which the robot stands where the motion starts or, if in the air, where it ends."""
    if scenario.start is Start.STANDING:
        return standing_posture(robot, scenario.surface, scenario.initial_com)
    if scenario.terminal is Terminal.STANDING:
        return standing_posture(robot, scenario.surface, scenario.final_com)
    return robot.home


def _row_bounds(stages: Sequence[NamedStage]) -> tuple[Array, Array, dict[str, RowSet]]:
    """Return the bounds of g in solver units, and where each name's rows are."""
    low, high, sets, first = list[Array](), list[Array](), dict[str, RowSet](), 0
    for named in stages:
        height, repeats = named.stage.rows.shape[0], named.stage.repeats
        lower, upper, offset = np.zeros(height), np.zeros(height), 0
        for name, rows in named.rows:
            count = rows.expression.shape[0]
            here = slice(offset, offset + count)
            lower[here], upper[here] = rows.lower / rows.scale, rows.upper / rows.scale
            here_too = RowSet(
                index=(first + np.arange(offset, offset + count)[:, None] + height * np.arange(repeats)).ravel(),
                knots=np.tile(named.knots, count),
                components=np.repeat(np.array(rows.components, dtype=np.str_), repeats),
                units=np.repeat(np.array(rows.units, dtype=np.str_), repeats),
                scale=np.full(count * repeats, rows.scale),
            )
            sets[name] = sets[name].joined(here_too) if name in sets else here_too
            offset += count
        low.append(np.tile(lower, repeats))
        high.append(np.tile(upper, repeats))
        first += height * repeats
    return np.concatenate(low), np.concatenate(high), sets


def _bound_sets(held: Sequence[Held], layout: Layout) -> dict[str, BoundSet]:
    """Return where each name's rows are among the bounds of x."""
    sets = {}
    for name in dict.fromkeys(some.term for some in held):
        mine = [some for some in held if some.term == name]
        counts = [some.knots.size for some in mine]
        sets[name] = BoundSet(
            index=np.concatenate(
                [layout.rows[some.variable].start + some.row + layout.size * some.knots for some in mine]
            ),
            knots=np.concatenate([some.knots for some in mine]),
            components=np.repeat(np.array([some.component for some in mine], dtype=np.str_), counts),
            units=np.repeat(np.array([some.unit for some in mine], dtype=np.str_), counts),
            scale=np.repeat([some.slope for some in mine], counts),
            lower=np.repeat([some.lower for some in mine], counts),
            upper=np.repeat([some.upper for some in mine], counts),
        )
    return sets


def _refuse_no_numbers(problem: Problem, stages: Sequence[NamedStage]) -> None:
    """Make sure that every term and its derivatives are numbers at the start guess.

    Raises:
        FormulationError: one is not.
    """
    guess, empty = problem.guess, np.zeros(0)
    values, jacobian = problem.nlp.jacobian(guess, empty)
    slopes = np.zeros(problem.row_lower.size)
    np.add.at(slopes, np.array(jacobian.sparsity().get_triplet()[0], dtype=np.int64), np.array(jacobian.nonzeros()))
    for what, numbers in (("value", np.array(values).ravel()), ("derivative", slopes)):
        for name, rows in problem.rows.items():
            if (bad := np.flatnonzero(~np.isfinite(numbers[rows.index]))).size:
                where = f"knot {rows.knots[bad[0]]}" + " ".join(("", str(rows.components[bad[0]]))).rstrip()
                raise FormulationError(
                    f"the term '{name}': its {what} at the start guess is no finite number, at {where}; expected a "
                    "function that is smooth there"
                )
    for name, value in problem.costs(guess).items():
        if not np.isfinite(value):
            raise FormulationError(
                f"the term '{name}': its value at the start guess is no finite number; expected a function that is "
                "smooth there"
            )
    if not np.isfinite(np.array(problem.nlp.gradient(guess, empty)[1])).all():
        names = [name for named in stages for name in _steep_costs(problem, named)]
        raise FormulationError(
            f"the term '{listed(names)}': its derivative at the start guess is no finite number; expected a function "
            "that is smooth there"
        )


def _steep_costs(problem: Problem, named: NamedStage) -> list[str]:
    """Return the costs of a stage that have no finite gradient at the start guess."""
    stage, x = named.stage, problem.guess
    columns = x[stage.positions(problem.layout.size, x.size - 1)]
    size = problem.layout.size
    steep = []
    for index, name in enumerate(named.cost_names):
        function = stage.cost_gradient(index).map(stage.repeats)
        gradient = function(columns[:size], columns[size : 2 * size], columns[2 * size :])
        if not np.isfinite(np.array(gradient)).all():
            steep.append(name)
    return steep


def _opti(nlp: Nlp, lower: Array, upper: Array, row_lower: Array, row_upper: Array) -> cs.Opti:
    """Return the `Opti` problem; bounds come first, so that they can be told from the rows."""
    opti = cs.Opti()
    x = opti.variable(lower.size)
    opti.subject_to(opti.bounded(lower, x, upper))
    opti.subject_to(opti.bounded(row_lower, nlp.rows(x), row_upper))
    opti.minimize(nlp.objective(x))
    return opti
