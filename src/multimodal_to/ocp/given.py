"""A motion that starts in a given state: what its first knot holds, and what its first interval is asked for."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from multimodal_to.adam.spatial import Array
from multimodal_to.errors import InputError, ScenarioError
from multimodal_to.models.attitude import signed_like
from multimodal_to.models.robot import Robot
from multimodal_to.models.state import State
from multimodal_to.models.terrain import heights_below
from multimodal_to.models.units import Sized
from multimodal_to.ocp.guess import IN_THE_AIR, contact_positions
from multimodal_to.ocp.variables import Bounds
from multimodal_to.scenarios.scenario import Scenario, Start, word
from multimodal_to.trajectory import Trajectory, rules
from multimodal_to.trajectory.states import state_at
from multimodal_to.values import FrozenMapping

NO_FORCE = Sized(0.01, "N", of_a_point=True)
"""Largest contact force component left at a knot that has to be free of contact."""


def check(robot: Robot, scenario: Scenario, initial: State | None) -> None:
    """Make sure that there is a state where the scenario starts in one, and nowhere else.

    Args:
        robot: with the jets that the scenario uses.
        scenario: the task.
        initial: the state, if there is one.

    Raises:
        ScenarioError: the start is a given one and there is no state.
        InputError: there is a state and the start is another one, or the state is of another robot.
    """
    if initial is None:
        if scenario.start is Start.GIVEN:
            raise ScenarioError(
                f"'{scenario.name}' starts in a given state, and none is given; expected `initial` of `build` or of "
                "`Planner.solve`, or a start that is 'standing' or 'hover'"
            )
        return
    if scenario.start is not Start.GIVEN:
        raise InputError(
            f"a state to start in is given, but '{scenario.name}' starts in '{word(scenario.start)}'; expected a "
            "scenario with start 'given'"
        )
    initial.refuse_other_robot(robot)


def measured(scenario: Scenario) -> State | None:
    """Return the state in the trajectory file that a scenario names, if it names one.

    Raises:
        TrajectoryError: the file is missing or broken.
        ScenarioError: it has no such knot.
    """
    if scenario.initial_state is None:
        return None
    motion = Trajectory.load(scenario.initial_state)
    knot = motion.knots if scenario.initial_knot is None else scenario.initial_knot
    if not 0 <= knot <= motion.knots:
        raise ScenarioError(f"initial_knot is {knot}; '{scenario.initial_state}' has the knots 0 to {motion.knots}")
    return state_at(motion, float(motion.time[knot]))


@dataclass(frozen=True, kw_only=True, eq=False)
class _Kinematics:
    """What follows from a state."""

    com: Array  # [m], (3,)
    momentum: Array  # velocity of the CoM [m/s] and angular momentum about it [kg m²/s], (6,)
    points: Array  # of contact, one after the other [m], (3 contacts,)


@lru_cache(maxsize=4)
def _kinematics(robot: Robot, initial: State) -> _Kinematics:
    return _Kinematics(
        com=initial.com(robot),
        momentum=np.concatenate(initial.momentum(robot)),
        points=contact_positions(robot, initial.posture),
    )


def com(robot: Robot, initial: State) -> Array:
    """Return where the CoM is in a state [m], (3,)."""
    return _kinematics(robot, initial).com


def set_start(bounds: Bounds, robot: Robot, scenario: Scenario, initial: State, rule: str) -> None:
    """Hold the first knot at a state, also where that is outside a range; forces and throttles are found.

    Velocities that are in the middles of intervals are free: `AT_START` says what their rows are.

    Args:
        bounds: of every variable at every knot; those of the first one are changed.
        robot: with the jets that the scenario uses.
        scenario: with the ground.
        initial: the state.
        rule: name of the integration rule.
    """
    at = _kinematics(robot, initial)
    points = at.points
    held: dict[str, Array] = {
        "com_position": at.com,
        "com_velocity": at.momentum[:3],
        "angular_momentum": at.momentum[3:],
        "base_position": initial.base_position,
        "base_quaternion_xyzw": signed_like(initial.base_quaternion_xyzw, robot.upright.base_quaternion_xyzw),
        "base_linear_velocity": initial.base_linear_velocity,
        "base_angular_velocity": initial.base_angular_velocity,
        "joint_positions": initial.joint_positions,
        "joint_velocities": initial.joint_velocities,
        "contact_positions": points,
        "thrust": initial.thrust,
        "thrust_rate": initial.thrust_rate,
    }
    for name, value in held.items():
        between = bool(rules.instant(rule, name))
        bounds.lower[name][:, 0] = -np.inf if between else value
        bounds.upper[name][:, 0] = np.inf if between else value
    places = points.reshape(-1, 3).T
    heights = places[2] - heights_below(scenario.surface, places)
    in_the_air = IN_THE_AIR.of(robot.units)
    least = 0.5 * scenario.contact_bounds(robot)[0] / np.maximum(heights, in_the_air)
    above, left = np.repeat(heights > in_the_air, 3), np.repeat(np.minimum(NO_FORCE.of(robot.units), least), 3)
    lower, upper = (side["contact_forces"] for side in (bounds.lower, bounds.upper))
    lower[above, 0], upper[above, 0] = (
        np.maximum(lower[above, 0], -left[above]),
        np.minimum(upper[above, 0], left[above]),
    )


AT_START: Mapping[str, Callable[[Robot, State], Array]] = FrozenMapping(
    {
        "momentum_at_start": lambda robot, state: _kinematics(robot, state).momentum,
        "base_twist_at_start": lambda robot, state: np.concatenate(
            [state.base_linear_velocity, state.base_angular_velocity]
        ),
        "joint_velocities_at_start": lambda robot, state: state.joint_velocities,
        "thrust_rate_at_start": lambda robot, state: state.thrust_rate,
    }
)
"""What the rows of a term are equal to in the first interval, by its name: the velocities at the first knot.

Under leapfrog a velocity is at mid-interval. (v_−½ + v_½) / 2 = v(0) and v_½ = v_−½ + a_0 Δt make
v_½ = v(0) + ½ a_0 Δt, the half kick of Störmer and Verlet, with the acceleration of the
new plan: of order two, as the rule itself.
"""
