"""The outline of a problem: variables with their bounds, and rows and costs by stage, before anything is derived."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass

from multimodal_to.errors import FormulationError, ScenarioError, listed
from multimodal_to.models.robot import Posture, Robot
from multimodal_to.models.state import State
from multimodal_to.ocp import given, keyframes
from multimodal_to.ocp.formulation import Formulation
from multimodal_to.ocp.guess import standing_posture, starting_posture
from multimodal_to.ocp.parameters import Parameters
from multimodal_to.ocp.stages import Held, NamedStage, collect
from multimodal_to.ocp.variables import Bounds, Layout, ranges
from multimodal_to.scenarios.failures import failing_knots
from multimodal_to.scenarios.limits import limited
from multimodal_to.scenarios.scenario import Scenario, Start, Terminal


@dataclass(frozen=True, kw_only=True, eq=False)
class Outline:
    """A problem before anything is derived: variables with their bounds, and rows and costs by stage."""

    layout: Layout
    bounds: Bounds
    box: Bounds  # without the terms that are bounds
    stages: list[NamedStage]
    held: list[Held]  # the rows that are bounds
    keyframe_terms: tuple[str, ...]  # names of the terms that are not the formulation's but the scenario's
    parameters: Parameters  # what its terms have read
    initial: State | None  # that a motion with a given start starts in

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

    def refuse_crossed(self) -> None:
        """Make sure that what keyframes ask of single variables is within these variables' ranges.

        Raises:
            ScenarioError: it is not.
            FormulationError: it would be without the terms of the formulation.
        """
        for some in self.held:
            if some.term not in self.keyframe_terms or not _contradicts(some, self.bounds, self.layout):
                continue
            scale = self.layout.scale[self.layout.rows[some.variable].start + some.row]
            knot = int(some.knots[0])
            low, high = (side[some.variable][some.row, knot] for side in (self.box.lower, self.box.upper))
            asked = " to ".join(dict.fromkeys(f"{limit * scale:.6g}" for limit in (some.lower, some.upper)))
            found = f"{some.variable} {some.component} has to be {asked} at knot {knot} for '{some.term}'"
            others = [name for name in self.terms_that_hold(some.variable, some.row, knot) if name != some.term]
            if others and not _contradicts(some, self.box, self.layout):
                raise FormulationError(f"the term '{listed(others)}' contradicts the start or the end: {found}")
            raise ScenarioError(f"{found}, outside its range {low:.6g} to {high:.6g}")


def formulate(
    robot: Robot, scenario: Scenario, standing: Posture, formulation: Formulation, initial: State | None = None
) -> Outline:
    """Return the outline of a problem.

    Args:
        robot: with the jets that the scenario uses.
        scenario: the task.
        standing: posture in which the motion starts or, if it starts in the air, that it is pulled to.
        formulation: what the problem is made of.
        initial: the state that a motion with a given start starts in.

    Raises:
        ScenarioError: what the start or the end holds is outside its range.
        FormulationError: a term does not return what it has to, or contradicts the start or the end.
    """
    layout = Layout.of(robot, formulation.variables)
    box = ranges(robot, scenario, layout)
    bounds = box.copy()
    parameters = Parameters.of(robot, scenario, standing, _target(robot, scenario, standing), formulation.rule.name)
    given.check(robot, scenario, initial)
    more = keyframes.terms(robot, scenario, formulation.rule.name)
    stages, held = collect(formulation.with_terms(*more), parameters, layout, bounds)
    keyframes.hold(box, robot, scenario, standing, formulation.rule.name, initial)
    try:
        keyframes.hold(bounds, robot, scenario, standing, formulation.rule.name, initial)
    except ScenarioError as error:  # without the terms it fits, as the line before has shown
        terms = dict.fromkeys(some.term for some in held if _contradicts(some, box, layout))
        raise FormulationError(f"the term '{listed(terms)}' contradicts the start or the end: {error}") from error
    return Outline(
        layout=layout,
        bounds=bounds,
        box=box,
        stages=stages,
        held=held,
        keyframe_terms=tuple(term.name for term in more),
        parameters=parameters,
        initial=initial,
    )


def _contradicts(held: Held, box: Bounds, layout: Layout) -> bool:
    """Return whether a row that is a bound leaves nothing of its variable's box at some knot.

    Args:
        held: the row.
        box: the bounds without terms.
        layout: of the variables of a knot.
    """
    scale = layout.scale[layout.rows[held.variable].start + held.row]
    lower, upper = (side[held.variable][held.row, held.knots] for side in (box.lower, box.upper))
    return bool(((upper < held.lower * scale - 1e-9) | (lower > held.upper * scale + 1e-9)).any())


def prepared(robot: Robot, scenario: Scenario) -> tuple[Robot, Posture]:
    """Return the robot with the jets that a scenario uses, and the posture in which it stands.

    Raises:
        ScenarioError: the scenario does not fit the robot.
    """
    if not scenario.jets:
        robot = robot.with_jets(())
    if not robot.contacts and (scenario.start is Start.STANDING or scenario.terminal is Terminal.STANDING):
        raise ScenarioError(f"{robot.name} has no contact points to stand on")
    failing_knots(scenario.failures, robot.jet_names, scenario.knots)  # which refuses a jet that is not there
    limited(scenario.limits, robot, scenario.knots)  # likewise
    for group in scenario.weights.joint_velocities:
        robot.group_indices(group)
    return robot, _standing(robot, scenario)


def _standing(robot: Robot, scenario: Scenario) -> Posture:
    """Return the posture in which the robot stands where the motion starts or, if in the air, ends; else upright."""
    if scenario.start is Start.STANDING:
        return starting_posture(robot, scenario)
    if scenario.terminal is Terminal.STANDING:
        return standing_posture(robot, scenario.surface, scenario.end_com)
    return robot.upright


def _target(robot: Robot, scenario: Scenario, standing: Posture) -> Posture:
    """Return the posture that posture costs pull to: where a motion ends standing elsewhere, that of the end.

    Joints that a keyframe bends at the start are not bent in it.

    An end at which no posture is found is no error here: a solver may find one, or say what gives way.
    """
    stands = scenario.start is Start.STANDING and scenario.terminal is Terminal.STANDING
    bent = scenario.start is Start.STANDING and any(keyframe.joints for keyframe in scenario.held_at(0))
    if bent or (stands and scenario.start_com != scenario.end_com):
        with suppress(ScenarioError):
            return standing_posture(robot, scenario.surface, scenario.end_com if stands else scenario.start_com)
    return standing
