"""The stages of a scenario: which named rows and costs hold at the first knot, over every interval, and at the end."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import casadi as cs
import numpy as np
from numpy.typing import NDArray

from multimodal_to.adam.spatial import SX, Array
from multimodal_to.models.robot import Robot
from multimodal_to.ocp import constraints, costs
from multimodal_to.ocp.boundary import END_ROWS, START_ROWS
from multimodal_to.ocp.constraints import IntervalRows, KnotRows, Rows, World
from multimodal_to.ocp.naming import components
from multimodal_to.ocp.transcription import Stage
from multimodal_to.ocp.variables import INTERVAL_SCALE, Bounds, Knot, Layout
from multimodal_to.scenarios.scenario import Scenario, Weights

AT_KNOTS: tuple[KnotRows, ...] = (
    constraints.com_kinematics,
    constraints.angular_momentum_kinematics,
    constraints.contact_kinematics,
    constraints.non_penetration,
    constraints.friction_cone,
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
class NamedStage:
    """A stage with the names of its rows and costs, in their order."""

    stage: Stage
    rows: list[tuple[str, Rows]]
    knots: NDArray[np.int64]  # that the rows are of; for those over an interval its end
    cost_names: tuple[str, ...]


def collect(world: World, scenario: Scenario, layout: Layout, bounds: Bounds) -> list[NamedStage]:
    """Return the stages of a scenario; rows of a single variable go into `bounds` instead."""
    z, z_next, dt = cs.SX.sym("z", layout.size), cs.SX.sym("z_next", layout.size), cs.SX.sym("dt")
    start, end = (Knot(world.robot, **layout.read(values * layout.scale)) for values in (z, z_next))
    interval = dt * INTERVAL_SCALE
    first, every, last = np.array([0]), np.arange(scenario.knots), np.array([scenario.knots - 1])

    at_start = _named(START_ROWS[scenario.start], start, world)
    at_knots = _named(AT_KNOTS, end, world)
    at_end = _named(END_ROWS[scenario.terminal], end, world)
    over_intervals = _named(OVER_INTERVALS, start, end, interval, world)
    rows = {
        "first": _move_to_bounds(at_start, z, layout, bounds, first),
        "every": _move_to_bounds(at_knots, z_next, layout, bounds, every + 1) + over_intervals,
        "last": _move_to_bounds(at_end, z_next, layout, bounds, last + 1),
    }
    charged = _costs(start, end, interval, world, scenario.weights)
    return [
        NamedStage(
            stage=Stage(
                name=name,
                starts=starts,
                start=z,
                end=z_next,
                interval=dt,
                families=tuple(some.expression / some.scale for _, some in rows[name]),
                costs=cs.vertcat(cs.SX(0, 1), *charged[name].values()),
            ),
            rows=rows[name],
            knots=starts if name == "first" else starts + 1,
            cost_names=tuple(charged[name]),
        )
        for name, starts in {"first": first, "every": every, "last": last}.items()
        if rows[name] or charged[name]
    ]


def _named(functions: Sequence[Callable[..., Rows]], *arguments: Any) -> list[tuple[str, Rows]]:
    """Return the rows of each function with its name; a robot without jets has none of theirs."""
    rows = [(function.__name__, function(*arguments)) for function in functions]
    robot = arguments[-1].robot  # of the world
    return [
        (name, replace(some, components=components(robot, some.of, some.expression.shape[0])))
        for name, some in rows
        if some.expression.shape[0]
    ]


def _move_to_bounds(
    named: list[tuple[str, Rows]], z: SX, layout: Layout, bounds: Bounds, knots: NDArray[np.int64]
) -> list[tuple[str, Rows]]:
    """Turn rows that are a single variable, up to a constant, into its bounds at `knots`; return the others."""
    left = []
    for label, rows in named:
        jacobian, kept, names = cs.sparsify(cs.jacobian(rows.expression, z)), [cs.SX(0, 1)], list[str]()
        for index in range(rows.expression.shape[0]):
            entry, row = rows.expression[index], jacobian[index, :]
            if row.nnz() != 1 or not row.nonzeros()[0].is_constant():
                kept.append(entry)
                names.append(rows.components[index])
                continue
            slope = float(row.nonzeros()[0])
            constant = float(cs.substitute(entry, z, cs.DM.zeros(z.shape[0])))
            low, high = sorted((limit - constant) / slope for limit in (rows.lower, rows.upper))
            _tighten(bounds, layout, row.sparsity().get_col()[0], low, high, knots)
        if sum(entry.shape[0] for entry in kept):
            left.append((label, replace(rows, expression=cs.vertcat(*kept), components=tuple(names))))
    return left


def _tighten(bounds: Bounds, layout: Layout, column: int, lower: float, upper: float, knots: NDArray[np.int64]) -> None:
    name = next(name for name, rows in layout.rows.items() if rows.start <= column < rows.stop)
    row, scale = column - layout.rows[name].start, layout.scale[column]
    bounds.lower[name][row, knots] = np.maximum(bounds.lower[name][row, knots], lower * scale)
    bounds.upper[name][row, knots] = np.minimum(bounds.upper[name][row, knots], upper * scale)


def _costs(start: Knot, end: Knot, dt: SX, world: World, weights: Weights) -> dict[str, dict[str, SX]]:
    """Return the weighted costs by stage and name; those of zero weight are left out."""
    every: dict[str, SX] = {}
    for residual in costs.RUNNING:
        weight = _weight(residual.__name__, world.robot, weights)
        if np.any(weight):
            every[residual.__name__] = _weighted_square(weight, residual(start, end, dt, world)) * dt
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
