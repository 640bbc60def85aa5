"""Forward dynamics of a `Tree`: the articulated body algorithm (ABA).

Source: R. Featherstone, "Rigid Body Dynamics Algorithms", Springer, 2008, chapter 7. As in RNEA, accelerations are
those of the bodies' origins, so that no linear velocity is needed. All of them are less gravity until the end.
"""

from __future__ import annotations

from collections.abc import Mapping

import casadi as cs

from multimodal_to.adam.crba import mass_matrix
from multimodal_to.adam.kinematics import Pose, joint_pose
from multimodal_to.adam.rnea import applied_wrenches, inverse_dynamics
from multimodal_to.adam.spatial import SX, Inertia, symmetric
from multimodal_to.adam.tree import BASE, Tree


def forward_dynamics(
    tree: Tree,
    base: Pose,
    s: SX,
    base_twist: SX,
    s_dot: SX,
    torques: SX,
    gravity: SX,
    wrenches: Mapping[str, SX] | None = None,
) -> SX:
    """Return ν̇ = (p̈, ω̇, s̈), (6 + n, 1): the articulated body algorithm (ABA).

    Bodies whose joints follow others cannot be articulated one by one: of such a robot, M ν̇ = (0, τ) − h is solved,
    with M by CRBA and h by RNEA.

    Args:
        tree: the robot.
        base: w_H_base, the pose of the base in the world.
        s: joint positions, (n, 1) [rad or m].
        base_twist: (ṗ, ω) of the base in world axes, (6, 1) [m/s, rad/s].
        s_dot: joint velocities, (n, 1) [rad/s or m/s].
        torques: of the joints, (n, 1) [N m or N].
        gravity: acceleration of free fall in world axes [m/s²], (3, 1).
        wrenches: by frame name, the (force, moment) that the world applies there, at the frame's origin, world axes.
    """
    n = len(tree.joints)
    if tree.followers:
        rest = cs.SX(6, 1), cs.SX(n, 1)
        bias = inverse_dynamics(tree, base, s, base_twist, s_dot, *rest, gravity, wrenches)
        return _solved(mass_matrix(tree, base, s), cs.vertcat(cs.SX(6, 1), torques) - bias)
    # what the bodies would need at zero ν̇: the bias wrenches, with gravity, as RNEA sees them
    poses = [base] + [joint_pose(body, s) for body in tree.bodies[1:]]
    omegas = [base.rotation.T @ base_twist[3:]]
    shifts: list[SX] = [cs.SX(6, 1)]  # velocity-dependent part of each body's (a, α) less its parent's, in body axes
    for body, pose in zip(tree.bodies[1:], poses[1:], strict=True):
        omega, rate = omegas[body.parent], body.joint_value(s_dot)
        back = pose.rotation.T
        centripetal = back @ cs.cross(omega, cs.cross(omega, pose.translation))
        omega = back @ omega
        if body.prismatic:
            shifts.append(cs.vertcat(centripetal + cs.vertcat(2 * omega[1] * rate, -2 * omega[0] * rate, 0), 0, 0, 0))
            omegas.append(omega)
        else:
            shifts.append(cs.vertcat(centripetal, omega[1] * rate, -omega[0] * rate, 0))
            omegas.append(omega + cs.vertcat(0, 0, rate))

    # inward: articulated inertias (6, 6) and bias wrenches
    inertias = [_spatial(body.inertia) for body in tree.bodies]
    biases = []
    for body, omega, wrench in zip(tree.bodies, omegas, applied_wrenches(tree, base, s, wrenches or {}), strict=True):
        first, second = body.inertia.first_moment, body.inertia.about_origin
        biases.append(cs.vertcat(cs.cross(omega, cs.cross(omega, first)), cs.cross(omega, second @ omega)) - wrench)
    pulls: dict[int, tuple[SX, SX, SX]] = {}
    for index in range(len(tree.bodies) - 1, BASE, -1):
        body, pose = tree.bodies[index], poses[index]
        axis = 2 if body.prismatic else 5
        column = inertias[index][:, axis]
        pull = column[axis]
        excess = torques[body.column] - biases[index][axis]
        pulls[index] = (column, pull, excess)
        inertia = symmetric(inertias[index] - column @ column.T / pull)
        bias = biases[index] + inertia @ shifts[index] + column * (excess / pull)
        motion = _motion_transform(pose)
        inertias[body.parent] = symmetric(inertias[body.parent] + motion.T @ (inertia @ motion))
        biases[body.parent] = biases[body.parent] + motion.T @ bias

    # the base, then outward
    accelerations = [_solved(inertias[BASE], -biases[BASE])]
    result = cs.SX(6 + n, 1)
    for index in range(1, len(tree.bodies)):
        body = tree.bodies[index]
        axis = 2 if body.prismatic else 5
        column, pull, excess = pulls[index]
        carried = _motion_transform(poses[index]) @ accelerations[body.parent] + shifts[index]
        joint = (excess - cs.dot(column, carried)) / pull
        result[6 + body.column] = joint
        unit = cs.DM.zeros(6)
        unit[axis] = 1
        accelerations.append(carried + unit * joint)
    result[:3] = base.rotation @ accelerations[BASE][:3] + gravity
    result[3:6] = base.rotation @ accelerations[BASE][3:]
    return result


def _solved(matrix: SX, right: SX) -> SX:
    """Return x of A x = b, with A symmetric and positive."""
    return cs.ldl_solve(right, *cs.ldl(matrix, False))


def _spatial(inertia: Inertia) -> SX:
    """Return the (6, 6) inertia that maps (a, α) of the origin to (force, moment about the origin)."""
    arm = cs.skew(inertia.first_moment)
    return cs.SX(cs.vertcat(cs.horzcat(inertia.mass * cs.DM.eye(3), -arm), cs.horzcat(arm, inertia.about_origin)))


def _motion_transform(pose: Pose) -> SX:
    """Return X, (6, 6), that maps (a, α) of the parent's origin to those of the child's, in child axes."""
    back = pose.rotation.T
    return cs.vertcat(cs.horzcat(back, -back @ cs.skew(pose.translation)), cs.horzcat(cs.SX(3, 3), back))
