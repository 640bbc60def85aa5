"""Another motion of the same robot in the same scene, faint: a plan behind what a simulation made of it."""

from __future__ import annotations

import numpy as np

from multimodal_to.models.robot import Robot
from multimodal_to.replay.bodies import draw_links, draw_visuals, drawn, faded, link_paths, link_poses
from multimodal_to.replay.scene import Scene, shapes
from multimodal_to.replay.visuals import Appearance
from multimodal_to.trajectory import Trajectory
from multimodal_to.trajectory.resampling import resample
from multimodal_to.trajectory.sameness import refuse_other_robot

GHOST_OPACITY = 0.35
GHOST_COLOUR = 0x7A3FB5


def in_step(trajectory: Trajectory, ghost: Trajectory) -> Trajectory:
    """Return a ghost at the knots of the motion that it goes with, both from their start; it waits at its ends.

    Raises:
        InputError: the ghost is not one of the same robot.
    """
    refuse_other_robot(ghost, trajectory, what="the motion to show with it", of=("joints",))
    times = ghost.time[0] + trajectory.time - trajectory.time[0]
    return resample(ghost, np.clip(times, ghost.time[0], ghost.time[-1]))


def draw_ghost(scene: Scene, robot: Robot, ghost: Trajectory, look: Appearance) -> None:
    """Draw the robot faint as it moves in the ghost, which is in step, and the way of its CoM.

    Args:
        scene: where to draw.
        robot: that moves.
        ghost: its other motion, at the knots of the scene, from `in_step`.
        look: the robot's visuals.
    """
    paths = link_paths(robot, look, "ghost/robot")
    draw_links(scene, paths, link_poses(robot, ghost, paths))
    draw_visuals(scene, paths, faded({visual: drawn(visual) for visual in look.visuals}, GHOST_OPACITY))
    way = shapes.Line(shapes.PointsGeometry(ghost.com_position), shapes.LineBasicMaterial(color=GHOST_COLOUR))
    scene.add("ghost/com_trace", way, None, np.eye(4))
