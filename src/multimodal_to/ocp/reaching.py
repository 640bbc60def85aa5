"""A posture that brings frames to where a keyframe asks for them, by inverse kinematics."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import casadi as cs
import numpy as np

from multimodal_to.adam import centroidal, quaternion
from multimodal_to.adam.kinematics import Pose, forward_kinematics
from multimodal_to.adam.spatial import SX, Array
from multimodal_to.models.robot import Posture, Robot
from multimodal_to.scenarios.keyframes import AXES, Keyframe, Placed, attitude_at, by_axis

_TURN_MAX = 0.5
"""How far the base may turn about each axis where a keyframe leaves its attitude open [rad]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Reached:
    """The posture in which frames are the nearest to where they are asked to be."""

    posture: Posture
    missed: Mapping[str, float]  # how far each frame stays from its position [m]


def reached(robot: Robot, one: Placed, com: Array, near: Posture, *, still: bool) -> Reached | None:
    """Return the posture that brings the frames of a keyframe nearest to their positions; None where none is found.

    Base and joints are free within their ranges, but for the attitude of a hover, joints that are asked for, and the
    CoM where it is asked for or has to stay. Among such postures it is the one near a given one. The search is a local
    one, solved by IPOPT.

    Args:
        robot: that reaches.
        one: the keyframe, which asks for a position of a frame.
        com: where the search begins with the CoM [m], (3,).
        near: the posture whose joints count as near.
        still: let the CoM stay there, and not only where the keyframe asks for it.
    """
    keyframe, limits = one.keyframe, robot.joint_limits
    tree, count = robot.kindyn.tree, len(robot.joint_names)
    position, tilt, s = cs.SX.sym("p", 3), cs.SX.sym("tilt", 3), cs.SX.sym("s", count)
    attitude = quaternion.product(quaternion.exp(tilt), cs.DM(attitude_at(robot, [one], one.knot)))
    base = Pose(quaternion.rotation_matrix(attitude), position)
    off = {
        name: _off(forward_kinematics(tree, tree.frame(name), base, s).translation, by_axis(target.position))
        for name, target in keyframe.frames.items()
        if target.position
    }
    asked = by_axis(None if isinstance(keyframe.com, str) else keyframe.com)
    asked = dict(zip(AXES, com.tolist(), strict=True)) if still else asked
    lower, upper = _ranges(robot, keyframe)
    held = keyframe.hover or keyframe.yaw is not None or keyframe.base_orientation is not None
    turn = np.full(3, 0.0 if held else _TURN_MAX)
    problem = {
        "x": cs.vertcat(position, tilt, s),
        "f": 1e4 * sum(cs.sumsqr(some) for some in off.values())
        + 1e-3 * (cs.sumsqr(s - near.joint_positions) + cs.sumsqr(tilt)),
        "g": _off(centroidal.com_position(tree, base, s), asked),
    }
    options = {"print_time": False, "ipopt": {"print_level": 0, "sb": "yes", "max_iter": 200, "tol": 1e-8}}
    solver = cs.nlpsol("reached", "ipopt", problem, options)
    answer = solver(
        x0=np.concatenate(
            [near.base_position + com - robot.com_at(near), np.zeros(3), np.clip(near.joint_positions, lower, upper)]
        ),
        lbx=np.concatenate([np.full(3, -np.inf), -turn, lower]),
        ubx=np.concatenate([np.full(3, np.inf), turn, upper]),
        lbg=0.0,
        ubg=0.0,
    )
    if not solver.stats()["success"]:
        return None
    found = cs.Function("found", [problem["x"]], [attitude, *(cs.norm_2(some) for some in off.values())])
    turned, *missed = found.call([answer["x"]])
    values = np.array(answer["x"]).ravel()
    return Reached(
        posture=Posture(
            base_position=values[:3],
            base_quaternion_xyzw=np.array(turned).ravel(),
            joint_positions=np.clip(values[6:], limits.lower, limits.upper),
        ),
        missed={name: float(value) for name, value in zip(off, missed, strict=True)},
    )


def _off(place: SX, asked: Mapping[str, float]) -> SX:
    """Return a place less where it is asked to be [m], along the axes that are asked for."""
    return cs.vertcat(cs.SX(0, 1), *(place[AXES.index(axis)] - value for axis, value in asked.items()))


def _ranges(robot: Robot, keyframe: Keyframe) -> tuple[Array, Array]:
    """Return the least and the greatest joint positions, with those that a keyframe asks for held, (n,) each."""
    lower, upper = robot.joint_limits.lower.copy(), robot.joint_limits.upper.copy()
    for name, value in keyframe.joints.items():
        index = robot.joint_names.index(name)
        least, most = lower[index], upper[index]
        lower[index] = np.clip(value - keyframe.joint_tolerance, least, most)
        upper[index] = np.clip(value + keyframe.joint_tolerance, least, most)
    return lower, upper
