"""A plan at every step of a simulation; after its end it stands still there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from multimodal_to.adam.spatial import Array
from multimodal_to.models.robot import Robot
from multimodal_to.trajectory import Trajectory, rules
from multimodal_to.trajectory.derived import acting_times, base_poses, joint_torques, without_acceleration
from multimodal_to.trajectory.resampling import resample


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

    @classmethod
    def joined(cls, parts: Sequence[Reference]) -> Reference:
        """Return references that follow one another as one."""
        return cls(
            **{entry.name: np.concatenate([getattr(part, entry.name) for part in parts]) for entry in fields(cls)}
        )


def reference(robot: Robot, plan: Trajectory, times: Array, delay: float = 0.0) -> Reference:
    """Return a plan at times since its start [s].

    Under leapfrog contact forces and throttles are constant from half an interval before their knot to half an interval
    after it, as the plan means them. Torques are linear between knots: those that jump shake the joints, and in a jump
    they ask a sixth more of the motors. Where contact forces and thrust rates belong to intervals, they are read in the
    middles of these, as velocities are, and linear between them.

    Backward Euler holds the velocity of knot k over the interval that ends there, so velocities are read half an
    interval later than positions; its throttle is held as well. So the velocity changes from that of knot k to that of
    k + 1 about t_k, when it is the forces of knot k + 1 that change it: with a `delay` of one interval the whole motion
    is read that much earlier than thrusts, contact forces and torques, and accelerates when they act.

    Args:
        robot: that moves.
        plan: its motion.
        times: since the plan's start [s], (steps,).
        delay: of the motion after its forces, in intervals of the plan.
    """
    knots = plan.time - plan.time[0]
    interval = plan.duration / plan.knots
    own = times - delay * interval  # of the motion
    moving = ((own >= 0.0) & (own <= plan.duration)).astype(float)[:, None]
    spooling = (times <= plan.duration).astype(float)[:, None]

    def at(values: Array, when: Array) -> Array:
        rows = [np.interp(when, knots, row) for row in values]
        return np.array(rows).reshape(len(values), times.size).T

    def rate(values: Array) -> Array:
        return np.asarray(at(values, own + interval / 2.0) * moving)

    def acting(name: str) -> Array:
        return at(getattr(plan, name), times + rules.instant(plan.rule, name) * interval)

    torques = joint_torques(robot, plan)
    if without_acceleration(plan) == 0:
        torques[:, 0] = torques[:, 1]  # such a trajectory doesn't tell the accelerations of its first knot
    held = np.minimum(np.searchsorted(acting_times(plan)[1] - plan.time[0], times - 1e-9), plan.knots)
    forces = plan.contact_forces[:, held].T if rules.acts_after(plan.rule) else acting("contact_forces")
    return Reference(
        com=at(plan.com_position, own),
        com_velocity=rate(plan.com_velocity),
        angular_momentum=rate(plan.angular_momentum),
        rotation=_rotations(plan, own),
        joints=at(plan.joint_positions, own),
        joint_velocities=rate(plan.joint_velocities),
        torques=at(torques, times),
        contact_forces=forces.reshape(times.size, -1, 3),
        thrust=at(plan.thrust, times),
        thrust_rate=acting("thrust_rate") * spooling,
        throttle=plan.throttle[:, held].T,
    )


def _rotations(plan: Trajectory, times: Array) -> Array:
    """Return the base's rotation at times since the start, that of start and end before and after, (steps, 3, 3)."""
    wanted = np.clip(plan.time[0] + times, plan.time[0], plan.time[-1])
    distinct = np.unique([*wanted, plan.time[0], plan.time[-1]])
    return np.asarray(base_poses(resample(plan, distinct))[np.searchsorted(distinct, wanted), :3, :3])
