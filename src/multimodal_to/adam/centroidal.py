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
    """Return the CoM in the world [m], (3, 1)."""
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


def momentum_in_base(tree: Tree, s: SX, angular_velocity: SX, s_dot: SX) -> tuple[Momentum, SX]:
    """Return the momentum about the base's origin while that origin rests, and the first moment, in base axes.

    `angular_velocity` is the base's, in base axes [rad/s]. Twists go outward (ω_i = Rᵀ ω + z q̇, v_i = Rᵀ (v + ω × p)),
    momenta (l = m v + ω × h, k = I ω + h × v) and first moments come back inward.
    """
    poses = [Pose(cs.SX.eye(3), cs.SX.zeros(3))] + [joint_pose(body, s) for body in tree.bodies[1:]]
    omegas, velocities = [angular_velocity], [cs.SX.zeros(3)]
    for body, pose in zip(tree.bodies[1:], poses[1:], strict=True):
        parent = body.parent
        along_z = cs.vertcat(0, 0, s_dot[body.column])
        omega = pose.rotation.T @ omegas[parent]
        velocity = pose.rotation.T @ (velocities[parent] + cs.cross(omegas[parent], pose.translation))
        omegas.append(omega if body.prismatic else omega + along_z)
        velocities.append(velocity + along_z if body.prismatic else velocity)

    masses = [body.inertia.mass for body in tree.bodies]
    moments = [body.inertia.first_moment for body in tree.bodies]
    linear, angular = [], []
    for body, omega, velocity in zip(tree.bodies, omegas, velocities, strict=True):
        inertia = body.inertia
        linear.append(inertia.mass * velocity + cs.cross(omega, inertia.first_moment))
        angular.append(inertia.about_origin @ omega + cs.cross(inertia.first_moment, velocity))
    for index in range(len(tree.bodies) - 1, BASE, -1):
        parent, pose = tree.bodies[index].parent, poses[index]
        force = pose.rotation @ linear[index]
        masses[parent] += masses[index]
        moments[parent] = moments[parent] + masses[index] * pose.translation + pose.rotation @ moments[index]
        linear[parent] = linear[parent] + force
        angular[parent] = angular[parent] + pose.rotation @ angular[index] + cs.cross(pose.translation, force)
    return Momentum(linear[BASE], angular[BASE]), moments[BASE]


def centroidal_momentum(tree: Tree, base: Pose, s: SX, base_twist: SX, s_dot: SX) -> Momentum:
    """Return linear momentum m ẋ and angular momentum about the CoM, in world axes.

    The angular part depends on neither the base's position nor its linear velocity: k_G = k_B − c × l_B with
    momenta taken while the base's origin rests, since a common velocity adds none about the CoM.
    """
    in_base = base.rotation.T @ base_twist[3:]
    momentum, first_moment = momentum_in_base(tree, s, in_base, s_dot)
    about_com = momentum.angular - cs.cross(first_moment / tree.total_mass, momentum.linear)
    return Momentum(
        tree.total_mass * base_twist[:3] + base.rotation @ momentum.linear, base.rotation @ about_com
    )
