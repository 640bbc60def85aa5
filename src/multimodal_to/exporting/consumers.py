"""A motion of all joints of a URDF in the order of another program's model of it, and what holds still."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from lxml import etree

from multimodal_to.adam import KinDynComputations
from multimodal_to.adam.spatial import Array
from multimodal_to.adam.tree import Joint
from multimodal_to.exporting.layouts import moving_joints
from multimodal_to.models.robot import Robot
from multimodal_to.trajectory import Trajectory
from multimodal_to.trajectory.derived import joint_torques, sampled
from multimodal_to.trajectory.sameness import refuse_other_robot


@dataclass(frozen=True, kw_only=True, eq=False)
class WholeMotion:
    """A motion of every joint of a URDF that can move, at the instants of the knots."""

    joints: tuple[Joint, ...]  # in the other program's order
    positions: Array  # [rad or m], (joints, knots + 1)
    velocities: Array  # [rad/s or m/s], (joints, knots + 1)
    torques: Array  # by inverse dynamics [N m or N], (joints, knots + 1)

    @property
    def names(self) -> tuple[str, ...]:
        """Return the joints by name."""
        return tuple(joint.name for joint in self.joints)


def whole_motion(robot: Robot, trajectory: Trajectory, names: Sequence[str]) -> WholeMotion:
    """Return a motion of joints of the robot's URDF: those that the robot does not move are where it holds them.

    A joint that mimics another follows it. Torques are those of joints that move one by one, as in the other program's
    model: what it takes to hold those that stand still, and to move a follower without its leader.

    Args:
        robot: the robot of the trajectory.
        trajectory: the motion.
        names: of the joints, in the other program's order; joints that the robot moves are all among them.

    Raises:
        InputError: the trajectory is for another robot.
        OutputError: the URDF is no longer the one that the robot was read from.
    """
    refuse_other_robot(trajectory, robot)
    by_name = {joint.name: joint for joint in moving_joints(robot) if joint.kind != "fixed"}
    positions, velocities = of_all_joints(robot, sampled(trajectory), names)
    rows = [list(by_name).index(name) for name in names]
    return WholeMotion(
        joints=tuple(by_name[name] for name in names),
        positions=positions,
        velocities=velocities,
        torques=_torques(robot, trajectory, tuple(by_name))[rows].reshape(len(rows), trajectory.time.size),
    )


def of_all_joints(robot: Robot, motion: Trajectory, names: Sequence[str]) -> tuple[Array, Array]:
    """Return positions and velocities of joints, (joints, columns of the motion) each.

    Args:
        robot: which of them it moves, which follow others, and where it holds the rest.
        motion: of the joints that it moves.
        names: of joints that can move.
    """
    tree = robot.kindyn.tree
    found = []
    for values in (tree.joint_values(motion.joint_positions), tree.joint_rates(motion.joint_velocities)):
        found.append(np.array([values[name] for name in names]).reshape(len(names), motion.time.size))
    return found[0], found[1]


def _torques(robot: Robot, trajectory: Trajectory, names: tuple[str, ...]) -> Array:
    """Return the torques of all joints by inverse dynamics [N m or N], (joints, knots + 1).

    Args:
        robot: the robot of the trajectory.
        trajectory: the motion.
        names: of the joints in the order wanted.
    """
    own = dict(zip(robot.joint_names, joint_torques(robot, trajectory), strict=True))
    if set(names) != set(own):
        for how in robot.kindyn.tree.followers.values():
            own.pop(how.joint, None)  # it moves its followers as well
        kindyn = KinDynComputations(_without_mimics(robot), names, gravity=robot.gravity)
        whole = replace(robot, kindyn=kindyn.with_frames(robot.added_frames))
        positions, velocities = of_all_joints(robot, trajectory, names)
        motion = replace(trajectory, joint_names=names, joint_positions=positions, joint_velocities=velocities)
        own = dict(zip(names, joint_torques(whole, motion), strict=True)) | own
    return np.array([own[name] for name in names]).reshape(len(names), trajectory.time.size)


def _without_mimics(robot: Robot) -> str:
    """Return the text of the robot's URDF with joints that follow no other: as other programs read it."""
    root = etree.parse(
        str(robot.urdf), etree.XMLParser(resolve_entities=False, load_dtd=False, no_network=True)
    ).getroot()
    for mimic in [*root.iter("mimic")]:
        mimic.getparent().remove(mimic)
    return str(etree.tostring(root, encoding="unicode"))
