"""A motion of all joints of a URDF in the order of another program's model of it, with those that a plan holds still.

Both programs go through the tree depth first, over fixed joints too. Of several joints on a link, Pinocchio takes them
by name, in the order of bytes (urdfdom keeps them so), and MuJoCo in the order of the file.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from lxml import etree

from multimodal_to.adam import KinDynComputations
from multimodal_to.adam.spatial import Array
from multimodal_to.adam.tree import Joint
from multimodal_to.adam.urdf import read_urdf
from multimodal_to.errors import OutputError, listed
from multimodal_to.models.robot import Robot
from multimodal_to.trajectory import Trajectory
from multimodal_to.trajectory.derived import joint_torques, sampled
from multimodal_to.trajectory.sameness import refuse_other_robot

Order = Callable[[Joint], Any]
"""The key by which joints that hang on one link are sorted."""


def by_name(joint: Joint) -> bytes:
    """Return what Pinocchio sorts joints on one link by."""
    return joint.name.encode("utf-8")


def by_place(joint: Joint) -> int:
    """Return what MuJoCo sorts joints on one link by: nothing, they stay in the order of the file."""
    return 0


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


def whole_motion(robot: Robot, trajectory: Trajectory, order: Order) -> WholeMotion:
    """Return a motion of all joints of the robot's URDF: those that the robot does not move are where it holds them.

    A joint that mimics another follows it. Torques are those of joints that move one by one, as in the other program's
    model: what it takes to hold those that stand still, and to move a follower without its leader.

    Args:
        robot: the robot of the trajectory.
        trajectory: the motion.
        order: of the joints that hang on one link.

    Raises:
        InputError: the trajectory is for another robot.
        OutputError: the URDF is no longer the one that the robot was read from.
    """
    refuse_other_robot(trajectory, robot)
    _, joints = read_urdf(robot.urdf)
    moving = tuple(_depth_first(joints, robot.kindyn.tree.base, order))
    by_joint = {joint.name: joint for joint in moving}
    tree = robot.kindyn.tree
    if changed := {*tree.joint_names, *tree.followers, *tree.locked} ^ set(by_joint):
        raise OutputError(f"'{robot.urdf}' no longer has the joints of {robot.name}: {listed(sorted(changed))} changed")
    names = tuple(by_joint)
    positions, velocities = _of_all_joints(robot, sampled(trajectory), names)
    return WholeMotion(
        joints=moving,
        positions=positions,
        velocities=velocities,
        torques=_torques(robot, trajectory, names),
    )


def _depth_first(joints: Sequence[Joint], base: str, order: Order) -> Iterator[Joint]:
    """Yield the joints that can move, as a program meets them from the base on."""
    below: dict[str, list[Joint]] = {}
    for joint in joints:
        below.setdefault(joint.parent, []).append(joint)
    pending = sorted(below.get(base, []), key=order)[::-1]
    while pending:
        joint = pending.pop()
        if joint.kind != "fixed":
            yield joint
        pending += sorted(below.get(joint.child, []), key=order)[::-1]


def _of_all_joints(robot: Robot, motion: Trajectory, names: Sequence[str]) -> tuple[Array, Array]:
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
        positions, velocities = _of_all_joints(robot, trajectory, names)
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
