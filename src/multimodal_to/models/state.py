"""`State`: a robot at an instant, where it is and how it moves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from multimodal_to.adam.spatial import Array
from multimodal_to.arguments import checked, vector
from multimodal_to.errors import InputError
from multimodal_to.models.robot import Posture, Robot
from multimodal_to.values import Value


@dataclass(frozen=True, kw_only=True, eq=False)
class State(Value):
    """Where a robot is and how it moves at an instant; vectors are in world axes.

    Raises:
        InputError: a size is wrong, a number is not finite, or the quaternion is zero.
    """

    base_position: Array  # p, the base's origin in the world [m], (3,)
    base_quaternion_xyzw: Array  # ρ, world-from-base, of any length but zero [1], (4,)
    joint_positions: Array  # s [rad or m], (n,)
    base_linear_velocity: Array  # ṗ of the base's origin, world axes [m/s], (3,)
    base_angular_velocity: Array  # ω of the base, world axes [rad/s], (3,)
    joint_velocities: Array  # ṡ [rad/s or m/s], (n,)
    thrust: Array  # T [N], (jets,)
    thrust_rate: Array  # Ṫ [N/s], (jets,)

    def __post_init__(self) -> None:
        for entry in fields(self):
            value = vector(f"the state's {entry.name}", getattr(self, entry.name), _SIZES.get(entry.name))
            object.__setattr__(self, entry.name, value)
        length = float(np.linalg.norm(self.base_quaternion_xyzw))
        if not length > 0.0:
            raise InputError("the state's base_quaternion_xyzw is zero; expected a quaternion of any other length")
        object.__setattr__(self, "base_quaternion_xyzw", self.base_quaternion_xyzw / length)
        for name, other in (("joint_velocities", "joint_positions"), ("thrust_rate", "thrust")):
            if getattr(self, name).size != getattr(self, other).size:
                raise InputError(f"the state has {getattr(self, name).size} {name}; expected as many as {other}")
        super().__post_init__()

    @classmethod
    @checked
    def at_rest(
        cls, robot: Robot, posture: Posture | None = None, thrust: Sequence[float] | Array | None = None
    ) -> State:
        """Return a state in which nothing moves.

        Args:
            robot: whose state it is.
            posture: of base and joints, by default the robot's home.
            thrust: T that the jets hold [N], (jets,); by default zero.
        """
        posture = posture or robot.home
        jets, joints = np.zeros(len(robot.jets)), np.zeros(len(robot.joint_names))
        return cls(
            base_position=posture.base_position,
            base_quaternion_xyzw=posture.base_quaternion_xyzw,
            joint_positions=posture.joint_positions,
            base_linear_velocity=np.zeros(3),
            base_angular_velocity=np.zeros(3),
            joint_velocities=joints,
            thrust=jets if thrust is None else np.asarray(thrust),
            thrust_rate=jets,
        )

    @property
    def posture(self) -> Posture:
        """Return where base and joints are."""
        return Posture(
            base_position=self.base_position,
            base_quaternion_xyzw=self.base_quaternion_xyzw,
            joint_positions=self.joint_positions,
        )

    @checked
    def com(self, robot: Robot) -> Array:
        """Return where the CoM is in the world [m], (3,)."""
        return robot.com_at(self.posture)

    @checked
    def momentum(self, robot: Robot) -> tuple[Array, Array]:
        """Return the velocity of the CoM [m/s] and the angular momentum about it [kg m²/s], world axes, (3,) each."""
        twist = np.concatenate([self.base_linear_velocity, self.base_angular_velocity])
        transform = self.posture.base_transform
        both = robot.kindyn.centroidal_momentum(transform, self.joint_positions, twist, self.joint_velocities)
        momentum = np.array(both).ravel()
        return momentum[:3] / robot.mass, momentum[3:]

    @checked
    def refuse_other_robot(self, robot: Robot) -> None:
        """Make sure that the state has the joints and the jets of a robot.

        Raises:
            InputError: it has more or fewer of them.
        """
        for what, found, expected in (
            ("joints", self.joint_positions.size, len(robot.joint_names)),
            ("jets", self.thrust.size, len(robot.jets)),
        ):
            if found != expected:
                raise InputError(f"the state has {found} {what}; {robot.name} has {expected}")


_SIZES = {"base_position": 3, "base_quaternion_xyzw": 4, "base_linear_velocity": 3, "base_angular_velocity": 3}
