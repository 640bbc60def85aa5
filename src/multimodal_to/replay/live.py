"""A live viewer: meshcat's own server and page."""

from __future__ import annotations

import io
from contextlib import redirect_stdout

from multimodal_to.models.robot import Robot
from multimodal_to.replay.motion import draw_motion
from multimodal_to.replay.scene import meshcat
from multimodal_to.replay.visuals import appearance
from multimodal_to.trajectory import Trajectory


def show(
    robot: Robot, trajectory: Trajectory, *, ghost: Trajectory | None = None, meshes: bool = True
) -> meshcat.Visualizer:
    """Start meshcat's server, draw the motion there and return the visualizer; a browser at its `url()` plays it.

    Args:
        robot: that moves.
        trajectory: its motion.
        ghost: another motion of the same robot, drawn faint in the same scene; it begins when this one does.
        meshes: draw meshes where the robot has them; else boxes, cylinders and spheres alone.

    Raises:
        InputError: the ghost is not one of the same robot.
    """
    look = appearance(robot.urdf, meshes=meshes)
    with redirect_stdout(io.StringIO()):  # meshcat prints the address
        visualizer = meshcat.Visualizer()
    draw_motion(visualizer, robot, trajectory, look, ghost=ghost, live=True)
    return visualizer
