"""`Tree`: a robot as bodies and joints, parents first, with named frames. `lean_tree.build_tree` makes it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import casadi as cs
import numpy as np

from multimodal_to.adam.spatial import Inertia
from multimodal_to.errors import ModelError, unknown
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
    """A joint that follows another: its position is `multiplier` times the other's plus `offset` [rad or m]."""

    joint: str
    multiplier: float = 1.0
    offset: float = 0.0


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
    rotation: cs.DM  # (3, 3)
    translation: cs.DM  # (3, 1) [m]
    offset: float  # added to the joint's angle [rad]
    inertia: Inertia


@dataclass(frozen=True, kw_only=True, eq=False)
class Frame(Value):
    """A named frame, fixed in a body."""

    body: int
    rotation: cs.DM  # (3, 3), body-from-frame
    translation: cs.DM  # (3, 1) [m], in the body


@dataclass(frozen=True, kw_only=True, eq=False)
class Tree(Value):
    """A floating-base robot: body 0 is the base, every other body comes after its parent."""

    base: str
    bodies: tuple[Body, ...]
    frames: Mapping[str, Frame]
    joints: tuple[Joint, ...]  # the moving ones, in the order of s
    locked: Mapping[str, float]  # joints held still, with their values [rad or m]
    merged: Mapping[str, str]  # link without a moving joint of its own -> link that carries it
    total_mass: float  # [kg]

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Return the names of the moving joints in the order of s."""
        return tuple(joint.name for joint in self.joints)

    def frame(self, name: str) -> Frame:
        """Return a frame by name.

        Raises:
            ModelError: there is no such frame.
        """
        if name not in self.frames:
            raise ModelError(unknown("frame", name, self.frames))
        return self.frames[name]

    def path(self, body: int) -> list[int]:
        """Return the bodies from the base's child down to `body`; empty for the base itself."""
        chain: list[int] = []
        while body != BASE:
            chain.insert(0, body)
            body = self.bodies[body].parent
        return chain
