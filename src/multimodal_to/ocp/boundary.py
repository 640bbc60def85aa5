"""How a motion starts and ends: bounds of the variables at the first and last knots."""

from __future__ import annotations

import numpy as np

from multimodal_to.models.attitude import signed_like
from multimodal_to.models.robot import Posture, Robot
from multimodal_to.models.state import State
from multimodal_to.ocp import given
from multimodal_to.ocp.guess import contact_positions
from multimodal_to.ocp.variables import Bounds
from multimodal_to.scenarios.failures import failing_knots
from multimodal_to.scenarios.scenario import Scenario, Start, Terminal
from multimodal_to.trajectory import rules

_AT_REST = ("base_linear_velocity", "base_angular_velocity", "joint_velocities")


def set_boundary(
    bounds: Bounds, robot: Robot, scenario: Scenario, standing: Posture, rule: str, initial: State | None = None
) -> None:
    """Hold the first and last knots as the scenario says.

    Args:
        bounds: of every variable at every knot; they are changed.
        robot: with the jets that the scenario uses.
        scenario: the task.
        standing: the posture that a motion that starts on its feet starts in.
        rule: name of the integration rule.
        initial: the state that a motion with a given start starts in.

    Raises:
        ScenarioError: what is held is outside its range.
    """
    if initial is not None:
        given.set_start(bounds, robot, scenario, initial, rule)
    else:
        _set_start(bounds, robot, scenario, standing)
    _set_end(bounds, robot, scenario, rule)
    if scenario.mid_height_min is not None:
        low = bounds.lower["com_position"]
        low[2, scenario.knots // 2] = max(low[2, scenario.knots // 2], scenario.mid_height_min)


def _set_start(bounds: Bounds, robot: Robot, scenario: Scenario, standing: Posture) -> None:
    fix = bounds.fix
    fix("com_position", 0, np.array(scenario.initial_com))
    for name in (*_AT_REST, "com_velocity", "angular_momentum", "thrust_rate"):
        fix(name, 0, 0.0)
    if scenario.start is Start.HOVER:
        fix("contact_forces", 0, 0.0, within=given.NO_FORCE)
        return
    fix("base_position", 0, standing.base_position)
    fix("base_quaternion_xyzw", 0, signed_like(standing.base_quaternion_xyzw, robot.upright.base_quaternion_xyzw))
    fix("joint_positions", 0, standing.joint_positions)
    fix("contact_positions", 0, contact_positions(robot, standing))
    fix("thrust", 0, 0.0)
    idle = [np.clip(jet.model.steady_throttle(0.0), jet.throttle_min, jet.throttle_max) for jet in robot.jets]
    fix("throttle", 0, np.array(idle))


def _set_end(bounds: Bounds, robot: Robot, scenario: Scenario, rule: str) -> None:
    """Hold the last knots.

    Args:
        bounds: of every variable at every knot; they are changed.
        robot: with the jets that the scenario uses.
        scenario: the task.
        rule: name of the integration rule.
    """
    fix, last = bounds.fix, scenario.knots
    fix("com_position", last, np.array(scenario.final_com))
    if scenario.terminal is Terminal.FREE:
        return
    # Velocities at the last knot hold its CoM velocity and angular momentum as well; these at the knot before make the
    # accelerations over the last interval zero.
    for name in _AT_REST:
        fix(name, last, 0.0)
    for name in ("com_velocity", "angular_momentum"):
        fix(name, last - 1, 0.0)
    if scenario.terminal is Terminal.HOVER:
        failed = failing_knots(scenario.failures, robot.jet_names, last)
        for knot in (last - 1, last):
            running = {row for row in range(len(robot.jets)) if not 0 < failed.get(row, 0) <= knot}
            fix("thrust_rate", knot, 0.0, rows=sorted(running))  # one that has failed is still running down
        # Where velocities are between knots, the forces of the knot before the last one make the last velocity.
        for knot in (last - 1, last) if rules.instant(rule, "com_velocity") else (last,):
            fix("contact_forces", knot, 0.0, within=given.NO_FORCE)
