"""Whether a motion does what the keyframes of its scenario ask: one property for each kind of thing asked."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence

import casadi as cs
import numpy as np

from multimodal_to.adam import quaternion
from multimodal_to.adam.spatial import Array
from multimodal_to.auditing.findings import Motion, Worst
from multimodal_to.auditing.property import Judged, Property
from multimodal_to.models.attitude import conjugate, product
from multimodal_to.scenarios.keyframes import AXES, Keyframe, Placed, by_axis
from multimodal_to.scenarios.scenario import Scenario
from multimodal_to.trajectory import rules

NAME = "keyframes"
"""What the names of these properties begin with."""
_HELD_UPRIGHT = 2.1e-3
"""How far a hover's attitude may be off about each axis [rad]: the problem leaves 2e-3."""
_FEASIBLE = "twice what a feasible motion may miss its row by"


def _property(kind: str, unit: str, meaning: str, limit: float = 2e-5, *, of_joints: bool = False) -> Property:
    return Property(
        name=f"{NAME}: {kind}",
        unit=unit,
        limit=limit,
        reason=_FEASIBLE if limit == 2e-5 else "chosen: a miss of 4e-5 m/s of the CoM, for the iRonCub",
        meaning=meaning,
        judged=Judged.WITH_KEYFRAMES,
        of_joints=of_joints,
    )


_BEYOND = "and beyond the tolerance"
PROPERTIES = (
    _property("CoM", "m", "how far the CoM is from where a keyframe wants it, or outside its range, by axis"),
    _property("base position", "m", "how far the base is from where a keyframe wants it, by axis"),
    _property("orientation", "rad", f"how far the base is turned from a keyframe's, about each axis, {_BEYOND}"),
    _property("yaw", "rad", f"how far the base is turned from a keyframe's about the vertical, {_BEYOND}"),
    _property("joints", "rad", f"how far a joint is from a keyframe's, {_BEYOND}", of_joints=True),
    _property("frame position", "m", f"how far a frame is from a keyframe's, by axis, {_BEYOND}"),
    _property("frame orientation", "rad", f"how far a frame is turned from a keyframe's, about each axis, {_BEYOND}"),
    _property("linear momentum", "kg m/s", "difference of m ẋ from a keyframe's, by axis", 2e-3),
    _property("angular momentum asked", "kg m²/s", "difference of hω from a keyframe's, by axis"),
)
"""What is judged of keyframes; what their rest, hover and standing ask for is in `properties`, as of start and end."""


def asked(scenario: Scenario) -> tuple[Placed, ...]:
    """Return the keyframes that are judged: those that are held, not those that are a cost."""
    return tuple(one for one in scenario.own_keyframes() if one.keyframe.weight is None)


def kinds(scenario: Scenario) -> set[str]:
    """Return the names of the properties that a scenario's keyframes are judged by."""
    found = set[str]()
    for one in asked(scenario):
        keyframe, targets = one.keyframe, one.keyframe.frames.values()
        momentum = keyframe.momentum
        for kind, there in (
            ("CoM", keyframe.com is not None or keyframe.com_min or keyframe.com_max),
            ("base position", keyframe.base_position),
            ("orientation", keyframe.base_orientation),
            ("yaw", keyframe.yaw is not None),
            ("joints", keyframe.joints),
            ("frame position", any(target.position for target in targets)),
            ("frame orientation", any(target.orientation for target in targets)),
            ("linear momentum", momentum and momentum.linear),
            ("angular momentum asked", momentum and momentum.angular),
            *((kind, keyframe.still) for kind in ("speed", "angular momentum")),
            ("feet off the ground", keyframe.standing),
            *((kind, keyframe.hover) for kind in _HOVERING),
        ):
            if there:
                found.add(f"{NAME}: {kind}")
    return found


_HOVERING = ("contact force", "base off upright", "thrust off weight", "thrust rate")


def misses(motion: Motion, scenario: Scenario) -> list[Worst]:
    """Return by how much each number that a keyframe asks for is missed, with the keyframe in its body's name."""
    return [
        Worst(name=f"{NAME}: {kind}", worst=worst, knot=one.knot, body=body)
        for one in asked(scenario)
        for kind, find in _MISSES.items()
        for body, worst in find(motion, one)
    ]


def worst_by_kind(findings: Sequence[Worst]) -> list[Worst]:
    """Return the worst finding of each kind, in the order of the table of properties."""
    worst = dict[str, Worst]()
    for finding in sorted(findings, key=lambda one: _ORDER.index(one.name)):
        if finding.name not in worst or finding.worst > worst[finding.name].worst:
            worst[finding.name] = finding
    return list(worst.values())


_ORDER = (
    *(entry.name for entry in PROPERTIES),
    *(f"{NAME}: {kind}" for kind in ("speed", "angular momentum", "feet off the ground", *_HOVERING)),
)
Misses = Iterator[tuple[str, float]]


def _com(motion: Motion, one: Placed) -> Misses:
    keyframe, there = one.keyframe, motion.trajectory.com_position[:, one.knot]
    position = {} if isinstance(keyframe.com, str) else by_axis(keyframe.com)
    yield from _off(there, position, 0.0, one.label)
    for axis, least in keyframe.com_min.items():
        yield f"{one.label} {axis}", float(least - there[AXES.index(axis)])
    for axis, most in keyframe.com_max.items():
        yield f"{one.label} {axis}", float(there[AXES.index(axis)] - most)


def _base_position(motion: Motion, one: Placed) -> Misses:
    there = motion.trajectory.base_position[:, one.knot]
    yield from _off(there, by_axis(one.keyframe.base_position), 0.0, one.label)


def _orientation(motion: Motion, one: Placed) -> Misses:
    if one.keyframe.base_orientation is not None:
        off = rotation_vector(np.array(one.keyframe.base_orientation), _attitude(motion, one))
        yield from ((f"{one.label} {axis}", abs(part) - _tolerance(one.keyframe)) for axis, part in _by_axis(off))


def _yaw(motion: Motion, one: Placed) -> Misses:
    if one.keyframe.yaw is not None:
        turn = product(_attitude(motion, one), conjugate(motion.robot.upright.base_quaternion_xyzw))
        yaw = 2.0 * np.arctan2(turn[:3] @ motion.robot.up, turn[3])
        off = abs(float(np.remainder(yaw - one.keyframe.yaw + np.pi, 2 * np.pi) - np.pi))
        yield one.label, off - _tolerance(one.keyframe)


def _tolerance(keyframe: Keyframe) -> float:
    return _HELD_UPRIGHT if keyframe.hover else keyframe.orientation_tolerance


def _attitude(motion: Motion, one: Placed) -> Array:
    return np.asarray(motion.trajectory.base_quaternion_xyzw[:, one.knot])


def _joints(motion: Motion, one: Placed) -> Misses:
    names, there = motion.robot.joint_names, motion.trajectory.joint_positions[:, one.knot]
    for name, value in one.keyframe.joints.items():
        yield name, abs(float(there[names.index(name)] - value)) - one.keyframe.joint_tolerance


def _frame_position(motion: Motion, one: Placed) -> Misses:
    for name, target in one.keyframe.frames.items():
        there = _pose(motion, one, name)[:3, 3]
        yield from _off(there, by_axis(target.position), target.position_tolerance, f"{one.label} {name}")


def _frame_orientation(motion: Motion, one: Placed) -> Misses:
    for name, target in one.keyframe.frames.items():
        if target.orientation is not None:
            rotation = _pose(motion, one, name)[:3, :3]
            off = rotation_vector(np.array(target.orientation), _quaternion(rotation))
            tolerance = target.orientation_tolerance
            yield from ((f"{one.label} {name} {axis}", abs(part) - tolerance) for axis, part in _by_axis(off))


def _pose(motion: Motion, one: Placed, frame: str) -> Array:
    joints = motion.trajectory.joint_positions[:, one.knot]
    return np.array(motion.robot.kindyn.forward_kinematics(frame, motion.base[one.knot], joints))


def _linear_momentum(motion: Motion, one: Placed) -> Misses:
    if one.keyframe.momentum is not None:
        there = motion.robot.mass * _meeting(motion, one, "com_velocity")
        yield from _off(there, by_axis(one.keyframe.momentum.linear), 0.0, one.label)


def _angular_momentum(motion: Motion, one: Placed) -> Misses:
    if one.keyframe.momentum is not None:
        there = _meeting(motion, one, "angular_momentum")
        yield from _off(there, by_axis(one.keyframe.momentum.angular), 0.0, one.label)


def _meeting(motion: Motion, one: Placed, name: str) -> Array:
    """Return a velocity at a knot: where it is between knots, the mean of the two that meet there.

    Args:
        motion: that is judged.
        one: the keyframe.
        name: of the velocity.
    """
    values = getattr(motion.trajectory, name)
    if rules.instant(motion.trajectory.rule, name) and one.knot < motion.trajectory.knots:
        return np.asarray(0.5 * (values[:, one.knot] + values[:, one.knot + 1]))
    return np.asarray(values[:, one.knot])


_MISSES: Mapping[str, Callable[[Motion, Placed], Misses]] = {
    "CoM": _com,
    "base position": _base_position,
    "orientation": _orientation,
    "yaw": _yaw,
    "joints": _joints,
    "frame position": _frame_position,
    "frame orientation": _frame_orientation,
    "linear momentum": _linear_momentum,
    "angular momentum asked": _angular_momentum,
}


def _off(there: Array, position: Mapping[str, float], tolerance: float, label: str) -> Misses:
    """Return by how much each axis that is asked for is off.

    Args:
        there: where something is, (3,).
        position: where it should be, by axis.
        tolerance: what is let go.
        label: what the body of a finding begins with.
    """
    for axis, value in position.items():
        yield f"{label} {axis}", abs(float(there[AXES.index(axis)]) - value) - tolerance


def _by_axis(vector: Array) -> Sequence[tuple[str, float]]:
    return [(axis, float(part)) for axis, part in zip(AXES, vector, strict=True)]


def rotation_vector(target: Array, there: Array) -> Array:
    """Return the rotation vector from one attitude to another, in the first one's axes [rad], (3,)."""
    return np.array(quaternion.log(cs.DM(product(conjugate(target), there)))).ravel()


def _quaternion(rotation: Array) -> Array:
    """Return the quaternion x y z w of a rotation matrix: the greatest column of 4 q qᵀ, which is never small."""
    (a, b, c), (d, e, f), (g, h, i) = rotation
    table = np.array(
        [
            [1 + a - e - i, b + d, c + g, h - f],
            [b + d, 1 - a + e - i, f + h, c - g],
            [c + g, f + h, 1 - a - e + i, d - b],
            [h - f, c - g, d - b, 1 + a + e + i],
        ]
    )
    column = table[:, int(np.diag(table).argmax())]
    return np.asarray(column / np.linalg.norm(column))
