"""A robot's base in a velocity representation, and what several quantities have in common.

The algorithms of this package work in the mixed representation. For the others, ν goes in as (ṗ, ω) = X v, forces come
out as Xᵀ f, and v̇ obeys (p̈, ω̇) = X v̇ + Ẋ v. In the body-fixed one the base itself takes the place of the world, so
that X is the identity and the base's pose drops out of everything but gravity.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import casadi as cs

from multimodal_to.adam import centroidal, kinematics, rnea
from multimodal_to.adam.kinematics import Chain, Motion, Pose
from multimodal_to.adam.representation import Representations, from_mixed, to_mixed, to_mixed_rate
from multimodal_to.adam.spatial import SX
from multimodal_to.adam.tree import Tree


@dataclass(frozen=True)
class FloatingBase:
    """The base of `tree` in a representation; `FloatingBase.at` makes it.

    Methods take s, v_b and ṡ as `KinDynComputations` does, v_b in the representation.
    """

    tree: Tree
    representation: Representations
    pose: Pose  # as the algorithms get it: in the world, or in itself when body-fixed
    world: SX  # (3, 3), the rotation from the axes that the algorithms work in to the world's

    @classmethod
    def at(cls, base_transform: SX, tree: Tree, representation: Representations) -> FloatingBase:
        """Return the base at `base_transform`, w_H_base, (4, 4).

        Args:
            base_transform: w_H_base, (4, 4) [1, m].
            tree: the robot.
            representation: how v_b is written.
        """
        if representation is Representations.BODY_FIXED_REPRESENTATION:
            return cls(tree, representation, as_pose(cs.SX.eye(4)), base_transform[:3, :3])
        return cls(tree, representation, as_pose(base_transform), cs.SX.eye(3))

    def velocities(self) -> SX:
        """Return diag(X, 1), (6 + n, 6 + n), which maps ν to the mixed (ṗ, ω, ṡ)."""
        return cs.diagcat(to_mixed(self.representation, self.pose), cs.SX.eye(len(self.tree.joints)))

    def twist(self, v_b: SX) -> SX:
        """Return (ṗ, ω) = X v_b, (6, 1)."""
        return to_mixed(self.representation, self.pose) @ v_b

    def rate(self, v_b: SX) -> SX:
        """Return Ẋ, (6, 6), while the base moves with v_b."""
        return to_mixed_rate(self.representation, self.pose, self.twist(v_b))

    def chain(self, frame: str, s: SX, v_b: SX, s_dot: SX) -> tuple[Chain, list[Motion]]:
        """Return the chain to a frame and how it moves while ν̇ = 0.

        Args:
            frame: name of the frame.
            s: joint positions, (n, 1) [rad or m].
            v_b: velocity of the base in the representation, (6, 1) [m/s, rad/s].
            s_dot: joint velocities, (n, 1) [rad/s or m/s].
        """
        twist, acceleration = self.twist(v_b), self.rate(v_b) @ v_b
        chain = Chain.to(self.tree, self.tree.frame(frame), self.pose, s)
        motion = Motion(twist[:3], twist[3:], acceleration[:3], acceleration[3:])
        return chain, kinematics.chain_motions(chain, motion, s_dot)

    def momentum(self, s: SX, v_b: SX, s_dot: SX) -> SX:
        """Return h = (m ẋ, hω), (6, 1), about the CoM.

        Args:
            s: joint positions, (n, 1) [rad or m].
            v_b: velocity of the base in the representation, (6, 1) [m/s, rad/s].
            s_dot: joint velocities, (n, 1) [rad/s or m/s].
        """
        momentum = centroidal.centroidal_momentum(self.tree, self.pose, s, self.twist(v_b), s_dot)
        return cs.vertcat(momentum.linear, momentum.angular)

    def forces(
        self,
        s: SX,
        v_b: SX | None = None,
        s_dot: SX | None = None,
        v_b_dot: SX | None = None,
        s_ddot: SX | None = None,
        *,
        gravity: cs.DM,
        wrenches: Mapping[str, SX] | None = None,
    ) -> SX:
        """Return M ν̇ + C ν + G − Σ Jᵀ w, (6 + n, 1), by RNEA; what is not given is zero.

        Args:
            s: joint positions, (n, 1) [rad or m].
            v_b: velocity of the base, (6, 1) [m/s, rad/s].
            s_dot: joint velocities, (n, 1) [rad/s or m/s].
            v_b_dot: derivative of the six numbers v_b, (6, 1) [m/s², rad/s²].
            s_ddot: joint accelerations, (n, 1) [rad/s² or m/s²].
            gravity: acceleration of free fall in world axes, (3, 1) [m/s²].
            wrenches: by frame, the (force, moment) that the world applies, (6, 1) [N, N m], in the representation.
        """
        v_b, v_b_dot = (cs.SX(6, 1) if value is None else value for value in (v_b, v_b_dot))
        s_dot, s_ddot = (cs.SX(len(self.tree.joints), 1) if value is None else value for value in (s_dot, s_ddot))
        into = to_mixed(self.representation, self.pose)
        forces = rnea.inverse_dynamics(
            self.tree,
            self.pose,
            s,
            base_twist=into @ v_b,
            s_dot=s_dot,
            base_acceleration=into @ v_b_dot + self.rate(v_b) @ v_b,
            s_ddot=s_ddot,
            gravity=self.world.T @ gravity,
            wrenches=self.mixed_wrenches(s, wrenches),
        )
        return cs.vertcat(into.T @ forces[:6], forces[6:])

    def mixed_wrenches(self, s: SX, wrenches: Mapping[str, SX] | None) -> dict[str, SX]:
        """Return the wrenches on frames, (6, 1) each, as the algorithms take them: Xᵀ⁻¹ w."""
        mixed = {}
        for name, wrench in (wrenches or {}).items():
            pose = kinematics.forward_kinematics(self.tree, self.tree.frame(name), self.pose, s)
            mixed[name] = from_mixed(self.representation, pose).T @ wrench
        return mixed


def as_pose(transform: SX) -> Pose:
    """Return a homogeneous transform, (4, 4), as a pose."""
    return Pose(transform[:3, :3], transform[:3, 3])
