"""Whether the jets can carry the weight, and whether they are there in time."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from multimodal_to.doctor.diagnosis import Symptom, error, note, warning
from multimodal_to.doctor.task import Task
from multimodal_to.errors import ScenarioError
from multimodal_to.models.turbines import greatest_held, spool_up
from multimodal_to.scenarios.failures import failing_knots

_HURRY = 0.8
"""Share of the longest horizon beyond which spooling up leaves little time to move [1]."""
_PATIENCE = 60.0
"""How long jets are watched to say how long they would need [s]."""


def weight(task: Task) -> Iterator[Symptom]:
    """Compare the weight with the thrust that the jets hold, where the robot has to hover."""
    if not task.hovers:
        return
    robot, when = task.robot, " and ".join(task.hovers)
    if not robot.jets:
        why = f"{robot.name} has none" if task.scenario.jets else "the scenario leaves them off (jets = false)"
        yield error(
            "thrust",
            f"the robot has to hover at the {when} without jets: {why}",
            "give it jets, or another start or terminal",
        )
    elif not task.lifts:
        yield error(
            "thrust",
            f"the robot has to hover at the {when}, but it weighs {robot.weight:.0f} N ({robot.mass:.1f} kg) and "
            f"{_count(task)} together hold at most {task.thrusts_held.sum():.0f} N",
            "take a lighter robot or stronger jets, or a start and terminal on the ground",
        )


def failures(task: Task) -> Iterator[Symptom]:
    """Look for jets that fail and are not there, and for a hover at the end that the others cannot hold."""
    robot, scenario = task.robot, task.scenario
    try:
        failing = failing_knots(scenario.failures, robot.jet_names, scenario.knots)
    except ScenarioError as cause:
        yield error("failures", str(cause), "name a jet that the scenario uses")
        return
    held = sum(greatest_held(jet) for row, jet in enumerate(robot.jets) if row not in failing)
    if failing and "end" in task.hovers and task.lifts and held < robot.weight:
        yield error(
            "failures",
            f"the motion ends in a hover, the robot weighs {robot.weight:.0f} N, and the jets that have not failed by "
            f"then hold at most {held:.0f} N",
            "end on the ground, or let fewer jets fail",
        )


def _count(task: Task) -> str:
    count = len(task.robot.jets)
    return (
        f"its {count} jets" if not task.lost else f"the jets that have not failed, {count - len(task.lost)} of {count},"
    )


def spool_up_time(task: Task) -> Iterator[Symptom]:
    """Compare the time that idle jets need to carry the weight with the horizon's longest duration."""
    robot, scenario, knots = task.robot, task.scenario, task.first_hover
    if not (task.stands_at_start and knots and task.lifts):
        return
    step, longest = scenario.interval_max, knots * scenario.interval_max
    count = max(scenario.knots, int(_PATIENCE / step))
    times = np.linspace(step, count * step, count)
    enough = np.flatnonzero(
        spool_up([jet for row, jet in enumerate(robot.jets) if row not in task.lost], times).sum(axis=0) >= robot.weight
    )
    needed = times[enough[0]] if enough.size else np.inf
    reached = f"the jets need {needed:.1f} s" if enough.size else f"the jets need more than {times[-1]:.0f} s"
    horizon = "the horizon" if knots == scenario.knots else f"the time until the hover at knot {knots}"
    found = f"{reached} at full throttle from idle until they carry {robot.weight:.0f} N, and {horizon} is"
    have = f"{knots} intervals of up to {step:g} s"
    if needed > longest + 1e-9:
        least = f"knots = {int(np.ceil(needed / step))} or " if enough.size else "more knots or "
        least = least if knots == scenario.knots else "a later hover or "
        yield error("spool-up", f"{found} at most {longest:.3g} s long ({have})", f"allow {least}a longer interval_max")
    elif needed > _HURRY * longest:
        yield warning(
            "spool-up",
            f"{found} at most {longest:.3g} s long ({have}), which leaves little",
            "allow more knots or a longer interval_max",
        )
    else:
        yield note("spool-up", f"{found} up to {longest:.3g} s long")
