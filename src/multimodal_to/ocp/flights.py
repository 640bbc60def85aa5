"""Flights for the start guess: a robot that nothing carries falls freely, so its CoM is on an arc."""

from __future__ import annotations

import numpy as np

from multimodal_to.adam.spatial import Array
from multimodal_to.models.robot import Robot
from multimodal_to.ocp.schedule import Schedule, runs
from multimodal_to.scenarios.scenario import Scenario

Flight = tuple[float, float]
"""When a flight is at its highest, in intervals from the start of the horizon, and how high it is there [m]."""


def flights(robot: Robot, scenario: Scenario, schedule: Schedule, height: float) -> list[Flight]:
    """Return the flights of a motion without jets: those that are given, or the throw up to `mid_height_min`.

    A given flight lasts from the end of the last force to the begin of the next one, T: it rises by ½ g (T / 2)².

    Args:
        robot: with the jets that the scenario uses; one with jets is carried by them.
        scenario: the task.
        schedule: which contact points bear no force.
        height: of the CoM at mid-horizon while the robot stands [m].
    """
    if robot.jets:
        return []
    if given := runs(schedule.in_air):
        found = list[Flight]()
        for first, last in given:
            begin, end = max(first - 0.5, 0.0), min(last + 0.5, scenario.knots)
            half = 0.5 * (end - begin) * interval(scenario)
            found.append((0.5 * (begin + end), 0.5 * gravity(robot) * half**2))
        return found
    return [] if scenario.mid_height_min is None else [(scenario.knots // 2, scenario.mid_height_min - height)]


def thrown(robot: Robot, scenario: Scenario, flights: list[Flight]) -> tuple[Array, Array]:
    """Return how far flights lift the CoM above the straight line [m], and how fast [m/s], (N + 1,) each.

    Args:
        robot: under whose gravity it falls.
        scenario: with knots and intervals.
        flights: of the motion.
    """
    rise, speed = np.zeros(scenario.knots + 1), np.zeros(scenario.knots + 1)
    for middle, peak in flights:
        times = interval(scenario) * (np.arange(scenario.knots + 1) - middle)
        over = np.maximum(peak - 0.5 * gravity(robot) * times**2, 0.0)
        rise, speed = rise + over, speed + np.where(over > 0.0, -gravity(robot) * times, 0.0)
    return rise, speed


def gravity(robot: Robot) -> float:
    """Return |g| [m/s²]."""
    return float(np.linalg.norm(robot.gravity))


def interval(scenario: Scenario) -> float:
    """Return Δt in the middle of its range [s]."""
    return 0.5 * (scenario.interval_min + scenario.interval_max)
