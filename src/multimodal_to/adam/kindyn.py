"""`KinDynComputations`: kinematics and dynamics of a robot as named `casadi.Function`s, each built once.

Names and argument order are those of adam (`adam.casadi.KinDynComputations`).
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike

from multimodal_to.adam.centroidal import composite_inertias
from multimodal_to.adam.quantities import Quantities
from multimodal_to.adam.representation import Representations
from multimodal_to.adam.spatial import SX
from multimodal_to.adam.tree import Tree
from multimodal_to.adam.urdf import load_tree
from multimodal_to.errors import InputError, ModelError

GRAVITY = (0.0, 0.0, -9.80665)
"""Standard acceleration of free fall in world axes [m/s²]."""


_POSE = ("H", "s")
_MOTION = ("H", "s", "v_b", "s_dot")
_INVERSE = (*_MOTION, "v_b_dot", "s_ddot")
_FORWARD = (*_MOTION, "tau")


class KinDynComputations:
    """Rigid-body library of one floating-base robot.

    Every quantity comes as `name_fun()`, a named `casadi.Function` that is built on first use and kept, and as
    `name(...)`, which checks the arguments and calls it with SX, MX, DM or numpy in.

    Arguments, where they occur, in this order:

    * `base_transform` (H): ``w_H_base``, (4, 4);
    * `joint_positions` (s): (n, 1) [rad or m], in the order of `joint_names`;
    * `base_velocity` (v_b): (6, 1), linear part first, in the chosen representation; mixed by default, which is (ṗ, ω)
      of the base's origin in world axes;
    * `joint_velocities` (s_dot): ṡ, (n, 1) [rad/s or m/s];
    * `base_acceleration` (v_b_dot): the derivative of the six numbers v_b, and `joint_accelerations` (s_ddot): s̈.

    ν = (v_b, ṡ). Frame velocities and Jacobians, forces and momenta are in the chosen representation too: forces are
    dual to ν, momenta are about the CoM in the base's axes when body-fixed and in the world's otherwise. Positions and
    velocities of the CoM are always in world axes.

    Args:
        urdfstring: path of a URDF, or its XML text (adam's name).
        joints_name_list: joints that move, in the order of s; by default all that can.
        root_link: the base, named as a check; a URDF has only one root.
        gravity: acceleration of free fall in world axes [m/s²]: three numbers, or six with adam's three zeros behind.
        representation: how velocities are written.
        locked_joints: positions [rad or m] of movable joints left out of `joints_name_list`; zero by default.

    Raises:
        ModelError: the URDF cannot be read or is no robot, or a joint does not exist.
        InputError: gravity is not three finite numbers, or the representation is unknown.
    """

    def __init__(
        self,
        urdfstring: str | os.PathLike[str],
        joints_name_list: Sequence[str] | None = None,
        root_link: str | None = None,
        gravity: ArrayLike = GRAVITY,
        *,
        representation: Representations = Representations.MIXED_REPRESENTATION,
        locked_joints: Mapping[str, float] | None = None,
    ) -> None:
        self.tree: Tree = load_tree(urdfstring, joints_name_list, locked_joints)
        if root_link not in (None, self.tree.base):
            raise ModelError(f"the root link is '{self.tree.base}', not '{root_link}'")
        self.gravity = _checked_gravity(gravity)
        if representation not in tuple(Representations):
            names = ", ".join(member.name for member in Representations)
            raise InputError(f"unknown representation {representation!r}; available: {names}")
        self.representation = Representations(representation)
        self._quantities = Quantities(self.tree, cs.DM(self.gravity), self.representation)
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

    # ---------------------------------------------------------------- frames

    def forward_kinematics_fun(self, frame: str) -> cs.Function:
        """Return (H, s) → w_H_frame, (4, 4)."""
        build = self._quantities.forward_kinematics
        return self._frame_function("forward_kinematics", frame, build, _POSE, "w_H_frame")

    def forward_kinematics(self, frame: str, base_transform: Any, joint_positions: Any) -> Any:
        """Return w_H_frame, (4, 4)."""
        return _call(self.forward_kinematics_fun(frame), base_transform, joint_positions)

    def jacobian_fun(self, frame: str) -> cs.Function:
        """Return (H, s) → J, (6, 6 + n): the frame's velocity is J ν."""
        return self._frame_function("jacobian", frame, self._quantities.jacobian, _POSE, "J")

    def jacobian(self, frame: str, base_transform: Any, joint_positions: Any) -> Any:
        """Return J, (6, 6 + n): the frame's velocity is J ν."""
        return _call(self.jacobian_fun(frame), base_transform, joint_positions)

    def relative_jacobian_fun(self, frame: str) -> cs.Function:
        """Return (s) → J, (6, n): the frame's velocity is J ṡ, with the base as the world."""
        return self._frame_function("relative_jacobian", frame, self._quantities.relative_jacobian, ("s",), "J")

    def relative_jacobian(self, frame: str, joint_positions: Any) -> Any:
        """Return J, (6, n): the frame's velocity is J ṡ, with the base as the world."""
        return _call(self.relative_jacobian_fun(frame), joint_positions)

    def jacobian_dot_fun(self, frame: str) -> cs.Function:
        """Return (H, s, v_b, s_dot) → J̇, (6, 6 + n), along the motion."""
        return self._frame_function("jacobian_dot", frame, self._quantities.jacobian_dot, _MOTION, "J_dot")

    def jacobian_dot(
        self, frame: str, base_transform: Any, joint_positions: Any, base_velocity: Any, joint_velocities: Any
    ) -> Any:
        """Return J̇, (6, 6 + n), along the motion."""
        return _call(self.jacobian_dot_fun(frame), base_transform, joint_positions, base_velocity, joint_velocities)

    def jacobian_dot_nu_fun(self, frame: str) -> cs.Function:
        """Return (H, s, v_b, s_dot) → J̇ ν, (6, 1): the frame's acceleration while ν̇ = 0."""
        return self._frame_function("jacobian_dot_nu", frame, self._quantities.jacobian_dot_nu, _MOTION, "J_dot_nu")

    def jacobian_dot_nu(
        self, frame: str, base_transform: Any, joint_positions: Any, base_velocity: Any, joint_velocities: Any
    ) -> Any:
        """Return J̇ ν, (6, 1): the frame's acceleration while ν̇ = 0."""
        return _call(self.jacobian_dot_nu_fun(frame), base_transform, joint_positions, base_velocity, joint_velocities)

    # ---------------------------------------------------------------- centre of mass and momentum

    def CoM_position_fun(self) -> cs.Function:
        """Return (H, s) → x, (3, 1): the CoM in the world [m]."""
        return self._function("CoM_position", self._quantities.com_position, _POSE, "CoM")

    def CoM_position(self, base_transform: Any, joint_positions: Any) -> Any:
        """Return x, (3, 1): the CoM in the world [m]."""
        return _call(self.CoM_position_fun(), base_transform, joint_positions)

    def CoM_velocity_fun(self) -> cs.Function:
        """Return (H, s, v_b, s_dot) → ẋ, (3, 1): the CoM's velocity in world axes [m/s]."""
        return self._function("CoM_velocity", self._quantities.com_velocity, _MOTION, "v_CoM")

    def CoM_velocity(self, base_transform: Any, joint_positions: Any, base_velocity: Any, joint_velocities: Any) -> Any:
        """Return ẋ, (3, 1): the CoM's velocity in world axes [m/s]."""
        return _call(self.CoM_velocity_fun(), base_transform, joint_positions, base_velocity, joint_velocities)

    def CoM_jacobian_fun(self) -> cs.Function:
        """Return (H, s) → J_CoM, (3, 6 + n): ẋ = J_CoM ν."""
        return self._function("CoM_jacobian", self._quantities.com_jacobian, _POSE, "J_CoM")

    def CoM_jacobian(self, base_transform: Any, joint_positions: Any) -> Any:
        """Return J_CoM, (3, 6 + n): ẋ = J_CoM ν."""
        return _call(self.CoM_jacobian_fun(), base_transform, joint_positions)

    def centroidal_momentum_fun(self) -> cs.Function:
        """Return (H, s, v_b, s_dot) → h = (m ẋ, hω), (6, 1), about the CoM, straight from the velocities."""
        return self._function("centroidal_momentum", self._quantities.centroidal_momentum, _MOTION, "h")

    def centroidal_momentum(
        self, base_transform: Any, joint_positions: Any, base_velocity: Any, joint_velocities: Any
    ) -> Any:
        """Return h = (m ẋ, hω), (6, 1), about the CoM, straight from the velocities."""
        return _call(self.centroidal_momentum_fun(), base_transform, joint_positions, base_velocity, joint_velocities)

    def centroidal_momentum_matrix_fun(self) -> cs.Function:
        """Return (H, s) → J_CMM, (6, 6 + n): h = J_CMM ν."""
        return self._function("centroidal_momentum_matrix", self._quantities.centroidal_momentum_matrix, _POSE, "J_CMM")

    def centroidal_momentum_matrix(self, base_transform: Any, joint_positions: Any) -> Any:
        """Return J_CMM, (6, 6 + n): h = J_CMM ν."""
        return _call(self.centroidal_momentum_matrix_fun(), base_transform, joint_positions)

    def centroidal_momentum_bias_fun(self) -> cs.Function:
        """Return (H, s, v_b, s_dot) → J̇_CMM ν, (6, 1): ḣ = J_CMM ν̇ + J̇_CMM ν."""
        build = self._quantities.centroidal_momentum_bias
        return self._function("centroidal_momentum_bias", build, _MOTION, "J_CMM_dot_nu")

    def centroidal_momentum_bias(
        self, base_transform: Any, joint_positions: Any, base_velocity: Any, joint_velocities: Any
    ) -> Any:
        """Return J̇_CMM ν, (6, 1): ḣ = J_CMM ν̇ + J̇_CMM ν."""
        return _call(
            self.centroidal_momentum_bias_fun(), base_transform, joint_positions, base_velocity, joint_velocities
        )

    # ---------------------------------------------------------------- dynamics

    def mass_matrix_fun(self) -> cs.Function:
        """Return (H, s) → M, (6 + n, 6 + n), by CRBA."""
        return self._function("mass_matrix", self._quantities.mass_matrix, _POSE, "M")

    def mass_matrix(self, base_transform: Any, joint_positions: Any) -> Any:
        """Return M, (6 + n, 6 + n), by CRBA."""
        return _call(self.mass_matrix_fun(), base_transform, joint_positions)

    def bias_force_fun(self) -> cs.Function:
        """Return (H, s, v_b, s_dot) → C ν + G, (6 + n, 1), by RNEA."""
        return self._function("bias_force", self._quantities.bias_force, _MOTION, "h")

    def bias_force(self, base_transform: Any, joint_positions: Any, base_velocity: Any, joint_velocities: Any) -> Any:
        """Return C ν + G, (6 + n, 1), by RNEA."""
        return _call(self.bias_force_fun(), base_transform, joint_positions, base_velocity, joint_velocities)

    def coriolis_term_fun(self) -> cs.Function:
        """Return (H, s, v_b, s_dot) → C ν, (6 + n, 1), by RNEA."""
        return self._function("coriolis_term", self._quantities.coriolis_term, _MOTION, "C_nu")

    def coriolis_term(
        self, base_transform: Any, joint_positions: Any, base_velocity: Any, joint_velocities: Any
    ) -> Any:
        """Return C ν, (6 + n, 1), by RNEA."""
        return _call(self.coriolis_term_fun(), base_transform, joint_positions, base_velocity, joint_velocities)

    def coriolis_matrix_fun(self) -> cs.Function:
        """Return (H, s, v_b, s_dot) → C, (6 + n, 6 + n), with Ṁ − 2 C skew-symmetric."""
        return self._function("coriolis_matrix", self._quantities.coriolis_matrix, _MOTION, "C")

    def coriolis_matrix(
        self, base_transform: Any, joint_positions: Any, base_velocity: Any, joint_velocities: Any
    ) -> Any:
        """Return C, (6 + n, 6 + n), with Ṁ − 2 C skew-symmetric."""
        return _call(self.coriolis_matrix_fun(), base_transform, joint_positions, base_velocity, joint_velocities)

    def gravity_term_fun(self) -> cs.Function:
        """Return (H, s) → G, (6 + n, 1): what holds the robot still."""
        return self._function("gravity_term", self._quantities.gravity_term, _POSE, "G")

    def gravity_term(self, base_transform: Any, joint_positions: Any) -> Any:
        """Return G, (6 + n, 1): what holds the robot still."""
        return _call(self.gravity_term_fun(), base_transform, joint_positions)

    def kinetic_energy_fun(self) -> cs.Function:
        """Return (H, s, v_b, s_dot) → T = ½ νᵀ M ν [J]."""
        return self._function("kinetic_energy", self._quantities.kinetic_energy, _MOTION, "T")

    def kinetic_energy(
        self, base_transform: Any, joint_positions: Any, base_velocity: Any, joint_velocities: Any
    ) -> Any:
        """Return T = ½ νᵀ M ν [J]."""
        return _call(self.kinetic_energy_fun(), base_transform, joint_positions, base_velocity, joint_velocities)

    def potential_energy_fun(self) -> cs.Function:
        """Return (H, s) → V = −m g·x [J], zero where the CoM passes the world's origin."""
        return self._function("potential_energy", self._quantities.potential_energy, _POSE, "V")

    def potential_energy(self, base_transform: Any, joint_positions: Any) -> Any:
        """Return V = −m g·x [J], zero where the CoM passes the world's origin."""
        return _call(self.potential_energy_fun(), base_transform, joint_positions)

    def rnea_fun(self, frames: Sequence[str] = ()) -> cs.Function:
        """Return (H, s, v_b, s_dot, v_b_dot, s_ddot, and the wrench on each of `frames`) → see `rnea`."""
        return self._wrench_function("rnea", self._quantities.rnea, _INVERSE, frames, "tau")

    def rnea(
        self,
        base_transform: Any,
        joint_positions: Any,
        base_velocity: Any,
        joint_velocities: Any,
        base_acceleration: Any,
        joint_accelerations: Any,
        external_wrenches: Mapping[str, Any] | None = None,
    ) -> Any:
        """Return M ν̇ + C ν + G − Σ Jᵀ w, (6 + n, 1): the force on the base and the joint torques of a motion.

        `external_wrenches` holds by frame name the (force, moment) that the world applies there, (6, 1), dual to the
        frame's velocity; mixed: at the frame's origin, in world axes.
        """
        wrenches = dict(external_wrenches or {})
        return _call(
            self.rnea_fun(tuple(wrenches)), base_transform, joint_positions, base_velocity, joint_velocities,
            base_acceleration, joint_accelerations, *wrenches.values(),
        )  # fmt: skip

    def aba_fun(self, frames: Sequence[str] = ()) -> cs.Function:
        """Return (H, s, v_b, s_dot, tau, and the wrench on each of `frames`) → ν̇; see `aba`.

        Raises:
            ModelError: a joint moves nothing that has mass, so that its acceleration is undefined.
        """
        return self._wrench_function("aba", self._aba, _FORWARD, frames, "nu_dot")

    def aba(
        self,
        base_transform: Any,
        joint_positions: Any,
        base_velocity: Any,
        joint_velocities: Any,
        joint_torques: Any,
        external_wrenches: Mapping[str, Any] | None = None,
    ) -> Any:
        """Return ν̇, (6 + n, 1), under joint torques and external wrenches (see `rnea`), by ABA.

        Raises:
            ModelError: a joint moves nothing that has mass, so that its acceleration is undefined.
        """
        wrenches = dict(external_wrenches or {})
        return _call(
            self.aba_fun(tuple(wrenches)), base_transform, joint_positions, base_velocity, joint_velocities,
            joint_torques, *wrenches.values(),
        )  # fmt: skip

    # ---------------------------------------------------------------- how a Function is made

    def _function(self, name: str, build: Callable[..., SX], inputs: Sequence[str], output: str) -> cs.Function:
        if name not in self._functions:
            n = self.NDoF
            shapes = {"H": (4, 4), "s": (n, 1), "s_dot": (n, 1), "s_ddot": (n, 1), "tau": (n, 1)}
            symbols = [cs.SX.sym(label, *shapes.get(label, (6, 1))) for label in inputs]
            safe = re.sub(r"[^A-Za-z0-9]+", "_", name).strip("_")
            self._functions[name] = cs.Function(safe, symbols, [cs.cse(build(*symbols))], list(inputs), [output])
        return self._functions[name]

    def _frame_function(
        self, name: str, frame: str, build: Callable[..., SX], inputs: Sequence[str], output: str
    ) -> cs.Function:
        self.tree.frame(frame)
        return self._function(f"{name} {frame}", partial(build, frame), inputs, output)

    def _wrench_function(
        self, name: str, build: Callable[..., SX], inputs: Sequence[str], frames: Sequence[str], output: str
    ) -> cs.Function:
        for frame in frames:
            self.tree.frame(frame)

        def with_wrenches(*arguments: SX) -> SX:
            return build(*arguments[: len(inputs)], dict(zip(frames, arguments[len(inputs) :], strict=True)))

        wrenches = [f"w_{index}" for index, _ in enumerate(frames)]
        return self._function(" ".join((name, *frames)), with_wrenches, (*inputs, *wrenches), output)

    def _aba(self, *arguments: Any) -> SX:
        """Return ABA's expression; refuse a joint that it would divide by nothing for."""
        composites = composite_inertias(self.tree, cs.DM.ones(self.NDoF))
        for body, composite in zip(self.tree.bodies[1:], composites[1:], strict=True):
            moved = composite.mass if body.prismatic else composite.about_origin[2, 2]
            if float(moved) <= 0:
                raise ModelError(f"joint '{body.joint}' moves nothing that has mass, so its acceleration is undefined")
        return self._quantities.aba(*arguments)


def _checked_gravity(gravity: ArrayLike) -> np.ndarray:
    vector = np.asarray(gravity, dtype=float).ravel()
    if vector.shape == (6,) and not vector[3:].any():  # adam's form
        vector = vector[:3]
    if vector.shape != (3,) or not np.isfinite(vector).all():
        raise InputError(f"gravity is {gravity!r}; expected three finite numbers, for example {GRAVITY}")
    return vector


def _call(function: cs.Function, *arguments: Any) -> Any:
    """Call a function with every argument's shape and finiteness checked."""
    return function(*(_checked(function, index, argument) for index, argument in enumerate(arguments)))


def _checked(function: cs.Function, index: int, argument: Any) -> Any:
    symbolic = isinstance(argument, cs.SX | cs.MX)
    value = argument if symbolic or isinstance(argument, cs.DM) else np.asarray(argument, dtype=float)
    expected, name = tuple(function.size_in(index)), function.name_in(index)
    if tuple(value.shape) not in (expected, expected[:1] if expected[1] == 1 else expected):
        raise InputError(f"{function.name()}: '{name}' has shape {tuple(value.shape)}; expected {expected}")
    if not symbolic and not np.isfinite(np.asarray(value)).all():
        raise InputError(f"{function.name()}: '{name}' holds values that are not finite")
    return value
