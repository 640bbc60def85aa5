"""Other bounds for a problem that is built: another state to start in, another end, another duration."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from multimodal_to.adam.spatial import Array
from multimodal_to.models.robot import Posture, Robot
from multimodal_to.models.state import State
from multimodal_to.ocp import given, keyframes
from multimodal_to.ocp.flights import interval
from multimodal_to.ocp.guess import start_guess
from multimodal_to.ocp.problem import BoundSet, Problem, RowSet
from multimodal_to.ocp.stages import Held, collect
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
    bound_rows = _bound_rows(problem, scenario)
    lower, upper = stacked(box, layout, scenario, scale)
    for some in bound_rows.values():
        np.maximum.at(lower, some.index, some.lower)
        np.minimum.at(upper, some.index, some.upper)
    bounds = Bounds(*(layout.read_horizon(side * scale) for side in (lower, upper)))
    for some_bounds in (box, bounds):
        keyframes.hold(some_bounds, robot, scenario, standing, rule, initial)
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
        bound_rows=bound_rows,
        guess=np.clip(problem.guess, lower, upper),
        initial=initial,
    )


def _bound_rows(problem: Problem, scenario: Scenario) -> dict[str, BoundSet]:
    """Return the rows of terms that are bounds, with those of the keyframes of a changed scenario."""
    robot, rule = problem.robot, problem.formulation.rule.name
    if scenario.placed() == problem.scenario.placed():
        return problem.bound_rows
    before, after = (keyframes.terms(robot, some, rule) for some in (problem.scenario, scenario))
    parameters = replace(problem.parameters, scenario=scenario)
    bounds = ranges(robot, scenario, problem.layout)
    _, held = collect(replace(problem.formulation, terms=after), parameters, problem.layout, bounds)
    names = {term.name for term in before}
    others = {name: some for name, some in problem.bound_rows.items() if name not in names}
    return others | bound_sets(held, problem.layout)


def bound_sets(held: Sequence[Held], layout: Layout) -> dict[str, BoundSet]:
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


def same_terms(scenario: Scenario, other: Scenario) -> bool:
    """Return whether the terms of two scenarios, equal but for what `rebind` changes, are the same.

    Posture costs pull to the posture of the end where that is a standing one, and so they depend on `final_com`.
    """
    return scenario.terminal is not Terminal.STANDING or scenario.final_com == other.final_com


def started(robot: Robot, scenario: Scenario, initial: State | None) -> Scenario:
    """Return a scenario with the CoM of the state that it starts in, in place of its file, if it starts in a given one.

    Args:
        robot: with the jets that the scenario uses.
        scenario: the task.
        initial: the state, if there is one.
    """
    if initial is None:
        return scenario
    x, y, z = (float(value) for value in given.com(robot, initial))
    return replace(scenario, initial_com=(x, y, z), initial_com_shift=None, initial_state=None, initial_knot=None)


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
    columns = start_guess(robot, scenario, posture, layout).ravel(order="F")
    return np.append(columns, interval(scenario)) / scale
