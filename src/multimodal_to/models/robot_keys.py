"""What a `robot.toml` holds, table by table: the only list of its keys, with what each number has to be."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from multimodal_to.adam.inspection import EFFORT_PLACEHOLDER, is_placeholder
from multimodal_to.errors import InputError, shown
from multimodal_to.files.keys import Key, keys_of
from multimodal_to.models.jet import ENGINES, Engine
from multimodal_to.models.proportions import SWING

Vector3 = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class JointTable:
    """A joint of `[joints]`."""

    lower: float
    """Least position to plan with, within the URDF's own range [rad or m]."""
    upper: float
    """Greatest position to plan with, within the URDF's own range [rad or m]."""
    speed: float
    """Greatest speed to plan with, either way [rad/s or m/s]."""
    home: float
    """Position in the home posture [rad or m]."""
    effort: float | None = None
    """Greatest torque or force to plan with, either way [N m or N]. Where there is none, it is the URDF's. There, a
    placeholder (10 000 or more, or 0 or less) is no limit."""

    def __post_init__(self) -> None:
        if not self.lower <= self.home <= self.upper:
            raise InputError(f"home {self.home} is not within its range {self.lower} to {self.upper}")
        _positive("speed", self.speed)
        if self.effort is not None and is_placeholder(self.effort):
            raise InputError(f"effort is {self.effort}; expected a number above 0 and below {EFFORT_PLACEHOLDER:g}")


@dataclass(frozen=True, kw_only=True)
class HomeTable:
    """The table `[home]`."""

    base_position: Vector3
    """Origin of the base in the world at home [m]."""
    base_quaternion_xyzw: tuple[float, float, float, float]
    """World-from-base rotation at home as a unit quaternion, x y z w [1]. It says where the robot heads, and what
    upright is for its base."""
    lean_xyzw: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)
    """How the base leans at home: the rotation from upright to home in the base's axes, a unit quaternion x y z w [1].
    A hover is upright. By default home is upright."""

    def __post_init__(self) -> None:
        for key in ("base_quaternion_xyzw", "lean_xyzw"):
            norm = float(np.linalg.norm(getattr(self, key)))
            if abs(norm - 1) > 1e-3:
                raise InputError(f"{key} has the norm {norm:.4f}; expected 1")


@dataclass(frozen=True, kw_only=True)
class ContactTable:
    """The table `[contact]`."""

    friction: float
    """Coefficient of friction between contact points and ground; a scenario may state another [1]."""
    feet: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """The frames that may touch the ground, by foot; their order is that of the contact points."""

    def __post_init__(self) -> None:
        _positive("friction", self.friction)


def _no_contact() -> ContactTable:
    return ContactTable(friction=1.0)  # nothing slides that does not touch


@dataclass(frozen=True, kw_only=True)
class FrameTable:
    """A frame of `[frames]`."""

    link: str
    """The link that it is fixed in."""
    position: Vector3 = (0.0, 0.0, 0.0)
    """Its origin in the frame of `link` [m]."""
    rpy: Vector3 = (0.0, 0.0, 0.0)
    """Its rotation in the frame of `link`, as a URDF writes it: roll, pitch and yaw, R = Rz Ry Rx [rad]."""


@dataclass(frozen=True, kw_only=True)
class ReachTable:
    """The table `[reach]`."""

    contacts: Vector3 | None = None
    """Greatest distance of a contact point from the CoM in a plan, by world axis [m]. Where there is none, it is the
    distance at home and a quarter of L more, and x and y are alike; L is the CoM's height above the contact points at
    home."""
    jets: Vector3 | None = None
    """Greatest distance of a jet's frame from the CoM in a plan, by world axis [m]. Where there is none, it is the
    distance at home and a quarter of L more along every axis."""

    def __post_init__(self) -> None:
        for name, axes in (("contacts", self.contacts), ("jets", self.jets)):
            if axes is not None and min(axes) <= 0:
                raise InputError(f"{name} is {shown(list(axes))}; expected three positive numbers [m]")


@dataclass(frozen=True, kw_only=True)
class GaitTable:
    """The table `[gait]`."""

    lift: float | None = None
    """Height of a swing in a start guess with steps [m]. Where there is none, it is 7 % of L."""
    swing: float = SWING
    """Share of a step's time in which its foot is in the air [1]."""

    def __post_init__(self) -> None:
        if self.lift is not None:
            _positive("lift", self.lift)
        if not 0 < self.swing <= 1:
            raise InputError(f"swing is {self.swing}; expected a number above 0 and at most 1")


@dataclass(frozen=True, kw_only=True)
class JetTable:
    """One of the tables `[[jet]]`."""

    name: str
    """What the jet is called."""
    frame: str
    """The frame that it sits in; its thrust acts at the origin, along `thrust_axis`."""
    model: str
    """Which of `jet_models` it is."""
    thrust_max: float
    """Greatest thrust [N]."""
    throttle: tuple[float, float]
    """Least and greatest throttle [%]."""
    thrust_axis: Vector3 = (0.0, 0.0, -1.0)
    """Direction of the thrust on the robot, in the frame; of any length but zero [1]."""
    drag: float = 0.0
    """Moment of a rotor's drag on the robot for each newton of thrust [m], right-handed about `thrust_axis`: positive
    for a rotor that turns clockwise, seen from where the thrust points to."""
    plume_length: float | None = None
    """How far the exhaust reaches from the frame's origin, against the thrust [m]. A jet has a plume where this or
    `plume_radius` is stated. Where only that one is, the length is L: heat and size of a jet grow with its robot."""
    plume_radius: float | None = None
    """Radius of the exhaust [m]. Where only `plume_length` is stated, it is a tenth of it, as wide as a free round jet
    gets over its length."""

    def __post_init__(self) -> None:
        _positive("thrust_max", self.thrust_max)
        if not any(self.thrust_axis):
            raise InputError("thrust_axis is zero; expected a direction")
        for name, size in (("plume_length", self.plume_length), ("plume_radius", self.plume_radius)):
            if size is not None:
                _positive(name, size)
        if not self.throttle[0] < self.throttle[1]:
            raise InputError(f"throttle is {shown(list(self.throttle))}; expected two numbers that rise")


@dataclass(frozen=True, kw_only=True)
class CapsuleTable:
    """One of the tables `[[capsule]]`."""

    link: str
    """The link or frame that it is fixed in; a link may have several."""
    start: Vector3
    """One end of its segment, in the frame of `link` [m]."""
    end: Vector3 | None = None
    """The other end [m]. Where there is none, the capsule is a sphere."""
    radius: float
    """Radius around the segment [m]."""
    name: str | None = None
    """What the capsule is called; where there is none, as its `link`."""

    def __post_init__(self) -> None:
        _positive("radius", self.radius)


@dataclass(frozen=True, kw_only=True)
class CollisionTable:
    """The table `[collision]`."""

    hold_apart: tuple[tuple[str, str], ...] = ()
    """Pairs of capsules that a problem holds apart, by their names; the plume of a jet is called as the jet, with
    `plume` after it. Where there are none, they are chosen by the home posture and the joints' ranges."""
    ignore: tuple[tuple[str, str], ...] = ()
    """Pairs that may come as near as they like, in a problem and for the audit."""


@dataclass(frozen=True, kw_only=True)
class RobotFile:
    """The whole file."""

    name: str
    """What the robot is called."""
    urdf: str
    """Path of the URDF, from the robot's folder and inside it, where a link may lie; or `package://NAME/PATH`, a file
    of an installed package or of a folder NAME beside or above."""
    home: HomeTable
    """The home posture, together with the joints' own; postures are searched near it."""
    joints: Mapping[str, JointTable] = field(default_factory=dict)
    """The joints that move, by their names in the URDF, in the order of s. Mimic joints follow; all others stay at
    zero."""
    joint_groups: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """Names for sets of joints, which weights of a scenario refer to."""
    frames: Mapping[str, FrameTable] = field(default_factory=dict)
    """Frames that the URDF lacks, such as contact points, by name. Every link of the URDF is a frame already."""
    contact: ContactTable = field(default_factory=_no_contact)
    """What touches the ground."""
    reach: ReachTable = field(default_factory=ReachTable)
    """How far from the CoM contact points and jets may be in a plan."""
    gait: GaitTable = field(default_factory=GaitTable)
    """How feet go in a start guess with steps."""
    jet: tuple[JetTable, ...] = ()
    """The jets, in their order."""
    jet_models: Mapping[str, Engine] = field(default_factory=dict)
    """How thrust follows the throttle for sorts of jets, by name."""
    capsule: tuple[CapsuleTable, ...] = ()
    """Shapes of links, which keep away from each other; without any, links may go through each other."""
    collision: CollisionTable = field(default_factory=CollisionTable)
    """Which capsules keep away from each other."""


UNIONS = {Engine: ENGINES}
"""What may stand for a type, by its `kind`."""


def robot_keys() -> tuple[Key, ...]:
    """Return every key that a `robot.toml` may have."""
    return keys_of(RobotFile, UNIONS)


def _positive(name: str, number: float) -> None:
    if number <= 0:
        raise InputError(f"{name} is {number}; expected a positive number")
