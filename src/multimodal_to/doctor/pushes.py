"""Whether a known push can be borne."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from multimodal_to.doctor.diagnosis import Symptom, error, warning
from multimodal_to.doctor.task import Task
from multimodal_to.errors import ModelError

_NAME = "pushes"


def pushes(task: Task) -> Iterator[Symptom]:
    """Look for pushes on frames that are not there, and compare them with friction and thrust."""
    robot, scenario = task.robot, task.scenario
    for push in scenario.pushes:
        try:
            robot.kindyn.tree.frame(push.of)
        except ModelError as cause:
            yield error(_NAME, str(cause), "name a link or frame of the robot")
            continue
        force = np.array(push.force)
        up = float(force @ robot.up)
        along = float(np.linalg.norm(force - up * robot.up))
        held = float(task.thrusts_held.sum())
        bears = max(task.parameters.friction * (robot.weight - up), 0.0) + held
        if along > bears:
            yield warning(
                _NAME,
                f"{along:.3g} N along the ground push '{push.of}', and friction and thrusts bear at most {bears:.3g} N "
                "where the robot stays: it will be carried away meanwhile",
                "push less or for a shorter time, allow more friction, or expect it to move",
            )
