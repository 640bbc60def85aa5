"""Whether keyframes can be met: joints within their ranges, frames within reach, and time for the way between."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import casadi as cs
import numpy as np

from multimodal_to.adam import centroidal, quaternion
from multimodal_to.adam.kinematics import Pose, forward_kinematics
from multimodal_to.adam.spatial import Array
from multimodal_to.adam.tree import BASE
from multimodal_to.doctor.diagnosis import Symptom, error, note, warning
from multimodal_to.doctor.task import Task
from multimodal_to.errors import ScenarioError, apart
from multimodal_to.models.joint_units import joint_units
from multimodal_to.models.robot import Robot
from multimodal_to.models.terrain import FlatGround
from multimodal_to.models.units import Sized
from multimodal_to.ocp import paper
from multimodal_to.ocp.guess import standing_posture
from multimodal_to.ocp.waypoints import com as com_path
from multimodal_to.scenarios.keyframes import AXES, Placed, attitude_at, by_axis

_MISSED = Sized(1e-3, "m")
"""A frame that a search brings no nearer than this to where it is asked to be counts as out of reach."""
_OFF = 1e-9


def joints(task: Task) -> Iterator[Symptom]:
    """Compare joints with their ranges, and how far they go between two knots with their greatest speed."""
    limits = task.robot.joint_limits
    for index, name in enumerate(task.robot.joint_names):
        unit = joint_units(task.robot, "rad")[index]
        before = _first_joint(task, index)
        for one in _in_order(task):
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
    time = (one.knot - knot) * task.scenario.interval_max
    fastest = float(task.robot.joint_limits.speed[index])
    unit = joint_units(task.robot, "rad")[index]
    if distance > fastest * time + _OFF:
        yield error(
            one.label,
            f"{name} has to go {apart(distance, fastest * time)} {unit} from {label} in at most {time:.3g} s, and its "
            f"greatest speed is {fastest:g} {unit}/s",
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
    for one in _in_order(task):
        keyframe = one.keyframe
        if not one.knot or (keyframe.yaw is None and keyframe.base_orientation is None):
            continue
        there = attitude_at(robot, [one], one.knot)
        if before is not None:
            label, knot, here = before
            angle = 2.0 * math.acos(min(abs(float(here @ there)), 1.0)) - keyframe.orientation_tolerance
            time = (one.knot - knot) * scenario.interval_max
            if angle > fastest * time:
                certain = angle > 1.8 * fastest * time and keyframe.hover
                yield (error if certain else warning)(
                    one.label,
                    f"the base has to turn by {apart(angle, fastest * time)} rad from {label} in at "
                    f"most {time:.3g} s, and base_speed_max is {fastest:.3g} rad/s",
                    "ask for it at a later knot, allow a longer interval_max or more base_speed_max",
                )
        before = (one.label, one.knot, there)


def stands(task: Task) -> Iterator[Symptom]:
    """Look for a posture for every keyframe that stands, with its CoM where it is asked to be."""
    scenario, robot = task.scenario, task.robot
    for one in _in_order(task):
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


def frames(task: Task) -> Iterator[Symptom]:
    """Bring frames to where they are asked to be, with the CoM and joints as asked, by inverse kinematics."""
    for one in _in_order(task):
        targets = {name: by_axis(target.position) for name, target in one.keyframe.frames.items() if target.position}
        if not targets:
            continue
        com = by_axis(None if isinstance(one.keyframe.com, str) else one.keyframe.com)
        for name, position in targets.items():
            if len(position) == len(com) == 3:
                away = math.dist(position.values(), com.values())
                longest = _extent(task.robot, name)
                if away > longest:
                    yield error(
                        one.label,
                        f"{name} has to be {apart(away, longest)} m from the CoM, and the robot is at most "
                        f"{longest:.3g} m long from there",
                        "ask for a nearer point, or for another CoM",
                    )
                    return
        missed = _nearest(task, one, targets)
        for name, distance in missed.items():
            if distance > _MISSED.of(task.robot.units) + one.keyframe.frames[name].position_tolerance:
                where = "with the CoM where it is asked to be, " if com else ""
                yield warning(
                    one.label,
                    f"{where}{name} was found to come no nearer than {distance:.3g} m to where it is asked to be",
                    "ask for a nearer point, leave the CoM free there, or allow a position_tolerance",
                )


def _extent(robot: Robot, frame: str) -> float:
    """Return a distance from a frame beyond which the CoM cannot be [m]: down to the base, and up to the farthest."""
    tree = robot.kindyn.tree
    slides = {joint.name: max(abs(joint.lower), abs(joint.upper)) for joint in tree.joints if joint.kind == "prismatic"}

    def along(name: str) -> float:
        place = tree.frames[name]
        steps = [
            float(cs.norm_2(tree.bodies[index].translation)) + slides.get(tree.bodies[index].joint or "", 0.0)
            for index in tree.path(place.body)
        ]
        return sum(steps) + float(cs.norm_2(place.translation))

    return along(frame) + max(along(name) for name in tree.frames)


def _nearest(task: Task, one: Placed, targets: Mapping[str, Mapping[str, float]]) -> dict[str, float]:
    """Return how far frames stay from where they are asked to be [m], in the posture that brings them nearest.

    Base and joints are free within their ranges, but for the attitude of a hover, joints that are asked for, and the
    CoM. The search is a local one, from home.

    Args:
        task: robot and scenario.
        one: the keyframe.
        targets: positions by frame and axis.
    """
    robot, keyframe = task.robot, one.keyframe
    tree, limits, count = robot.kindyn.tree, robot.joint_limits, len(robot.joint_names)
    position, tilt, s = cs.SX.sym("p", 3), cs.SX.sym("tilt", 3), cs.SX.sym("s", count)
    attitude = attitude_at(robot, [one], one.knot)
    base = Pose(quaternion.rotation_matrix(quaternion.product(quaternion.exp(tilt), cs.DM(attitude))), position)
    off = {}
    for name, asked in targets.items():
        there = forward_kinematics(tree, tree.frame(name), base, s).translation
        off[name] = cs.vertcat(*(there[AXES.index(axis)] - value for axis, value in asked.items()))
    com = by_axis(None if isinstance(keyframe.com, str) else keyframe.com)
    there = centroidal.com_position(tree, base, s)
    lower, upper = limits.lower.copy(), limits.upper.copy()
    for name, value in keyframe.joints.items():
        index = robot.joint_names.index(name)
        lower[index] = np.clip(value - keyframe.joint_tolerance, lower[index], upper[index])
        upper[index] = np.clip(value + keyframe.joint_tolerance, lower[index], upper[index])
    free = 0.0 if keyframe.hover or keyframe.yaw is not None or keyframe.base_orientation is not None else 0.5
    near = cs.sumsqr(s - robot.home.joint_positions) + cs.sumsqr(tilt)
    problem = {
        "x": cs.vertcat(position, tilt, s),
        "f": 1e4 * sum(cs.sumsqr(some) for some in off.values()) + 1e-3 * near,
        "g": cs.vertcat(cs.SX(0, 1), *(there[AXES.index(axis)] - value for axis, value in com.items())),
    }
    options = {"print_time": False, "ipopt": {"print_level": 0, "sb": "yes", "max_iter": 200, "tol": 1e-8}}
    solver = cs.nlpsol("nearest", "ipopt", problem, options)
    path = com_path(task.scenario)[:, one.knot]
    start = robot.home.base_position + path - robot.com_at(robot.home)
    answer = solver(
        x0=np.concatenate([start, np.zeros(3), np.clip(robot.home.joint_positions, lower, upper)]),
        lbx=np.concatenate([np.full(3, -np.inf), np.full(3, -free), lower]),
        ubx=np.concatenate([np.full(3, np.inf), np.full(3, free), upper]),
        lbg=0.0,
        ubg=0.0,
    )
    if not solver.stats()["success"]:
        return {}
    distances = cs.Function("distances", [problem["x"]], [cs.norm_2(some) for some in off.values()])
    found = distances.call([answer["x"]])
    return {name: float(value) for name, value in zip(off, found, strict=True)}


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
    asked = [one.label for one in _in_order(task) if one.knot and one.keyframe.yaw]
    found = "the jets all push along the vertical, and no force turns the robot about it while it is in the air"
    if asked and not task.stands_at_start:
        yield warning(asked[0], f"a yaw is asked for, and {found}", "ask for no yaw, or let a jet push aside")
    else:
        yield note("yaw", found)


_PARALLEL = 1e-6


def _in_order(task: Task) -> list[Placed]:
    """Return the keyframes that are held, by knot."""
    held = [one for one in task.scenario.own_keyframes() if one.keyframe.weight is None]
    return sorted(held, key=lambda one: one.knot)
