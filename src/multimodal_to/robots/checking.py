"""`check`: what is missing or wrong in a robot's folder, and what looks odd about a robot that loads."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from multimodal_to.adam.inspection import describe
from multimodal_to.adam.spatial import Array
from multimodal_to.arguments import checked
from multimodal_to.errors import ModelError, listed
from multimodal_to.models import proportions
from multimodal_to.models.loading import load_robot
from multimodal_to.models.robot import Robot

LEVEL = 0.01
"""Contact points at home are on one level where they differ by less than this in height [L]."""
_NAMED = 6  # so many joints are named


@dataclass(frozen=True, kw_only=True)
class Check:
    """What was found about a robot's folder."""

    robot: Robot | None  # none where it does not load
    fault: str  # why it does not load, all of it; empty where it does
    remarks: tuple[str, ...]  # what looks odd, a sentence each

    @property
    def holds(self) -> bool:
        """Return whether the robot loads."""
        return not self.fault


@checked
def check(robot: str | os.PathLike[str]) -> Check:
    """Return what is missing or wrong in a robot's folder, or in a bundled robot.

    Keys that are missing, mistyped or left over are named all at once; then names that the URDF does not know.
    """
    try:
        loaded = load_robot(robot)
    except ModelError as error:
        return Check(robot=None, fault=str(error), remarks=())
    return Check(robot=loaded, fault="", remarks=tuple(_remarks(loaded)))


def _remarks(robot: Robot) -> Iterator[str]:
    yield from _of_urdf(robot)
    limits, names = robot.joint_limits, np.array(robot.joint_names, dtype=np.str_)
    most = proportions.MOST_EFFORT * robot.weight * robot.standing_height
    if unknown := names[~(limits.effort <= most)].tolist():
        yield f"no effort limit is known of {_some(unknown)}: state `effort`, or torques are not judged"
    at_end = np.minimum(robot.home.joint_positions - limits.lower, limits.upper - robot.home.joint_positions) <= 0
    if ends := names[at_end].tolist():
        yield f"at home these joints are at an end of their range: {_some(ends)}"
    yield from _of_feet(robot)
    if robot.jets:
        yield from _of_jets(robot)
    if len(robot.feet) > 1 and not robot.link_capsules:
        yield "no link has a capsule, so links may go through each other"


def _of_urdf(robot: Robot) -> Iterator[str]:
    kinds: dict[str, list[str]] = {}
    for finding in describe(robot.urdf, robot.joint_names).findings:
        if "limit" not in finding.text and "range" not in finding.text:  # robot.toml has its own
            kinds.setdefault(finding.text, []).append(finding.subject)
    for text, subjects in kinds.items():
        yield f"the URDF: {_some(subjects)} {text}"


def _of_feet(robot: Robot) -> Iterator[str]:
    if not robot.contacts:
        yield "the robot has no contact points: it touches nothing"
        return
    points, unit = _places(robot, robot.contact_names), robot.standing_height
    if float(np.ptp(points[:, 2])) > LEVEL * unit:
        names = np.array(robot.contact_names, dtype=np.str_)[points[:, 2] > points[:, 2].min() + LEVEL * unit]
        yield f"at home the contact points are not on one level; above the lowest are {_some(names.tolist())}"
    if abs(float(points[:, 2].min())) > LEVEL * unit:
        yield f"at home the lowest contact point is at z = {points[:, 2].min():.3g} m; the ground is most often at 0"
    com = robot.com_at(robot.home)
    low, high = points[:, :2].min(axis=0) - LEVEL * unit, points[:, :2].max(axis=0) + LEVEL * unit
    if ((com[:2] < low) | (com[:2] > high)).any():
        yield "at home the CoM is not above the contact points, so the robot falls"
    if unit < float(np.linalg.norm(np.ptp(points[:, :2], axis=0))) / 4:
        yield f"the CoM is only {unit:.3g} m above wide feet, and this height is the robot's unit of length"


def _of_jets(robot: Robot) -> Iterator[str]:
    up = np.array([-robot.pose_at_home(jet.frame)[2, 2] for jet in robot.jets])
    lift = float(np.maximum(up, 0.0) @ [jet.thrust_max for jet in robot.jets])
    if lift < robot.weight:
        yield f"at home the jets lift at most {lift:.0f} N of the weight, {robot.weight:.0f} N"
    if down := [jet.name for jet, part in zip(robot.jets, up, strict=True) if part < 0]:
        yield f"at home these jets push the robot down: {_some(down)}; see `thrust_axis`"


def _places(robot: Robot, frames: tuple[str, ...]) -> Array:
    return np.array([robot.pose_at_home(frame)[:3, 3] for frame in frames])


def _some(names: list[str]) -> str:
    return listed(names[:_NAMED]) + (f" and {len(names) - _NAMED} more" if len(names) > _NAMED else "")
