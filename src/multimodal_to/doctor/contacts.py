"""Whether contacts that are given contradict each other, the start and the end, or the time that there is."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from multimodal_to.doctor.balance import residual
from multimodal_to.doctor.diagnosis import Symptom, error, warning
from multimodal_to.doctor.task import Task
from multimodal_to.errors import ScenarioError, apart, listed
from multimodal_to.models.contact import DESCENT_RATE
from multimodal_to.ocp import margins
from multimodal_to.ocp.schedule import Flags, Schedule, runs

_NAME = "contacts"


def contacts(task: Task) -> Iterator[Symptom]:
    """Look for feet that cannot do what is given of them."""
    if not (task.scenario.contacts or task.scenario.gait):
        return
    try:
        schedule = Schedule.of(task.robot, task.scenario, task.formulation.rule.name)
    except ScenarioError as cause:
        yield error(_NAME, str(cause), "change the stretches of `contacts`, or the `gait`")
        return
    yield from _start(task, schedule)
    yield from _end(task, schedule)
    yield from _on_the_way(task, schedule)
    yield from _flights(task, schedule)
    yield from _swings(task, schedule)


def _start(task: Task, schedule: Schedule) -> Iterator[Symptom]:
    """Ask whether the feet that are not off hold the posture in which the motion starts."""
    off = schedule.unloaded[:, 0]
    if task.start_posture is None or not off.any():
        return
    left = residual(task, task.start_posture, feet=~off, thrusts=np.zeros(len(task.robot.jets)))
    if not left.nothing:
        yield error(
            _NAME,
            f"the motion starts standing, and {_said(task, off)} off at the start; the others leave {left} over",
            "let the stretch begin later, or start in a hover",
        )


def _end(task: Task, schedule: Schedule) -> Iterator[Symptom]:
    off = schedule.unloaded[:, -1]
    if task.stands_at_end and off.all():
        yield error(_NAME, "the motion ends standing, and all feet are off at the end", "let a foot be on at the end")
    if "end" in task.hovers and (on := schedule.on[:, -1]).any():
        yield warning(
            _NAME,
            f"the motion ends in a hover, and {_said(task, on)} on at the end: on the ground, without any force",
            "let the stretch end before, or end standing",
        )


def _on_the_way(task: Task, schedule: Schedule) -> Iterator[Symptom]:
    """Compare keyframes between the ends that hover or stand with the contacts that are given at their knots."""
    for one in task.scenario.keyframes_between():
        if one.keyframe.hover and (on := schedule.stands[:, one.knot]).any():
            yield warning(
                _NAME,
                f"{one.label} hovers at knot {one.knot}, and {_said(task, on)} on there, where no force may act",
                "let the stretch end before the keyframe, or ask for standing",
            )
        if one.keyframe.standing and schedule.in_air[one.knot] and not task.lifts:
            yield error(
                _NAME,
                f"{one.label} stands at knot {one.knot}, all feet are off there, and nothing else carries the weight",
                "let a foot be on there, or place the keyframe elsewhere",
            )


def _flights(task: Task, schedule: Schedule) -> Iterator[Symptom]:
    """Without jets a flight of the time T takes off at g T / 2, less what it lands lower, Δ, over T."""
    if task.lifts:
        return
    robot, scenario = task.robot, task.scenario
    gravity, (fastest, _) = robot.weight / robot.mass, scenario.base_speeds(robot)
    for first, last in runs(schedule.in_air):
        intervals = last - first + (1 if first and last < scenario.knots else 0.5)
        time = intervals * scenario.interval_min
        if not task.stands_at_end and last == scenario.knots:
            continue  # it may fall
        speed = 0.5 * gravity * time
        found = (
            f"all feet are off from knot {first} to {last}, at least {time:.3g} s, and the jets do not carry the "
            f"weight: the CoM has to take off at {apart(speed, fastest)} m/s to be back at its height, "
            f"and base_speed_max is {fastest:.3g} m/s"
        )
        if speed > fastest:
            lower = 2.0 * robot.contact_reach[2] / time
            yield (error if speed - lower > fastest else warning)(
                _NAME, found, "let the feet be off for a shorter time, or allow more base_speed_max"
            )


def _swings(task: Task, schedule: Schedule) -> Iterator[Symptom]:
    """Compare a clearance with the height from which a foot can come down in time, as `touch_down` lets it."""
    robot, scenario = task.robot, task.scenario
    if not task.held(margins.TOUCH_DOWN) or not scenario.margins.touch_down_speed:
        return
    step = scenario.interval_max
    way = scenario.margins.touch_down_speed * robot.units.of("m/s") * step
    gain = 1.0 + DESCENT_RATE * robot.units.frequency * step
    for point, knot in np.argwhere(schedule.clearance > 0.0):
        down = next((k for k in range(knot, scenario.knots + 1) if schedule.stands[point, k]), None)
        if down is None:
            continue
        highest = way * (gain ** (down - knot) - 1.0) / (gain - 1.0)
        asked = schedule.clearance[point, knot]
        if asked > highest:
            yield error(
                _NAME,
                f"{robot.contact_names[point]} has to be {asked:g} m high at knot {knot} and to stand at knot {down}; "
                f"margins.touch_down_speed, {scenario.margins.touch_down_speed:g}, lets it come down from "
                f"{apart(highest, asked)} m at most",
                "ask for less clearance, a longer swing, or a greater touch_down_speed",
            )
            return


def _said(task: Task, points: Flags) -> str:
    names = dict.fromkeys(task.robot.contacts[index].foot for index in np.flatnonzero(points))
    return f"{listed(list(names))} {'is' if len(names) == 1 else 'are'}"
