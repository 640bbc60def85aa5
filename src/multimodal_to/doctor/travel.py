"""Whether there is time for the way, given how fast the base moves, how hard feet push and how things fall."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from multimodal_to.doctor.diagnosis import Symptom, error, warning
from multimodal_to.doctor.task import Task
from multimodal_to.errors import apart
from multimodal_to.models.terrain import FlatGround
from multimodal_to.scenarios.scenario import Terminal

_LIMBS = 0.25
"""How far limbs may carry the CoM beside the base, whose speed alone is limited, as a share of the legs' reach [1]."""


def speed(task: Task) -> Iterator[Symptom]:
    """Compare the stretches that the CoM has to travel with the greatest base speed and the longest time."""
    scenario = task.scenario

    def furthest(intervals: int) -> float:
        return intervals * scenario.interval_max * scenario.base_speed_max

    start, end = np.array(scenario.start_com), np.array(scenario.end_com)
    stretches = [("from start to end", float(np.abs(end - start).max()), task.moving_intervals)]
    if scenario.mid_height_min is not None:
        middle = scenario.knots // 2
        stretches += [
            ("up to mid_height_min", scenario.mid_height_min - start[2], middle),
            ("down from mid_height_min", scenario.mid_height_min - end[2], task.moving_intervals - middle),
        ]
    label, distance, intervals = max(stretches, key=lambda stretch: stretch[1] - furthest(stretch[2]))
    if distance <= furthest(intervals):
        return
    certain = distance - _LIMBS * task.robot.contact_reach[2] > furthest(intervals + 1) or intervals <= 0
    yield (error if certain else warning)(
        "time for the distance",
        f"the CoM has to go {apart(distance, furthest(intervals))} m {label} in at most "
        f"{intervals * scenario.interval_max:.4g} s ({intervals} intervals in which it can move), and "
        f"base_speed_max is {scenario.base_speed_max:g} m/s",
        "allow more knots, a longer interval_max or more speed",
    )


def push(task: Task) -> Iterator[Symptom]:
    """Compare the way along the ground with what friction alone can push and stop, from rest to rest without jets.

    All normal impulses together are m g T, so that those along the ground, half of them forward and half back, move
    the CoM by at most μ g T² / 2 along an axis.
    """
    scenario, robot = task.scenario, task.robot
    if robot.jets or not isinstance(scenario.surface, FlatGround) or not (task.stands_at_start and task.stands_at_end):
        return
    way = np.abs(np.subtract(scenario.end_com, scenario.start_com))[:2]
    moving, step, friction = task.moving_intervals, scenario.interval_max, task.parameters.friction
    gravity = robot.weight / robot.mass
    furthest = friction * gravity * (moving + 1) * moving * step**2 / 2
    if way.max() > furthest:
        yield error(
            "time for the distance",
            f"the CoM has to go {apart(way.max(), furthest)} m along {'xy'[int(way.argmax())]} in at most "
            f"{moving * step:.4g} s, and friction, {friction:g}, "
            f"moves it by at most {apart(furthest, way.max())} m from rest to rest",
            "allow more knots, a longer interval_max or more friction",
        )


def leap(task: Task) -> Iterator[Symptom]:
    """Without jets, what is above the legs' reach has to be reached ballistically: fast enough, and with time to fall.

    To rise by Δ takes a lift-off at √(2 g Δ) and, with the way down, 2 √(2 Δ / g).
    """
    scenario, robot = task.scenario, task.robot
    if robot.jets or task.hovers or not isinstance(scenario.surface, FlatGround):
        return
    heights = {"mid_height_min": scenario.mid_height_min}
    if scenario.terminal is Terminal.FREE and scenario.final_com is not None:
        heights["the height of final_com"] = scenario.end_com[2]
    gravity = robot.weight / robot.mass
    for label, height in heights.items():
        # A contact point keeps its share of the weight up to a height of complementarity_max over that share.
        loose = scenario.contact_bounds(robot)[0] * len(robot.contacts) / robot.weight
        rise = (height or 0.0) - scenario.surface.height - robot.contact_reach[2] - loose
        if height is None or rise <= 0:
            continue
        lift_off, climb = math.sqrt(2 * gravity * rise), math.sqrt(2 * rise / gravity)
        found = f"{label}, {height:g} m, is {rise:.3g} m above where feet on the ground let the CoM be; a jump there"
        if task.stands_at_end and 2 * climb > task.longest:
            yield error(
                "leap",
                f"{found} and back takes {2 * climb:.2g} s, and the horizon is at most {task.longest:.3g} s long",
                "allow more knots or a longer interval_max",
            )
        elif lift_off > scenario.base_speed_max:
            certain = rise - _LIMBS * robot.contact_reach[2] > scenario.base_speed_max * climb
            yield (error if certain else warning)(
                "leap",
                f"{found} without jets lifts off at {lift_off:.2g} m/s, and base_speed_max is "
                f"{scenario.base_speed_max:g} m/s",
                "ask for less height, allow more base_speed_max, or turn the jets on",
            )
