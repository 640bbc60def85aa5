"""What came of a playback: how far it left the plan, whether it fell, and the motion as a `Trajectory`."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from multimodal_to.adam.spatial import Array
from multimodal_to.arguments import checked
from multimodal_to.models.joint_units import slides
from multimodal_to.models.robot import Robot
from multimodal_to.simulation.model import TIME_STEP
from multimodal_to.simulation.playback import Playback
from multimodal_to.simulation.stabiliser import rotation_vector
from multimodal_to.trajectory import Trajectory
from multimodal_to.trajectory.derived import acting_times, base_poses, contact_points, loaded_force

BLINK = 0.1
"""A foot that stands or floats for less than this hasn't switched [s]."""


@dataclass(frozen=True, kw_only=True)
class Switch:
    """A planned touch-down or lift-off of a foot, and when the simulated one was; None where there was none."""

    foot: str
    touches: bool
    planned: float  # [s]
    simulated: float | None  # [s]


@dataclass(frozen=True, kw_only=True)
class JointTorque:
    """What was asked of a joint's motor until the end, or until the robot fell."""

    joint: str
    over_effort: float  # largest asked torque over the effort limit, before the clip [1]
    when: float  # it was asked, since the start [s]
    beyond: float  # for how long more than the limit was asked; so long it was clipped, if torques are [s]


@dataclass(frozen=True, kw_only=True)
class Tracking:
    """The largest errors over the plan, and how things stood after its end was held."""

    com: float  # [m]
    attitude: float  # of the base [°]
    joint: float  # of those that turn [°]
    joint_name: str  # empty where none turns
    slide: float  # of the joints that slide [m]
    slide_name: str  # empty where none slides
    thrust: float  # [N]
    switches: tuple[Switch, ...]
    torques: tuple[JointTorque, ...]  # of the joints that have an effort limit, the largest over its limit first
    clipped: bool  # torques were clipped at these limits
    fell: float | None  # when [s]
    end: str  # "fell", "stands", "hovers" or "in the air"
    com_at_end: float  # [m]
    attitude_at_end: float  # [°]
    survived: bool  # it ended as the plan does: on its feet or in a hover
    touch_down_speed: float  # largest of a contact point downwards as its foot comes down [m/s]; 0 where none does

    @property
    def torque_over_effort(self) -> float:
        """Return the largest asked torque over the effort limit of its joint [1]; 0 if no joint has a limit."""
        return max((torque.over_effort for torque in self.torques), default=0.0)

    @property
    def longest_beyond(self) -> float:
        """Return for how long the joint that was asked for more than its limit longest was so [s]."""
        return max((torque.beyond for torque in self.torques), default=0.0)


@checked
def tracking(playback: Playback) -> Tracking:
    """Return the errors of a playback."""
    plan, robot, reference = playback.plan, playback.robot, playback.reference
    during = playback.time <= plan.duration
    com = np.linalg.norm(playback.com - reference.com, axis=1)
    attitude = np.degrees(
        [
            np.linalg.norm(rotation_vector(wanted @ turn.T))
            for wanted, turn in zip(reference.rotation, _rotations(playback.qpos), strict=True)
        ]
    )
    joints = np.abs(playback.qpos[:, 7:] - reference.joints)[during].max(axis=0, initial=0.0)
    turn, turning = _worst_joint(robot, joints, sliding=False)
    slide, sliding = _worst_joint(robot, joints, sliding=True)
    thrust = np.abs(playback.thrust - reference.thrust)[during]
    return Tracking(
        com=float(com[during].max()),
        attitude=float(attitude[during].max()),
        joint=float(np.degrees(turn)),
        joint_name=turning,
        slide=slide,
        slide_name=sliding,
        thrust=float(thrust.max(initial=0.0)),
        switches=_switches(playback),
        torques=_joint_torques(playback),
        clipped=playback.torque_limits,
        fell=playback.fell,
        end=(end := _end(playback)),
        survived=end == _planned_end(plan, robot),
        touch_down_speed=_touch_down_speed(playback),
        com_at_end=float(com[-1]),
        attitude_at_end=float(attitude[-1]),
    )


def _worst_joint(robot: Robot, errors: Array, *, sliding: bool) -> tuple[float, str]:
    """Return the largest error of the joints that slide, or of those that turn [m or rad], and whose it is.

    Args:
        robot: whose joints.
        errors: of each, (n,).
        sliding: which of the two.
    """
    of_kind = [index for index, slider in enumerate(slides(robot)) if slider == sliding]
    if not of_kind:
        return 0.0, ""
    worst = max(of_kind, key=lambda index: float(errors[index]))
    return float(errors[worst]), robot.joint_names[worst]


def _joint_torques(playback: Playback) -> tuple[JointTorque, ...]:
    """Return what was asked of every joint that has an effort limit; rows after a fall repeat and don't count."""
    limits = playback.robot.joint_limits.effort
    steps = _steps(playback)
    shares = np.abs(playback.asked_torques[:steps]) / limits
    found = [
        JointTorque(
            joint=name,
            over_effort=float(share.max()),
            when=float(playback.time[share.argmax()]),
            beyond=float((share > 1.0).sum() * TIME_STEP),
        )
        for name, limit, share in zip(playback.robot.joint_names, limits, shares.T, strict=True)
        if np.isfinite(limit)
    ]
    return tuple(sorted(found, key=lambda torque: -torque.over_effort))


def _end(playback: Playback) -> str:
    if playback.fell is not None:
        return "fell"
    last = playback.contact_forces[-100:, :, 2].sum(axis=1).mean()
    if last > loaded_force(playback.robot):
        return "stands"
    return "hovers" if np.linalg.norm(playback.qvel[-1, :3]) < 0.2 else "in the air"


def _planned_end(plan: Trajectory, robot: Robot) -> str:
    return "stands" if float(plan.vertical_contact_force()[-1]) > loaded_force(robot) else "hovers"


def _touch_down_speed(playback: Playback) -> float:
    """Return the largest speed downwards of a contact point just before its foot comes down [m/s]."""
    up, count = playback.robot.up, _steps(playback)
    heights = playback.points[:count] @ up
    speeds, fastest = -np.diff(heights, axis=0, prepend=heights[:1]) / TIME_STEP, 0.0
    for members in playback.robot.feet.values():
        own = list(members)
        forces = np.linalg.norm(playback.contact_forces[:count, own].sum(axis=1), axis=1)
        touches = forces > loaded_force(playback.robot)
        for first in np.flatnonzero(touches[1:] & ~touches[:-1]) + 1:
            blink = int(first - BLINK / TIME_STEP)
            if blink >= 0 and not touches[blink:first].any():
                fastest = max(fastest, float(speeds[blink:first, own][-5:].max()))
    return fastest


def _steps(playback: Playback) -> int:
    """Return how many rows there are until the end or a fall, after which they repeat."""
    if playback.fell is None:
        return int(playback.time.size)
    return int(np.searchsorted(playback.time, playback.fell, side="right"))


def _rotations(qpos: Array) -> Array:
    w, x, y, z = qpos[:, 3:7].T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.array(rows).transpose(2, 0, 1)


def _switches(playback: Playback) -> tuple[Switch, ...]:
    """Return every planned touch-down and lift-off with the simulated one of the same kind that is nearest in time."""
    found, touching = [], loaded_force(playback.robot)
    for foot, members in playback.robot.feet.items():
        own = list(members)
        times = playback.time
        planned = _edges(times, playback.reference.contact_forces[:, own, 2].sum(axis=1) > touching)
        simulated = _edges(times, np.linalg.norm(playback.contact_forces[:, own].sum(axis=1), axis=1) > touching)
        for time, touches in planned:
            others = [other for other, kind in simulated if kind == touches]
            nearest = min(others, key=lambda other: abs(other - time)) if others else None
            found.append(Switch(foot=foot, touches=touches, planned=time, simulated=nearest))
    return tuple(sorted(found, key=lambda switch: switch.planned))


def _edges(times: Array, stands: Array) -> list[tuple[float, bool]]:
    """Return when a foot begins to stand (True) or to float (False), without blinks."""
    edges = (np.flatnonzero(np.diff(stands.astype(int))) + 1).tolist()
    kept: list[int] = []
    for edge in edges:
        if kept and times[edge] - times[kept[-1]] < BLINK:
            kept.pop()
        else:
            kept.append(edge)
    return [(float(times[edge]), bool(stands[edge])) for edge in kept]


@checked
def simulated_trajectory(playback: Playback) -> Trajectory:
    """Return the motion at the instants of the plan, under the plan's scenario and rule, to be drawn beside it.

    Rates are differences of columns. Contact forces and throttles are means over the time in which those of the plan
    act: `derived.acting_times`.
    """
    robot, plan = playback.robot, playback.plan
    grid = plan.time - plan.time[0]
    rows = _rows(playback, grid)
    during = _rows(playback, plan.times("joint_velocities") - plan.time[0])
    acting = [_rows(playback, when - plan.time[0]) for when in acting_times(plan)]
    qpos, qvel = playback.qpos[rows].T, playback.qvel[during].T
    arrays: dict[str, Any] = {
        "base_position": qpos[:3],
        "base_quaternion_xyzw": qpos[[4, 5, 6, 3]],
        "joint_positions": qpos[7:],
        "base_linear_velocity": qvel[:3],
        "base_angular_velocity": qvel[3:6],
        "joint_velocities": qvel[6:],
        "com_position": playback.com[rows].T,
        "contact_forces": _means(playback.contact_forces.reshape(playback.time.size, -1), *acting),
        "thrust": playback.thrust[rows].T,
        "thrust_rate": playback.thrust_rate[during].T,
        "throttle": _means(playback.throttle, *acting),
    }
    motion = replace(plan, scenario=f"{plan.scenario} in MuJoCo", solve_json="", **arrays)
    points = contact_points(robot, motion)
    moving = playback.qpos[during].T
    poses = base_poses(replace(motion, base_position=moving[:3], base_quaternion_xyzw=moving[[4, 5, 6, 3]]))
    momentum = robot.kindyn.centroidal_momentum_fun().map(grid.size)
    momenta = np.array(momentum(np.hstack(list(poses)), moving[7:], qvel[:6], qvel[6:]))
    arrays = {
        "com_velocity": momenta[:3] / robot.mass,
        "angular_momentum": momenta[3:],
        "contact_positions": points.transpose(0, 2, 1).reshape(-1, grid.size),
    }
    arrays |= {
        "com_acceleration": _rates(arrays["com_velocity"], grid),
        "angular_momentum_rate": _rates(arrays["angular_momentum"], grid),
        "contact_force_rates": _rates(motion.contact_forces, grid),
        "thrust_acceleration": _rates(motion.thrust_rate, grid),
    }
    return replace(motion, **arrays)


def _rows(playback: Playback, times: Array) -> np.ndarray:
    """Return the rows of a playback at times since its start [s]; before it the first, after it the last."""
    return np.clip(np.searchsorted(playback.time, times - 1e-9), 0, playback.time.size - 1)


def _rates(values: Array, grid: Array) -> Array:
    """Return backward differences, zero at the first knot."""
    return np.asarray(np.diff(values, axis=1, prepend=values[:, :1]) / np.diff(grid, prepend=grid[0] - 1.0))


def _means(values: Array, starts: Array, ends: Array) -> Array:
    """Return the means over the steps from each start to its end, at least over one, (columns, starts)."""
    means = [values[start : max(end, start + 1)].mean(axis=0) for start, end in zip(starts, ends, strict=True)]
    return np.array(means).reshape(len(starts), values.shape[1]).T
