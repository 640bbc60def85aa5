"""What sensors and an estimate make of a state: noise, and a base that drifts as inertial unit and leg odometry do.

The base's place wanders: its error is a random walk while no foot stands, and stays while one does, since a standing
foot tells where the base is. Each time that a foot comes down, its place on the ground is a little off. Roll and pitch
have an error that gravity keeps bounded; the heading's is a slow random walk.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from multimodal_to.adam.spatial import Array
from multimodal_to.models import attitude
from multimodal_to.models.state import State


@dataclass(frozen=True, kw_only=True)
class Noise:
    """Standard deviations of what is measured; each is of one sample, unless it is of a random walk."""

    seed: int = 0
    joint: float = 5e-4  # of an encoder [rad or m]
    joint_velocity: float = 0.02  # [rad/s or m/s]
    gyroscope: float = 0.01  # [rad/s]
    velocity: float = 0.01  # of the base [m/s]
    walk: float = 5e-3  # of the base's place in flight, of a random walk [m/√s]
    touch_down: float = 1e-3  # what a foot that comes down adds to the base's place [m]
    tilt: float = 5e-3  # of roll and pitch, with a memory of 1 s [rad]
    heading: float = 2e-3  # of a random walk [rad/√s]
    thrust: float = 0.01  # of each jet, as a share of its thrust [1]


class Estimate:
    """An estimator's error as it goes on.

    Args:
        noise: how large.
        period: between two estimates [s].
    """

    def __init__(self, noise: Noise, period: float) -> None:
        self._noise, self._period = noise, period
        self._rng = np.random.default_rng(noise.seed)
        self._place, self._tilt, self._heading, self._stood = np.zeros(3), np.zeros(2), 0.0, True

    def __call__(self, state: State, stands: bool) -> State:
        """Return what is seen of a state.

        Args:
            state: as it is.
            stands: a foot stands.
        """
        noise, rng, period = self._noise, self._rng, self._period
        if not stands:
            self._place = self._place + noise.walk * period**0.5 * rng.normal(size=3)
        elif not self._stood:
            level = noise.touch_down * rng.normal(size=3)
            self._place = np.array([*(self._place + level)[:2], level[2]])  # the ground's height is known
        self._stood = stands
        keep = np.exp(-period)
        self._tilt = keep * self._tilt + (1 - keep**2) ** 0.5 * noise.tilt * rng.normal(size=2)
        self._heading += noise.heading * period**0.5 * float(rng.normal())
        turn = np.array([*self._tilt, self._heading]) / 2.0
        error = np.array([*turn, (1.0 - turn @ turn) ** 0.5])

        def off(values: Array, spread: float) -> Array:
            return values + spread * rng.normal(size=values.size)

        return replace(
            state,
            base_position=state.base_position + self._place,
            base_quaternion_xyzw=attitude.product(error, state.base_quaternion_xyzw),
            joint_positions=off(state.joint_positions, noise.joint),
            joint_velocities=off(state.joint_velocities, noise.joint_velocity),
            base_linear_velocity=off(state.base_linear_velocity, noise.velocity),
            base_angular_velocity=off(state.base_angular_velocity, noise.gyroscope),
            thrust=state.thrust * (1.0 + noise.thrust * rng.normal(size=state.thrust.size)),
        )
