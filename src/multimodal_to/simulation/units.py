"""A robot's own units, in which a controller's gains are the same for a small robot and a large one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from multimodal_to.adam.spatial import Array
from multimodal_to.models.robot import Robot

EARTH = 9.81  # what counts as the strength of gravity where there is none [m/s²]


@dataclass(frozen=True, kw_only=True)
class Units:
    """Mass m, strength of gravity g, and L, the height of the CoM above the contact points at home."""

    mass: float  # m [kg]
    gravity: float  # g [m/s²]
    length: float  # L [m]

    @classmethod
    def of(cls, robot: Robot) -> Units:
        """Return the units of a robot; those of the Earth's gravity where the robot has none."""
        return cls(mass=robot.mass, gravity=float(np.linalg.norm(robot.gravity)) or EARTH, length=robot.standing_height)

    @property
    def frequency(self) -> float:
        """Return √(g / L) [1/s]."""
        return float((self.gravity / self.length) ** 0.5)

    @property
    def force(self) -> float:
        """Return m g [N]."""
        return self.mass * self.gravity

    @property
    def moment(self) -> float:
        """Return m g L [N m]."""
        return self.force * self.length

    def servo(self, count: int, stiffness: float, damping: float) -> tuple[Array, Array]:
        """Return K [N m/rad] and D [N m s/rad] of joints' servos, (count,) each.

        Args:
            count: of joints.
            stiffness: K [m g L/rad].
            damping: D [m g L √(L/g)/rad].
        """
        return np.full(count, stiffness * self.moment), np.full(count, damping * self.moment / self.frequency)
