"""`KinDynComputations`: kinematics and dynamics of a robot as named `casadi.Function`s, each built once.

Names and argument order are those of adam (`adam.casadi.KinDynComputations`). Velocities are in the mixed
representation: (ṗ_base, ω_base, ṡ), linear part first, all in world axes.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike

from multimodal_to.adam import centroidal, dynamics, kinematics
from multimodal_to.adam.kinematics import Pose
from multimodal_to.adam.spatial import SX, homogeneous
from multimodal_to.adam.tree import Tree
from multimodal_to.adam.urdf import load_tree
from multimodal_to.errors import InputError

GRAVITY = (0.0, 0.0, -9.80665)
"""Standard acceleration of free fall in world axes [m/s²]."""


class KinDynComputations:
    """Rigid-body library of one floating-base robot.

    Every quantity comes as `name_fun()`, a named `casadi.Function` that is built on first use and kept, and as
    `name(...)`, which checks the arguments and calls it with SX, MX, DM or numpy in.

    Arguments, where they occur, in this order:

    * `base_transform`: ``w_H_base``, (4, 4);
    * `joint_positions`: s, (n, 1) [rad or m], in the order of `joint_names`;
    * `base_velocity`: (ṗ, ω) of the base's origin, (6, 1), world axes;
    * `joint_velocities`: ṡ, (n, 1);
    * `base_acceleration`: (p̈, ω̇), (6, 1), world axes, and `joint_accelerations`: s̈, (n, 1).

    Args:
        urdf: path of a URDF, or its XML text.
        joints_name_list: joints that move, in the order of s; by default all that can.
        gravity: acceleration of free fall in world axes [m/s²], three numbers.
        locked_joints: positions [rad or m] of movable joints left out of `joints_name_list`; zero by default.

    Raises:
        ModelError: the URDF cannot be read or is no robot, or a joint does not exist.
        InputError: gravity is not three finite numbers.
    """

    def __init__(
        self,
        urdf: str | os.PathLike[str],
        joints_name_list: Sequence[str] | None = None,
        gravity: ArrayLike = GRAVITY,
        locked_joints: Mapping[str, float] | None = None,
    ) -> None:
        self.tree: Tree = load_tree(urdf, joints_name_list, locked_joints)
        vector = np.asarray(gravity, dtype=float)
        if vector.shape != (3,) or not np.isfinite(vector).all():
            raise InputError(f"gravity is {gravity!r}; expected three finite numbers, for example {GRAVITY}")
        self.gravity = vector
        self._functions: dict[str, cs.Function] = {}

    # ---------------------------------------------------------------- the robot

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Return the joints in the order of s."""
        return self.tree.joint_names

    @property
    def NDoF(self) -> int:
        """Return the number of joints n (adam's name)."""
        return len(self.tree.joints)

    @property
    def frame_names(self) -> tuple[str, ...]:
        """Return the names of all frames: every link of the URDF."""
        return tuple(self.tree.frames)

    def get_total_mass(self) -> float:
        """Return the total mass [kg]."""
        return self.tree.total_mass

    # ---------------------------------------------------------------- kinematics

    def forward_kinematics_fun(self, frame: str) -> cs.Function:
        """Return (w_H_base, s) → w_H_frame, (4, 4)."""
        place = self.tree.frame(frame)

        def build(base: Pose, s: SX) -> SX:
            pose = kinematics.forward_kinematics(self.tree, place, base, s)
            return homogeneous(pose.rotation, pose.translation)

        return self._function(f"forward_kinematics_{frame}", build, ("H", "s"), "w_H_frame")

    def forward_kinematics(self, frame: str, base_transform: Any, joint_positions: Any) -> Any:
        """Return w_H_frame, (4, 4)."""
        return self._call(self.forward_kinematics_fun(frame), base_transform, joint_positions)

    def jacobian_fun(self, frame: str) -> cs.Function:
        """Return (w_H_base, s) → J, (6, 6 + n): (ṗ_frame, ω_frame) = J ν in world axes."""
        place = self.tree.frame(frame)
        return self._function(
            f"jacobian_{frame}",
            lambda base, s: kinematics.geometric_jacobian(self.tree, place, base, s)[0],
            ("H", "s"),
            "J",
        )

    def jacobian(self, frame: str, base_transform: Any, joint_positions: Any) -> Any:
        """Return J, (6, 6 + n): (ṗ_frame, ω_frame) = J ν in world axes."""
        return self._call(self.jacobian_fun(frame), base_transform, joint_positions)

    # ---------------------------------------------------------------- centre of mass and momentum

    def CoM_position_fun(self) -> cs.Function:
        """Return (w_H_base, s) → CoM in the world [m], (3, 1)."""
        return self._function(
            "CoM_position", lambda base, s: centroidal.com_position(self.tree, base, s), ("H", "s"), "CoM"
        )

    def CoM_position(self, base_transform: Any, joint_positions: Any) -> Any:
        """Return the CoM in the world [m], (3, 1)."""
        return self._call(self.CoM_position_fun(), base_transform, joint_positions)

    def CoM_jacobian_fun(self) -> cs.Function:
        """Return (w_H_base, s) → J_CoM, (3, 6 + n): ẋ = J_CoM ν."""
        return self._function(
            "CoM_jacobian", lambda base, s: dynamics.com_jacobian(self.tree, base, s), ("H", "s"), "J_CoM"
        )

    def CoM_jacobian(self, base_transform: Any, joint_positions: Any) -> Any:
        """Return J_CoM, (3, 6 + n): ẋ = J_CoM ν."""
        return self._call(self.CoM_jacobian_fun(), base_transform, joint_positions)

    def centroidal_momentum_matrix_fun(self) -> cs.Function:
        """Return (w_H_base, s) → J_CMM, (6, 6 + n): h = J_CMM ν about the CoM in world axes."""
        return self._function(
            "centroidal_momentum_matrix",
            lambda base, s: dynamics.centroidal_momentum_matrix(self.tree, base, s),
            ("H", "s"),
            "J_CMM",
        )

    def centroidal_momentum_matrix(self, base_transform: Any, joint_positions: Any) -> Any:
        """Return J_CMM, (6, 6 + n): h = J_CMM ν about the CoM in world axes."""
        return self._call(self.centroidal_momentum_matrix_fun(), base_transform, joint_positions)

    def centroidal_momentum_fun(self) -> cs.Function:
        """Return (w_H_base, s, base twist, ṡ) → h = (m ẋ, hω), (6, 1), about the CoM in world axes, without J_CMM."""

        def build(base: Pose, s: SX, twist: SX, s_dot: SX) -> SX:
            momentum = centroidal.centroidal_momentum(self.tree, base, s, twist, s_dot)
            return cs.vertcat(momentum.linear, momentum.angular)

        return self._function("centroidal_momentum", build, ("H", "s", "v_b", "s_dot"), "h")

    def centroidal_momentum(
        self, base_transform: Any, joint_positions: Any, base_velocity: Any, joint_velocities: Any
    ) -> Any:
        """Return h = (m ẋ, hω), (6, 1), about the CoM in world axes, without J_CMM."""
        return self._call(
            self.centroidal_momentum_fun(), base_transform, joint_positions, base_velocity, joint_velocities
        )

    # ---------------------------------------------------------------- dynamics

    def mass_matrix_fun(self) -> cs.Function:
        """Return (w_H_base, s) → M, (6 + n, 6 + n), by CRBA."""
        return self._function(
            "mass_matrix", lambda base, s: dynamics.mass_matrix(self.tree, base, s), ("H", "s"), "M"
        )

    def mass_matrix(self, base_transform: Any, joint_positions: Any) -> Any:
        """Return M, (6 + n, 6 + n)."""
        return self._call(self.mass_matrix_fun(), base_transform, joint_positions)

    def bias_force_fun(self) -> cs.Function:
        """Return (w_H_base, s, base twist, ṡ) → C ν + G, (6 + n, 1), by RNEA."""

        def build(base: Pose, s: SX, twist: SX, s_dot: SX) -> SX:
            return self._rnea(base, s, twist, s_dot, cs.SX(6, 1), cs.SX(self.NDoF, 1), self.gravity)

        return self._function("bias_force", build, ("H", "s", "v_b", "s_dot"), "h")

    def bias_force(
        self, base_transform: Any, joint_positions: Any, base_velocity: Any, joint_velocities: Any
    ) -> Any:
        """Return C ν + G, (6 + n, 1)."""
        return self._call(self.bias_force_fun(), base_transform, joint_positions, base_velocity, joint_velocities)

    def coriolis_term_fun(self) -> cs.Function:
        """Return (w_H_base, s, base twist, ṡ) → C ν, (6 + n, 1)."""

        def build(base: Pose, s: SX, twist: SX, s_dot: SX) -> SX:
            return self._rnea(base, s, twist, s_dot, cs.SX(6, 1), cs.SX(self.NDoF, 1), np.zeros(3))

        return self._function("coriolis_term", build, ("H", "s", "v_b", "s_dot"), "C_nu")

    def coriolis_term(
        self, base_transform: Any, joint_positions: Any, base_velocity: Any, joint_velocities: Any
    ) -> Any:
        """Return C ν, (6 + n, 1)."""
        return self._call(self.coriolis_term_fun(), base_transform, joint_positions, base_velocity, joint_velocities)

    def gravity_term_fun(self) -> cs.Function:
        """Return (w_H_base, s) → G, (6 + n, 1): what holds the robot still."""

        def build(base: Pose, s: SX) -> SX:
            none = cs.SX(self.NDoF, 1)
            return self._rnea(base, s, cs.SX(6, 1), none, cs.SX(6, 1), none, self.gravity)

        return self._function("gravity_term", build, ("H", "s"), "G")

    def gravity_term(self, base_transform: Any, joint_positions: Any) -> Any:
        """Return G, (6 + n, 1)."""
        return self._call(self.gravity_term_fun(), base_transform, joint_positions)

    def rnea_fun(self) -> cs.Function:
        """Return (w_H_base, s, base twist, ṡ, base acceleration, s̈) → M ν̇ + C ν + G, (6 + n, 1)."""

        def build(base: Pose, s: SX, twist: SX, s_dot: SX, acceleration: SX, s_ddot: SX) -> SX:
            return self._rnea(base, s, twist, s_dot, acceleration, s_ddot, self.gravity)

        return self._function("rnea", build, ("H", "s", "v_b", "s_dot", "v_b_dot", "s_ddot"), "tau")

    def rnea(
        self,
        base_transform: Any,
        joint_positions: Any,
        base_velocity: Any,
        joint_velocities: Any,
        base_acceleration: Any,
        joint_accelerations: Any,
    ) -> Any:
        """Return M ν̇ + C ν + G, (6 + n, 1): base wrench and joint torques of a motion without contact."""
        return self._call(
            self.rnea_fun(), base_transform, joint_positions, base_velocity, joint_velocities, base_acceleration,
            joint_accelerations,
        )  # fmt: skip

    def aba_fun(self) -> cs.Function:
        """Return (w_H_base, s, base twist, ṡ, τ, base wrench) → ν̇ = (p̈, ω̇, s̈), (6 + n, 1), by ABA."""

        def build(base: Pose, s: SX, twist: SX, s_dot: SX, torques: SX, wrench: SX) -> SX:
            return dynamics.forward_dynamics(self.tree, base, s, twist, s_dot, torques, wrench, cs.DM(self.gravity))

        return self._function("aba", build, ("H", "s", "v_b", "s_dot", "tau", "w_b"), "nu_dot")

    def aba(
        self,
        base_transform: Any,
        joint_positions: Any,
        base_velocity: Any,
        joint_velocities: Any,
        joint_torques: Any,
        base_wrench: Any = None,
    ) -> Any:
        """Return ν̇ = (p̈, ω̇, s̈), (6 + n, 1), under joint torques and an optional wrench on the base."""
        wrench = np.zeros(6) if base_wrench is None else base_wrench
        return self._call(
            self.aba_fun(), base_transform, joint_positions, base_velocity, joint_velocities, joint_torques, wrench
        )

    # ---------------------------------------------------------------- how a Function is made and called

    def _rnea(
        self, base: Pose, s: SX, twist: SX, s_dot: SX, acceleration: SX, s_ddot: SX, gravity: ArrayLike
    ) -> SX:
        return dynamics.inverse_dynamics(
            self.tree, base, s, twist, s_dot, acceleration, s_ddot, cs.DM(np.asarray(gravity))
        )

    def _function(self, name: str, build: Callable[..., SX], inputs: tuple[str, ...], output: str) -> cs.Function:
        if name not in self._functions:
            transform = cs.SX.sym("H", 4, 4)
            base = Pose(transform[:3, :3], transform[:3, 3])
            rows = {"s": self.NDoF, "s_dot": self.NDoF, "s_ddot": self.NDoF, "tau": self.NDoF}
            others = [cs.SX.sym(label, rows.get(label, 6)) for label in inputs[1:]]
            result = cs.cse(build(base, *others))
            safe = "".join(letter if letter.isalnum() else "_" for letter in name).replace("__", "_").strip("_")
            self._functions[name] = cs.Function(safe, [transform, *others], [result], list(inputs), [output])
        return self._functions[name]

    @staticmethod
    def _call(function: cs.Function, *arguments: Any) -> Any:
        """Call a function with every argument's shape and finiteness checked."""
        checked = []
        for index, argument in enumerate(arguments):
            value = argument if isinstance(argument, cs.SX | cs.MX | cs.DM) else np.asarray(argument, dtype=float)
            expected, name = function.size_in(index), function.name_in(index)
            column = expected[1] == 1 and not isinstance(value, cs.SX | cs.MX | cs.DM) and value.shape == (expected[0],)
            if tuple(value.shape) != expected and not column:
                raise InputError(
                    f"{function.name()}: '{name}' has shape {tuple(value.shape)}; expected {expected}"
                )
            if not isinstance(value, cs.SX | cs.MX) and not np.isfinite(np.asarray(value)).all():
                raise InputError(f"{function.name()}: '{name}' holds values that are not finite")
            checked.append(value)
        return function(*checked)
