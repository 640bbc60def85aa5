"""A robot's library without its quantities: the robot, how velocities are written, gravity, and the functions made."""

from __future__ import annotations

import copy
import os
from collections.abc import Callable, Hashable, Mapping, Sequence
from typing import Any, Self

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike

from multimodal_to.adam.representation import Representations, checked_representation
from multimodal_to.adam.tree import FixedFrame, Tree
from multimodal_to.adam.urdf import load_tree
from multimodal_to.arguments import checked
from multimodal_to.errors import InputError, ModelError, shown
from multimodal_to.values import content

GRAVITY = (0.0, 0.0, -9.80665)
"""Standard acceleration of free fall in world axes [m/s²]."""


class Library:
    """What the quantities of a robot need; `KinDynComputations` adds the quantities, and describes the arguments."""

    @checked
    def __init__(
        self,
        urdfstring: str | os.PathLike[str],
        joints_name_list: Sequence[str] | None = None,
        root_link: str | None = None,
        gravity: ArrayLike = GRAVITY,
        f_opts: Mapping[str, Any] | None = None,
        *,
        representation: Representations | int = Representations.MIXED_REPRESENTATION,
        locked_joints: Mapping[str, float] | None = None,
    ) -> None:
        self.tree: Tree = load_tree(urdfstring, joints_name_list, locked_joints)
        if root_link not in (None, self.tree.base):
            raise ModelError(f"the root link is '{self.tree.base}', not '{root_link}'")
        self._gravity = _checked_gravity(gravity)
        self._representation = checked_representation(representation)
        self._f_opts = dict(f_opts or {})
        self._made_for = self._representation, *self._gravity
        self._functions: dict[tuple[object, ...], cs.Function] = {}

    def __eq__(self, other: object) -> bool:
        """Return whether the other is a library of the same robot, gravity, representation and `f_opts`."""
        return type(self) is type(other) and self._content() == other._content()

    def __hash__(self) -> int:
        return hash(self.tree)  # which does not change, as gravity may

    def _content(self) -> tuple[Hashable, ...]:
        return content(self.tree), content(self._gravity), self._representation, content(self._f_opts)

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_functions": {}}  # they are made anew where they are asked for

    def __setstate__(self, state: Mapping[str, Any]) -> None:
        self.__dict__.update(state)
        self._gravity = _checked_gravity(self._gravity)

    def __copy__(self) -> Self:
        return copy.deepcopy(self)

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        """Return a library that may change on its own; the tree and the functions, which cannot, are shared."""
        other = memo[id(self)] = object.__new__(type(self))
        other.__dict__.update(self.__dict__, _f_opts=dict(self._f_opts), _functions=dict(self._functions))
        return other

    @classmethod
    def from_urdf(
        cls,
        urdfstring: str | os.PathLike[str],
        joints_name_list: Sequence[str] | None = None,
        root_link: str | None = None,
        gravity: ArrayLike = GRAVITY,
        f_opts: Mapping[str, Any] | None = None,
    ) -> Self:
        """Return the library of a URDF's robot: the constructor under adam's other name, with its arguments."""
        return cls(urdfstring, joints_name_list, root_link, gravity, f_opts)

    # ---------------------------------------------------------------- the robot

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Return the joints in the order of s."""
        return self.tree.joint_names

    @property
    def NDoF(self) -> int:
        """Return the number of joints n (adam's name)."""
        return len(self.tree.joints)

    @property
    def frame_names(self) -> tuple[str, ...]:
        """Return the names of all frames: every link of the URDF, and what `with_frames` added."""
        return tuple(self.tree.frames)

    def get_total_mass(self) -> float:
        """Return the total mass [kg]."""
        return self.tree.total_mass

    # ---------------------------------------------------------------- what may change

    @property
    def representation(self) -> Representations:
        """Return how velocities are written."""
        return self._representation

    def set_frame_velocity_representation(self, representation: Representations | int) -> None:
        """Let every later call be in `representation`, a member of our `Representations` or of adam's (adam's name).

        A function that was made before keeps its representation. A robot of `load_robot` needs the mixed one: change
        the representation of an object of your own.

        Raises:
            InputError: the representation is unknown.
        """
        self._representation = checked_representation(representation)

    @property
    def gravity(self) -> np.ndarray:
        """Return the acceleration of free fall in world axes, (3,) [m/s²]; it cannot be written to."""
        return self._gravity

    def with_gravity(self, gravity: ArrayLike) -> Self:
        """Return the same robot under another gravity; this one keeps its own.

        Args:
            gravity: acceleration of free fall in world axes [m/s²]: three numbers, or six with three zeros behind.

        Raises:
            InputError: gravity is not three finite numbers.
        """
        other = copy.copy(self)
        other._gravity = _checked_gravity(gravity)
        return other

    def with_frames(self, frames: Mapping[str, FixedFrame]) -> Self:
        """Return the same robot with more frames, by name; this one keeps its own.

        Raises:
            ModelError: a frame of that name exists, or the link that it is fixed in does not.
        """
        other = copy.copy(self)
        other.tree = self.tree.with_frames(frames)
        return other

    @property
    def g(self) -> np.ndarray:
        """Return gravity and three zeros, (6,) [m/s²] (adam's name); a new value holds for every later call.

        Raises:
            InputError: the new value is not three finite numbers, with or without three zeros behind.
        """
        return np.concatenate([self._gravity, np.zeros(3)])

    @g.setter
    def g(self, gravity: ArrayLike) -> None:
        self._gravity = _checked_gravity(gravity)

    @property
    def f_opts(self) -> dict[str, Any]:
        """Return a copy of the options of every `casadi.Function` that is built (adam's name)."""
        return dict(self._f_opts)

    # ---------------------------------------------------------------- the functions

    @property
    def _changed(self) -> tuple[float, ...]:
        """Return representation and gravity where they are no longer those of the constructor; else nothing."""
        now = self._representation, *self._gravity
        return () if now == self._made_for else tuple(float(number) for number in now)

    def _kept(self, key: tuple[str, ...], make: Callable[[], cs.Function]) -> cs.Function:
        """Return the function of a key under the present representation and gravity; make it where it is not there."""
        whole = (self.representation, *self.gravity, *key)
        if whole not in self._functions:
            self._functions[whole] = make()
        return self._functions[whole]


def _checked_gravity(gravity: ArrayLike) -> np.ndarray:
    try:
        vector = np.array(gravity, dtype=float).ravel()
    except Exception as error:  # NumPy and CasADi have no type in common for this
        raise InputError(f"gravity is {shown(gravity)}; expected three finite numbers, as {GRAVITY}") from error
    if vector.shape == (6,) and not vector[3:].any():  # adam's form
        vector = vector[:3]
    if vector.shape != (3,) or not np.isfinite(vector).all():
        raise InputError(f"gravity is {shown(gravity)}; expected three finite numbers, for example {GRAVITY}")
    vector.flags.writeable = False
    return vector
