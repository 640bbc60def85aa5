"""`Tree`: a robot as bodies and joints, parents first, with named frames. `lean_tree.build_tree` makes it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import casadi as cs
import numpy as np

from multimodal_to.adam.spatial import Array, Inertia
from multimodal_to.arguments import checked
from multimodal_to.errors import InputError, ModelError, unknown
from multimodal_to.values import Value

BASE = 0
"""Index of the base in `Tree.bodies`."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Link(Value):
    """A link of a URDF: mass [kg], CoM [m] and inertia about the CoM [kg m²], both in the link's frame."""

    name: str
    mass: float = 0.0
    com: np.ndarray = field(default_factory=lambda: np.zeros(3))
    inertia: np.ndarray = field(default_factory=lambda: np.zeros((3, 3)))
    remarks: tuple[str, ...] = ()  # what the reader had to make up or mend


@dataclass(frozen=True, kw_only=True)
class Mimic:
    """How a joint follows another: its position is `multiplier` times that of `joint` plus `offset` [rad or m]."""

    joint: str
    multiplier: float = 1.0
    offset: float = 0.0

    def __str__(self) -> str:
        """Return the follower's position as a formula: `-2 leader + 0.1`."""
        factor = {1.0: "", -1.0: "-"}.get(self.multiplier, f"{self.multiplier:g} ")
        added = "" if self.offset == 0 else f" {'-' if self.offset < 0 else '+'} {abs(self.offset):g}"
        return f"{factor}{self.joint}{added}"


@dataclass(frozen=True, kw_only=True, eq=False)
class Joint(Value):
    """A joint of a URDF; the child's frame is at (`rotation`, `translation`) [m] in the parent's when it is at zero."""

    name: str
    kind: str  # "revolute", "continuous", "prismatic" or "fixed"
    parent: str
    child: str
    rotation: np.ndarray = field(default_factory=lambda: np.eye(3))
    translation: np.ndarray = field(default_factory=lambda: np.zeros(3))
    axis: np.ndarray = field(default_factory=lambda: np.array([1.0, 0.0, 0.0]))  # unit, in the child's frame
    lower: float = -np.inf  # [rad or m]
    upper: float = np.inf  # [rad or m]
    effort: float = np.inf  # [N m or N]
    velocity: float = np.inf  # [rad/s or m/s]
    mimic: Mimic | None = None
    remarks: tuple[str, ...] = ()  # what the reader had to make up or mend


@dataclass(frozen=True, kw_only=True, eq=False)
class Body(Value):
    """A moving body: z is its joint's axis, and (`rotation`, `translation`) its frame in the parent's at q = 0.

    Its inertia is the regrouped one, which sums up to the robot's but is not the one of its links.
    """

    name: str
    parent: int  # index into Tree.bodies; −1 for the base
    joint: str | None  # None for the base
    prismatic: bool
    column: int  # of s and of every joint-space quantity; −1 for the base
    multiplier: float  # the joint moves by this times s[column]: 1, or what its mimic joint says
    rotation: cs.DM  # (3, 3)
    translation: cs.DM  # (3, 1) [m]
    offset: float  # added to the joint's angle [rad]
    inertia: Inertia

    def joint_value(self, joints: cs.SX) -> cs.SX:
        """Return what the body's own joint has of s, ṡ or s̈: multiplier · s[column]."""
        return self.multiplier * joints[self.column]


@dataclass(frozen=True, kw_only=True, eq=False)
class Frame(Value):
    """A named frame, fixed in a body."""

    body: int
    rotation: cs.DM  # (3, 3), body-from-frame
    translation: cs.DM  # (3, 1) [m], in the body


@dataclass(frozen=True, kw_only=True, eq=False)
class FixedFrame(Value):
    """A frame that a URDF lacks, fixed in one of its links."""

    link: str
    rotation: np.ndarray = field(default_factory=lambda: np.eye(3))  # link-from-frame, (3, 3)
    translation: np.ndarray = field(default_factory=lambda: np.zeros(3))  # of its origin in the link [m], (3,)


@dataclass(frozen=True, kw_only=True, eq=False)
class Tree(Value):
    """A floating-base robot: body 0 is the base, every other body comes after its parent."""

    base: str
    bodies: tuple[Body, ...]
    frames: Mapping[str, Frame]
    joints: tuple[Joint, ...]  # the moving ones, in the order of s, with limits that their followers keep as well
    followers: Mapping[str, Mimic]  # mimic joints that move, each as it follows one of `joints`
    locked: Mapping[str, float]  # joints held still, with their values [rad or m]
    merged: Mapping[str, str]  # link without a moving joint of its own -> link that carries it
    total_mass: float  # [kg]

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Return the names of the moving joints in the order of s."""
        return tuple(joint.name for joint in self.joints)

    @property
    def coupling(self) -> cs.DM:
        """Return G, (bodies − 1, n): the joints of all bodies but the base move with G ṡ.

        What belongs to those joints one by one is gathered by it: J G of a Jacobian, Gᵀ τ of torques, Gᵀ M G. Without
        mimic joints it only orders them.
        """
        coupling = cs.DM(len(self.bodies) - 1, len(self.joints))
        for row, body in enumerate(self.bodies[1:]):
            coupling[row, body.column] = body.multiplier
        return coupling

    @checked
    def joint_values(self, s: Array) -> dict[str, Array]:
        """Return where every joint of the URDF that can move is: those of s, their followers, and the locked ones.

        Args:
            s: joint positions, (n,), or (n, count) for many [rad or m].
        """
        values = dict(zip(self.joint_names, self._of_joints("s", s), strict=True))
        values |= {name: how.multiplier * values[how.joint] + how.offset for name, how in self.followers.items()}
        return values | {name: np.full(s.shape[1:], value) for name, value in self.locked.items()}

    def _of_joints(self, what: str, values: Array) -> Array:
        if values.ndim == 0 or len(values) != len(self.joint_names):
            raise InputError(f"'{what}' has the shape {values.shape}; expected ({len(self.joint_names)}, ...)")
        return values

    @checked
    def joint_rates(self, s_dot: Array) -> dict[str, Array]:
        """Return how fast every joint of the URDF that can move does, as `joint_values` says where it is.

        Args:
            s_dot: joint velocities, (n,), or (n, count) for many [rad/s or m/s].
        """
        rates = dict(zip(self.joint_names, self._of_joints("s_dot", s_dot), strict=True))
        rates |= {name: how.multiplier * rates[how.joint] for name, how in self.followers.items()}
        return rates | {name: np.zeros(s_dot.shape[1:]) for name in self.locked}

    @checked
    def with_frames(self, frames: Mapping[str, FixedFrame]) -> Tree:
        """Return the tree with more frames.

        Raises:
            ModelError: a frame of that name exists, or the link that it is fixed in does not.
        """
        if not frames:
            return self
        known = dict(self.frames)
        for name, added in frames.items():
            if name in self.frames:
                raise ModelError(f"the frame '{name}' exists already; expected another name")
            link = self.frame(added.link)
            known[name] = Frame(
                body=link.body,
                rotation=link.rotation @ cs.DM(added.rotation),
                translation=link.translation + link.rotation @ cs.DM(added.translation),
            )
        return replace(self, frames=known)

    @checked
    def frame(self, name: str) -> Frame:
        """Return a frame by name.

        Raises:
            ModelError: there is no such frame.
        """
        if name not in self.frames:
            raise ModelError(unknown("frame", name, self.frames))
        return self.frames[name]

    @checked
    def path(self, body: int) -> list[int]:
        """Return the bodies from the base's child down to `body`; empty for the base itself."""
        chain: list[int] = []
        while body != BASE:
            chain.insert(0, body)
            body = self.bodies[body].parent
        return chain
