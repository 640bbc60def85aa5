"""`build`: a robot and a scenario become a `Problem`, the complete optimal control problem on CasADi's `Opti`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import casadi as cs
import numpy as np
from numpy.typing import NDArray

from multimodal_to.adam.spatial import SX
from multimodal_to.errors import ScenarioError
from multimodal_to.models.robot import Posture, Robot
from multimodal_to.ocp import constraints, costs
from multimodal_to.ocp.boundary import END_ROWS, START_ROWS, set_boundary
from multimodal_to.ocp.constraints import IntervalRows, KnotRows, Rows, World
from multimodal_to.ocp.guess import standing_posture, straight_line
from multimodal_to.ocp.scenario import Scenario, Start, Terminal, Weights
from multimodal_to.ocp.transcription import Nlp, Stage, assemble
from multimodal_to.ocp.variables import INTERVAL_SCALE, Bounds, Knot, Layout, ranges
from multimodal_to.trajectory import QUANTITIES

Array = NDArray[np.float64]

AT_KNOTS: tuple[KnotRows, ...] = (
    constraints.com_kinematics,
    constraints.angular_momentum_kinematics,
    constraints.contact_kinematics,
    constraints.non_penetration,
    constraints.friction_pyramid,
    constraints.complementarity,
    constraints.contact_reach,
    constraints.jet_reach,
)
"""Rows of every knot but the first."""

OVER_INTERVALS: tuple[IntervalRows, ...] = (
    constraints.momentum_dynamics,
    constraints.com_integration,
    constraints.base_position_integration,
    constraints.base_orientation_integration,
    constraints.joint_integration,
    constraints.thrust_integration,
    constraints.thrust_dynamics,
    constraints.sliding,
)
"""Rows of every interval."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RowSet:
    """The rows of one name on the whole horizon."""

    unit: str
    index: NDArray[np.int64]  # into g
    scale: float  # own unit per solver unit


@dataclass(frozen=True, kw_only=True, eq=False)
class Problem:
    """A scenario for a robot as an `Opti` problem, with the names of its variables, rows and costs.

    x stacks the knots' variables, knot by knot, and Δt, all divided by their scales.
    """

    robot: Robot
    scenario: Scenario
    layout: Layout
    opti: cs.Opti
    slack_factor: cs.MX  # Opti's parameter: what both slack weights are multiplied by while solving
    nlp: Nlp
    lower: Array  # of x
    upper: Array
    row_lower: Array  # of g
    row_upper: Array
    rows: dict[str, RowSet]
    cost_names: tuple[str, ...]  # in the order of nlp.costs; a name may occur more than once
    guess: Array  # of x
    scale: Array = field(repr=False)  # of x

    def largest_violations(self, x: Array) -> dict[str, float]:
        """Return by how much each set of rows, and each variable's bounds, are missed at x, in their own units."""
        g = np.array(self.nlp.rows(x)).ravel()
        missed = np.maximum(np.maximum(self.row_lower - g, g - self.row_upper), 0.0)
        report = {name: float(missed[rows.index].max() * rows.scale) for name, rows in self.rows.items()}
        outside = np.maximum(np.maximum(self.lower - x, x - self.upper), 0.0) * self.scale
        for name, values in self.layout.read(outside[:-1].reshape(self.layout.size, -1, order="F")).items():
            report[f"bounds of {name}"] = float(values.max(initial=0.0))
        report["bounds of interval"] = float(outside[-1])
        return report

    def costs(self, x: Array) -> dict[str, float]:
        """Return each named cost's share of the objective at x, with the scenario's own weights."""
        report = dict.fromkeys(self.cost_names, 0.0)
        for name, value in zip(self.cost_names, np.array(self.nlp.costs(x, 1.0)).ravel(), strict=True):
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
    if not scenario.jets:
        robot = robot.with_jets(())
    if not robot.contacts:
        raise ScenarioError(f"{robot.name} has no contact points to stand on")
    for group in scenario.weights.joint_velocities:
        robot.group_indices(group)
    layout = Layout.of(robot)
    standing = _standing(robot, scenario)
    world = World(
        robot=robot, surface=scenario.surface, friction=scenario.friction or robot.friction, standing=standing
    )
    bounds = ranges(robot, scenario)

    z, z_next, dt = cs.SX.sym("z", layout.size), cs.SX.sym("z_next", layout.size), cs.SX.sym("dt")
    slack_factor = cs.SX.sym("slack_factor")
    start, end = (Knot(robot, **layout.read(values * layout.scale)) for values in (z, z_next))
    interval = dt * INTERVAL_SCALE
    starts = {
        "first": np.array([0]), "every": np.arange(scenario.knots), "last": np.array([scenario.knots - 1])
    }  # fmt: skip
    at_start = _named(START_ROWS[scenario.start], start, world)
    at_knots = _named(AT_KNOTS, end, world)
    at_end = _named(END_ROWS[scenario.terminal], end, world)
    over_intervals = _named(OVER_INTERVALS, start, end, interval, world)
    named = {
        "first": _move_to_bounds(at_start, z, layout, bounds, starts["first"]),
        "every": _move_to_bounds(at_knots, z_next, layout, bounds, starts["every"] + 1) + over_intervals,
        "last": _move_to_bounds(at_end, z_next, layout, bounds, starts["last"] + 1),
    }
    charged = _costs(start, end, interval, world, scenario.weights, slack_factor)
    stages = [
        Stage(
            name=name, starts=starts[name], start=z, end=z_next, interval=dt,
            parameter=slack_factor,
            rows=cs.vertcat(cs.SX(0, 1), *(rows.expression / rows.scale for _, rows in named[name])),
            costs=cs.vertcat(cs.SX(0, 1), *charged[name].values()),
        )
        for name in named
        if named[name] or charged[name]
    ]  # fmt: skip
    nlp = assemble(stages, layout.size, scenario.knots)
    set_boundary(bounds, robot, scenario, standing)

    low, high, row_sets = _row_bounds([(named[stage.name], stage.repeats) for stage in stages])
    scale = np.append(np.tile(layout.scale, scenario.knots + 1), INTERVAL_SCALE)
    lower, upper = (
        np.append(np.concatenate([side[name] for name in layout.rows]).ravel(order="F"), limit) / scale
        for side, limit in ((bounds.lower, scenario.interval_min), (bounds.upper, scenario.interval_max))
    )
    middle = 0.5 * (scenario.interval_min + scenario.interval_max)
    guess = np.append(straight_line(robot, scenario, standing).ravel(order="F"), middle) / scale
    opti, factor = _opti(nlp, lower, upper, low, high)
    return Problem(
        robot=robot, scenario=scenario, layout=layout, opti=opti, slack_factor=factor, nlp=nlp, lower=lower,
        upper=upper, row_lower=low, row_upper=high, rows=row_sets, scale=scale, guess=np.clip(guess, lower, upper),
        cost_names=tuple(name for stage in stages for name in charged[stage.name]),
    )  # fmt: skip


def _named(functions: Sequence[Callable[..., Rows]], *arguments: object) -> list[tuple[str, Rows]]:
    """Return the rows of each function with its name; a robot without jets has none of theirs."""
    rows = [(function.__name__, function(*arguments)) for function in functions]
    return [(name, some) for name, some in rows if some.expression.shape[0]]


def _move_to_bounds(
    named: list[tuple[str, Rows]], z: SX, layout: Layout, bounds: Bounds, knots: NDArray[np.int64]
) -> list[tuple[str, Rows]]:
    """Turn rows that are a single variable, up to a constant, into its bounds at `knots`; return the others."""
    left = []
    for label, rows in named:
        jacobian, kept = cs.sparsify(cs.jacobian(rows.expression, z)), [cs.SX(0, 1)]
        for index in range(rows.expression.shape[0]):
            entry, row = rows.expression[index], jacobian[index, :]
            if row.nnz() != 1 or not row.nonzeros()[0].is_constant():
                kept.append(entry)
                continue
            slope = float(row.nonzeros()[0])
            constant = float(cs.substitute(entry, z, cs.DM.zeros(z.shape[0])))
            low, high = sorted((limit - constant) / slope for limit in (rows.lower, rows.upper))
            _tighten(bounds, layout, row.sparsity().get_col()[0], low, high, knots)
        if sum(entry.shape[0] for entry in kept):
            left.append((label, replace(rows, expression=cs.vertcat(*kept))))
    return left


def _tighten(bounds: Bounds, layout: Layout, column: int, lower: float, upper: float, knots: NDArray[np.int64]) -> None:
    name = next(name for name, rows in layout.rows.items() if rows.start <= column < rows.stop)
    row, scale = column - layout.rows[name].start, layout.scale[column]
    bounds.lower[name][row, knots] = np.maximum(bounds.lower[name][row, knots], lower * scale)
    bounds.upper[name][row, knots] = np.minimum(bounds.upper[name][row, knots], upper * scale)


def _standing(robot: Robot, scenario: Scenario) -> Posture:
    """Return the posture in which the robot stands where the motion starts or, if in the air, where it ends."""
    if scenario.start is Start.STANDING:
        return standing_posture(robot, scenario.surface, scenario.initial_com)
    if scenario.terminal is Terminal.STANDING:
        return standing_posture(robot, scenario.surface, scenario.final_com)
    return robot.home


def _costs(
    start: Knot, end: Knot, dt: SX, world: World, weights: Weights, slack_factor: SX
) -> dict[str, dict[str, SX]]:
    """Return the weighted costs by stage and name; those of zero weight are left out."""
    every: dict[str, SX] = {}
    for residual in costs.RUNNING:
        weight = _weight(residual.__name__, world.robot, weights)
        if np.any(weight):
            every[residual.__name__] = _weighted_square(weight, residual(start, end, dt, world)) * dt
    for residual in costs.LINEAR:
        weight = _weight(residual.__name__, world.robot, weights)
        if np.any(weight):
            every[residual.__name__] = slack_factor * weight * cs.sum1(residual(start, end, dt, world))
    last: dict[str, SX] = {}
    for residual in costs.FINAL:
        name = f"final_{residual.__name__}"
        weight = _weight(name, world.robot, weights)
        if np.any(weight):
            last[name] = _weighted_square(weight, residual(start, end, dt, world))
    first: dict[str, SX] = {}
    if weights.contact_forces:
        first["contact_forces"] = _weighted_square(weights.contact_forces, start.contact_forces) * dt
    if weights.initial_posture:
        residual = costs.initial_posture(start, end, dt, world)
        first["initial_posture"] = _weighted_square(weights.initial_posture, residual)
    return {"first": first, "every": every, "last": last}


def _weight(name: str, robot: Robot, weights: Weights) -> float | Array:
    """Return a cost's weight: one number, or one per joint for a weight by joint group."""
    value = getattr(weights, name)
    if isinstance(value, int | float):
        return float(value)
    by_joint = np.zeros(len(robot.joint_names))
    for group, weight in value.items():
        by_joint[robot.group_indices(group)] = weight
    return by_joint


def _weighted_square(weight: float | Array, residual: SX) -> SX:
    return cs.dot(cs.DM(weight) * residual, residual)


def _row_bounds(named: Sequence[tuple[list[tuple[str, Rows]], int]]) -> tuple[Array, Array, dict[str, RowSet]]:
    """Return the bounds of g in solver units, and where each name's rows are."""
    low, high, sets, first = list[Array](), list[Array](), dict[str, RowSet](), 0
    for rows_of_stage, repeats in named:
        height = sum(rows.expression.shape[0] for _, rows in rows_of_stage)
        lower, upper, offset = np.zeros(height), np.zeros(height), 0
        for name, rows in rows_of_stage:
            count = rows.expression.shape[0]
            here = slice(offset, offset + count)
            lower[here], upper[here] = rows.lower / rows.scale, rows.upper / rows.scale
            index = (first + np.arange(offset, offset + count)[:, None] + height * np.arange(repeats)).ravel()
            before = sets[name].index if name in sets else np.zeros(0, dtype=np.int64)
            sets[name] = RowSet(unit=rows.unit, index=np.concatenate([before, index]), scale=rows.scale)
            offset += count
        low.append(np.tile(lower, repeats))
        high.append(np.tile(upper, repeats))
        first += height * repeats
    return np.concatenate(low), np.concatenate(high), sets


def _opti(nlp: Nlp, lower: Array, upper: Array, row_lower: Array, row_upper: Array) -> tuple[cs.Opti, cs.MX]:
    """Return the `Opti` problem and its parameter; bounds come first, so that they can be told from the rows."""
    opti = cs.Opti()
    x, slack_factor = opti.variable(lower.size), opti.parameter()
    opti.subject_to(opti.bounded(lower, x, upper))
    opti.subject_to(opti.bounded(row_lower, nlp.rows(x), row_upper))
    opti.minimize(nlp.objective(x, slack_factor))
    return opti, slack_factor
