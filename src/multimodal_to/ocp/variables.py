"""What is optimised: the decision variables of one knot, their layout, scales and bounds."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as cs
import numpy as np

from multimodal_to.adam import quaternion
from multimodal_to.adam.kinematics import Pose, forward_kinematics
from multimodal_to.adam.spatial import SX, Array
from multimodal_to.errors import ScenarioError
from multimodal_to.models.robot import Robot
from multimodal_to.scenarios.scenario import Scenario
from multimodal_to.trajectory import QUANTITIES

SCALES = {
    "com_position": 1.0,
    "com_velocity": 1.0,
    "angular_momentum": 1.0,
    "base_position": 1.0,
    "base_quaternion_xyzw": 1.0,
    "base_linear_velocity": 1.0,
    "base_angular_velocity": 1.0,
    "joint_positions": 1.0,
    "joint_velocities": 1.0,
    "contact_positions": 1.0,
    "contact_forces": 50.0,
    "thrust": 100.0,
    "thrust_rate": 50.0,
    "throttle": 50.0,
}
"""The decision variables of a knot in their order, each with the size that the solver sees as one.

ẍ, ḣω, ḟ and T̈ are no variables: backward Euler makes them differences of these.
"""
INTERVAL_SCALE = 0.1  # of Δt [s]


@dataclass(frozen=True)
class Layout:
    """Where each decision variable stands among those of one knot."""

    rows: dict[str, slice]
    scale: Array  # (size,)

    @classmethod
    def of(cls, robot: Robot) -> Layout:
        """Return the layout for a robot."""
        count = {"robot": 1, "joint": len(robot.joint_names), "contact": len(robot.contacts), "jet": len(robot.jets)}
        rows, scale, start = {}, list[float](), 0
        for name, size in SCALES.items():
            dimension = QUANTITIES[name].rows * count[QUANTITIES[name].of]
            rows[name] = slice(start, start + dimension)
            scale += [size] * dimension
            start += dimension
        return cls(rows, np.array(scale))

    @property
    def size(self) -> int:
        """Return the number of decision variables of one knot."""
        return int(self.scale.size)

    def read(self, values: Any) -> dict[str, Any]:
        """Return the variables by name from a (size, ...) array or CasADi column in their own units."""
        return {name: values[rows] for name, rows in self.rows.items()}

    def read_horizon(self, x: Array) -> dict[str, Array]:
        """Return the variables by name, (dim, N + 1) each, from all of them: the knots one after the other, and Δt."""
        return self.read(x[:-1].reshape(self.size, -1, order="F"))


@dataclass(frozen=True)
class Knot:
    """The variables of one knot as SX columns, in their own units."""

    robot: Robot
    com_position: SX
    com_velocity: SX
    angular_momentum: SX
    base_position: SX
    base_quaternion_xyzw: SX
    base_linear_velocity: SX
    base_angular_velocity: SX
    joint_positions: SX
    joint_velocities: SX
    contact_positions: SX
    contact_forces: SX
    thrust: SX
    thrust_rate: SX
    throttle: SX

    @cached_property
    def base(self) -> Pose:
        """Return w_H_base."""
        return Pose(quaternion.rotation_matrix(self.base_quaternion_xyzw), self.base_position)

    @cached_property
    def _poses(self) -> dict[str, Pose]:
        return {}

    def pose(self, frame: str) -> Pose:
        """Return w_H_frame; each frame's expression is made once."""
        if frame not in self._poses:
            tree = self.robot.kindyn.tree
            self._poses[frame] = forward_kinematics(tree, tree.frame(frame), self.base, self.joint_positions)
        return self._poses[frame]

    @cached_property
    def points(self) -> list[SX]:
        """Return the contact points [m], (3, 1) each."""
        return cs.vertsplit(self.contact_positions, 3) if self.robot.contacts else []

    @cached_property
    def forces(self) -> list[SX]:
        """Return the contact forces [N], (3, 1) each."""
        return cs.vertsplit(self.contact_forces, 3) if self.robot.contacts else []


@dataclass(frozen=True)
class Bounds:
    """Lower and upper bounds of every variable at every knot, in their own units: (dim, N + 1) each by name."""

    lower: dict[str, Array]
    upper: dict[str, Array]

    def fix(self, name: str, knot: int, value: Array | float, within: float = 0.0) -> None:
        """Hold a variable at a value at one knot.

        Raises:
            ScenarioError: its range does not allow that value.
        """
        target = np.broadcast_to(np.asarray(value, dtype=float), self.lower[name][:, knot].shape)
        low, high = self.lower[name][:, knot], self.upper[name][:, knot]
        if bad := np.flatnonzero((target < low - 1e-9) | (target > high + 1e-9)).tolist():
            raise ScenarioError(
                f"{name}[{bad[0]}] has to be {target[bad[0]]:.6g} at knot {knot}, outside its range "
                f"{low[bad[0]]:.6g} to {high[bad[0]]:.6g} {QUANTITIES[name].unit}"
            )
        self.lower[name][:, knot] = np.clip(target - within, low, high)
        self.upper[name][:, knot] = np.clip(target + within, low, high)


def ranges(robot: Robot, scenario: Scenario) -> Bounds:
    """Return the box constraints that hold at every knot: limits of the robot, and of the scenario (eq. 28, 29)."""
    limits, jets, count = robot.joint_limits, robot.jets, scenario.knots + 1
    speed = scenario.base_speed_max
    reach = np.array(scenario.com_range)
    box: dict[str, tuple[Any, Any]] = {
        "com_position": (-reach, reach),
        "base_quaternion_xyzw": (-1.0, 1.0),
        "base_linear_velocity": (-speed, speed),
        "base_angular_velocity": (-speed, speed),
        "joint_positions": (limits.lower, limits.upper),
        "joint_velocities": (-limits.speed, limits.speed),
        "thrust": (0.0, np.array([jet.thrust_max for jet in jets])),
        "throttle": (np.array([jet.throttle_min for jet in jets]), np.array([jet.throttle_max for jet in jets])),
    }
    lower, upper = {}, {}
    for name, rows in Layout.of(robot).rows.items():
        low, high = box.get(name, (-np.inf, np.inf))
        shape = (rows.stop - rows.start, count)
        lower[name] = np.array(np.broadcast_to(np.reshape(low, (-1, 1)), shape), dtype=float)
        upper[name] = np.array(np.broadcast_to(np.reshape(high, (-1, 1)), shape), dtype=float)
    return Bounds(lower, upper)
