"""Other bounds for a problem that is built: another state to start in, another end, another duration."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from multimodal_to.adam.spatial import Array
from multimodal_to.models.robot import Posture, Robot
from multimodal_to.models.state import State
from multimodal_to.ocp import given
from multimodal_to.ocp.boundary import set_boundary
from multimodal_to.ocp.guess import start_guess
from multimodal_to.ocp.problem import Problem, RowSet
from multimodal_to.ocp.variables import Bounds, Layout, ranges
from multimodal_to.scenarios.scenario import Scenario, Terminal


def rebind(problem: Problem, scenario: Scenario, initial: State | None = None) -> Problem:
    """Return a problem with the bounds of a changed scenario, and everything else as it is, also its start guess.

    Args:
        problem: that is built.
        scenario: the problem's own, but for `final_com`, `mid_height_min`, `interval_min` and `interval_max`.
        initial: the state to start in, where the scenario starts in a given one.

    Raises:
        ScenarioError: what the start or the end holds is outside its range, or there is no state.
        InputError: there is a state for a scenario with another start, or it is of another robot.
    """
    robot, layout, scale, rule = problem.robot, problem.layout, problem.scale, problem.formulation.rule.name
    given.check(robot, scenario, initial)
    scenario = started(robot, scenario, initial)
    standing = problem.parameters.standing
    box = ranges(robot, scenario, layout)
    lower, upper = stacked(box, layout, scenario, scale)
    for some in problem.bound_rows.values():
        np.maximum.at(lower, some.index, some.lower)
        np.minimum.at(upper, some.index, some.upper)
    bounds = Bounds(*(layout.read_horizon(side * scale) for side in (lower, upper)))
    for some_bounds in (box, bounds):
        set_boundary(some_bounds, robot, scenario, standing, rule, initial)
    lower, upper = stacked(bounds, layout, scenario, scale)
    box_lower, box_upper = stacked(box, layout, scenario, scale)
    row_lower, row_upper = problem.row_lower, problem.row_upper
    if initial is not None:
        row_lower, row_upper = row_lower.copy(), row_upper.copy()
        hold_rows(row_lower, row_upper, problem.rows, robot, initial)
    return replace(
        problem,
        scenario=scenario,
        lower=lower,
        upper=upper,
        box_lower=box_lower,
        box_upper=box_upper,
        row_lower=row_lower,
        row_upper=row_upper,
        guess=np.clip(problem.guess, lower, upper),
        initial=initial,
    )


def same_terms(scenario: Scenario, other: Scenario) -> bool:
    """Return whether the terms of two scenarios, equal but for what `rebind` changes, are the same.

    Posture costs pull to the posture of the end where that is a standing one, and so they depend on `final_com`.
    """
    return scenario.terminal is not Terminal.STANDING or scenario.final_com == other.final_com


def started(robot: Robot, scenario: Scenario, initial: State | None) -> Scenario:
    """Return a scenario with the CoM of the state that it starts in, if it starts in a given one.

    Args:
        robot: with the jets that the scenario uses.
        scenario: the task.
        initial: the state, if there is one.
    """
    if initial is None:
        return scenario
    x, y, z = (float(value) for value in given.com(robot, initial))
    return replace(scenario, initial_com=(x, y, z))


def stacked(bounds: Bounds, layout: Layout, scenario: Scenario, scale: Array) -> tuple[Array, Array]:
    """Return bounds of all variables, in solver units.

    Args:
        bounds: of the variables of the knots.
        layout: of these.
        scenario: with the bounds of Δt.
        scale: of all variables.
    """
    lower, upper = (
        np.append(np.concatenate([side[name] for name in layout.rows]).ravel(order="F"), limit) / scale
        for side, limit in ((bounds.lower, scenario.interval_min), (bounds.upper, scenario.interval_max))
    )
    return lower, upper


def hold_rows(row_lower: Array, row_upper: Array, rows: dict[str, RowSet], robot: Robot, initial: State) -> None:
    """Set the rows of a given start to what the state says.

    Args:
        row_lower: bounds of g, in solver units; they are changed.
        row_upper: likewise.
        rows: where each name's rows are.
        robot: whose state it is.
        initial: the state.
    """
    for name, values in given.AT_START.items():
        if name in rows:
            row_lower[rows[name].index] = row_upper[rows[name].index] = values(robot, initial) / rows[name].scale


def guessed(robot: Robot, scenario: Scenario, posture: Posture, layout: Layout, scale: Array) -> Array:
    """Return the start guess of all variables, in solver units.

    Args:
        robot: with the jets that the scenario uses.
        scenario: the task.
        posture: that moves along.
        layout: of the variables of a knot.
        scale: of all variables.
    """
    middle = 0.5 * (scenario.interval_min + scenario.interval_max)
    return np.append(start_guess(robot, scenario, posture, layout).ravel(order="F"), middle) / scale
