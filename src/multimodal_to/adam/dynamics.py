"""Mass matrix, inverse and forward dynamics of a `Tree`: CRBA, RNEA and ABA.

Source: R. Featherstone, "Rigid Body Dynamics Algorithms", 2008, in 3-vectors: each body carries its angular velocity
and the acceleration of its origin, so that no linear velocity is needed, and a base acceleration in the mixed
representation (p̈, ω̇) goes in as it is.
"""

from __future__ import annotations

from collections.abc import Mapping

import casadi as cs

from multimodal_to.adam.centroidal import composite_inertias
from multimodal_to.adam.kinematics import Pose, body_poses, joint_angle, joint_pose
from multimodal_to.adam.spatial import SX, Inertia, symmetric
from multimodal_to.adam.tree import BASE, Frame, Tree


def momentum_columns(tree: Tree, base: Pose, s: SX) -> tuple[SX, list[Pose], SX]:
    """Return the momentum that a unit of each velocity gives, the body poses from the base's origin, and the CoM.

    The columns, (6, 6 + n), are (l, k) in world axes about the base's origin. A unit velocity of joint i moves all that
    hangs on it, with composite inertia (m, h, I): l = z × h, k = I z + p_i × l, or l = m z, k = h × z when prismatic.
    The CoM is seen from the base's origin, in world axes.
    """
    composites = composite_inertias(tree, s)
    poses = body_poses(tree, Pose(base.rotation, cs.SX.zeros(3)), s)
    whole = composites[BASE].rotated(base.rotation)
    columns = cs.SX(6, 6 + len(tree.joints))
    columns[:3, :3] = tree.total_mass * cs.SX.eye(3)
    columns[3:, :3] = cs.skew(whole.first_moment)
    columns[:3, 3:6] = -cs.skew(whole.first_moment)
    columns[3:, 3:6] = whole.about_origin
    for body, composite, pose in zip(tree.bodies[1:], composites[1:], poses[1:], strict=True):
        x, y, _ = cs.vertsplit(composite.first_moment)
        if body.prismatic:
            linear, angular = cs.vertcat(0, 0, composite.mass), cs.vertcat(y, -x, 0)
        else:
            linear, angular = cs.vertcat(-y, x, 0), composite.about_origin[:, 2]
        linear = pose.rotation @ linear
        columns[:3, 6 + body.column] = linear
        columns[3:, 6 + body.column] = pose.rotation @ angular + cs.cross(pose.translation, linear)
    return columns, poses, whole.first_moment / tree.total_mass


def mass_matrix(tree: Tree, base: Pose, s: SX) -> SX:
    """Return M(q), (6 + n, 6 + n), for ν = (ṗ_base, ω_base, ṡ): the composite rigid body algorithm (CRBA).

    M_ij of joint i and a joint j above it is the momentum column of i seen along j's motion, a_j·(k + l × p_j) when
    j is revolute, a_j·l when prismatic; joints on different branches do not meet.
    """
    columns, poses, _ = momentum_columns(tree, base, s)
    matrix = cs.SX(6 + len(tree.joints), 6 + len(tree.joints))
    matrix[:6, :] = columns
    axes = [pose.rotation[:, 2] for pose in poses]
    moments = [cs.cross(pose.translation, axis) for pose, axis in zip(poses, axes, strict=True)]
    for index, body in enumerate(tree.bodies):
        if index == BASE:
            continue
        column = 6 + body.column
        linear, angular = columns[:3, column], columns[3:, column]
        for above in tree.path(index):
            other = tree.bodies[above]
            if other.prismatic:
                entry = cs.dot(axes[above], linear)
            else:
                entry = cs.dot(axes[above], angular) + cs.dot(moments[above], linear)
            low, high = sorted((column, 6 + other.column))
            matrix[low, high] = entry
    return cs.sparsify(symmetric(matrix))


def centroidal_momentum_matrix(tree: Tree, base: Pose, s: SX) -> SX:
    """Return J_CMM(q), (6, 6 + n), with h = J_CMM ν about the CoM in world axes: the columns of CRBA, moved there."""
    columns, _, com = momentum_columns(tree, base, s)
    matrix = cs.SX(columns)
    matrix[3:, :3] = 0
    for column in range(3, 6 + len(tree.joints)):
        matrix[3:, column] = columns[3:, column] - cs.cross(com, columns[:3, column])
    matrix[3:, 3:6] = symmetric(matrix[3:, 3:6])
    return cs.sparsify(matrix)


def com_jacobian(tree: Tree, base: Pose, s: SX) -> SX:
    """Return J_CoM(q), (3, 6 + n), with ẋ = J_CoM ν: the linear momentum columns over the mass."""
    columns, _, _ = momentum_columns(tree, base, s)
    return cs.sparsify(columns[:3, :] / tree.total_mass)


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
        base: pose of the base in the world.
        s: joint positions.
        base_twist: (ṗ, ω) of the base in world axes.
        s_dot: joint velocities.
        base_acceleration: (p̈, ω̇) of the base in world axes.
        s_ddot: joint accelerations.
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
        rate, rate_change = s_dot[body.column], s_ddot[body.column]
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
    for body, omega, alpha, acceleration in zip(tree.bodies, omegas, alphas, accelerations, strict=True):
        inertia = body.inertia
        forces.append(inertia.mass * acceleration + _turning(omega, alpha) @ inertia.first_moment)
        moments.append(
            inertia.about_origin @ alpha
            + cs.cross(omega, inertia.about_origin @ omega)
            + cs.cross(inertia.first_moment, acceleration)
        )
    if wrenches:
        _subtract_wrenches(tree, base, s, wrenches, forces, moments)
    torques = cs.SX(6 + len(tree.joints), 1)
    for index in range(len(tree.bodies) - 1, BASE, -1):
        body, pose = tree.bodies[index], poses[index]
        torques[6 + body.column] = forces[index][2] if body.prismatic else moments[index][2]
        force = pose.rotation @ forces[index]
        forces[body.parent] = forces[body.parent] + force
        moments[body.parent] = (
            moments[body.parent] + pose.rotation @ moments[index] + cs.cross(pose.translation, force)
        )
    torques[:3] = base.rotation @ forces[BASE]
    torques[3:6] = base.rotation @ moments[BASE]
    return torques


def _turning(omega: SX, alpha: SX) -> SX:
    """Return S(α) + S(ω)², (3, 3): times a fixed arm, the acceleration of its tip."""
    x, y, z = cs.vertsplit(omega)
    xx, yy, zz, xy, xz, yz = x * x, y * y, z * z, x * y, x * z, y * z
    return cs.vertcat(
        cs.horzcat(-(yy + zz), xy - alpha[2], xz + alpha[1]),
        cs.horzcat(xy + alpha[2], -(xx + zz), yz - alpha[0]),
        cs.horzcat(xz - alpha[1], yz + alpha[0], -(xx + yy)),
    )


def _subtract_wrenches(
    tree: Tree, base: Pose, s: SX, wrenches: Mapping[str, SX], forces: list[SX], moments: list[SX]
) -> None:
    poses = body_poses(tree, base, s)
    for name, wrench in wrenches.items():
        frame: Frame = tree.frame(name)
        back = poses[frame.body].rotation.T
        force = back @ wrench[:3]
        forces[frame.body] = forces[frame.body] - force
        moments[frame.body] = moments[frame.body] - back @ wrench[3:] - cs.cross(frame.translation, force)


def forward_dynamics(
    tree: Tree, base: Pose, s: SX, base_twist: SX, s_dot: SX, torques: SX, base_wrench: SX, gravity: SX
) -> SX:
    """Return ν̇ = (p̈, ω̇, s̈), (6 + n, 1): the articulated body algorithm (ABA).

    Args:
        tree: the robot.
        base: pose of the base in the world.
        s: joint positions.
        base_twist: (ṗ, ω) of the base in world axes.
        s_dot: joint velocities.
        torques: of the joints [N m or N].
        base_wrench: (force, moment) on the base, at its origin, world axes.
        gravity: acceleration of free fall in world axes [m/s²], (3, 1).
    """
    n = len(tree.joints)
    still = cs.SX.zeros(6)
    # what the bodies would need at zero ν̇: the bias wrenches, with gravity, as RNEA sees them
    poses = [base] + [joint_pose(body, s) for body in tree.bodies[1:]]
    omegas = [base.rotation.T @ base_twist[3:]]
    shifts: list[SX] = [still]  # velocity-dependent part of each body's (a, α) less its parent's, in body axes
    for body, pose in zip(tree.bodies[1:], poses[1:], strict=True):
        omega, rate = omegas[body.parent], s_dot[body.column]
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
    for body, omega in zip(tree.bodies, omegas, strict=True):
        first, second = body.inertia.first_moment, body.inertia.about_origin
        biases.append(cs.vertcat(cs.cross(omega, cs.cross(omega, first)), cs.cross(omega, second @ omega)))
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
    up = base.rotation.T
    wrench = cs.vertcat(up @ base_wrench[:3], up @ base_wrench[3:])
    accelerations = [cs.solve(inertias[BASE], wrench - biases[BASE])]
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


def _spatial(inertia: Inertia) -> SX:
    """Return the (6, 6) inertia that maps (a, α) of the origin to (force, moment about the origin)."""
    arm = cs.skew(inertia.first_moment)
    return cs.SX(
        cs.vertcat(cs.horzcat(inertia.mass * cs.DM.eye(3), -arm), cs.horzcat(arm, inertia.about_origin))
    )


def _motion_transform(pose: Pose) -> SX:
    """Return X, (6, 6), that maps (a, α) of the parent's origin to those of the child's, in child axes."""
    back = pose.rotation.T
    return cs.vertcat(cs.horzcat(back, -back @ cs.skew(pose.translation)), cs.horzcat(cs.SX(3, 3), back))
