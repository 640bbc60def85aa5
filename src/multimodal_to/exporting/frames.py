"""A motion as frames at a steady rate: joints and bodies of a layout, with velocities, forces and thrusts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from multimodal_to.adam.spatial import Array
from multimodal_to.adam.tree import Link
from multimodal_to.adam.urdf import read_urdf
from multimodal_to.exporting.consumers import of_all_joints, whole_motion
from multimodal_to.exporting.layouts import Layout
from multimodal_to.models import attitude
from multimodal_to.models.robot import Robot
from multimodal_to.trajectory import Trajectory
from multimodal_to.trajectory.derived import base_poses, frame_poses, loaded_force, without_acceleration
from multimodal_to.trajectory.smoothing import frame_times, smooth


@dataclass(frozen=True, kw_only=True)
class Mass:
    """What a body of a layout weighs: its link and those fixed to it that are no bodies of their own."""

    mass: float  # [kg]
    com: Array  # in the body's frame [m], (3,)
    inertia: Array  # about the CoM, along the body's axes [kg m²], (3, 3)


@dataclass(frozen=True, kw_only=True, eq=False)
class Frames:
    """A motion at the times of frames, (frames,) first in every array; vectors in world axes."""

    robot: Robot
    layout: Layout
    motion: Trajectory  # at the frames, every quantity at its own time
    fps: float  # [1/s]
    joint_positions: Array  # of the layout's joints [rad or m], (frames, joints)
    joint_velocities: Array  # [rad/s or m/s], (frames, joints)
    joint_torques: Array  # by inverse dynamics [N m or N], (frames, joints)
    body_poses: Array  # world-from-body, (frames, bodies, 4, 4)
    body_velocities: Array  # of the bodies' origins, linear part first [m/s, rad/s], (frames, bodies, 6)

    @property
    def base_quaternion_xyzw(self) -> Array:
        """Return the base's orientation, (frames, 4)."""
        return self.motion.base_quaternion_xyzw.T

    @property
    def body_positions(self) -> Array:
        """Return where the bodies' origins are [m], (frames, bodies, 3)."""
        return self.body_poses[:, :, :3, 3]

    @cached_property
    def body_quaternions_xyzw(self) -> Array:
        """Return the bodies' orientations without jumps of sign, (frames, bodies, 4)."""
        each = [attitude.continuous(quaternions(poses[:, :3, :3])) for poses in self.body_poses.transpose(1, 0, 2, 3)]
        return np.array(each).transpose(2, 0, 1)

    @cached_property
    def masses(self) -> tuple[Mass, ...]:
        """Return what each body of the layout weighs."""
        return body_masses(self.robot, self.layout.bodies)

    @property
    def body_coms(self) -> Array:
        """Return where the bodies' centres of mass are [m], (frames, bodies, 3)."""
        coms = np.array([body.com for body in self.masses])
        return np.asarray(self.body_positions + np.einsum("tbij,bj->tbi", self.body_poses[:, :, :3, :3], coms))

    def at(self, points: Array) -> Array:
        """Return the linear velocity of the bodies at points [m/s], (frames, bodies, 3).

        Args:
            points: moving with each body, in the world [m], (frames, bodies, 3).
        """
        linear, angular = self.body_velocities[..., :3], self.body_velocities[..., 3:]
        return np.asarray(linear + np.cross(angular, points - self.body_positions))

    @property
    def contact_state(self) -> Array:
        """Return whether each contact point carries more than `loaded_force`, (frames, contacts)."""
        return np.asarray(np.linalg.norm(self.contact_forces, axis=2) > loaded_force(self.robot))

    @property
    def contact_forces(self) -> Array:
        """Return the forces of the ground on the robot [N], (frames, contacts, 3)."""
        return self.motion.per_contact("contact_forces").transpose(2, 0, 1)


def frames_of(robot: Robot, trajectory: Trajectory, layout: Layout, fps: float) -> Frames:
    """Return a motion at a steady rate.

    Args:
        robot: the robot of the trajectory.
        trajectory: the motion.
        layout: whose joints and bodies are wanted.
        fps: frames a second.

    Raises:
        InputError: the trajectory is for another robot, or too short for two frames.
    """
    times = frame_times(trajectory, fps)
    motion = smooth(trajectory, times)
    whole = whole_motion(robot, trajectory, layout.joints)
    torques, unknown = whole.torques.copy(), without_acceleration(trajectory)
    torques[:, unknown] = torques[:, -2 if unknown else 1]
    positions, velocities = of_all_joints(robot, motion, layout.joints)
    return Frames(
        robot=robot,
        layout=layout,
        motion=motion,
        fps=fps,
        joint_positions=positions.T,
        joint_velocities=velocities.T,
        joint_torques=np.array([np.interp(times, trajectory.time, row) for row in torques]).reshape(-1, times.size).T,
        body_poses=np.array([frame_poses(robot, motion, body) for body in layout.bodies]).transpose(1, 0, 2, 3),
        body_velocities=body_velocities(robot, motion, layout.bodies),
    )


def body_velocities(robot: Robot, motion: Trajectory, bodies: Sequence[str]) -> Array:
    """Return J ν of links, linear part first, (frames, bodies, 6).

    Args:
        robot: of the motion.
        motion: with every quantity at its own time.
        bodies: links by name.
    """
    count, base = motion.time.size, np.hstack(list(base_poses(motion)))
    rates = np.vstack([motion.base_linear_velocity, motion.base_angular_velocity, motion.joint_velocities])
    found = []
    for body in bodies:
        jacobians = np.array(robot.kindyn.jacobian_fun(body).map(count)(base, motion.joint_positions))
        found.append(np.einsum("rkc,ck->kr", jacobians.reshape(6, count, -1), rates))
    return np.array(found).transpose(1, 0, 2)


def quaternions(rotations: Array) -> Array:
    """Return unit quaternions x y z w in columns, (4, count), of rotation matrices, (count, 3, 3).

    4 ρ ρᵀ is linear in R; the row of its largest diagonal entry is the best conditioned multiple of ρ.
    """
    m = rotations.transpose(1, 2, 0)
    trace = m[0, 0] + m[1, 1] + m[2, 2]
    squares = [1.0 + 2.0 * m[axis, axis] - trace for axis in range(3)]
    xy, xz, yz = m[0, 1] + m[1, 0], m[0, 2] + m[2, 0], m[1, 2] + m[2, 1]
    xw, yw, zw = m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]
    product = np.array(
        [[squares[0], xy, xz, xw], [xy, squares[1], yz, yw], [xz, yz, squares[2], zw], [xw, yw, zw, 1.0 + trace]]
    )
    largest = np.argmax(np.einsum("iik->ik", product), axis=0)
    rows = product[largest, :, np.arange(largest.size)].T
    return np.asarray(rows / np.linalg.norm(rows, axis=0))


def body_masses(robot: Robot, bodies: Sequence[str]) -> tuple[Mass, ...]:
    """Return mass, CoM and inertia of bodies, each with the links behind fixed joints that are no bodies themselves.

    Args:
        robot: whose URDF says what links weigh.
        bodies: links by name.
    """
    links, joints = read_urdf(robot.urdf)
    parents = {joint.child: (joint.parent, joint.kind) for joint in joints}
    groups: dict[str, list[Link]] = {body: [] for body in bodies}
    for link in links:
        name = link.name
        while name not in groups and name in parents and parents[name][1] == "fixed":
            name = parents[name][0]
        if name in groups:
            groups[name].append(link)
    return tuple(_sum(_in_frames(robot, body, group)) for body, group in groups.items())


def _in_frames(robot: Robot, body: str, links: Sequence[Link]) -> list[tuple[Link, Array]]:
    """Return links with their poses in the frame of a body that they are fixed to.

    Args:
        robot: with the frames.
        body: a link by name.
        links: fixed to it.
    """
    frames = robot.kindyn.tree.frames
    poses: Mapping[str, Array] = {name: np.eye(4) for name in (body, *(link.name for link in links))}
    for name, pose in poses.items():
        pose[:3, :3], pose[:3, 3] = np.array(frames[name].rotation), np.array(frames[name].translation).ravel()
    origin = np.linalg.inv(poses[body])
    return [(link, origin @ poses[link.name]) for link in links]


def _sum(links: Sequence[tuple[Link, Array]]) -> Mass:
    mass = sum(link.mass for link, _ in links)
    if mass <= 0.0:
        return Mass(mass=0.0, com=np.zeros(3), inertia=np.zeros((3, 3)))
    coms = [pose[:3, :3] @ link.com + pose[:3, 3] for link, pose in links]
    com = np.sum([link.mass * at for (link, _), at in zip(links, coms, strict=True)], axis=0) / mass
    inertia = np.zeros((3, 3))
    for (link, pose), at in zip(links, coms, strict=True):
        arm = at - com
        inertia += pose[:3, :3] @ link.inertia @ pose[:3, :3].T
        inertia += link.mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    return Mass(mass=mass, com=com, inertia=inertia)
