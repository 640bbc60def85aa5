"""Centre of mass, composite inertias, and the centroidal momentum of a `Tree`.

Source: D. E. Orin, A. Goswami, S.-H. Lee, "Centroidal dynamics of a humanoid robot", Autonomous Robots, 2013.
Everything is gathered from the tips to the base in body frames, where most entries are zero, and turned into world
axes once, at the end.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as cs

from multimodal_to.adam.kinematics import Pose, joint_angle, joint_pose
from multimodal_to.adam.spatial import SX, Inertia
from multimodal_to.adam.tree import BASE, Tree


def com_in_base(tree: Tree, s: SX) -> SX:
    """Return the CoM in the base's frame [m], (3, 1): the first moments m c, summed from the tips, over the mass."""
    masses = [body.inertia.mass for body in tree.bodies]
    moments = [body.inertia.first_moment for body in tree.bodies]
    for index in range(len(tree.bodies) - 1, BASE, -1):
        body, pose = tree.bodies[index], joint_pose(tree.bodies[index], s)
        masses[body.parent] += masses[index]
        moments[body.parent] = moments[body.parent] + masses[index] * pose.translation + pose.rotation @ moments[index]
    return moments[BASE] / tree.total_mass


def com_position(tree: Tree, base: Pose, s: SX) -> SX:
    """Return the CoM in the world [m], (3, 1).

    Args:
        tree: the robot.
        base: w_H_base, the pose of the base in the world.
        s: joint positions, (n, 1) [rad or m].
    """
    return base.rotation @ com_in_base(tree, s) + base.translation


def composite_inertias(tree: Tree, s: SX) -> list[Inertia]:
    """Return for every body the inertia of all that hangs on it, itself included, in its own frame and axes."""
    composites = [body.inertia for body in tree.bodies]
    for index in range(len(tree.bodies) - 1, BASE, -1):
        body, carried = tree.bodies[index], composites[index]
        if not body.prismatic:
            carried = carried.rotated_about_z(*joint_angle(body, s))
        translation = joint_pose(body, s).translation if body.prismatic else body.translation
        composites[body.parent] += carried.rotated(body.rotation).shifted(translation)
    return composites


@dataclass(frozen=True)
class Momentum:
    """Linear momentum [kg m/s] and angular momentum [kg m²/s] about a stated point, (3, 1) each."""

    linear: SX
    angular: SX


@dataclass(frozen=True)
class BodyMotions:
    """Of every body, in its own axes: pose in the parent, velocity (v, ω) and momentum (l, k) at its origin."""

    poses: list[Pose]
    velocities: list[SX]
    omegas: list[SX]
    momenta: list[Momentum]


def body_motions(tree: Tree, s: SX, velocity: SX, omega: SX, s_dot: SX) -> BodyMotions:
    """Return how all bodies move when the base does with (`velocity`, `omega`), both in base axes.

    Twists go outward: ω_i = Rᵀ ω + z q̇, v_i = Rᵀ (v + ω × p), and l = m v + ω × h, k = I ω + h × v.

    Args:
        tree: the robot.
        s: joint positions, (n, 1) [rad or m].
        velocity: of the base's origin, in base axes, (3, 1) [m/s].
        omega: angular velocity of the base, in base axes, (3, 1) [rad/s].
        s_dot: joint velocities, (n, 1) [rad/s or m/s].
    """
    poses = [Pose(cs.SX.eye(3), cs.SX.zeros(3))] + [joint_pose(body, s) for body in tree.bodies[1:]]
    velocities, omegas = [velocity], [omega]
    for body, pose in zip(tree.bodies[1:], poses[1:], strict=True):
        parent, back = body.parent, pose.rotation.T
        along_z = cs.vertcat(0, 0, body.joint_value(s_dot))
        omega = back @ omegas[parent]
        velocity = back @ (velocities[parent] + cs.cross(omegas[parent], pose.translation))
        omegas.append(omega if body.prismatic else omega + along_z)
        velocities.append(velocity + along_z if body.prismatic else velocity)
    momenta = []
    for body, velocity, omega in zip(tree.bodies, velocities, omegas, strict=True):
        mass, first, second = body.inertia.mass, body.inertia.first_moment, body.inertia.about_origin
        momenta.append(Momentum(mass * velocity + cs.cross(omega, first), second @ omega + cs.cross(first, velocity)))
    return BodyMotions(poses, velocities, omegas, momenta)


def momentum_in_base(tree: Tree, s: SX, angular_velocity: SX, s_dot: SX) -> tuple[Momentum, SX]:
    """Return the momentum about the base's origin while that origin rests, and the first moment, in base axes.

    Momenta and first moments of the bodies are gathered inward.

    Args:
        tree: the robot.
        s: joint positions, (n, 1) [rad or m].
        angular_velocity: of the base, in base axes, (3, 1) [rad/s].
        s_dot: joint velocities, (n, 1) [rad/s or m/s].
    """
    bodies = body_motions(tree, s, cs.SX.zeros(3), angular_velocity, s_dot)
    masses = [body.inertia.mass for body in tree.bodies]
    moments = [body.inertia.first_moment for body in tree.bodies]
    linear = [momentum.linear for momentum in bodies.momenta]
    angular = [momentum.angular for momentum in bodies.momenta]
    for index in range(len(tree.bodies) - 1, BASE, -1):
        parent, pose = tree.bodies[index].parent, bodies.poses[index]
        carried = pose.rotation @ linear[index]
        masses[parent] += masses[index]
        moments[parent] = moments[parent] + masses[index] * pose.translation + pose.rotation @ moments[index]
        linear[parent] = linear[parent] + carried
        angular[parent] = angular[parent] + pose.rotation @ angular[index] + cs.cross(pose.translation, carried)
    return Momentum(linear[BASE], angular[BASE]), moments[BASE]


def centroidal_momentum(tree: Tree, base: Pose, s: SX, base_twist: SX, s_dot: SX) -> Momentum:
    """Return linear momentum m ẋ and angular momentum about the CoM, in world axes.

    The angular part depends on neither the base's position nor its linear velocity: k_G = k_B − c × l_B with
    momenta taken while the base's origin rests, since a common velocity adds none about the CoM.

    Args:
        tree: the robot.
        base: w_H_base, the pose of the base in the world.
        s: joint positions, (n, 1) [rad or m].
        base_twist: (ṗ, ω) of the base in world axes, (6, 1) [m/s, rad/s].
        s_dot: joint velocities, (n, 1) [rad/s or m/s].
    """
    in_base = base.rotation.T @ base_twist[3:]
    momentum, first_moment = momentum_in_base(tree, s, in_base, s_dot)
    about_com = momentum.angular - cs.cross(first_moment / tree.total_mass, momentum.linear)
    return Momentum(tree.total_mass * base_twist[:3] + base.rotation @ momentum.linear, base.rotation @ about_com)


def com_velocity(tree: Tree, base: Pose, s: SX, base_twist: SX, s_dot: SX) -> SX:
    """Return ẋ in world axes [m/s], (3, 1): the base's velocity and, over the mass, the momentum seen from it.

    Args:
        tree: the robot.
        base: w_H_base, the pose of the base in the world.
        s: joint positions, (n, 1) [rad or m].
        base_twist: (ṗ, ω) of the base in world axes, (6, 1) [m/s, rad/s].
        s_dot: joint velocities, (n, 1) [rad/s or m/s].
    """
    momentum, _ = momentum_in_base(tree, s, base.rotation.T @ base_twist[3:], s_dot)
    return base_twist[:3] + base.rotation @ (momentum.linear / tree.total_mass)


def kinetic_energy(tree: Tree, base: Pose, s: SX, base_twist: SX, s_dot: SX) -> SX:
    """Return T = ½ Σ (v·l + ω·k) over the bodies [J], which is ½ νᵀ M ν.

    Args:
        tree: the robot.
        base: w_H_base, the pose of the base in the world.
        s: joint positions, (n, 1) [rad or m].
        base_twist: (ṗ, ω) of the base in world axes, (6, 1) [m/s, rad/s].
        s_dot: joint velocities, (n, 1) [rad/s or m/s].
    """
    back = base.rotation.T
    bodies = body_motions(tree, s, back @ base_twist[:3], back @ base_twist[3:], s_dot)
    doubled = 0
    for velocity, omega, momentum in zip(bodies.velocities, bodies.omegas, bodies.momenta, strict=True):
        doubled += cs.dot(velocity, momentum.linear) + cs.dot(omega, momentum.angular)
    return doubled / 2


def potential_energy(tree: Tree, base: Pose, s: SX, gravity: SX) -> SX:
    """Return V = −m g·x [J], zero where the CoM passes the world's origin.

    Args:
        tree: the robot.
        base: w_H_base, the pose of the base in the world.
        s: joint positions, (n, 1) [rad or m].
        gravity: acceleration of free fall in world axes, (3, 1) [m/s²].
    """
    return -tree.total_mass * cs.dot(gravity, com_position(tree, base, s))
