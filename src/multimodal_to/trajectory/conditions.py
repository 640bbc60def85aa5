"""What an answer depends on beside its task: gravity, friction and the robot's own numbers, as a trajectory keeps them.

Gravity and friction are the world's: whoever judges or draws a motion takes those that it keeps. The rest is the
robot's own: a motion is judged for the robot at hand, and `differences` says what is another.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from multimodal_to.arguments import checked
from multimodal_to.errors import TrajectoryError, shown
from multimodal_to.files.reading import is_number
from multimodal_to.models.loading import bundled_robots, load_robot
from multimodal_to.models.robot import Robot
from multimodal_to.trajectory.trajectory import Trajectory

_SAME = 1e-9
"""Numbers that differ by less than this share are the same [1]."""


@checked
def to_json(robot: Robot) -> str:
    """Return what of a robot an answer depends on, as the JSON text that a trajectory keeps in `robot_json`."""
    return json.dumps(_facts(robot), ensure_ascii=False, allow_nan=False)


@checked
def under_conditions(robot: Robot, trajectory: Trajectory) -> Robot:
    """Return the robot under the gravity and with the friction that a trajectory keeps; as it is where it keeps none.

    Raises:
        TrajectoryError: what it keeps is not what `to_json` writes.
    """
    stored = _stored(trajectory)
    gravity, friction = stored.get("gravity", robot.gravity.tolist()), stored.get("friction", robot.friction)
    if not (isinstance(gravity, list) and len(gravity) == 3 and all(map(is_number, gravity))):
        raise _wrong(trajectory, f"gravity is {shown(gravity)}; expected three numbers [m/s²]")
    if not (is_number(friction) and friction > 0):
        raise _wrong(trajectory, f"friction is {shown(friction)}; expected a positive number")
    if np.array_equal(gravity, robot.gravity) and friction == robot.friction:
        return robot
    return replace(robot.with_gravity(gravity), friction=float(friction))


@checked
def robot_of(trajectory: Trajectory) -> Robot:
    """Return the bundled robot that a trajectory names, with its jets and under its conditions.

    A trajectory may name a folder, which is not followed: files of others are to be no way to read what is here.

    Raises:
        TrajectoryError: it names none that is bundled, or keeps conditions that are none.
    """
    if trajectory.robot not in bundled_robots():
        raise TrajectoryError(
            f"the trajectory is of '{trajectory.robot}', which is not bundled; "
            "expected the robot as well: show(load_robot(FOLDER), ...)"
        )
    return under_conditions(load_robot(trajectory.robot).with_jets(trajectory.jet_names), trajectory)


@checked
def differences(robot: Robot, trajectory: Trajectory) -> tuple[str, ...]:
    """Return in words how a robot differs from the one that a trajectory was planned for, beside gravity and friction.

    Empty where it does not, or where the trajectory does not say.

    Raises:
        TrajectoryError: what it keeps is not what `to_json` writes.
    """
    stored = _stored(trajectory)
    here = {name: value for name, value in _facts(robot).items() if name not in ("gravity", "friction")}
    return tuple(
        f"{name} is {shown(_one(before))} there and {shown(_one(now))} here"
        for name, before, now in _compared("", {key: stored[key] for key in here if key in stored}, here)
    )


def _facts(robot: Robot) -> dict[str, Any]:
    limits, names = robot.joint_limits, robot.joint_names
    return {
        "gravity": robot.gravity.tolist(),
        "friction": float(robot.friction),
        "mass": robot.mass,
        "upright": np.round(robot.upright.base_transform[:3, :3].T @ robot.up, 12).tolist(),
        "locked": {name: float(value) for name, value in robot.kindyn.tree.locked.items()},
        "joint_limits": {
            name: {key: _finite(float(getattr(limits, key)[index])) for key in ("lower", "upper", "speed", "effort")}
            for index, name in enumerate(names)
        },
        "jets": {
            jet.name: {
                "frame": jet.frame,
                "thrust_max": float(jet.thrust_max),
                "throttle_min": float(jet.throttle_min),
                "throttle_max": float(jet.throttle_max),
                "drag": float(jet.drag),
                "model": {name: float(value) for name, value in vars(jet.model).items()},
            }
            for jet in robot.jets
        },
    }


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _stored(trajectory: Trajectory) -> Mapping[str, Any]:
    if not trajectory.robot_json:
        return {}
    try:
        table = json.loads(trajectory.robot_json)
    except (ValueError, RecursionError) as error:
        raise _wrong(trajectory, f"it is no JSON: {error}") from error
    if not isinstance(table, dict):
        raise _wrong(trajectory, "it is no JSON object")
    return table


def _wrong(trajectory: Trajectory, what: str) -> TrajectoryError:
    return TrajectoryError(f"what '{trajectory.scenario}' keeps of its robot cannot be read: {what}")


def _compared(name: str, before: Any, now: Any) -> Iterator[tuple[str, Any, Any]]:
    """Yield the dotted names of what differs, with both values.

    Args:
        name: of both.
        before: as the trajectory keeps it.
        now: of the robot at hand.
    """
    if isinstance(before, dict) and isinstance(now, dict):
        for key in now:
            if key in before:  # the jets that a motion does not use are not kept
                yield from _compared(f"{name}.{key}" if name else key, before[key], now[key])
    elif not _same(before, now):
        yield name, before, now


def _same(before: Any, now: Any) -> bool:
    if isinstance(before, list) and isinstance(now, list):
        return len(before) == len(now) and all(_same(*pair) for pair in zip(before, now, strict=True))
    if is_number(before) and is_number(now):
        return math.isclose(before, now, rel_tol=_SAME, abs_tol=_SAME)
    return bool(before == now)


def _one(value: Any) -> Any:
    return "none" if value is None else value
