"""A replay inside a notebook."""

from __future__ import annotations

import html
from dataclasses import dataclass, field

from multimodal_to.arguments import checked
from multimodal_to.errors import InputError
from multimodal_to.models.robot import Robot
from multimodal_to.replay.page import page
from multimodal_to.trajectory import Trajectory
from multimodal_to.trajectory.conditions import robot_of


@dataclass(frozen=True, kw_only=True)
class Embedded:
    """A page in a frame of its own, which notebooks show where it is the value of a cell.

    Raises:
        InputError: the height is not positive.
    """

    page: str = field(repr=False)
    height: int = 520  # [pixel]

    def __post_init__(self) -> None:
        if not self.height > 0:
            raise InputError(f"the height of the frame is {self.height}; expected a positive number of pixels")

    def _repr_html_(self) -> str:
        """Return the frame as HTML; it holds the whole page and fetches nothing."""
        style = f"width: 100%; height: {self.height}px; border: 0"
        return f'<iframe title="replay" style="{style}" srcdoc="{html.escape(self.page)}"></iframe>'


@checked
def show(robot: Robot | None, trajectory: Trajectory, *, meshes: bool = True, height: int = 520) -> Embedded:
    """Return the replay as a notebook shows it where it is the value of a cell, in a frame of its own.

    It fetches nothing, and has 3 MB at most for the bundled robots.

    Args:
        robot: that moves; None: the bundled one that the trajectory names.
        trajectory: its motion.
        meshes: draw meshes where the robot has them; else boxes, cylinders and spheres alone.
        height: of the frame [pixel].

    Raises:
        InputError: the height is not positive, or the trajectory is for another robot.
        TrajectoryError: there is no robot, and the trajectory names none that is bundled.
    """
    found = robot_of(trajectory) if robot is None else robot
    return Embedded(page=page(found, trajectory, meshes=meshes), height=height)
