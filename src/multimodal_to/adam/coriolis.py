"""The Coriolis matrix of a `Tree`, by a recursion over composite bodies.

Source: S. Echeandia, P. M. Wensing, "Numerical methods to compute the Coriolis matrix and Christoffel symbols for
rigid-body systems", Journal of Computational and Nonlinear Dynamics, 2021.
"""

from __future__ import annotations

import casadi as cs

from multimodal_to.adam.centroidal import body_motions
from multimodal_to.adam.crba import gathered, joint_motions, to_base, unit_momenta
from multimodal_to.adam.kinematics import Pose
from multimodal_to.adam.spatial import SX
from multimodal_to.adam.tree import BASE, Tree


def coriolis_matrix(tree: Tree, base: Pose, s: SX, base_twist: SX, s_dot: SX) -> SX:
    """Return C(q, ν), (6 + n, 6 + n), with C ν the Coriolis term and Ṁ − 2 C skew-symmetric.

    C = Σ Jᵀ (I J̇ + B J) over the bodies with B = ½ (v×* I − I v× + (I v)×̄*), which maps a motion (w, ϖ) to the force
    −l × ϖ and the moment D ϖ, where D = −S(h) S(v) − S(ω) (½ tr(I) 1 − I). As in CRBA, sums over the bodies that hang
    on a joint are gathered inward first; joints are those of the bodies, until the end. The base's linear velocity does
    not enter: seen from a frame that moves along with it, the robot is the same.

    Args:
        tree: the robot.
        base: w_H_base, the pose of the base in the world.
        s: joint positions, (n, 1) [rad or m].
        base_twist: (ṗ, ω) of the base in world axes, (6, 1) [m/s, rad/s].
        s_dot: joint velocities, (n, 1) [rad/s or m/s].
    """
    units = unit_momenta(tree, base, s)
    bodies = body_motions(tree, s, cs.SX.zeros(3), base.rotation.T @ base_twist[3:], s_dot)
    momenta = [momentum.linear for momentum in bodies.momenta]
    turnings = []  # D of each body, and then of all that hangs on it, in its own frame
    for body, velocity, omega in zip(tree.bodies, bodies.velocities, bodies.omegas, strict=True):
        first, second = body.inertia.first_moment, body.inertia.about_origin
        spread = cs.trace(second) / 2 * cs.DM.eye(3) - second
        turnings.append(-cs.skew(first) @ cs.skew(velocity) - cs.skew(omega) @ spread)
    for index in range(len(tree.bodies) - 1, BASE, -1):
        parent, pose = tree.bodies[index].parent, bodies.poses[index]
        linear = pose.rotation @ momenta[index]
        momenta[parent] = momenta[parent] + linear
        turned = pose.rotation @ turnings[index] @ pose.rotation.T
        turnings[parent] = turnings[parent] + turned - cs.skew(pose.translation) @ cs.skew(linear)

    n = len(tree.bodies) - 1
    motions = joint_motions(tree, units.poses)
    rates, wrenches, turns = cs.SX(6, n), cs.SX(6, n), cs.SX(3, n)
    for joint, body in enumerate(tree.bodies[1:]):
        index = joint + 1
        pose, inertia = units.poses[index], units.composites[index]
        (vx, vy, _), (wx, wy, _) = cs.vertsplit(bodies.velocities[index]), cs.vertsplit(bodies.omegas[index])
        around, along = cs.vertcat(wy, -wx, 0), cs.vertcat(vy, -vx, 0)  # ω × z, v × z
        if body.prismatic:  # S = (z, 0): Ṡ = (ω × z, 0), B S = 0, Bᵀ S = (0, l × z)
            rate, angular_rate = around, cs.SX(3, 1)
            force, moment = cs.SX(3, 1), cs.SX(3, 1)
            turn = cs.cross(momenta[index], cs.DM([0, 0, 1]))
        else:  # S = (0, z): Ṡ = (v × z, ω × z), B S = (z × l, D z), Bᵀ S = (0, Dᵀ z)
            rate, angular_rate = along, around
            force, moment = cs.cross(cs.DM([0, 0, 1]), momenta[index]), turnings[index][:, 2]
            turn = turnings[index][2, :].T
        force = force + inertia.mass * rate + cs.cross(angular_rate, inertia.first_moment)
        moment = moment + inertia.about_origin @ angular_rate + cs.cross(inertia.first_moment, rate)
        wrenches[:, joint] = to_base(pose, force, moment)
        angular_rate = pose.rotation @ angular_rate
        rates[:3, joint] = pose.rotation @ rate + cs.cross(pose.translation, angular_rate)
        rates[3:, joint] = angular_rate
        turns[:, joint] = pose.rotation @ turn

    matrix = cs.SX(6 + n, 6 + n)
    matrix[:3, 3:6] = -cs.skew(base.rotation @ momenta[BASE])
    matrix[3:6, 3:6] = base.rotation @ turnings[BASE] @ base.rotation.T
    matrix[:6, 6:] = wrenches
    matrix[6:, 3:6] = turns.T
    for index in range(len(tree.bodies)):
        for above in tree.path(index):
            i, j = index - 1, above - 1
            matrix[6 + j, 6 + i] = cs.dot(motions[:, j], wrenches[:, i])
            if i != j:
                carried = cs.dot(units.joints[:, i], rates[:, j])
                matrix[6 + i, 6 + j] = carried + cs.dot(turns[:, i], motions[3:, j])
    return cs.sparsify(gathered(tree, matrix))
