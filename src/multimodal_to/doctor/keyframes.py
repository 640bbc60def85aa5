"""Whether keyframes can be met: joints within their ranges, frames within reach, and time for the way between."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from multimodal_to.adam.spatial import Array
from multimodal_to.adam.tree import BASE
from multimodal_to.doctor.diagnosis import Symptom, error, note, warning
from multimodal_to.doctor.task import Task, narrowed
from multimodal_to.errors import ScenarioError, apart
from multimodal_to.models.joint_units import joint_units
from multimodal_to.models.terrain import FlatGround
from multimodal_to.ocp import paper
from multimodal_to.ocp.guess import standing_posture
from multimodal_to.scenarios.keyframes import Placed, attitude_at

_OFF = 1e-9


def joints(task: Task) -> Iterator[Symptom]:
    """Compare joints with their ranges, and how far they go between two knots with their greatest speed."""
    limits = task.robot.joint_limits
    for index, name in enumerate(task.robot.joint_names):
        unit = joint_units(task.robot, "rad")[index]
        before = _first_joint(task, index)
        for one in task.held_in_order:
            if name not in one.keyframe.joints:
                continue
            off, value = one.keyframe.joint_tolerance, one.keyframe.joints[name]
            low, high = limits.lower[index], limits.upper[index]
            if value - off > high + _OFF or value + off < low - _OFF:
                yield error(
                    one.label,
                    f"{name} has to be {value:g} {unit}, and its range is {low:.4g} to {high:.4g} {unit}",
                    "ask for less, or widen the range in robot.toml",
                )
                continue
            if before is not None:
                yield from _too_fast(task, one, name, (before[0], before[1], abs(value - before[2]) - off - before[3]))
            before = (one.label, one.knot, value, off)


def _first_joint(task: Task, index: int) -> tuple[str, int, float, float] | None:
    """Return where a joint starts, if the start says it: label, knot, position and tolerance."""
    if task.start_posture is None:
        return None
    return "the start", 0, float(task.start_posture.joint_positions[index]), 0.0


def _too_fast(task: Task, one: Placed, name: str, way: tuple[str, int, float]) -> Iterator[Symptom]:
    """Compare the way of a joint with its greatest speed.

    Args:
        task: robot and scenario.
        one: the keyframe that it goes to.
        name: of the joint.
        way: where it comes from: label, knot, and how far that is.
    """
    label, knot, distance = way
    index = task.robot.joint_names.index(name)
    fastest, time = float(task.robot.joint_limits.speed[index]), (one.knot - knot) * task.scenario.interval_max
    furthest = task.furthest("joint_velocities", index, fastest, (knot, one.knot))
    unit = joint_units(task.robot, "rad")[index]
    if distance > furthest + _OFF:
        yield error(
            one.label,
            f"{name} has to go {apart(distance, furthest)} {unit} from {label} in at most {time:.3g} s, and its "
            f"greatest speed is {fastest:g} {unit}/s{narrowed(furthest, fastest * time)}",
            "ask for it at a later knot, or allow a longer interval_max",
        )


def turns(task: Task) -> Iterator[Symptom]:
    """Compare the turn between two attitudes that are held with how fast the base may turn.

    Each component of ω is at most `base_speed_max`, so that its length is at most √3 as much.
    """
    scenario, robot = task.scenario, task.robot
    _, fastest = scenario.base_speeds(robot)
    before: tuple[str, int, Array] | None = None
    if not task.stands_at_start or task.start_posture is not None:
        standing = task.start_posture.base_quaternion_xyzw if task.start_posture else robot.upright.base_quaternion_xyzw
        first = standing if task.stands_at_start else attitude_at(robot, scenario.placed(), 0)
        before = ("the start", 0, first)
    for one in task.held_in_order:
        keyframe = one.keyframe
        if not one.knot or (keyframe.yaw is None and keyframe.base_orientation is None):
            continue
        there = attitude_at(robot, [one], one.knot)
        if before is not None:
            label, knot, here = before
            angle = 2.0 * math.acos(min(abs(float(here @ there)), 1.0)) - keyframe.orientation_tolerance
            time = (one.knot - knot) * scenario.interval_max
            most = task.furthest("base_angular_velocity", 0, fastest, (knot, one.knot))
            if angle > most:
                certain = angle > 1.8 * most and keyframe.hover
                yield (error if certain else warning)(
                    one.label,
                    f"the base has to turn by {apart(angle, most)} rad from {label} in at "
                    f"most {time:.3g} s, and base_speed_max is {fastest:.3g} rad/s{narrowed(most, fastest * time)}",
                    "ask for it at a later knot, allow a longer interval_max or more base_speed_max",
                )
        before = (one.label, one.knot, there)


def stands(task: Task) -> Iterator[Symptom]:
    """Look for a posture for every keyframe that stands, with its CoM where it is asked to be."""
    scenario, robot = task.scenario, task.robot
    for one in task.held_in_order:
        com = one.keyframe.com
        if not one.keyframe.standing or one.knot in (0, scenario.knots) or not isinstance(com, tuple):
            continue
        reach = float(robot.contact_reach[2])
        if isinstance(scenario.surface, FlatGround) and task.held(paper.CONTACT_REACH):
            above = com[2] - scenario.surface.height
            if above > reach:
                yield error(
                    one.label,
                    f"it stands with its CoM {apart(above, reach)} m above the feet, beyond the reach of contact "
                    f"points in the problem, {reach:g} m ('contacts' in [reach] of robot.toml)",
                    "ask for a lower CoM",
                )
                continue
        try:
            standing_posture(robot, scenario.surface, com)
        except ScenarioError as cause:
            yield warning(one.label, str(cause), "ask for another CoM there")


def yaw_without_moment(task: Task) -> Iterator[Symptom]:
    """Say where no force turns the robot about the vertical in the air: jets without drag on the base, all along it."""
    robot, tree = task.robot, task.robot.kindyn.tree
    if not robot.jets or not task.hovers or any(jet.drag or tree.frame(jet.frame).body != BASE for jet in robot.jets):
        return
    up = robot.upright.base_transform[:3, :3].T @ robot.up
    pushes = [np.array(tree.frame(jet.frame).rotation)[:, 2] for jet in robot.jets]
    if max(float(np.linalg.norm(np.cross(push, up))) for push in pushes) > _PARALLEL or any(
        jet.drag for jet in robot.jets
    ):
        return
    asked = [one.label for one in task.held_in_order if one.knot and one.keyframe.yaw]
    found = "the jets all push along the vertical, and no force turns the robot about it while it is in the air"
    if asked and not task.stands_at_start:
        yield warning(asked[0], f"a yaw is asked for, and {found}", "ask for no yaw, or let a jet push aside")
    else:
        yield note("yaw", found)


_PARALLEL = 1e-6
