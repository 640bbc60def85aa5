"""A plan at every step of a simulation, linear between its knots; after its end it stands still there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from multimodal_to.derived import base_poses, generalised_forces
from multimodal_to.models.robot import Robot
from multimodal_to.resampling import resample
from multimodal_to.trajectory import Array, Trajectory


@dataclass(frozen=True, kw_only=True, eq=False)
class Reference:
    """A plan on a grid of times since its start, a row for each; vectors in world axes."""

    com: Array  # x [m], (steps, 3)
    com_velocity: Array  # ẋ [m/s], (steps, 3)
    angular_momentum: Array  # hω [kg m²/s], (steps, 3)
    rotation: Array  # of the base, (steps, 3, 3)
    joints: Array  # s [rad or m], (steps, n)
    joint_velocities: Array  # ṡ, (steps, n)
    torques: Array  # by RNEA [N m], (steps, n)
    contact_forces: Array  # f [N], (steps, contacts, 3)
    thrust: Array  # T [N], (steps, jets)
    thrust_rate: Array  # Ṫ [N/s], (steps, jets)
    throttle: Array  # u [%], (steps, jets)


def reference(robot: Robot, plan: Trajectory, times: Array) -> Reference:
    """Return a plan at times since its start [s].

    Backward Euler holds the velocity of knot k over the interval that ends there, so velocities are read half an
    interval later than positions; its throttle is held as well.
    """
    knots = plan.time - plan.time[0]
    half = plan.duration / plan.knots / 2.0
    moving = (times <= plan.duration).astype(float)[:, None]

    def at(values: Array, delay: float = 0.0) -> Array:
        rows = [np.interp(times + delay, knots, row) for row in values]
        return np.array(rows).reshape(len(values), times.size).T

    inside = np.minimum(times[times <= plan.duration] + plan.time[0], plan.time[-1])
    rotations = base_poses(resample(plan, inside))[:, :3, :3]
    torques = generalised_forces(robot, plan)[6:]
    torques[:, 0] = torques[:, 1]  # a trajectory doesn't tell the accelerations of its first knot
    held = np.minimum(np.searchsorted(knots, times - 1e-9), plan.knots)
    return Reference(
        com=at(plan.com_position),
        com_velocity=at(plan.com_velocity, half) * moving,
        angular_momentum=at(plan.angular_momentum, half) * moving,
        rotation=np.concatenate([rotations, np.repeat(rotations[-1:], times.size - len(rotations), axis=0)]),
        joints=at(plan.joint_positions),
        joint_velocities=at(plan.joint_velocities, half) * moving,
        torques=at(torques),
        contact_forces=at(plan.contact_forces).reshape(times.size, -1, 3),
        thrust=at(plan.thrust),
        thrust_rate=at(plan.thrust_rate) * moving,
        throttle=plan.throttle[:, held].T,
    )
