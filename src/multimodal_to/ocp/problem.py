"""`build`: a robot and a scenario become a `Problem`, the complete optimal control problem on CasADi's `Opti`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import casadi as cs
import numpy as np
from numpy.typing import NDArray

from multimodal_to.adam.spatial import Array
from multimodal_to.errors import ScenarioError
from multimodal_to.models.robot import Posture, Robot
from multimodal_to.ocp import compiled
from multimodal_to.ocp.boundary import set_boundary
from multimodal_to.ocp.constraints import World
from multimodal_to.ocp.guess import standing_posture, start_guess
from multimodal_to.ocp.stages import NamedStage, collect
from multimodal_to.ocp.transcription import Nlp, assemble
from multimodal_to.ocp.variables import INTERVAL_SCALE, Bounds, Layout, ranges
from multimodal_to.scenarios.scenario import Scenario, Start, Terminal
from multimodal_to.trajectory import QUANTITIES, Trajectory
from multimodal_to.trajectory.resampling import resample
from multimodal_to.trajectory.sameness import refuse_other_robot


@dataclass(frozen=True, kw_only=True, eq=False)
class RowSet:
    """The rows of one name on the whole horizon."""

    unit: str
    index: NDArray[np.int64]  # into g
    knots: NDArray[np.int64]  # that each is of; for rows over an interval its end
    components: NDArray[np.str_]  # which of the rows of that name at a knot, as `l_sole_1 z`
    scale: float  # own unit per solver unit

    def joined(self, other: RowSet) -> RowSet:
        """Return these rows and others of the same name."""
        return replace(
            self,
            index=np.concatenate([self.index, other.index]),
            knots=np.concatenate([self.knots, other.knots]),
            components=np.concatenate([self.components, other.components]),
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Problem:
    """A scenario for a robot as an `Opti` problem, with the names of its variables, rows and costs.

    x stacks the knots' variables, knot by knot, and Δt, all divided by their scales.
    """

    robot: Robot
    scenario: Scenario
    layout: Layout
    opti: cs.Opti
    nlp: Nlp
    lower: Array  # of x
    upper: Array
    row_lower: Array  # of g
    row_upper: Array
    rows: dict[str, RowSet]
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
        report = {name: float(amounts[rows.index].max() * rows.scale) for name, rows in self.rows.items()}
        outside = missed(x, self.lower, self.upper) * self.scale
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
        if name in self.rows:
            return self.rows[name].unit
        variable = name.removeprefix("bounds of ")
        return QUANTITIES[variable].unit if variable in QUANTITIES else "s"


def build(robot: Robot, scenario: Scenario) -> Problem:
    """Return the problem of a scenario for a robot; nothing is solved but the start posture.

    Raises:
        ScenarioError: the scenario contradicts itself or does not fit the robot.
    """
    robot, standing = _prepared(robot, scenario)
    layout, bounds, stages = formulate(robot, scenario, standing)
    nlp = assemble([named.stage for named in stages], layout.size, scenario.knots)

    scale = np.append(np.tile(layout.scale, scenario.knots + 1), INTERVAL_SCALE)
    lower, upper = (
        np.append(np.concatenate([side[name] for name in layout.rows]).ravel(order="F"), limit) / scale
        for side, limit in ((bounds.lower, scenario.interval_min), (bounds.upper, scenario.interval_max))
    )
    row_lower, row_upper, rows = _row_bounds(stages)
    middle = 0.5 * (scenario.interval_min + scenario.interval_max)
    guess = np.append(start_guess(robot, scenario, standing).ravel(order="F"), middle) / scale
    opti = _opti(nlp, lower, upper, row_lower, row_upper)
    return Problem(
        robot=robot,
        scenario=scenario,
        layout=layout,
        opti=opti,
        nlp=nlp,
        lower=lower,
        upper=upper,
        row_lower=row_lower,
        row_upper=row_upper,
        rows=rows,
        cost_names=tuple(name for named in stages for name in named.cost_names),
        guess=np.clip(guess, lower, upper),
        scale=scale,
    )


def precompile(robot: Robot, scenario: Scenario) -> tuple[Path, ...]:
    """Compile the derivatives of a scenario's problem, for every later `build` of one like it; return their files.

    Takes a C compiler some ten seconds; an iteration of the solver then takes a seventh less. Alike are problems with
    the same robot, ground and weights, whatever their targets and numbers of knots.

    Raises:
        ScenarioError: the scenario contradicts itself or does not fit the robot.
        SolverError: there is no C compiler, or it refuses.
        OutputError: the folder of compiled derivatives cannot be written to.
    """
    robot, standing = _prepared(robot, scenario)
    _, _, stages = formulate(robot, scenario, standing)
    repeated = [named.stage for named in stages if named.stage.repeats > 1]
    return compiled.compile_functions(function for stage in repeated for function in stage.derivatives())


def formulate(robot: Robot, scenario: Scenario, standing: Posture) -> tuple[Layout, Bounds, list[NamedStage]]:
    """Return the variables with their bounds, and the rows and costs by stage, before anything is derived of them.

    Args:
        robot: with the jets that the scenario uses.
        scenario: the task.
        standing: posture in which the motion starts or, if it starts in the air, that it is pulled to.

    Raises:
        ScenarioError: what the start or the end holds is outside its range.
    """
    layout, bounds = Layout.of(robot), ranges(robot, scenario)
    stages = collect(World.of(robot, scenario, standing), scenario, layout, bounds)
    set_boundary(bounds, robot, scenario, standing)
    return layout, bounds, stages


def missed(values: Array, lower: Array, upper: Array) -> Array:
    """Return by how much values are below or above their limits, else zero; what is not a number stays none."""
    return np.maximum(np.maximum(lower - values, values - upper), 0.0)


def _prepared(robot: Robot, scenario: Scenario) -> tuple[Robot, Posture]:
    """Return the robot with the jets that a scenario uses, and the posture in which it stands."""
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
            index = (first + np.arange(offset, offset + count)[:, None] + height * np.arange(repeats)).ravel()
            here_too = RowSet(
                unit=rows.unit,
                index=index,
                knots=np.tile(named.knots, count),
                components=np.repeat(np.array(rows.components, dtype=np.str_), repeats),
                scale=rows.scale,
            )
            sets[name] = sets[name].joined(here_too) if name in sets else here_too
            offset += count
        low.append(np.tile(lower, repeats))
        high.append(np.tile(upper, repeats))
        first += height * repeats
    return np.concatenate(low), np.concatenate(high), sets


def _opti(nlp: Nlp, lower: Array, upper: Array, row_lower: Array, row_upper: Array) -> cs.Opti:
    """Return the `Opti` problem; bounds come first, so that they can be told from the rows."""
    opti = cs.Opti()
    x = opti.variable(lower.size)
    opti.subject_to(opti.bounded(lower, x, upper))
    opti.subject_to(opti.bounded(row_lower, nlp.rows(x), row_upper))
    opti.minimize(nlp.objective(x))
    return opti
