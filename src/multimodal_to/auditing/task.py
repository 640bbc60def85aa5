"""Whether a motion does what its scenario asks: how it starts and ends, and the ranges in between."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from multimodal_to.adam.spatial import Array
from multimodal_to.auditing import keyframes
from multimodal_to.auditing.findings import Motion, Worst, worst_of
from multimodal_to.models.attitude import tilt
from multimodal_to.scenarios.failures import failing_knots
from multimodal_to.scenarios.keyframes import attitude_at
from multimodal_to.scenarios.scenario import Scenario, Start, Terminal
from multimodal_to.trajectory.derived import at_knots, surface_frames, without_acceleration

_SPEEDS = ("com_velocity", "base_linear_velocity", "base_angular_velocity", "joint_velocities")


def task_findings(motion: Motion, scenario: Scenario) -> list[Worst]:
    """Check a motion against its scenario."""
    return [
        *_start(motion, scenario),
        *_between(motion, scenario),
        *_keyframes(motion, scenario),
        *_end(motion, scenario),
    ]


def _keyframes(motion: Motion, scenario: Scenario) -> list[Worst]:
    """Return the worst miss of each kind that keyframes ask for, in the order of the table of properties."""
    name = keyframes.NAME
    still = [
        replace(finding, body=f"{one.label} {finding.body}".rstrip())
        for one in keyframes.asked(scenario)
        for finding in (
            *(_rest(name, motion, one.knot) if one.keyframe.still else ()),
            *(_standing(name, motion, one.knot, scenario) if one.keyframe.standing else ()),
            *(_hover(name, motion, one.knot, scenario) if one.keyframe.hover else ()),
        )
    ]
    return keyframes.worst_by_kind([*keyframes.misses(motion, scenario), *still])


def _start(motion: Motion, scenario: Scenario) -> list[Worst]:
    findings = [_com("start: CoM", motion, 0, scenario.start_com)]
    if scenario.start is Start.GIVEN:  # it may move, and nothing has to carry it
        return findings
    findings += _rest("start", motion, 0)
    if scenario.start is Start.STANDING:
        findings += [*_standing("start", motion, 0, scenario), _no_thrust(motion)]
    if scenario.start is Start.HOVER:
        findings += _hover("start", motion, 0, scenario)
    return [*findings, *_equilibrium("start", motion, 0)]


def _end(motion: Motion, scenario: Scenario) -> list[Worst]:
    last = motion.trajectory.knots
    findings = [] if scenario.final_com is None else [_com("end: CoM", motion, last, scenario.end_com)]
    if scenario.terminal in (Terminal.HOVER, Terminal.STANDING):
        findings += _rest("end", motion, last)
    if scenario.terminal is Terminal.STANDING:
        findings += _standing("end", motion, last, scenario)
    if scenario.terminal is Terminal.HOVER:
        known = last + without_acceleration(motion.trajectory)  # the last knot, or the one before it
        findings += [*_hover("end", motion, last, scenario), *_equilibrium("end", motion, known)]
    return findings


def _between(motion: Motion, scenario: Scenario) -> list[Worst]:
    """How far quantities are beyond the scenario's ranges; zero or less is within them."""
    trajectory, steps = motion.trajectory, np.diff(motion.trajectory.time)
    twists = np.abs(np.vstack([trajectory.base_linear_velocity, trajectory.base_angular_velocity]))
    fastest = np.repeat(scenario.base_speeds(motion.robot), 3)[:, None]
    away = np.abs(trajectory.com_position) - np.reshape(scenario.com_box(motion.robot), (3, 1))
    off_time = np.maximum(steps - scenario.interval_max, scenario.interval_min - steps)
    findings = [
        Worst(name="knots", worst=abs(trajectory.knots - scenario.knots), knot=trajectory.knots),
        worst_of("time step range", off_time, first=1),
        worst_of("base speed range", twists - fastest),
        worst_of("CoM range", away, ("x", "y", "z")),
    ]
    if scenario.mid_height_min is not None:
        middle = trajectory.knots // 2
        below = scenario.mid_height_min - float(trajectory.com_position[2, middle])
        findings.append(Worst(name="middle: CoM below", worst=below, knot=middle))
    return findings


def _com(name: str, motion: Motion, knot: int, target: tuple[float, float, float]) -> Worst:
    """Return how far the CoM is from where it should be.

    Args:
        name: of the property.
        motion: that is judged.
        knot: at which.
        target: position of the CoM in the world [m].
    """
    off = np.abs(motion.trajectory.com_position[:, knot] - target)[:, None]
    return worst_of(name, off, ("x", "y", "z"), first=knot)


def _rest(when: str, motion: Motion, knot: int) -> list[Worst]:
    """Nothing moves: not the CoM, the base or a joint, and there is no angular momentum.

    Args:
        when: "start" or "end", with which the properties' names begin.
        motion: that is judged.
        knot: at which.
    """
    trajectory = motion.trajectory
    speeds = np.concatenate([getattr(trajectory, name)[:, knot] for name in _SPEEDS])
    momentum = trajectory.angular_momentum[:, knot]
    return [
        _at(f"{when}: speed", knot, np.abs(speeds)),
        _at(f"{when}: angular momentum", knot, np.abs(momentum)),
    ]


def _standing(when: str, motion: Motion, knot: int, scenario: Scenario) -> list[Worst]:
    """Every contact point is on the ground.

    Args:
        when: "start" or "end", with which the property's name begins.
        motion: that is judged.
        knot: at which.
        scenario: with the ground.
    """
    heights = surface_frames(scenario.surface, motion.points[:, knot])[0]
    return [worst_of(f"{when}: feet off the ground", np.abs(heights)[:, None], motion.robot.contact_names, knot)]


def _hover(when: str, motion: Motion, knot: int, scenario: Scenario) -> list[Worst]:
    """No contact force, an upright base, and thrusts that carry the weight and hold still, but for jets that failed.

    Args:
        when: "start" or "end", with which the properties' names begin.
        motion: that is judged.
        knot: at which.
        scenario: with the jets that fail; its keyframes may ask for another attitude than upright.
    """
    trajectory, weight = motion.trajectory, motion.robot.mass * motion.robot.gravity
    asked = attitude_at(motion.robot, scenario.placed(), knot)
    upright = replace(motion.robot.upright, base_quaternion_xyzw=asked).base_transform[:3, :3]
    failed = failing_knots(scenario.failures, motion.robot.jet_names, trajectory.knots)
    running = [row for row in range(len(motion.robot.jets)) if not 0 < failed.get(row, 0) <= knot]
    all_run = len(running) == len(motion.robot.jets)
    held = knot if all_run else knot + without_acceleration(trajectory)  # one that has failed is still running down
    off = tilt(motion.base[knot, :3, :3], upright, motion.robot.up)
    return [
        _at(f"{when}: contact force", knot, np.abs(trajectory.contact_forces[:, knot])),
        _at(f"{when}: base off upright", knot, np.array(off)),
        _at(f"{when}: thrust off weight", held, np.abs(motion.thrusts[:, held].sum(axis=0) + weight)),
        _at(f"{when}: thrust rate", knot, np.abs(trajectory.thrust_rate[running, knot])),
    ]


def _no_thrust(motion: Motion) -> Worst:
    return _at("start: thrust", 0, np.abs(motion.trajectory.thrust[:, 0]))


def _equilibrium(when: str, motion: Motion, knot: int) -> list[Worst]:
    """Contact forces, thrusts and weight are in static equilibrium, whatever accelerations the file states.

    Args:
        when: "start" or "end", with which the properties' names begin.
        motion: that is judged.
        knot: at which.
    """
    robot, com = motion.robot, motion.trajectory.com_position[:, knot]
    acting = motion.trajectory.contact_forces  # at the first knot those of the rest before it
    if knot:
        acting = at_knots(motion.trajectory, "contact_forces")
    forces = np.concatenate([acting[:, knot].reshape(-1, 3), motion.thrusts[:, knot]])
    points = np.concatenate([motion.points[:, knot], motion.thrust_points[:, knot]])
    if knot:  # the rest before the first knot is that without a push
        forces = np.concatenate([forces, motion.pushes[:, knot]])
        points = np.concatenate([points, motion.push_points[:, knot]])
    moment = np.cross(points - com, forces).sum(axis=0) + motion.drag_moments[:, knot].sum(axis=0)
    return [
        _at(f"{when}: force balance", knot, np.abs(forces.sum(axis=0) + robot.mass * robot.gravity)),
        _at(f"{when}: moment balance", knot, np.abs(moment)),
    ]


def _at(name: str, knot: int, values: Array) -> Worst:
    """Return the largest of a property's values at one knot.

    Args:
        name: of the property.
        knot: at which.
        values: of any shape, in the property's unit.
    """
    return Worst(name=name, worst=float(values.max(initial=0.0)), knot=knot)
