"""What of a robot keeps away from things in the world: points, or capsules of its links."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from multimodal_to.errors import ModelError
from multimodal_to.models.capsule import Capsule
from multimodal_to.models.robot import Robot

POINT = 1e-9
"""Radius of a point [m]."""


def bodies_of(robot: Robot, frames: Sequence[str]) -> tuple[Capsule, ...]:
    """Return the origins of frames as capsules without size; without frames, the capsules of the robot's links.

    Raises:
        ModelError: there is no such frame, or the robot has no capsules.
    """
    for name in frames:
        robot.kindyn.tree.frame(name)
    if frames:
        origin = np.zeros(3)
        return tuple(Capsule(name=name, frame=name, start=origin, end=origin, radius=POINT) for name in frames)
    if not robot.link_capsules:
        raise ModelError(
            f"{robot.name} has no capsules that could keep away from anything; expected some in its robot.toml, or the "
            "names of frames"
        )
    return robot.link_capsules
