"""Whether limits over stretches are of what the robot has, and leave the jets enough to hover."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from multimodal_to.doctor.diagnosis import Symptom, error
from multimodal_to.doctor.task import Task
from multimodal_to.errors import ScenarioError
from multimodal_to.scenarios.limits import limited

_NAME = "limits"


def limits(task: Task) -> Iterator[Symptom]:
    """Look for names that the robot has not, and compare the thrusts that are left with the weight in every hover.

    Speeds are compared with what they have to do where that is: the way of the CoM, turns, and joints.
    """
    robot, scenario = task.robot, task.scenario
    try:
        limited(scenario.limits, robot, scenario.knots)
    except ScenarioError as cause:
        yield error(_NAME, str(cause), "name what the robot has")
        return
    if not scenario.limits or not task.lifts:
        return
    for one in scenario.placed():
        if not one.keyframe.hover or one.keyframe.weight is not None:
            continue
        most = [task.greatest("thrust", row, held)[one.knot] for row, held in enumerate(task.thrusts_held)]
        if (held := float(np.sum(most))) < robot.weight:
            yield error(
                _NAME,
                f"{one.label} hovers at knot {one.knot}, the robot weighs {robot.weight:.0f} N, and the limits let its "
                f"jets hold at most {held:.0f} N there",
                "let the limits begin later or end earlier, or allow more thrust",
            )
