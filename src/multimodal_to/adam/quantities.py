"""Every quantity of a robot as an expression, with velocities and forces in the chosen representation.

The algorithms of this package work in the mixed representation. For the others, ν goes in as (ṗ, ω) = X v, forces come
out as Xᵀ f, and v̇ obeys (p̈, ω̇) = X v̇ + Ẋ v. In the body-fixed one the base itself takes the place of the world, so
that X is the identity and the base's pose drops out of everything but gravity.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import casadi as cs

from multimodal_to.adam import centroidal, kinematics, rnea
from multimodal_to.adam.aba import forward_dynamics
from multimodal_to.adam.coriolis import coriolis_matrix
from multimodal_to.adam.crba import centroidal_momentum_matrix, com_jacobian, mass_matrix
from multimodal_to.adam.kinematics import Chain, Motion, Pose
from multimodal_to.adam.representation import Representations, from_mixed, to_mixed, to_mixed_rate
from multimodal_to.adam.spatial import SX, homogeneous, symmetric
from multimodal_to.adam.tree import Tree


@dataclass(frozen=True)
class Quantities:
    """The quantities of `tree` under `gravity` [m/s²], (3, 1) in world axes; `KinDynComputations` describes each."""

    tree: Tree
    gravity: cs.DM
    representation: Representations

    # ---------------------------------------------------------------- frames

    def forward_kinematics(self, frame: str, transform: SX, s: SX) -> SX:
        """Return w_H_frame, (4, 4)."""
        pose = kinematics.forward_kinematics(self.tree, self.tree.frame(frame), _pose(transform), s)
        return homogeneous(pose.rotation, pose.translation)

    def jacobian(self, frame: str, transform: SX, s: SX) -> SX:
        """Return X_f⁻¹ J X, (6, 6 + n)."""
        base = self._seen(transform)
        chain = Chain.to(self.tree, self.tree.frame(frame), base, s)
        jacobian = kinematics.geometric_jacobian(chain, self._n)
        return from_mixed(self.representation, chain.end) @ jacobian @ self._velocities(base)

    def relative_jacobian(self, frame: str, s: SX) -> SX:
        """Return X_f⁻¹ J, (6, n), of the joints alone, with the base as the world."""
        chain = Chain.to(self.tree, self.tree.frame(frame), _pose(cs.SX.eye(4)), s)
        return from_mixed(self.representation, chain.end) @ kinematics.geometric_jacobian(chain, self._n)[:, 6:]

    def jacobian_dot(self, frame: str, transform: SX, s: SX, v: SX, s_dot: SX) -> SX:
        """Return d/dt (X_f⁻¹ J X) = X_f⁻¹ (J̇ X + J Ẋ − Ẋ_f X_f⁻¹ J X), (6, 6 + n)."""
        base = self._seen(transform)
        chain, motions = self._chain(frame, base, s, v, s_dot)
        twist = cs.vertcat(motions[-1].linear, motions[-1].angular)
        out, out_rate = (
            from_mixed(self.representation, chain.end),
            to_mixed_rate(self.representation, chain.end, twist),
        )
        jacobian = kinematics.geometric_jacobian(chain, self._n)
        rate = kinematics.geometric_jacobian_rate(chain, motions, self._n)
        into, into_rate = self._velocities(base), cs.diagcat(self._rate(base, v), cs.SX(self._n, self._n))
        return out @ (rate @ into + jacobian @ into_rate - out_rate @ (out @ jacobian @ into))

    def jacobian_dot_nu(self, frame: str, transform: SX, s: SX, v: SX, s_dot: SX) -> SX:
        """Return J̇ ν, (6, 1): the frame's acceleration while ν̇ = 0."""
        chain, motions = self._chain(frame, self._seen(transform), s, v, s_dot)
        end = motions[-1]
        twist, rate = cs.vertcat(end.linear, end.angular), cs.vertcat(end.linear_rate, end.angular_rate)
        out = from_mixed(self.representation, chain.end)
        return out @ (rate - to_mixed_rate(self.representation, chain.end, twist) @ (out @ twist))

    # ---------------------------------------------------------------- centre of mass and momentum

    def com_position(self, transform: SX, s: SX) -> SX:
        """Return x, (3, 1), world axes."""
        return centroidal.com_position(self.tree, _pose(transform), s)

    def com_velocity(self, transform: SX, s: SX, v: SX, s_dot: SX) -> SX:
        """Return ẋ, (3, 1), world axes."""
        base = self._seen(transform)
        return self._world(transform) @ centroidal.com_velocity(self.tree, base, s, self._twist(base, v), s_dot)

    def com_jacobian(self, transform: SX, s: SX) -> SX:
        """Return J_CoM X, (3, 6 + n), world axes."""
        base = self._seen(transform)
        return self._world(transform) @ com_jacobian(self.tree, base, s) @ self._velocities(base)

    def centroidal_momentum(self, transform: SX, s: SX, v: SX, s_dot: SX) -> SX:
        """Return h, (6, 1), about the CoM."""
        base = self._seen(transform)
        momentum = centroidal.centroidal_momentum(self.tree, base, s, self._twist(base, v), s_dot)
        return cs.vertcat(momentum.linear, momentum.angular)

    def centroidal_momentum_matrix(self, transform: SX, s: SX) -> SX:
        """Return J_CMM X, (6, 6 + n)."""
        base = self._seen(transform)
        return centroidal_momentum_matrix(self.tree, base, s) @ self._velocities(base)

    def centroidal_momentum_bias(self, transform: SX, s: SX, v: SX, s_dot: SX) -> SX:
        """Return J̇_CMM ν, (6, 1): ḣ while ν̇ = 0."""
        base = self._seen(transform)
        twist, acceleration = self._twist(base, v), self._rate(base, v) @ v
        rate = rnea.momentum_rate(self.tree, base, s, twist, s_dot, acceleration, cs.SX(self._n, 1))
        if self.representation is Representations.BODY_FIXED_REPRESENTATION:  # its axes turn with the base
            momentum = self.centroidal_momentum(transform, s, v, s_dot)
            rate -= cs.vertcat(cs.cross(v[3:], momentum[:3]), cs.cross(v[3:], momentum[3:]))
        return rate

    # ---------------------------------------------------------------- dynamics

    def mass_matrix(self, transform: SX, s: SX) -> SX:
        """Return Xᵀ M X, (6 + n, 6 + n)."""
        base = self._seen(transform)
        into = self._velocities(base)
        return cs.sparsify(symmetric(into.T @ mass_matrix(self.tree, base, s) @ into))

    def coriolis_matrix(self, transform: SX, s: SX, v: SX, s_dot: SX) -> SX:
        """Return Xᵀ (C X + M Ẋ), (6 + n, 6 + n)."""
        base = self._seen(transform)
        into = self._velocities(base)
        matrix = coriolis_matrix(self.tree, base, s, self._twist(base, v), s_dot) @ into
        if self.representation is not Representations.MIXED_REPRESENTATION:
            matrix += mass_matrix(self.tree, base, s)[:, :6] @ cs.horzcat(self._rate(base, v), cs.SX(6, self._n))
        return cs.sparsify(into.T @ matrix)

    def rnea(
        self, transform: SX, s: SX, v: SX, s_dot: SX, v_dot: SX, s_ddot: SX, wrenches: Mapping[str, SX] | None = None
    ) -> SX:
        """Return M ν̇ + C ν + G − Σ Jᵀ w, (6 + n, 1)."""
        return self._inverse_dynamics(transform, s, v, s_dot, v_dot, s_ddot, self.gravity, wrenches)

    def bias_force(self, transform: SX, s: SX, v: SX, s_dot: SX) -> SX:
        """Return C ν + G, (6 + n, 1)."""
        none = cs.SX(6, 1), cs.SX(self._n, 1)
        return self._inverse_dynamics(transform, s, v, s_dot, *none, self.gravity)

    def coriolis_term(self, transform: SX, s: SX, v: SX, s_dot: SX) -> SX:
        """Return C ν, (6 + n, 1)."""
        none = cs.SX(6, 1), cs.SX(self._n, 1)
        return self._inverse_dynamics(transform, s, v, s_dot, *none, cs.DM(3, 1))

    def gravity_term(self, transform: SX, s: SX) -> SX:
        """Return G, (6 + n, 1)."""
        none = cs.SX(6, 1), cs.SX(self._n, 1)
        return self._inverse_dynamics(transform, s, *none, *none, self.gravity)

    def aba(self, transform: SX, s: SX, v: SX, s_dot: SX, tau: SX, wrenches: Mapping[str, SX] | None = None) -> SX:
        """Return ν̇, (6 + n, 1)."""
        base = self._seen(transform)
        twist, gravity = self._twist(base, v), self._world(transform).T @ self.gravity
        applied = self._mixed_wrenches(base, s, wrenches)
        acceleration = forward_dynamics(self.tree, base, s, twist, s_dot, tau, gravity, applied)
        v_dot = from_mixed(self.representation, base) @ (acceleration[:6] - self._rate(base, v) @ v)
        return cs.vertcat(v_dot, acceleration[6:])

    def kinetic_energy(self, transform: SX, s: SX, v: SX, s_dot: SX) -> SX:
        """Return ½ νᵀ M ν, (1, 1)."""
        base = self._seen(transform)
        return centroidal.kinetic_energy(self.tree, base, s, self._twist(base, v), s_dot)

    def potential_energy(self, transform: SX, s: SX) -> SX:
        """Return −m g·x, (1, 1)."""
        return centroidal.potential_energy(self.tree, _pose(transform), s, self.gravity)

    # ---------------------------------------------------------------- between the representations

    @property
    def _n(self) -> int:
        return len(self.tree.joints)

    def _seen(self, transform: SX) -> Pose:
        """Return the base's pose as the algorithms get it: in the world, or in itself when body-fixed."""
        fixed = self.representation is Representations.BODY_FIXED_REPRESENTATION
        return _pose(cs.SX.eye(4) if fixed else transform)

    def _world(self, transform: SX) -> SX:
        """Return the rotation, (3, 3), from the axes that the algorithms work in to the world's."""
        fixed = self.representation is Representations.BODY_FIXED_REPRESENTATION
        return transform[:3, :3] if fixed else cs.SX.eye(3)

    def _velocities(self, base: Pose) -> SX:
        """Return the (6 + n, 6 + n) matrix that maps ν to the mixed (ṗ, ω, ṡ)."""
        return cs.diagcat(to_mixed(self.representation, base), cs.SX.eye(self._n))

    def _twist(self, base: Pose, v: SX) -> SX:
        return to_mixed(self.representation, base) @ v

    def _rate(self, base: Pose, v: SX) -> SX:
        return to_mixed_rate(self.representation, base, self._twist(base, v))

    def _chain(self, frame: str, base: Pose, s: SX, v: SX, s_dot: SX) -> tuple[Chain, list[Motion]]:
        """Return the chain to a frame and how it moves while ν̇ = 0."""
        twist, acceleration = self._twist(base, v), self._rate(base, v) @ v
        chain = Chain.to(self.tree, self.tree.frame(frame), base, s)
        motion = Motion(twist[:3], twist[3:], acceleration[:3], acceleration[3:])
        return chain, kinematics.chain_motions(chain, motion, s_dot)

    def _mixed_wrenches(self, base: Pose, s: SX, wrenches: Mapping[str, SX] | None) -> dict[str, SX]:
        mixed = {}
        for name, wrench in (wrenches or {}).items():
            pose = kinematics.forward_kinematics(self.tree, self.tree.frame(name), base, s)
            mixed[name] = from_mixed(self.representation, pose).T @ wrench
        return mixed

    def _inverse_dynamics(
        self,
        transform: SX,
        s: SX,
        v: SX,
        s_dot: SX,
        v_dot: SX,
        s_ddot: SX,
        gravity: cs.DM,
        wrenches: Mapping[str, SX] | None = None,
    ) -> SX:
        base = self._seen(transform)
        into = to_mixed(self.representation, base)
        acceleration = into @ v_dot + self._rate(base, v) @ v
        forces = rnea.inverse_dynamics(
            self.tree, base, s, into @ v, s_dot, acceleration, s_ddot, self._world(transform).T @ gravity,
            self._mixed_wrenches(base, s, wrenches),
        )  # fmt: skip
        return cs.vertcat(into.T @ forces[:6], forces[6:])


def _pose(transform: SX) -> Pose:
    return Pose(transform[:3, :3], transform[:3, 3])
