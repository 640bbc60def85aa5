"""`KinDynComputations`: kinematics and dynamics of a robot as named `casadi.Function`s, each built once.

Names, arguments and their order are those of adam (`adam.casadi.KinDynComputations`).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import casadi as cs

from multimodal_to.adam import aba, centroidal, coriolis, crba, kinematics, rnea
from multimodal_to.adam.floating_base import FloatingBase, as_pose
from multimodal_to.adam.kinematics import Chain
from multimodal_to.adam.library import Library
from multimodal_to.adam.quantity import of_frame, of_state, of_wrenches, quantity
from multimodal_to.adam.representation import Representations, from_mixed, to_mixed_rate
from multimodal_to.adam.singular import refuse_massless_motions
from multimodal_to.adam.spatial import homogeneous, symmetric


class KinDynComputations(Library):
    """Rigid-body library of one floating-base robot.

    Every quantity comes as `name_fun()`, a named `casadi.Function` that is built on first use and kept, and as
    `name(...)`, which checks the arguments and calls it with SX, MX, DM or numpy in. Arguments have the same names and
    the same order in all of them; `quantity.ARGUMENTS` gives the symbol, shape, frame and unit of each.

    ν = (v_b, ṡ), with v_b in the chosen representation; the default is the mixed one, (ṗ, ω) of the base's origin in
    world axes. Frame velocities and Jacobians, forces and momenta are in that representation too: forces are dual to ν,
    momenta are about the CoM, in the base's axes when body-fixed and in the world's otherwise. Positions and velocities
    of the CoM are always in world axes.

    Args:
        urdfstring: path of a URDF, or its XML text (adam's name).
        joints_name_list: joints that move, in the order of s; by default all that can. Mimic joints follow theirs.
        root_link: the base, named as a check; a URDF has only one root.
        gravity: acceleration of free fall in world axes [m/s²]: three numbers, or six with adam's three zeros behind.
        f_opts: options of every `casadi.Function` that is built, for example `{"jit": True}`; none by default.
        representation: how velocities are written, as a member of our `Representations` or of adam's.
        locked_joints: positions [rad or m] of movable joints left out of `joints_name_list`; zero by default.

    Raises:
        ModelError: the URDF cannot be read or is no robot, or a joint does not exist.
        InputError: gravity is not three finite numbers, or the representation is unknown.
    """

    # ---------------------------------------------------------------- frames

    @quantity
    def forward_kinematics(self, frame: str, base_transform: Any, joint_positions: Any) -> Any:
        """Return w_H_frame, (4, 4)."""
        pose = kinematics.forward_kinematics(
            self.tree, self.tree.frame(frame), as_pose(base_transform), joint_positions
        )
        return homogeneous(pose.rotation, pose.translation)

    @quantity
    def jacobian(self, frame: str, base_transform: Any, joint_positions: Any) -> Any:
        """Return J, (6, 6 + n): the frame's velocity is J ν."""
        base = self._base(base_transform)
        chain = Chain.to(self.tree, self.tree.frame(frame), base.pose, joint_positions)
        jacobian = kinematics.geometric_jacobian(chain, self.NDoF)
        return from_mixed(self.representation, chain.end) @ jacobian @ base.velocities()

    @quantity
    def relative_jacobian(self, frame: str, joint_positions: Any) -> Any:
        """Return J, (6, n): the frame's velocity is J ṡ, with the base as the world."""
        chain = Chain.to(self.tree, self.tree.frame(frame), as_pose(cs.SX.eye(4)), joint_positions)
        return from_mixed(self.representation, chain.end) @ kinematics.geometric_jacobian(chain, self.NDoF)[:, 6:]

    @quantity
    def jacobian_dot(
        self, frame: str, base_transform: Any, joint_positions: Any, base_velocity: Any, joint_velocities: Any
    ) -> Any:
        """Return J̇, (6, 6 + n), along the motion: X_f⁻¹ (J̇ X + J Ẋ − Ẋ_f X_f⁻¹ J X) of the mixed J."""
        base = self._base(base_transform)
        chain, motions = base.chain(frame, joint_positions, base_velocity, joint_velocities)
        twist = cs.vertcat(motions[-1].linear, motions[-1].angular)
        out = from_mixed(self.representation, chain.end)
        out_rate = to_mixed_rate(self.representation, chain.end, twist)
        jacobian = kinematics.geometric_jacobian(chain, self.NDoF)
        rate = kinematics.geometric_jacobian_rate(chain, motions, self.NDoF)
        into, into_rate = base.velocities(), cs.diagcat(base.rate(base_velocity), cs.SX(self.NDoF, self.NDoF))
        return out @ (rate @ into + jacobian @ into_rate - out_rate @ (out @ jacobian @ into))

    @quantity
    def jacobian_dot_nu(
        self, frame: str, base_transform: Any, joint_positions: Any, base_velocity: Any, joint_velocities: Any
    ) -> Any:
        """Return J̇ ν, (6, 1): the frame's acceleration while ν̇ = 0."""
        base = self._base(base_transform)
        chain, motions = base.chain(frame, joint_positions, base_velocity, joint_velocities)
        end = motions[-1]
        twist, rate = cs.vertcat(end.linear, end.angular), cs.vertcat(end.linear_rate, end.angular_rate)
        out = from_mixed(self.representation, chain.end)
        return out @ (rate - to_mixed_rate(self.representation, chain.end, twist) @ (out @ twist))

    # ---------------------------------------------------------------- centre of mass and momentum

    @quantity
    def CoM_position(self, base_transform: Any, joint_positions: Any) -> Any:
        """Return x, (3, 1): the CoM in the world [m]."""
        return centroidal.com_position(self.tree, as_pose(base_transform), joint_positions)

    @quantity
    def CoM_velocity(self, base_transform: Any, joint_positions: Any, base_velocity: Any, joint_velocities: Any) -> Any:
        """Return ẋ, (3, 1): the CoM's velocity in world axes [m/s]."""
        base = self._base(base_transform)
        twist = base.twist(base_velocity)
        return base.world @ centroidal.com_velocity(self.tree, base.pose, joint_positions, twist, joint_velocities)

    @quantity
    def CoM_jacobian(self, base_transform: Any, joint_positions: Any) -> Any:
        """Return J_CoM, (3, 6 + n): ẋ = J_CoM ν."""
        base = self._base(base_transform)
        return base.world @ crba.com_jacobian(self.tree, base.pose, joint_positions) @ base.velocities()

    @quantity
    def centroidal_momentum(
        self, base_transform: Any, joint_positions: Any, base_velocity: Any, joint_velocities: Any
    ) -> Any:
        """Return h = (m ẋ, hω), (6, 1), about the CoM, straight from the velocities."""
        return self._base(base_transform).momentum(joint_positions, base_velocity, joint_velocities)

    @quantity
    def centroidal_momentum_matrix(self, base_transform: Any, joint_positions: Any) -> Any:
        """Return J_CMM, (6, 6 + n): h = J_CMM ν."""
        base = self._base(base_transform)
        return crba.centroidal_momentum_matrix(self.tree, base.pose, joint_positions) @ base.velocities()

    @quantity
    def centroidal_momentum_bias(
        self, base_transform: Any, joint_positions: Any, base_velocity: Any, joint_velocities: Any
    ) -> Any:
        """Return J̇_CMM ν, (6, 1): ḣ = J_CMM ν̇ + J̇_CMM ν."""
        base, v, none = self._base(base_transform), base_velocity, cs.SX(self.NDoF, 1)
        twist, acceleration = base.twist(v), base.rate(v) @ v
        rate = rnea.momentum_rate(self.tree, base.pose, joint_positions, twist, joint_velocities, acceleration, none)
        if self.representation is Representations.BODY_FIXED_REPRESENTATION:  # its axes turn with the base
            momentum = base.momentum(joint_positions, v, joint_velocities)
            rate -= cs.vertcat(cs.cross(v[3:], momentum[:3]), cs.cross(v[3:], momentum[3:]))
        return rate

    # ---------------------------------------------------------------- dynamics

    @quantity
    def mass_matrix(self, base_transform: Any, joint_positions: Any) -> Any:
        """Return M, (6 + n, 6 + n), by CRBA: Xᵀ M X of the mixed M."""
        base = self._base(base_transform)
        into = base.velocities()
        return cs.sparsify(symmetric(into.T @ crba.mass_matrix(self.tree, base.pose, joint_positions) @ into))

    @quantity
    def coriolis_matrix(
        self, base_transform: Any, joint_positions: Any, base_velocity: Any, joint_velocities: Any
    ) -> Any:
        """Return C, (6 + n, 6 + n), with Ṁ − 2 C skew-symmetric: Xᵀ (C X + M Ẋ) of the mixed C."""
        base = self._base(base_transform)
        into, twist = base.velocities(), base.twist(base_velocity)
        matrix = coriolis.coriolis_matrix(self.tree, base.pose, joint_positions, twist, joint_velocities) @ into
        if self.representation is not Representations.MIXED_REPRESENTATION:
            rate = cs.horzcat(base.rate(base_velocity), cs.SX(6, self.NDoF))
            matrix += crba.mass_matrix(self.tree, base.pose, joint_positions)[:, :6] @ rate
        return cs.sparsify(into.T @ matrix)

    @quantity
    def bias_force(self, base_transform: Any, joint_positions: Any, base_velocity: Any, joint_velocities: Any) -> Any:
        """Return C ν + G, (6 + n, 1), by RNEA."""
        base = self._base(base_transform)
        return base.forces(joint_positions, base_velocity, joint_velocities, gravity=cs.DM(self.gravity))

    @quantity
    def coriolis_term(
        self, base_transform: Any, joint_positions: Any, base_velocity: Any, joint_velocities: Any
    ) -> Any:
        """Return C ν, (6 + n, 1), by RNEA."""
        base = self._base(base_transform)
        return base.forces(joint_positions, base_velocity, joint_velocities, gravity=cs.DM(3, 1))

    @quantity
    def gravity_term(self, base_transform: Any, joint_positions: Any) -> Any:
        """Return G, (6 + n, 1): what holds the robot still."""
        return self._base(base_transform).forces(joint_positions, gravity=cs.DM(self.gravity))

    @quantity
    def kinetic_energy(
        self, base_transform: Any, joint_positions: Any, base_velocity: Any, joint_velocities: Any
    ) -> Any:
        """Return T = ½ νᵀ M ν [J], (1, 1)."""
        base = self._base(base_transform)
        twist = base.twist(base_velocity)
        return centroidal.kinetic_energy(self.tree, base.pose, joint_positions, twist, joint_velocities)

    @quantity
    def potential_energy(self, base_transform: Any, joint_positions: Any) -> Any:
        """Return V = −m g·x [J], (1, 1), zero where the CoM passes the world's origin."""
        pose = as_pose(base_transform)
        return centroidal.potential_energy(self.tree, pose, joint_positions, cs.DM(self.gravity))

    @quantity
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
        motion = joint_positions, base_velocity, joint_velocities, base_acceleration, joint_accelerations
        return self._base(base_transform).forces(*motion, gravity=cs.DM(self.gravity), wrenches=external_wrenches)

    @quantity
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
            ModelError: a joint, the base or several of them move without moving any mass, so that their accelerations
                are undefined; or they do so in this posture.
        """
        refuse_massless_motions(self.tree)
        base = self._base(base_transform)
        acceleration = aba.forward_dynamics(
            self.tree,
            base.pose,
            joint_positions,
            base.twist(base_velocity),
            joint_velocities,
            joint_torques,
            base.world.T @ cs.DM(self.gravity),
            base.mixed_wrenches(joint_positions, external_wrenches),
        )
        v_dot = from_mixed(self.representation, base.pose) @ (
            acceleration[:6] - base.rate(base_velocity) @ base_velocity
        )
        return cs.vertcat(v_dot, acceleration[6:])

    # ---------------------------------------------------------------- the function of each, and the name of its result

    forward_kinematics_fun = of_frame(forward_kinematics, "w_H_frame")
    jacobian_fun = of_frame(jacobian, "J")
    relative_jacobian_fun = of_frame(relative_jacobian, "J")
    jacobian_dot_fun = of_frame(jacobian_dot, "J_dot")
    jacobian_dot_nu_fun = of_frame(jacobian_dot_nu, "J_dot_nu")
    CoM_position_fun = of_state(CoM_position, "CoM")
    CoM_velocity_fun = of_state(CoM_velocity, "v_CoM")
    CoM_jacobian_fun = of_state(CoM_jacobian, "J_CoM")
    centroidal_momentum_fun = of_state(centroidal_momentum, "h")
    centroidal_momentum_matrix_fun = of_state(centroidal_momentum_matrix, "J_CMM")
    centroidal_momentum_bias_fun = of_state(centroidal_momentum_bias, "J_CMM_dot_nu")
    mass_matrix_fun = of_state(mass_matrix, "M")
    coriolis_matrix_fun = of_state(coriolis_matrix, "C")
    bias_force_fun = of_state(bias_force, "h")
    coriolis_term_fun = of_state(coriolis_term, "C_nu")
    gravity_term_fun = of_state(gravity_term, "G")
    kinetic_energy_fun = of_state(kinetic_energy, "T")
    potential_energy_fun = of_state(potential_energy, "V")
    rnea_fun = of_wrenches(rnea, "tau")
    aba_fun = of_wrenches(aba, "nu_dot")

    def _base(self, base_transform: Any) -> FloatingBase:
        return FloatingBase.at(base_transform, self.tree, self.representation)
