"""`Knot`: the variables of one knot by name, for terms to read."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property

import casadi as cs

from multimodal_to.adam import quaternion
from multimodal_to.adam.kinematics import Pose, forward_kinematics
from multimodal_to.adam.spatial import SX
from multimodal_to.models.centroidal import drag_moment, momentum_rate, thrust_force
from multimodal_to.models.robot import Robot
from multimodal_to.ocp.lifting import Lift, not_lifted
from multimodal_to.values import Value


@dataclass(frozen=True, eq=False)
class Knot(Value):
    """The variables of one knot as SX columns, in their own units; world axes unless said."""

    robot: Robot
    com_position: SX  # x [m], (3, 1)
    com_velocity: SX  # ẋ [m/s], (3, 1)
    angular_momentum: SX  # hω about the CoM [kg m²/s], (3, 1)
    base_position: SX  # p, the base's origin [m], (3, 1)
    base_quaternion_xyzw: SX  # ρ, world-from-base [1], (4, 1)
    base_linear_velocity: SX  # ṗ [m/s], (3, 1)
    base_angular_velocity: SX  # ω [rad/s], (3, 1)
    joint_positions: SX  # s [rad or m], (n, 1)
    joint_velocities: SX  # ṡ [rad/s or m/s], (n, 1)
    contact_positions: SX  # p_i one below the other [m], (3 contacts, 1)
    contact_forces: SX  # f_i one below the other, on the robot [N], (3 contacts, 1)
    thrust: SX  # T [N], (jets, 1)
    thrust_rate: SX  # Ṫ [N/s], (jets, 1)
    throttle: SX  # u [%], (jets, 1)
    lift: Lift = not_lifted  # for a quantity through which many variables act

    @cached_property
    def base(self) -> Pose:
        """Return w_H_base."""
        return Pose(quaternion.rotation_matrix(self.base_quaternion_xyzw), self.base_position)

    @cached_property
    def _poses(self) -> dict[str, Pose]:
        return {}

    def pose(self, frame: str) -> Pose:
        """Return w_H_frame of a link or frame: its `rotation`, (3, 3), and its `translation` [m], (3, 1).

        The expression of each frame is made once.

        Raises:
            ModelError: the robot has no such frame.
        """
        if frame not in self._poses:
            tree = self.robot.kindyn.tree
            self._poses[frame] = forward_kinematics(tree, tree.frame(frame), self.base, self.joint_positions)
        return self._poses[frame]

    @cached_property
    def points(self) -> list[SX]:
        """Return the contact points [m], (3, 1) each."""
        return cs.vertsplit(self.contact_positions, 3) if self.robot.contacts else []

    @cached_property
    def momentum_rate(self) -> tuple[SX, SX]:
        """Return m ẍ = m g + Σ f [N] and ḣω = Σ (p − x) × f [N m] under all contacts and jets, (3, 1) each (eq. 14).

        Rotors add the moments of their drag to ḣω.
        """
        forces = list(zip(self.points, self.forces, strict=True))
        for index, jet in enumerate(self.robot.jets):
            pose = self.pose(jet.frame)
            forces.append((pose.translation, thrust_force(pose.rotation, self.thrust[index])))
        linear, angular = momentum_rate(self.robot.mass, cs.DM(self.robot.gravity), self.com_position, forces)
        for index, jet in enumerate(self.robot.jets):
            if jet.drag:
                angular = angular + drag_moment(self.pose(jet.frame).rotation, self.thrust[index], jet.drag)
        return linear, angular

    @cached_property
    def forces(self) -> list[SX]:
        """Return the contact forces [N], (3, 1) each."""
        return cs.vertsplit(self.contact_forces, 3) if self.robot.contacts else []


VARIABLE_NAMES = tuple(entry.name for entry in fields(Knot) if entry.name not in ("robot", "lift"))
"""The names of the variables of a knot."""
