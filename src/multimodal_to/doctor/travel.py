"""Whether there is time for the way, given how fast the base moves, how hard feet push and how things fall."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from multimodal_to.doctor.diagnosis import Symptom, error, warning
from multimodal_to.doctor.task import Task, narrowed
from multimodal_to.errors import apart
from multimodal_to.models.terrain import FlatGround
from multimodal_to.scenarios.keyframes import AXES, Placed
from multimodal_to.scenarios.scenario import Terminal

_ROUNDING = 1e-9
_FEWEST = 4
"""Intervals below which a flight is followed badly [1]."""
_LIMBS = 0.25
"""How far limbs may carry the CoM beside the base, whose speed alone is limited, as a share of the legs' reach [1]."""


def speed(task: Task) -> Iterator[Symptom]:
    """Compare the stretches that the CoM has to travel with the greatest base speed and the longest time."""
    scenario = task.scenario
    fastest, _ = scenario.base_speeds(task.robot)

    def furthest(first: int, last: int) -> float:
        return task.furthest("base_linear_velocity", 0, fastest, (first, last))

    start, end = np.array(scenario.start_com), np.array(scenario.end_com)
    stretches = [("from start to end", float(np.abs(end - start).max()), 0, task.moving_intervals)]
    if scenario.mid_height_min is not None:
        middle = scenario.knots // 2
        stretches += [
            ("up to mid_height_min", scenario.mid_height_min - start[2], 0, middle),
            ("down from mid_height_min", scenario.mid_height_min - end[2], middle, task.moving_intervals),
        ]
    stretches += _between_keyframes(task, "CoM")
    label, distance, first, last = max(stretches, key=lambda stretch: stretch[1] - furthest(*stretch[2:]))
    most, intervals = furthest(first, last), last - first
    if distance <= most:
        return
    usual = scenario.interval_max * fastest
    certain = distance - _LIMBS * task.robot.contact_reach[2] > most + usual or intervals <= 0
    yield (error if certain else warning)(
        "time for the distance",
        f"the CoM has to go {apart(distance, most)} m {label} in at most "
        f"{intervals * scenario.interval_max:.4g} s ({intervals} intervals in which it can move), and "
        f"base_speed_max is {fastest:.3g} m/s{narrowed(most, intervals * usual)}",
        "allow more knots, a longer interval_max or more speed",
    )


def _between_keyframes(task: Task, what: str) -> list[tuple[str, float, int, int]]:
    """Return each stretch that something has to go along an axis between keyframes: label, way [m], first, last knot.

    Between these knots it can move.

    Args:
        task: robot and scenario.
        what: goes there, as `Keyframe.limits` calls it, without its axis.
    """
    stretches = []
    for axis in AXES:
        known: tuple[str, int, float, float] | None = None
        for one, low, high in _held(task, f"{what} {axis} [m]"):
            if one.label == "middle":
                continue
            if known is not None and one.knot > known[1] and {one.label, known[0]} != {"start", "end"}:
                first = known[1] + (known[0] == "start" and task.rests_first)
                last = task.moving_intervals if one.label == "end" else one.knot
                way = max(low - known[3], known[2] - high, 0.0)
                stretches.append((f"along {axis} from {known[0]} to {one.label}", way, first, last))
            known = one.label, one.knot, low, high
    return stretches


def _held(task: Task, what: str) -> Iterator[tuple[Placed, float, float]]:
    """Yield the keyframes that hold a quantity within a range, by knot, with its least and its greatest value.

    Args:
        task: robot and scenario.
        what: is held, as `Keyframe.limits` calls it.
    """
    for one in sorted(task.scenario.placed(), key=lambda some: some.knot):
        asked = [limits[1:] for limits in one.keyframe.limits() if limits[0] == what]
        if one.keyframe.weight is None and asked:
            yield one, max(least for least, _ in asked), min(most for _, most in asked)


def base_way(task: Task) -> Iterator[Symptom]:
    """Compare the ways of the base between keyframes that place it with its greatest speed."""
    fastest, _ = task.scenario.base_speeds(task.robot)
    for label, way, first, last in _between_keyframes(task, "base position"):
        most = task.furthest("base_linear_velocity", 0, fastest, (first, last))
        if way > most + _ROUNDING:
            time = (last - first) * task.scenario.interval_max
            yield error(
                "time for the distance",
                f"the base has to go {apart(way, most)} m {label} in at most "
                f"{time:.4g} s, and base_speed_max is {fastest:.3g} m/s{narrowed(most, time * fastest)}",
                "allow more knots, a longer interval_max or more speed",
            )


def momenta(task: Task) -> Iterator[Symptom]:
    """Compare momenta with the greatest speed, and a momentum that is lost on the way with what gravity takes.

    Nothing but gravity pushes down where there are no jets and no known pushes: m g T in the time T.
    """
    scenario, robot = task.scenario, task.robot
    fastest, _ = scenario.base_speeds(robot)
    for one in task.held_in_order:
        for what, least, most in one.keyframe.limits():
            if what.startswith("linear momentum") and (speed := max(abs(least), abs(most)) / robot.mass) > fastest:
                yield warning(
                    one.label,
                    f"{what.removesuffix(' [kg m/s]')} asks the CoM to go at {apart(speed, fastest)} m/s, and "
                    f"base_speed_max is {fastest:.3g} m/s",
                    "ask for less, or allow more base_speed_max",
                )
    if not (robot.jets or scenario.pushes):
        yield from _lost(task)


def _lost(task: Task) -> Iterator[Symptom]:
    """Compare what is lost of the momentum upwards between two keyframes with what gravity takes in the time."""
    before: tuple[str, int, float] | None = None
    for one, low, high in _held(task, "linear momentum z [kg m/s]"):
        if before is not None:
            label, knot, there = before
            taken = task.robot.weight * (one.knot - knot + 1) * task.scenario.interval_max
            if there - high > taken:
                yield error(
                    one.label,
                    f"the momentum upwards has to fall by {apart(there - high, taken)} kg m/s from {label}, and "
                    f"gravity takes at most {apart(taken, there - high)} kg m/s in the time",
                    "ask for it at a later knot, or allow a longer interval_max",
                )
        before = one.label, one.knot, low


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
    # A contact point keeps its share of the weight up to a height of complementarity_max over that share.
    loose = scenario.contact_bounds(robot)[0] * len(robot.contacts) / robot.weight
    for label, height, knot in _heights(task):
        rise = height - scenario.surface.height - robot.contact_reach[2] - loose
        if rise > 0:
            yield from _leap(task, label, rise, knot)


def _heights(task: Task) -> Iterator[tuple[str, float, int]]:
    """Return the heights that the CoM has to reach: what asks for it, z [m], and at which knot."""
    scenario = task.scenario
    if scenario.mid_height_min is not None:
        yield f"mid_height_min, {scenario.mid_height_min:g} m,", scenario.mid_height_min, scenario.knots // 2
    if scenario.terminal is Terminal.FREE and scenario.says_end_com:
        yield f"the height of final_com, {scenario.end_com[2]:g} m,", scenario.end_com[2], scenario.knots
    for one in scenario.own_keyframes():
        for what, least, _ in one.keyframe.limits() if one.keyframe.weight is None else ():
            if what == "CoM z [m]" and math.isfinite(least):
                yield f"the CoM of {one.label}, {least:g} m,", least, one.knot


def _leap(task: Task, label: str, rise: float, knot: int) -> Iterator[Symptom]:
    """Compare a jump with the time that there is, the speed that is allowed and the length of an interval.

    Args:
        task: robot and scenario.
        label: what asks for it.
        rise: how far above the legs' reach [m].
        knot: at which.
    """
    scenario, gravity = task.scenario, task.robot.weight / task.robot.mass
    fastest, _ = scenario.base_speeds(task.robot)
    lift_off, climb = math.sqrt(2 * gravity * rise), math.sqrt(2 * rise / gravity)
    found = f"{label} is {rise:.3g} m above where feet on the ground let the CoM be; a jump there"
    before, after = (count * scenario.interval_max for count in (knot, scenario.knots - knot))
    if task.stands_at_end and 2 * climb > task.longest:
        yield error(
            "leap",
            f"{found} and back takes {2 * climb:.2g} s, and the horizon is at most {task.longest:.3g} s long",
            "allow more knots or a longer interval_max",
        )
    elif (task.stands_at_start and before < climb) or (task.stands_at_end and after < climb):
        yield error(
            "leap",
            f"{found} takes {climb:.2g} s up and as long down, and knot {knot} is at most {before:.3g} s after the "
            f"start and {after:.3g} s before the end",
            "allow more knots or a longer interval_max, or ask for it at another knot",
        )
    elif lift_off > fastest:
        certain = rise - _LIMBS * task.robot.contact_reach[2] > fastest * climb
        yield (error if certain else warning)(
            "leap",
            f"{found} without jets lifts off at {lift_off:.2g} m/s, and base_speed_max is {fastest:.3g} m/s",
            "ask for less height, allow more base_speed_max, or turn the jets on",
        )
    elif 2 * climb < _FEWEST * scenario.interval_min:
        yield warning(
            "leap",
            f"{found} and back takes {2 * climb:.2g} s, less than {_FEWEST} intervals of {scenario.interval_min:g} s",
            "take shorter intervals: so few of them do not follow a flight",
        )
