"""A motion of all joints of a URDF in the order of another program's model of it, with those that a plan holds still.

Both programs go through the tree depth first, over fixed joints too. Of several joints on a link, Pinocchio takes them
by name, in the order of bytes (urdfdom keeps them so), and MuJoCo in the order of the file.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from lxml import etree

from multimodal_to.adam import KinDynComputations
from multimodal_to.adam.spatial import Array
from multimodal_to.adam.tree import Joint
from multimodal_to.adam.urdf import read_urdf
from multimodal_to.errors import OutputError
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

    A joint that mimics another follows it. Their torques are what it takes to hold them there.

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
    if missing := [name for name in robot.joint_names if name not in by_joint]:
        raise OutputError(f"'{robot.urdf}' no longer has the joint '{missing[0]}' of {robot.name}")
    held, at_knots = robot.kindyn.tree.locked, sampled(trajectory)
    positions = np.array([_row(joint, by_joint, held, at_knots, "joint_positions") for joint in moving])
    velocities = np.array([_row(joint, by_joint, held, at_knots, "joint_velocities") for joint in moving])
    shape = len(moving), trajectory.time.size
    return WholeMotion(
        joints=moving,
        positions=positions.reshape(shape),
        velocities=velocities.reshape(shape),
        torques=_torques(robot, trajectory, moving, by_joint),
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


def _row(
    joint: Joint, by_joint: Mapping[str, Joint], held: Mapping[str, float], motion: Trajectory, name: str
) -> Array:
    """Return the positions or velocities of a joint, (knots + 1,).

    Args:
        joint: whose.
        by_joint: all joints by name.
        held: where joints that do not move are.
        motion: of those that do.
        name: "joint_positions" or "joint_velocities".
    """
    is_position = name == "joint_positions"
    if joint.name in motion.joint_names:
        return np.asarray(getattr(motion, name)[motion.joint_names.index(joint.name)])
    if joint.mimic is not None and joint.name not in held:
        leader = _row(by_joint[joint.mimic.joint], by_joint, held, motion, name)
        return joint.mimic.multiplier * leader + is_position * joint.mimic.offset
    return np.full(motion.time.size, held.get(joint.name, 0.0) if is_position else 0.0)


def _torques(robot: Robot, trajectory: Trajectory, moving: Sequence[Joint], by_joint: Mapping[str, Joint]) -> Array:
    """Return the torques of all joints by inverse dynamics [N m or N], (joints, knots + 1).

    Args:
        robot: the robot of the trajectory.
        trajectory: the motion.
        moving: the joints in the order wanted.
        by_joint: the same by name.
    """
    own = dict(zip(robot.joint_names, joint_torques(robot, trajectory), strict=True))
    names = tuple(joint.name for joint in moving)
    if set(names) != set(own):
        held = robot.kindyn.tree.locked
        whole = replace(robot, kindyn=KinDynComputations(_without_mimics(robot), names, gravity=robot.gravity))
        rows: dict[str, Any] = {
            name: np.array([_row(joint, by_joint, held, trajectory, name) for joint in moving])
            for name in ("joint_positions", "joint_velocities")
        }
        others = joint_torques(whole, replace(trajectory, joint_names=names, **rows))
        own = dict(zip(names, others, strict=True)) | own
    return np.array([own[name] for name in names]).reshape(len(names), trajectory.time.size)


def _without_mimics(robot: Robot) -> str:
    """Return the text of the robot's URDF with joints that follow no other: as other programs read it."""
    root = etree.parse(
        str(robot.urdf), etree.XMLParser(resolve_entities=False, load_dtd=False, no_network=True)
    ).getroot()
    for mimic in [*root.iter("mimic")]:
        mimic.getparent().remove(mimic)
    return str(etree.tostring(root, encoding="unicode"))
