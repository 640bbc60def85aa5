"""`Keyframe`: what is asked of a motion at one instant. A scenario is a list of them beside its numbers."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace

import numpy as np

from multimodal_to.adam.spatial import Array
from multimodal_to.arguments import check_fields, checked, refuse_negative
from multimodal_to.errors import InputError, ScenarioError, shown, unknown
from multimodal_to.models import attitude
from multimodal_to.models.robot import Robot
from multimodal_to.trajectory.instants import START, Instant, check_instant, knot_at
from multimodal_to.values import FrozenMapping

Vector3 = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]
AXES = "xyz"
HOME = "home"
"""What stands for the CoM of home: `Robot.home_com`, on the ground below the world's origin."""
_ROUNDING = 1e-9
"""Limits that cross by less do not contradict each other, in their units."""
_ANGLE = 1e-6
"""Attitudes that are less apart are the same [rad]."""


@dataclass(frozen=True, kw_only=True)
class FrameTarget:
    """Where a frame is, a hand, a foot or a tool.

    Raises:
        InputError: a number makes no sense, or nothing is asked.
    """

    position: Vector3 | Mapping[str, float] | None = None
    """Where its origin is in the world [m]: three numbers, or some axes, as `{z = 0.9}`."""
    position_tolerance: float = 0.0
    """How far the origin may be off along each axis [m]."""
    orientation: Quaternion | None = None
    """Rotation from its axes to the world's, a quaternion x y z w of either sign [1]."""
    orientation_tolerance: float = 0.0
    """How far it may be turned from there [rad]."""

    def __post_init__(self) -> None:
        check_fields(self)
        _keep_axes(self, "position")
        _keep_quaternion(self, "orientation")
        for name in ("position_tolerance", "orientation_tolerance"):
            refuse_negative(name, getattr(self, name))
        if self.position is None and self.orientation is None:
            raise InputError("nothing is asked of the frame; expected 'position' or 'orientation'")


@dataclass(frozen=True, kw_only=True)
class Momentum:
    """Momentum of the whole robot at a knot.

    Raises:
        InputError: a number makes no sense, or nothing is asked.
    """

    linear: Vector3 | Mapping[str, float] | None = None
    """m ẋ in the world's axes [kg m/s]: three numbers, or some axes."""
    angular: Vector3 | Mapping[str, float] | None = None
    """hω about the CoM, in the world's axes [kg m²/s]: three numbers, or some axes."""

    def __post_init__(self) -> None:
        check_fields(self)
        _keep_axes(self, "linear")
        _keep_axes(self, "angular")
        if self.linear is None and self.angular is None:
            raise InputError("the momentum asks for nothing; expected 'linear' or 'angular'")


@dataclass(frozen=True, kw_only=True)
class Keyframe:
    """What is asked of a motion at one knot: each value as a constraint or, with a weight, as a cost.

    Raises:
        InputError: a number makes no sense, parts contradict each other, or nothing is asked.
    """

    when: Instant | None = None
    """Share of the horizon from 0 to 1, "start" or "end" [1]; the nearest knot is taken."""
    knot: int | None = None
    """Which knot, from 0 to the number of intervals, instead of `when` [1]."""
    com: Vector3 | Mapping[str, float] | str | None = None
    """Where the CoM is in the world [m]: three numbers, some axes as `{z = 0.75}`, or "home"."""
    com_shift: Vector3 | None = None
    """Where the CoM is from the one of home, which stands on the ground [m]."""
    com_min: Mapping[str, float] = field(default_factory=dict)
    """Least coordinates of the CoM by axis [m]."""
    com_max: Mapping[str, float] = field(default_factory=dict)
    """Greatest coordinates of the CoM by axis [m]."""
    base_position: Vector3 | Mapping[str, float] | None = None
    """Where the base's origin is in the world [m]: three numbers, or some axes."""
    base_orientation: Quaternion | None = None
    """Rotation from the base's axes to the world's, a quaternion x y z w of either sign [1]."""
    yaw: float | None = None
    """Turn of the base about the vertical from home's heading, to the left, from −π to π [rad]."""
    orientation_tolerance: float = 0.0
    """How far the base may be turned from `base_orientation`, or about the vertical from `yaw` [rad]."""
    joints: Mapping[str, float] = field(default_factory=dict)
    """Positions of joints by name [rad or m]."""
    joint_tolerance: float = 0.0
    """How far each of these joints may be off [rad or m]."""
    frames: Mapping[str, FrameTarget] = field(default_factory=dict)
    """Where frames of the URDF are, by name: hands, feet, tools."""
    momentum: Momentum | None = None
    """Momentum of the whole robot."""
    rest: bool = False
    """Nothing moves: base and joints have no velocity over the interval that ends at the knot."""
    hover: bool = False
    """At rest in the air: upright, no contact force, the thrusts carry the weight and hold still."""
    standing: bool = False
    """At rest with every contact point on the ground."""
    weight: float | None = None
    """Weight of the squared misses, each in its own unit [1/unit²]; without, they are held to zero."""

    def __post_init__(self) -> None:
        check_fields(self)
        self._check_when()
        self._check_com()
        _keep_axes(self, "base_position")
        _keep_quaternion(self, "base_orientation")
        for name in ("com_min", "com_max", "joints"):
            object.__setattr__(self, name, FrozenMapping({key: float(one) for key, one in getattr(self, name).items()}))
            _refuse_not_finite(name, *getattr(self, name).values())
        object.__setattr__(self, "frames", FrozenMapping(self.frames))
        for name in ("com_min", "com_max"):
            _refuse_other_axes(name, getattr(self, name))
        if self.yaw is not None and not -math.pi <= self.yaw <= math.pi:
            raise InputError(f"yaw is {self.yaw} rad; expected a number from −π to π")
        for name in ("orientation_tolerance", "joint_tolerance"):
            refuse_negative(name, getattr(self, name))
        self._check_together()

    # ---------------------------------------------------------------- what is asked

    @checked
    def at(self, knots: int) -> int:
        """Return the knot of a horizon of so many intervals."""
        if self.knot is not None:
            return self.knot
        return knot_at(START if self.when is None else self.when, knots)

    @property
    def of_home(self) -> bool:
        """Return whether the CoM is said from home's."""
        return self.com == HOME or self.com_shift is not None

    @property
    def still(self) -> bool:
        """Return whether nothing moves there."""
        return self.rest or self.hover or self.standing

    @checked
    def from_home(self, home: Vector3) -> Keyframe:
        """Return the keyframe with numbers for a CoM that is said from home's [m]."""
        if not self.of_home:
            return self
        x, y, z = (a + b for a, b in zip(home, self.com_shift or (0.0, 0.0, 0.0), strict=True))
        return replace(self, com=(x, y, z), com_shift=None)

    @checked
    def check_names(self, robot: Robot, label: str) -> None:
        """Make sure that the robot has every joint and frame that is named.

        Args:
            robot: whose motion it is.
            label: what the keyframe is called.

        Raises:
            ScenarioError: it lacks one.
        """
        for name in self.joints:
            if name not in robot.joint_names:
                raise ScenarioError(f"{label}: {unknown('joint', name, robot.joint_names)}")
        known = robot.kindyn.tree.frames
        for name in self.frames:
            if name not in known:
                raise ScenarioError(f"{label}: {unknown('frame', name, known)}")

    def limits(self) -> Iterator[tuple[str, float, float]]:
        """Return each number that is asked for as what it is of, its least and its greatest value."""
        position = {} if isinstance(self.com, str) else by_axis(self.com)
        yield from ((f"CoM {axis} [m]", value, value) for axis, value in position.items())
        yield from ((f"CoM {axis} [m]", value, math.inf) for axis, value in self.com_min.items())
        yield from ((f"CoM {axis} [m]", -math.inf, value) for axis, value in self.com_max.items())
        for axis, value in by_axis(self.base_position).items():
            yield f"base position {axis} [m]", value, value
        if self.yaw is not None:
            yield "yaw [rad]", self.yaw - self.orientation_tolerance, self.yaw + self.orientation_tolerance
        for name, value in self.joints.items():
            yield f"joint {name} [rad or m]", value - self.joint_tolerance, value + self.joint_tolerance
        for name, target in self.frames.items():
            off = target.position_tolerance
            for axis, value in by_axis(target.position).items():
                yield f"frame {name} {axis} [m]", value - off, value + off
        momentum = self.momentum or Momentum(linear={}, angular={})
        for kind, unit in (("linear", "kg m/s"), ("angular", "kg m²/s")):
            asked = {axis: 0.0 for axis in AXES} if self.still else {}
            for some in (asked, by_axis(getattr(momentum, kind))):
                for axis, value in some.items():
                    yield f"{kind} momentum {axis} [{unit}]", value, value

    # ---------------------------------------------------------------- checks

    def _check_when(self) -> None:
        if (self.when is None) == (self.knot is None):
            raise InputError("a keyframe has 'when' or 'knot'; expected one of them")
        if self.knot is not None and self.knot < 0:
            raise InputError(f"knot is {self.knot}; expected a number of at least zero")
        if self.when is not None:
            check_instant(self.when, "when", InputError)

    def _check_com(self) -> None:
        if isinstance(self.com, str):
            if self.com != HOME:
                raise InputError(f"com is {shown(self.com)}; expected three numbers, some axes, or '{HOME}'")
        else:
            _keep_axes(self, "com")
        if self.com_shift is not None:
            _keep_axes(self, "com_shift")
            if self.com not in (None, HOME):
                raise InputError(f"com_shift is from home's CoM, and com is {shown(self.com)}; expected one of them")

    def _check_together(self) -> None:
        if self.hover and self.standing:
            raise InputError("hover and standing are both asked for; expected one of them")
        if self.base_orientation is not None and self.yaw is not None:
            raise InputError("base_orientation and yaw are both asked for; expected one of them")
        if self.orientation_tolerance and self.base_orientation is None and self.yaw is None:
            raise InputError("orientation_tolerance is of nothing; expected base_orientation or yaw beside it")
        if self.orientation_tolerance and self.hover:
            raise InputError("a hover is held upright; expected no orientation_tolerance beside it")
        if self.weight is not None:
            self._check_cost(self.weight)
        if not asked_of(self):
            raise InputError("the keyframe asks for nothing; expected at least one of com, yaw, joints, frames, rest …")

    def _check_cost(self, weight: float) -> None:
        if not 0.0 < weight < math.inf:
            raise InputError(f"weight is {weight}; expected a positive number")
        for name in _ONLY_HELD:
            if getattr(self, name):
                raise InputError(f"{name} is no cost; expected it in a keyframe without a weight")
        for name, target in self.frames.items():
            if target.position_tolerance or target.orientation_tolerance:
                raise InputError(f"a tolerance of frame '{name}' is no cost; expected it without a weight")


_ABOUT = ("when", "knot", "weight", "orientation_tolerance", "joint_tolerance")
_ONLY_HELD = ("com_min", "com_max", "rest", "hover", "standing", "orientation_tolerance", "joint_tolerance")
"""What cannot be a cost."""


@dataclass(frozen=True, kw_only=True)
class Placed:
    """A keyframe of a scenario, at its knot."""

    label: str
    """What reports call it: "start", "middle", "end", or "keyframe 2"."""
    knot: int
    keyframe: Keyframe


def contradiction(placed: Sequence[Placed]) -> str:
    """Return in one sentence which two keyframes at a knot cannot hold together; nothing where all can."""
    known = dict[tuple[int, str], tuple[float, float, str]]()
    for one in placed:
        if one.keyframe.weight is not None:
            continue
        for what, lower, upper in one.keyframe.limits():
            low, high, label = known.get((one.knot, what), (-math.inf, math.inf, ""))
            if max(low, lower) > min(high, upper) + _ROUNDING:
                both = f"{label} and {one.label}" if label and label != one.label else one.label
                return f"{both}: {what} at knot {one.knot} has to be {_said(low, high)} and {_said(lower, upper)}"
            known[one.knot, what] = max(low, lower), min(high, upper), label or one.label
    return _turned_twice(placed)


def _turned_twice(placed: Sequence[Placed]) -> str:
    """Return in one sentence which two keyframes at a knot ask for attitudes that are too far apart."""
    known = dict[tuple[int, str], tuple[Array, float, str]]()
    yaws = {one.knot: one.label for one in placed if one.keyframe.weight is None and one.keyframe.yaw is not None}
    for one in placed:
        keyframe = one.keyframe
        if keyframe.weight is not None:
            continue
        asked = {
            f"frame {name}": (some.orientation, some.orientation_tolerance) for name, some in keyframe.frames.items()
        }
        asked["base"] = keyframe.base_orientation, keyframe.orientation_tolerance
        if keyframe.base_orientation is not None and one.knot in yaws:
            return f"{yaws[one.knot]} asks for a yaw at knot {one.knot} and {one.label} for a base_orientation"
        for what, (orientation, tolerance) in asked.items():
            if orientation is None:
                continue
            value = np.array(orientation)
            before, slack, label = known.setdefault((one.knot, what), (value, tolerance, one.label))
            angle = 2.0 * math.acos(min(abs(float(before @ value)), 1.0))
            if angle > math.sqrt(3.0) * (slack + tolerance) + _ANGLE:
                return f"{label} and {one.label}: {what} at knot {one.knot} has two orientations, {angle:.3g} rad apart"
    return ""


def _said(lower: float, upper: float) -> str:
    if lower == upper:
        return f"{lower:g}"
    if upper == math.inf:
        return f"at least {lower:g}"
    return f"at most {upper:g}" if lower == -math.inf else f"{lower:g} to {upper:g}"


def attitude_at(robot: Robot, placed: Sequence[Placed], knot: int) -> Array:
    """Return the attitude of the base in a hover at a knot, a quaternion x y z w, (4,).

    It is the `base_orientation` that a keyframe asks for there; else upright, turned by the `yaw` of one, if any.

    Args:
        robot: whose upright and heading are meant.
        placed: the keyframes of the scenario.
        knot: of the horizon.
    """
    upright: Array = robot.upright.base_quaternion_xyzw
    for one in placed:
        if one.knot != knot or one.keyframe.weight is not None:
            continue
        if one.keyframe.base_orientation is not None:
            return attitude.signed_like(np.array(one.keyframe.base_orientation), upright)
        if one.keyframe.yaw is not None:
            half = 0.5 * one.keyframe.yaw
            return attitude.product(np.append(math.sin(half) * robot.up, math.cos(half)), upright)
    return upright


def by_axis(value: Vector3 | Mapping[str, float] | None) -> Mapping[str, float]:
    """Return a position by axis: of three numbers all, of none no axis.

    >>> dict(by_axis((1.0, 2.0, 3.0))), dict(by_axis({"z": 0.75}))
    ({'x': 1.0, 'y': 2.0, 'z': 3.0}, {'z': 0.75})
    """
    if value is None:
        return {}
    return value if isinstance(value, Mapping) else dict(zip(AXES, value, strict=True))


def _keep_axes(record: object, name: str) -> None:
    """Keep a position as a tuple of floats, or as a mapping from axes to floats.

    Raises:
        InputError: it is neither.
    """
    value = getattr(record, name)
    if value is None:
        return
    if isinstance(value, Mapping):
        _refuse_other_axes(name, value)
        kept: object = FrozenMapping({axis: float(value[axis]) for axis in AXES if axis in value})
        _refuse_not_finite(name, *value.values())
    else:
        if len(value) != 3:
            raise InputError(f"{name} is {shown(value)}; expected three numbers")
        _refuse_not_finite(name, *value)
        kept = tuple(float(one) for one in value)
    object.__setattr__(record, name, kept)


def _keep_quaternion(record: object, name: str) -> None:
    """Keep an orientation as a quaternion of length 1.

    Raises:
        InputError: it is no quaternion.
    """
    value = getattr(record, name)
    if value is None:
        return
    length = math.hypot(*value)
    if len(value) != 4 or not 0.0 < length < math.inf:
        raise InputError(f"{name} is {shown(value)}; expected a quaternion x y z w, not all zero")
    length = 1.0 if abs(length - 1.0) < _ROUNDING else length  # so that one that was read stays as it is
    object.__setattr__(record, name, tuple(float(one) / length for one in value))


def _refuse_other_axes(name: str, value: Mapping[str, float]) -> None:
    for axis in value:
        if axis not in ("x", "y", "z"):
            raise InputError(f"{name}: {unknown('axis', axis, AXES)}")


def _refuse_not_finite(name: str, *numbers: float) -> None:
    if not all(math.isfinite(number) for number in numbers):
        raise InputError(f"{name} is {shown(list(numbers))}; expected finite numbers")


def asked_of(keyframe: Keyframe) -> tuple[str, ...]:
    """Return the names of the fields with which a keyframe asks for something."""
    values = {entry.name: getattr(keyframe, entry.name) for entry in fields(keyframe) if entry.name not in _ABOUT}
    return tuple(
        name for name, value in values.items() if value or (isinstance(value, float | int) and value is not False)
    )
