"""Starter tasks in the air, by the robot's jets.

Lengths are in ℓ: the standing height L, or the mean distance of the jets from the CoM where that is more, as for a flat
drone whose legs are short.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from multimodal_to.arguments import checked
from multimodal_to.errors import ScenarioError
from multimodal_to.models.robot import Robot
from multimodal_to.models.turbines import spool_up
from multimodal_to.models.units import Units
from multimodal_to.scenarios.contacts import ContactState
from multimodal_to.scenarios.keyframes import HOME
from multimodal_to.scenarios.scenario import Scenario, Start, Terminal, Vector3
from multimodal_to.tasks.costs import weights
from multimodal_to.tasks.given import given, looks, positive, refuse_footless

HEIGHT = 0.5
"""How high a robot takes off, and from where it lands, by default [ℓ]."""
ACCELERATION = 0.1
"""How hard the CoM speeds up and slows down on its way [g]."""
SETTLING = 3.0
"""How long the robot has to become still at the end, beside the way [√(ℓ/g)]."""
_INTERVALS = 40
"""Into how many intervals the way is divided, and as many the time before it or after it on the ground."""
_LONGEST, _TIMES = 60.0, 600
"""How long engines are looked at [√(ℓ/g)], and how often."""


@checked
def hover(robot: Robot, *, by: Vector3 | None = None) -> Scenario:
    """Return a way through the air, from a hover to a hover.

    Args:
        robot: that flies; it starts ℓ above home, where it has feet.
        by: how far it gets in the world [m]; ℓ ahead where it is not said.

    Raises:
        ScenarioError: the robot has no jets, or jets that cannot carry it, or the way is no finite one.
    """
    length = _units(robot).length
    by = (looks(robot) * length, 0.0, 0.0) if by is None else by
    if not all(map(math.isfinite, by)):
        raise ScenarioError(f"by is {by}; expected three finite numbers [m]")
    _spool_up_time(robot, "hover")
    high = length if robot.contacts else 0.0
    time = _way_time(robot, math.hypot(*by))
    return _in_air(
        robot,
        "hover",
        f"Hover by {math.hypot(*by):.3g} m",
        start=Start.HOVER,
        terminal=Terminal.HOVER,
        shifts=((0.0, 0.0, high), (by[0], by[1], by[2] + high)),
        times=(time,),
        states=(ContactState.OFF,),
    )


@checked
def take_off(robot: Robot, *, height: float | None = None) -> Scenario:
    """Return a take-off: the engines spool up while the robot stands, then it rises to a hover.

    Args:
        robot: that takes off.
        height: how far its CoM rises above home [m]; 0.5 ℓ where it is not said.

    Raises:
        ScenarioError: the robot has no feet, no jets, or jets that cannot carry it, or the height is not positive.
    """
    refuse_footless(robot, "take-off")
    height = positive("height", HEIGHT * _units(robot).length if height is None else height, "m")
    return _in_air(
        robot,
        "take-off",
        f"Take-off by {height:.3g} m",
        start=Start.STANDING,
        terminal=Terminal.HOVER,
        shifts=((0.0, 0.0, 0.0), (0.0, 0.0, height)),
        times=(_spool_up_time(robot, "take-off"), _way_time(robot, height)),
        states=(ContactState.ON, ContactState.OFF),
    )


@checked
def land(robot: Robot, *, height: float | None = None) -> Scenario:
    """Return a landing: from a hover down to the ground, where the engines spool down while the robot stands.

    Args:
        robot: that lands.
        height: how far its CoM is above home at the start [m]; 0.5 ℓ where it is not said.

    Raises:
        ScenarioError: the robot has no feet, no jets, or jets that cannot carry it, or the height is not positive.
    """
    refuse_footless(robot, "land")
    height = positive("height", HEIGHT * _units(robot).length if height is None else height, "m")
    return _in_air(
        robot,
        "land",
        f"Landing from {height:.3g} m",
        start=Start.HOVER,
        terminal=Terminal.STANDING,
        shifts=((0.0, 0.0, height), (0.0, 0.0, 0.0)),
        times=(_way_time(robot, height), _spool_up_time(robot, "land")),
        states=(ContactState.OFF, ContactState.ON),
    )


def _units(robot: Robot) -> Units:
    """Return the robot's own units with ℓ as the length."""
    com = robot.com_at(robot.home)
    away = [float(np.linalg.norm(robot.pose_at_home(jet.frame)[:3, 3] - com)) for jet in robot.jets]
    return replace(robot.units, length=max(robot.standing_height, float(np.mean(away or [0.0]))))


def _way_time(robot: Robot, distance: float) -> float:
    """Return how long a way takes from rest to rest [s]: 2 √(d / a), and the time to become still."""
    units = _units(robot)
    return 2.0 * math.sqrt(distance / (ACCELERATION * units.gravity)) + SETTLING * units.of("s")


def _spool_up_time(robot: Robot, name: str) -> float:
    """Return how long the engines take from idle to the robot's weight at full throttle, and half of it more [s].

    Args:
        robot: with its jets.
        name: of the task.

    Raises:
        ScenarioError: there are none, or they do not get there.
    """
    if not robot.jets:
        raise ScenarioError(f"{robot.name} has no jets; expected some for '{name}'")
    unit = _units(robot).of("s")
    times = unit * np.linspace(0.0, _LONGEST, _TIMES + 1)[1:]
    lift = spool_up(robot.jets, times).sum(axis=0)
    enough = np.flatnonzero(lift > robot.weight)
    if not enough.size:
        raise ScenarioError(
            f"the jets of {robot.name} give {lift[-1]:.3g} N at full throttle; expected more than its weight, "
            f"{robot.weight:.3g} N, for '{name}'"
        )
    return 1.5 * float(times[enough[0]]) + SETTLING * unit


def _in_air(
    robot: Robot,
    name: str,
    title: str,
    *,
    start: Start,
    terminal: Terminal,
    shifts: tuple[Vector3, Vector3],
    times: tuple[float, ...],
    states: tuple[ContactState, ...],
) -> Scenario:
    """Return a task of stretches of given lengths and contacts.

    Args:
        robot: whose task it is.
        name: of the task.
        title: for a person.
        start: how it starts.
        terminal: how it ends.
        shifts: where the CoM starts and ends, from home's [m].
        times: how long each stretch is [s].
        states: what holds of the contact points over each.
    """
    knots = _INTERVALS * len(times)
    interval = sum(times) / knots
    ends = np.cumsum([0.0, *times]) / sum(times)
    stretches = zip(states, ends[:-1], ends[1:], strict=True)
    more: dict[str, Any] = {}
    if robot.contacts:
        more["contacts"] = tuple(given(robot, state, float(begin), float(end)) for state, begin, end in stretches)
    return Scenario(
        name=name,
        title=title,
        knots=knots,
        initial_com=HOME,
        initial_com_shift=shifts[0],
        final_com=HOME,
        final_com_shift=shifts[1],
        start=start,
        terminal=terminal,
        interval_min=interval,
        interval_max=interval,
        weights=weights(robot, _units(robot)),
        **more,
    )
