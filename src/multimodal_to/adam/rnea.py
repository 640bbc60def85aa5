"""Inverse dynamics of a `Tree`: the recursive Newton-Euler algorithm (RNEA), and the momentum's rate that it gives.

Source: R. Featherstone, "Rigid Body Dynamics Algorithms", Springer, 2008, chapter 5, in 3-vectors: each body carries
its angular velocity and the acceleration of its origin, so that no linear velocity is needed, and a base acceleration
in the mixed representation (p̈, ω̇) goes in as it is.
"""

from __future__ import annotations

from collections.abc import Mapping

import casadi as cs

from multimodal_to.adam.centroidal import com_in_base
from multimodal_to.adam.kinematics import Pose, body_poses, joint_pose
from multimodal_to.adam.spatial import SX
from multimodal_to.adam.tree import BASE, Tree


def inverse_dynamics(
    tree: Tree,
    base: Pose,
    s: SX,
    base_twist: SX,
    s_dot: SX,
    base_acceleration: SX,
    s_ddot: SX,
    gravity: SX,
    wrenches: Mapping[str, SX] | None = None,
) -> SX:
    """Return M ν̇ + C ν + G − Σ Jᵀ w, (6 + n, 1): the recursive Newton-Euler algorithm (RNEA).

    Args:
        tree: the robot.
        base: w_H_base, the pose of the base in the world.
        s: joint positions, (n, 1) [rad or m].
        base_twist: (ṗ, ω) of the base in world axes, (6, 1) [m/s, rad/s].
        s_dot: joint velocities, (n, 1) [rad/s or m/s].
        base_acceleration: (p̈, ω̇) of the base in world axes, (6, 1) [m/s², rad/s²].
        s_ddot: joint accelerations, (n, 1) [rad/s² or m/s²].
        gravity: acceleration of free fall in world axes [m/s²], (3, 1).
        wrenches: by frame name, the (force, moment) that the world applies there, at the frame's origin, world axes.
    """
    # outward: angular velocity and acceleration, acceleration of the origin less gravity, all in body axes
    up = base.rotation.T
    omegas = [up @ base_twist[3:]]
    alphas = [up @ base_acceleration[3:]]
    accelerations = [up @ (base_acceleration[:3] - gravity)]
    poses = [base] + [joint_pose(body, s) for body in tree.bodies[1:]]
    for body, pose in zip(tree.bodies[1:], poses[1:], strict=True):
        omega, alpha, acceleration = omegas[body.parent], alphas[body.parent], accelerations[body.parent]
        back = pose.rotation.T
        carried = acceleration + _turning(omega, alpha) @ pose.translation
        rate, rate_change = body.joint_value(s_dot), body.joint_value(s_ddot)
        omega, alpha, acceleration = back @ omega, back @ alpha, back @ carried
        if body.prismatic:
            acceleration = acceleration + cs.vertcat(2 * omega[1] * rate, -2 * omega[0] * rate, rate_change)
        else:
            alpha = alpha + cs.vertcat(omega[1] * rate, -omega[0] * rate, rate_change)
            omega = omega + cs.vertcat(0, 0, rate)
        omegas.append(omega)
        alphas.append(alpha)
        accelerations.append(acceleration)

    # inward: forces and moments about the origin
    forces, moments = [], []
    applied = applied_wrenches(tree, base, s, wrenches or {})
    for body, omega, alpha, acceleration, wrench in zip(
        tree.bodies, omegas, alphas, accelerations, applied, strict=True
    ):
        mass, first, second = body.inertia.mass, body.inertia.first_moment, body.inertia.about_origin
        forces.append(mass * acceleration + _turning(omega, alpha) @ first - wrench[:3])
        gyroscopic = cs.cross(omega, second @ omega)
        moments.append(second @ alpha + gyroscopic + cs.cross(first, acceleration) - wrench[3:])
    torques = cs.SX(6 + len(tree.joints), 1)
    for index in range(len(tree.bodies) - 1, BASE, -1):
        body, pose = tree.bodies[index], poses[index]
        torques[6 + body.column] += body.multiplier * (forces[index][2] if body.prismatic else moments[index][2])
        force = pose.rotation @ forces[index]
        forces[body.parent] = forces[body.parent] + force
        moments[body.parent] = moments[body.parent] + pose.rotation @ moments[index] + cs.cross(pose.translation, force)
    torques[:3] = base.rotation @ forces[BASE]
    torques[3:6] = base.rotation @ moments[BASE]
    return torques


def momentum_rate(tree: Tree, base: Pose, s: SX, base_twist: SX, s_dot: SX, base_acceleration: SX, s_ddot: SX) -> SX:
    """Return ḣ about the CoM in world axes, (6, 1): the base's wrench of RNEA without gravity, moved to the CoM.

    Args:
        tree: the robot.
        base: w_H_base, the pose of the base in the world.
        s: joint positions, (n, 1) [rad or m].
        base_twist: (ṗ, ω) of the base in world axes, (6, 1) [m/s, rad/s].
        s_dot: joint velocities, (n, 1) [rad/s or m/s].
        base_acceleration: (p̈, ω̇) of the base in world axes, (6, 1) [m/s², rad/s²].
        s_ddot: joint accelerations, (n, 1) [rad/s² or m/s²].
    """
    wrench = inverse_dynamics(tree, base, s, base_twist, s_dot, base_acceleration, s_ddot, cs.DM.zeros(3, 1))
    arm = base.rotation @ com_in_base(tree, s)
    return cs.vertcat(wrench[:3], wrench[3:6] - cs.cross(arm, wrench[:3]))


def _turning(omega: SX, alpha: SX) -> SX:
    """Return S(α) + S(ω)², (3, 3): times a fixed arm, the acceleration of its tip."""
    x, y, z = cs.vertsplit(omega)
    xx, yy, zz, xy, xz, yz = x * x, y * y, z * z, x * y, x * z, y * z
    return cs.vertcat(
        cs.horzcat(-(yy + zz), xy - alpha[2], xz + alpha[1]),
        cs.horzcat(xy + alpha[2], -(xx + zz), yz - alpha[0]),
        cs.horzcat(xz - alpha[1], yz + alpha[0], -(xx + yy)),
    )


def applied_wrenches(tree: Tree, base: Pose, s: SX, wrenches: Mapping[str, SX]) -> list[SX]:
    """Return the wrench (force, moment) on each body at its own origin, in its own axes, (6, 1) each.

    Args:
        tree: the robot.
        base: w_H_base, the pose of the base in the world.
        s: joint positions, (n, 1) [rad or m].
        wrenches: by frame name, (force, moment) at the frame's origin in world axes, (6, 1) [N, N m].
    """
    applied = [cs.SX(6, 1) for _ in tree.bodies]
    poses = body_poses(tree, base, s) if wrenches else []
    for name, wrench in wrenches.items():
        frame = tree.frame(name)
        back = poses[frame.body].rotation.T
        force = back @ wrench[:3]
        applied[frame.body] += cs.vertcat(force, back @ wrench[3:] + cs.cross(frame.translation, force))
    return applied
