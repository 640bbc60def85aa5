"""What depends on the inertias alone: the mass matrix by CRBA, the centroidal momentum matrix and the CoM's Jacobian.

Source: R. Featherstone, "Rigid Body Dynamics Algorithms", Springer, 2008, chapter 6; the centroidal momentum matrix:
D. E. Orin, A. Goswami, S.-H. Lee, "Centroidal dynamics of a humanoid robot", Autonomous Robots, 2013.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as cs

from multimodal_to.adam.centroidal import composite_inertias
from multimodal_to.adam.kinematics import Pose, body_poses
from multimodal_to.adam.spatial import SX, Inertia, symmetric
from multimodal_to.adam.tree import BASE, Tree


@dataclass(frozen=True)
class UnitMomenta:
    """What a unit of each velocity sets moving, seen from the base's origin in the axes of the base's pose."""

    base: SX  # (6, 6): momentum (l, k) for a unit of each of (ṗ, ω)
    joints: SX  # (6, bodies − 1): for a unit of each body's joint, in the order of the bodies
    poses: list[Pose]  # of the bodies, from the base's origin
    com: SX  # [m], (3, 1)
    composites: list[Inertia]  # of each body with all that hangs on it, in its own frame


def unit_momenta(tree: Tree, base: Pose, s: SX) -> UnitMomenta:
    """Return the momenta of unit velocities.

    A unit velocity of joint i moves all that hangs on it, with the composite inertia (m, h, I) of body i:
    l = z × h, k = I z + p_i × l, or l = m z, k = h × z + p_i × l when prismatic.

    Args:
        tree: the robot.
        base: w_H_base, the pose of the base in the world.
        s: joint positions, (n, 1) [rad or m].
    """
    composites = composite_inertias(tree, s)
    poses = body_poses(tree, Pose(base.rotation, cs.SX.zeros(3)), s)
    whole = composites[BASE].rotated(base.rotation)
    of_base, of_joints = cs.SX(6, 6), []
    of_base[:3, :3] = tree.total_mass * cs.SX.eye(3)
    of_base[3:, :3] = cs.skew(whole.first_moment)
    of_base[:3, 3:] = -cs.skew(whole.first_moment)
    of_base[3:, 3:] = whole.about_origin
    for body, composite, pose in zip(tree.bodies[1:], composites[1:], poses[1:], strict=True):
        x, y, _ = cs.vertsplit(composite.first_moment)
        if body.prismatic:
            linear, angular = cs.vertcat(0, 0, composite.mass), cs.vertcat(y, -x, 0)
        else:
            linear, angular = cs.vertcat(-y, x, 0), composite.about_origin[:, 2]
        of_joints.append(to_base(pose, linear, angular))
    joints = cs.horzcat(cs.SX(6, 0), *of_joints)
    return UnitMomenta(of_base, joints, poses, whole.first_moment / tree.total_mass, composites)


def to_base(pose: Pose, linear: SX, angular: SX) -> SX:
    """Return a momentum or wrench at a body's origin, in body axes, at the base's origin: (R l, R k + p × R l).

    Args:
        pose: the body's, in the base.
        linear: momentum [kg m/s] or force [N] in body axes, (3, 1).
        angular: angular momentum [kg m²/s] or moment [N m] about the body's origin, in body axes, (3, 1).
    """
    turned = pose.rotation @ linear
    return cs.vertcat(turned, pose.rotation @ angular + cs.cross(pose.translation, turned))


def joint_motions(tree: Tree, poses: list[Pose]) -> SX:
    """Return what a unit of each body's joint does at the base's origin, (6, bodies − 1): (p × a, a), or (a, 0)."""
    motions = cs.SX(6, len(tree.bodies) - 1)
    for joint, (body, pose) in enumerate(zip(tree.bodies[1:], poses[1:], strict=True)):
        axis = pose.rotation[:, 2]
        if body.prismatic:
            motions[:3, joint] = axis
        else:
            motions[:3, joint] = cs.cross(pose.translation, axis)
            motions[3:, joint] = axis
    return motions


def gathered(tree: Tree, matrix: SX) -> SX:
    """Return Gᵀ A G, (6 + n, 6 + n), of a matrix over the base and the bodies' joints: `Tree.coupling` is their G."""
    coupling = cs.diagcat(cs.DM.eye(6), tree.coupling)
    return coupling.T @ matrix @ coupling


def mass_matrix(tree: Tree, base: Pose, s: SX) -> SX:
    """Return M(q), (6 + n, 6 + n), for ν = (ṗ_base, ω_base, ṡ): the composite rigid body algorithm (CRBA).

    M_ij of joint i and a joint j above it is the momentum that joint i gives, along the motion of joint j; joints on
    different branches do not meet. Joints are those of the bodies first, and then gathered into those of s.

    Args:
        tree: the robot.
        base: w_H_base, the pose of the base in the world.
        s: joint positions, (n, 1) [rad or m].
    """
    units = unit_momenta(tree, base, s)
    motions = joint_motions(tree, units.poses)
    joints = len(tree.bodies) - 1
    matrix = cs.SX(6 + joints, 6 + joints)
    matrix[:6, :] = cs.horzcat(units.base, units.joints)
    for index in range(len(tree.bodies)):
        for above in tree.path(index):
            motion, momentum = motions[:, above - 1], units.joints[:, index - 1]
            matrix[5 + above, 5 + index] = cs.dot(motion[3:], momentum[3:]) + cs.dot(motion[:3], momentum[:3])
    return cs.sparsify(symmetric(gathered(tree, symmetric(matrix))))


def centroidal_momentum_matrix(tree: Tree, base: Pose, s: SX) -> SX:
    """Return J_CMM(q), (6, 6 + n), with h = J_CMM ν about the CoM: the unit momenta of CRBA, moved there.

    Args:
        tree: the robot.
        base: w_H_base, the pose of the base in the world.
        s: joint positions, (n, 1) [rad or m].
    """
    units = unit_momenta(tree, base, s)
    columns = cs.horzcat(units.base, units.joints @ tree.coupling)
    matrix = cs.SX(columns)
    matrix[3:, :3] = 0
    for column in range(3, 6 + len(tree.joints)):
        matrix[3:, column] = columns[3:, column] - cs.cross(units.com, columns[:3, column])
    matrix[3:, 3:6] = symmetric(matrix[3:, 3:6])
    return cs.sparsify(matrix)


def com_jacobian(tree: Tree, base: Pose, s: SX) -> SX:
    """Return J_CoM(q), (3, 6 + n), with ẋ = J_CoM ν: the linear unit momenta over the mass.

    Args:
        tree: the robot.
        base: w_H_base, the pose of the base in the world.
        s: joint positions, (n, 1) [rad or m].
    """
    units = unit_momenta(tree, base, s)
    return cs.sparsify(cs.horzcat(units.base, units.joints @ tree.coupling)[:3, :] / tree.total_mass)
