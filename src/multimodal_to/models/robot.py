"""`Robot`: a rigid-body tree with contact points and jets."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from pathlib import Path

import casadi as cs
import numpy as np

from multimodal_to.adam import KinDynComputations, quaternion
from multimodal_to.adam.spatial import Array
from multimodal_to.adam.tree import FixedFrame
from multimodal_to.arguments import check_fields, checked, vector
from multimodal_to.errors import ModelError, listed, unknown
from multimodal_to.models import attitude, capsule_pairs, proportions
from multimodal_to.models.capsule import Capsule, CapsulePair
from multimodal_to.models.contact import ContactPoint
from multimodal_to.models.jet import Jet
from multimodal_to.models.proportions import Gait
from multimodal_to.models.units import EARTH, Units
from multimodal_to.values import FrozenMapping, Value

NamePairs = frozenset[frozenset[str]]
"""Pairs of capsules by their names."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Posture(Value):
    """A configuration of the robot: base in the world and joints; of ρ and −ρ it keeps the one of `attitude.signed`.

    Raises:
        InputError: a field is no vector of finite numbers, or one of another size.
    """

    base_position: Array  # (3,) [m]
    base_quaternion_xyzw: Array  # (4,), unit, world-from-base
    joint_positions: Array  # (n,) [rad or m]

    def __post_init__(self) -> None:
        for name, size in (("base_position", 3), ("base_quaternion_xyzw", 4), ("joint_positions", None)):
            object.__setattr__(self, name, vector(f"the posture's {name}", getattr(self, name), size))
        super().__post_init__()
        self.__setstate__({"base_quaternion_xyzw": attitude.signed(self.base_quaternion_xyzw)})

    @property
    def base_transform(self) -> Array:
        """Return w_H_base, (4, 4)."""
        transform = np.eye(4)
        transform[:3, :3] = np.array(quaternion.rotation_matrix(cs.DM(self.base_quaternion_xyzw)))
        transform[:3, 3] = self.base_position
        return transform


@dataclass(frozen=True, kw_only=True, eq=False)
class JointLimits(Value):
    """Ranges to plan in, each (n,) in the order of the joints.

    Raises:
        InputError: one is no vector of numbers.
    """

    lower: Array  # [rad or m]
    upper: Array  # [rad or m]
    speed: Array  # [rad/s or m/s]
    effort: Array  # [N m or N]; inf where none is known

    def __post_init__(self) -> None:
        for entry in fields(self):
            limits = vector(f"the joint limits' {entry.name}", getattr(self, entry.name), None, finite=False)
            object.__setattr__(self, entry.name, limits)
        super().__post_init__()


@dataclass(frozen=True, kw_only=True, eq=False)
class Robot(Value):
    """Everything that depends on the robot and not on the task.

    Raises:
        ModelError: a field is not what it is said to be here.
    """

    name: str
    urdf: Path
    kindyn: KinDynComputations = field(repr=False)
    joint_groups: Mapping[str, tuple[str, ...]]
    joint_limits: JointLimits
    contacts: tuple[ContactPoint, ...]
    friction: float
    jets: tuple[Jet, ...]
    home: Posture
    contact_reach: Array  # greatest distance of a contact point from the CoM in a plan, by world axis [m], (3,)
    jet_reach: Array  # greatest distance of a jet's frame from the CoM in a plan, by world axis [m], (3,)
    gait: Gait
    link_capsules: tuple[Capsule, ...] = ()  # shapes of links; `capsules` has the plumes beside
    ignored_pairs: NamePairs = frozenset()  # of capsules that may come as near as they like
    held_pairs: NamePairs = frozenset()  # of capsules that a problem holds apart; empty: `near_capsule_pairs` chooses
    lean_xyzw: Array = field(default_factory=lambda: np.array([0.0, 0.0, 0.0, 1.0]))
    """Rotation from upright to home in the base's axes, (4,): ρ_home = ρ_upright ∘ lean."""
    added_frames: Mapping[str, FixedFrame] = field(default_factory=lambda: FrozenMapping({}))
    """Frames that the URDF lacks, by name; `kindyn` has them."""

    def __post_init__(self) -> None:
        for name, size in (("contact_reach", 3), ("jet_reach", 3), ("lean_xyzw", 4)):
            object.__setattr__(self, name, vector(f"the robot's {name}", getattr(self, name), size, ModelError))
        check_fields(self, ModelError, "the robot's ")
        if not 0.0 <= self.friction < np.inf:
            raise ModelError(f"the robot's friction is {self.friction}; expected a number of at least zero")
        super().__post_init__()

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Return the joints in the order of s."""
        return self.kindyn.joint_names

    @property
    def contact_names(self) -> tuple[str, ...]:
        """Return the frames of the contact points."""
        return tuple(contact.frame for contact in self.contacts)

    @cached_property
    def feet(self) -> Mapping[str, tuple[int, ...]]:
        """Return the feet by name: which of the contact points each has, in order."""
        names = dict.fromkeys(contact.foot for contact in self.contacts)
        return {
            name: tuple(index for index, contact in enumerate(self.contacts) if contact.foot == name) for name in names
        }

    @property
    def jet_names(self) -> tuple[str, ...]:
        """Return the names of the jets."""
        return tuple(jet.name for jet in self.jets)

    @property
    def mass(self) -> float:
        """Return the total mass [kg]."""
        return self.kindyn.get_total_mass()

    @property
    def gravity(self) -> Array:
        """Return the acceleration of free fall in world axes [m/s²], (3,)."""
        return self.kindyn.gravity

    @property
    def weight(self) -> float:
        """Return m |g| [N]."""
        return self.mass * float(np.linalg.norm(self.gravity))

    @property
    def up(self) -> Array:
        """Return the unit vector against gravity in world axes, (3,); without gravity it is z."""
        strength = float(np.linalg.norm(self.gravity))
        return -self.gravity / strength if strength else np.array([0.0, 0.0, 1.0])

    @property
    def upright(self) -> Posture:
        """Return home without its lean: the attitude of the base in a hover, with home's heading."""
        turned = attitude.product(self.home.base_quaternion_xyzw, attitude.conjugate(self.lean_xyzw))
        return replace(self.home, base_quaternion_xyzw=attitude.tidied(turned))

    @cached_property
    def standing_height(self) -> float:
        """Return L [m], the robot's own unit of length: the height of its CoM above its contact points at home."""
        contacts = offsets_from_com(self.kindyn, self.home, self.contact_names)
        jets = offsets_from_com(self.kindyn, self.home, [jet.frame for jet in self.jets])
        return proportions.standing_height(contacts, jets)

    @checked
    def pose_at_home(self, frame: str) -> Array:
        """Return the pose of a link or frame at home in the world [m], (4, 4)."""
        return np.array(self.kindyn.forward_kinematics(frame, self.home.base_transform, self.home.joint_positions))

    @cached_property
    def units(self) -> Units:
        """Return the robot's own units: m, L and g, and how many contact points share the weight."""
        strength = float(np.linalg.norm(self.gravity))
        return Units(
            mass=self.mass,
            length=self.standing_height,
            gravity=strength or EARTH,
            contact_points=max(len(self.contacts), 1),
        )

    @cached_property
    def home_com(self) -> tuple[float, float, float]:
        """Return the CoM of home above the world's origin, with the lowest contact points at z = 0 [m], (x, y, z).

        Without contact points it is the CoM of home as `robot.toml` places it.
        """
        contacts = offsets_from_com(self.kindyn, self.home, self.contact_names)
        if not len(contacts):
            x, y, z = (float(one) for one in self.com_at(self.home))
            return x, y, z
        return 0.0, 0.0, -float(contacts[:, 2].min())

    @property
    def capsules(self) -> tuple[Capsule, ...]:
        """Return the shapes of links, then the plumes of the jets that are in use."""
        return (*self.link_capsules, *(jet.plume for jet in self.jets if jet.plume is not None))

    @cached_property
    def _apart_at_home(self) -> dict[CapsulePair, float]:
        pairs = capsule_pairs.apart_at_home(
            self.kindyn, self.home.joint_positions, self.capsules, self.standing_height, self.held_pairs
        )
        return {pair: away for pair, away in pairs.items() if frozenset(c.name for c in pair) not in self.ignored_pairs}

    @cached_property
    def capsule_pairs(self) -> tuple[CapsulePair, ...]:
        """Return the pairs of capsules that have to keep apart: `models.capsule_pairs.apart_at_home`."""
        return tuple(self._apart_at_home)

    @cached_property
    def near_capsule_pairs(self) -> tuple[CapsulePair, ...]:
        """Return those of `capsule_pairs` that a problem holds apart.

        They are `held_pairs`. A robot that does not say them has those that are nearer than `models.capsule_pairs.NEAR`
        L at home, and can meet within the ranges of the joints.

        Raises:
            ModelError: two capsules of `held_pairs` are neighbours, or overlap at home, or are ignored.
        """
        if self.held_pairs:
            return self._stated_pairs()
        nearest = capsule_pairs.NEAR * self.standing_height
        pairs = [pair for pair, away in self._apart_at_home.items() if away < nearest]
        return capsule_pairs.within_reach(self.kindyn, self.joint_limits.lower, self.joint_limits.upper, pairs)

    def _stated_pairs(self) -> tuple[CapsulePair, ...]:
        by_names = {frozenset(capsule.name for capsule in pair): pair for pair in self.capsule_pairs}
        present = {capsule.name for capsule in self.capsules}  # not the plumes of jets that are not in use
        for names in self.held_pairs:
            if names <= present and names not in by_names:
                raise ModelError(
                    f"the capsules {listed(sorted(names))} cannot be held apart: they are neighbours in the tree, or "
                    "overlap at home, or are ignored"
                )
        return tuple(pair for names, pair in by_names.items() if names in self.held_pairs)

    @checked
    def with_jets(self, names: Sequence[str]) -> Robot:
        """Return the robot with only the jets of these names, in this order; with none it has none to use.

        Raises:
            ModelError: there is no such jet.
        """
        known = {jet.name: jet for jet in self.jets}
        for name in names:
            if name not in known:
                raise ModelError(unknown("jet", name, known))
        return replace(self, jets=tuple(known[name] for name in names))

    @checked
    def com_at(self, posture: Posture) -> Array:
        """Return where the CoM is in a posture, in the world [m], (3,)."""
        return np.array(self.kindyn.CoM_position(posture.base_transform, posture.joint_positions)).ravel()

    @checked
    def with_gravity(self, gravity: Sequence[float] | Array) -> Robot:
        """Return the robot under another gravity: three numbers in world axes [m/s²].

        Raises:
            InputError: gravity is not three finite numbers.
        """
        return replace(self, kindyn=self.kindyn.with_gravity(gravity))

    @checked
    def group_indices(self, group: str) -> list[int]:
        """Return where the joints of a named group stand in s.

        Raises:
            ModelError: there is no such group.
        """
        if group not in self.joint_groups:
            raise ModelError(unknown("joint group", group, self.joint_groups))
        return [self.joint_names.index(name) for name in self.joint_groups[group]]


def offsets_from_com(kindyn: KinDynComputations, posture: Posture, frames: Sequence[str]) -> Array:
    """Return where frames are from the CoM in a posture, in world axes [m], (frames, 3).

    Args:
        kindyn: kinematics of the robot.
        posture: where it is.
        frames: names of links or frames.
    """
    com = np.array(kindyn.CoM_position(posture.base_transform, posture.joint_positions)).ravel()
    poses = [kindyn.forward_kinematics(frame, posture.base_transform, posture.joint_positions) for frame in frames]
    return np.array([np.array(pose)[:3, 3] - com for pose in poses]).reshape(-1, 3)
