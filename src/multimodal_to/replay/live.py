"""A live viewer: meshcat's own server and page."""

from __future__ import annotations

import io
from contextlib import redirect_stdout

from multimodal_to.models.robot import Robot
from multimodal_to.replay.motion import draw_motion
from multimodal_to.replay.scene import meshcat
from multimodal_to.replay.visuals import appearance
from multimodal_to.trajectory import Trajectory


def show(robot: Robot, trajectory: Trajectory, *, meshes: bool = True) -> meshcat.Visualizer:
    """Start meshcat's server, draw the motion there and return the visualizer; a browser at its `url()` plays it."""
    look = appearance(robot.urdf, meshes=meshes)
    with redirect_stdout(io.StringIO()):  # meshcat prints the address
        visualizer = meshcat.Visualizer()
    draw_motion(visualizer, robot, trajectory, look, follow_here=True)
    return visualizer
