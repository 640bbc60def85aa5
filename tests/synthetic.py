"""A take-off made by hand, not by a solver: for tests of what draws or judges a trajectory."""

from __future__ import annotations

import numpy as np

from multimodal_to.models.robot import Robot
from multimodal_to.trajectory import QUANTITIES, Trajectory
from multimodal_to.trajectory.derived import frame_poses

DURATION = 2.0  # [s]
KNOTS = 20
LIFT_OFF = 1.0  # from here on no contact force [s]


def take_off(robot: Robot) -> Trajectory:
    """Return a motion in which the contact forces hand the weight over to the thrusts, and the base then rises.

    Before `LIFT_OFF` the base stands and thrust grows from zero; after it the base rises, turns about the vertical
    and all joints move. Contact points are those of the moving feet.
    """
    time = np.linspace(0.0, DURATION, KNOTS + 1)
    bodies = {"robot": 1, "joint": len(robot.joint_names), "contact": len(robot.contact_names), "jet": len(robot.jets)}
    arrays = {name: np.zeros((quantity.rows * bodies[quantity.of], time.size)) for name, quantity in QUANTITIES.items()}

    handed_over, flown = np.clip(time / LIFT_OFF, 0.0, 1.0), np.clip(time - LIFT_OFF, 0.0, None)
    yaw = 0.6 * flown
    arrays["base_position"][2] = 0.63 + 0.3 * flown**2
    arrays["base_quaternion_xyzw"][2:] = np.sin(yaw / 2), np.cos(yaw / 2)
    arrays["joint_positions"][:] = 0.3 + 0.2 * np.sin(3.0 * flown)
    arrays["com_position"][:] = arrays["base_position"] + [[-0.02], [0.0], [0.06]]
    arrays["thrust"][:] = handed_over * np.array([0.6 * jet.thrust_max for jet in robot.jets]).reshape(-1, 1)
    arrays["throttle"][:] = 60.0 * handed_over
    forces = arrays["contact_forces"].reshape(len(robot.contact_names), 3, -1)
    forces[:, 0] = 0.2 * robot.weight / len(forces) * (1.0 - handed_over)
    forces[:, 2] = robot.weight / len(forces) * (1.0 - handed_over)

    def trajectory() -> Trajectory:
        return Trajectory(
            robot=robot.name,
            scenario="take-off & hover",
            time=time,
            joint_names=robot.joint_names,
            contact_names=robot.contact_names,
            jet_names=robot.jet_names,
            **arrays,
        )

    feet = [frame_poses(robot, trajectory(), name)[:, :3, 3].T for name in robot.contact_names]
    arrays["contact_positions"] = np.concatenate(feet)
    return trajectory()
