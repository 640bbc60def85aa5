"""A plan at every step of a simulation; after its end it stands still there.

Positions are cubic between knots: they pass through the knots with the mean velocity of the two intervals around each.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from multimodal_to.adam.spatial import Array
from multimodal_to.models.robot import Robot
from multimodal_to.trajectory import Trajectory, rules
from multimodal_to.trajectory.derived import acting_times, base_poses, joint_torques, without_acceleration


@dataclass(frozen=True, kw_only=True, eq=False)
class Reference:
    """A plan on a grid of times since its start, a row for each; vectors in world axes."""

    com: Array  # x [m], (steps, 3)
    com_velocity: Array  # ẋ [m/s], (steps, 3)
    com_acceleration: Array  # ẍ [m/s²], (steps, 3)
    angular_momentum: Array  # hω [kg m²/s], (steps, 3)
    angular_momentum_rate: Array  # ḣω [N m], (steps, 3)
    base_position: Array  # p [m], (steps, 3)
    rotation: Array  # of the base, (steps, 3, 3)
    base_velocity: Array  # (ṗ, ω) [m/s, rad/s], (steps, 6)
    base_acceleration: Array  # (p̈, ω̇) [m/s², rad/s²], (steps, 6)
    joints: Array  # s [rad or m], (steps, n)
    joint_velocities: Array  # ṡ, (steps, n)
    joint_accelerations: Array  # s̈, (steps, n)
    torques: Array  # by RNEA [N m or N], (steps, n)
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


def reference(robot: Robot, plan: Trajectory, times: Array) -> Reference:
    """Return a plan at times since its start [s].

    Under leapfrog contact forces and throttles are constant from half an interval before their knot to half an interval
    after it, as the plan means them. Torques are linear between knots: those that jump shake the joints, and in a jump
    they ask a sixth more of the motors. Where contact forces and thrust rates belong to intervals, they are read in the
    middles of these, as velocities are, and linear between them.

    Args:
        robot: that moves.
        plan: its motion.
        times: since the plan's start [s], (steps,).
    """
    knots = plan.time - plan.time[0]
    interval = plan.duration / plan.knots
    going = ((times >= 0.0) & (times <= plan.duration)).astype(float)[:, None]
    spooling = (times <= plan.duration).astype(float)[:, None]
    within = _Within.of(knots, times)

    def at(values: Array, when: Array) -> Array:
        rows = [np.interp(when, knots, row) for row in values]
        return np.array(rows).reshape(len(values), when.size).T

    def rate(values: Array) -> Array:
        return np.asarray(at(values, times + interval / 2.0) * going)

    def acceleration(velocities: Array) -> Array:
        """Return it linear between knots, where it is the change between the intervals around them."""
        middle = np.diff(velocities, axis=1) / np.diff(knots)
        return np.asarray(at(np.hstack([middle, np.zeros((len(middle), 1))]), times) * going)

    def moved(positions: Array, velocities: Array) -> tuple[Array, Array]:
        place, speed = within.cubic(positions, at(velocities, knots + interval / 2.0).T)
        return place, speed * going

    def acting(name: str) -> Array:
        return at(getattr(plan, name), times + rules.instant(plan.rule, name) * interval)

    torques = joint_torques(robot, plan)
    if without_acceleration(plan) == 0:
        torques[:, 0] = torques[:, 1]  # such a trajectory doesn't tell the accelerations of its first knot
    held = np.minimum(np.searchsorted(acting_times(plan)[1] - plan.time[0], times - 1e-9), plan.knots)
    forces = plan.contact_forces[:, held].T if rules.acts_after(plan.rule) else acting("contact_forces")
    com, com_velocity = moved(plan.com_position, plan.com_velocity)
    base, base_velocity = moved(plan.base_position, plan.base_linear_velocity)
    joints, joint_velocities = moved(plan.joint_positions, plan.joint_velocities)
    turns = base_poses(plan)[:, :3, :3]
    rotation, spin = within.turned(turns, at(plan.base_angular_velocity, knots + interval / 2.0))
    return Reference(
        com=com,
        com_velocity=com_velocity,
        com_acceleration=acceleration(plan.com_velocity),
        angular_momentum=rate(plan.angular_momentum),
        angular_momentum_rate=acceleration(plan.angular_momentum),
        base_position=base,
        rotation=rotation,
        base_velocity=np.hstack([base_velocity, spin * going]),
        base_acceleration=acceleration(np.vstack([plan.base_linear_velocity, plan.base_angular_velocity])),
        joints=joints,
        joint_velocities=joint_velocities,
        joint_accelerations=acceleration(plan.joint_velocities),
        torques=at(torques, times),
        contact_forces=forces.reshape(times.size, -1, 3),
        thrust=at(plan.thrust, times),
        thrust_rate=acting("thrust_rate") * spooling,
        throttle=plan.throttle[:, held].T,
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class _Within:
    """Times within the intervals of a grid; those before it are at its start, those after it at its end."""

    interval: np.ndarray  # index of each time's interval, (steps,)
    length: Array  # of that interval [s], (steps, 1)
    share: Array  # of it that is over, from 0 to 1, (steps, 1)

    @classmethod
    def of(cls, knots: Array, times: Array) -> _Within:
        interval = np.clip(np.searchsorted(knots, times, side="right") - 1, 0, knots.size - 2)
        length = np.diff(knots)[interval]
        share = np.clip((times - knots[interval]) / length, 0.0, 1.0)
        return cls(interval=interval, length=length[:, None], share=share[:, None])

    def cubic(self, values: Array, slopes: Array) -> tuple[Array, Array]:
        """Return the cubic through values (rows, knots) with slopes [1/s] there, and its slope, (steps, rows) each."""
        return self._between(
            values[:, self.interval].T,
            values[:, self.interval + 1].T,
            slopes[:, self.interval].T,
            slopes[:, self.interval + 1].T,
        )

    def turned(self, turns: Array, spins: Array) -> tuple[Array, Array]:
        """Return rotations through those of the knots, (steps, 3, 3), and about their angular velocities, (steps, 3).

        Args:
            turns: of the knots, (knots, 3, 3).
            spins: ω there, in world axes [rad/s], (knots, 3).
        """
        whole = _logarithms(turns[1:] @ turns[:-1].transpose(0, 2, 1))
        start = np.zeros((self.interval.size, 3))
        angle, spin = self._between(start, whole[self.interval], spins[self.interval], spins[self.interval + 1])
        return _rotations(angle) @ turns[self.interval], spin

    def _between(self, start: Array, end: Array, slope: Array, last: Array) -> tuple[Array, Array]:
        """Return Hermite's cubic and its slope.

        Args:
            start: value at the interval's start, (steps, rows).
            end: value at its end.
            slope: slope at its start [1/s].
            last: slope at its end [1/s].
        """
        u, dt = self.share, self.length
        value = (1 + 2 * u) * (1 - u) ** 2 * start + u**2 * (3 - 2 * u) * end
        value = value + dt * (u * (1 - u) ** 2 * slope - u**2 * (1 - u) * last)
        rate = 6 * u * (1 - u) * (end - start) / dt + (1 - u) * (1 - 3 * u) * slope + u * (3 * u - 2) * last
        return value, rate


def _logarithms(rotations: Array) -> Array:
    """Return the rotation vectors of rotations by less than half a turn [rad], (count, 3)."""
    axial = np.stack(
        [
            rotations[:, 2, 1] - rotations[:, 1, 2],
            rotations[:, 0, 2] - rotations[:, 2, 0],
            rotations[:, 1, 0] - rotations[:, 0, 1],
        ],
        axis=1,
    )
    sine, cosine = np.linalg.norm(axial, axis=1) / 2, (np.trace(rotations, axis1=1, axis2=2) - 1) / 2
    angle = np.arctan2(sine, cosine)
    return np.asarray(axial * np.where(sine > 1e-9, angle / np.maximum(2 * sine, 1e-12), 0.5)[:, None])


def _rotations(vectors: Array) -> Array:
    """Return the rotations of rotation vectors [rad], (count, 3, 3)."""
    angle = np.linalg.norm(vectors, axis=1)[:, None, None]
    x, y, z = vectors.T
    zero = np.zeros_like(x)
    cross = np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]]).transpose(2, 0, 1)
    return np.asarray(
        np.eye(3) + np.sinc(angle / np.pi) * cross + 0.5 * np.sinc(angle / (2 * np.pi)) ** 2 * cross @ cross
    )
