"""The three ways to write a frame's velocity as six numbers, and how each turns into the mixed one.

Linear part first, for a frame at R, p in the world that moves with (ṗ, ω), both in world axes:

* mixed: (ṗ, ω), the velocity of the frame's origin in the world's axes;
* body-fixed: (Rᵀ ṗ, Rᵀ ω), the same in the frame's own axes;
* inertial-fixed: (ṗ − ω × p, ω), the velocity of what passes the world's origin, in the world's axes.

Pinocchio calls them LOCAL_WORLD_ALIGNED, LOCAL and WORLD. With (ṗ, ω) = X v, forces f dual to v are f = Xᵀ f_mixed,
and accelerations obey (p̈, ω̇) = X v̇ + Ẋ v, where v̇ is the derivative of the six numbers.

Source: S. Traversaro, A. Saccon, "Multibody dynamics notation", TU Eindhoven, 2019.
"""

from __future__ import annotations

from enum import Enum, IntEnum

import casadi as cs

from multimodal_to.adam.kinematics import Pose
from multimodal_to.adam.spatial import SX
from multimodal_to.errors import InputError


class Representations(IntEnum):
    """How velocities are written; names and values are those of adam."""

    BODY_FIXED_REPRESENTATION = 1
    MIXED_REPRESENTATION = 2
    INERTIAL_FIXED_REPRESENTATION = 3


def checked_representation(representation: int) -> Representations:
    """Return our member for `representation`: a member of ours or of adam's, or its value.

    Raises:
        InputError: there is no such value, or it belongs to a member of some enumeration that has another name.
    """
    names = Representations.__members__
    known = representation in tuple(Representations)
    if not known or (isinstance(representation, Enum) and representation.name not in names):
        raise InputError(f"unknown representation {representation!r}; available: {', '.join(names)}")
    return Representations(representation)


def to_mixed(representation: Representations, pose: Pose) -> SX:
    """Return X, (6, 6): (ṗ, ω) = X v of a frame at `pose`."""
    if representation is Representations.BODY_FIXED_REPRESENTATION:
        return cs.diagcat(pose.rotation, pose.rotation)
    if representation is Representations.INERTIAL_FIXED_REPRESENTATION:
        return _shear(-pose.translation)
    return cs.SX.eye(6)


def from_mixed(representation: Representations, pose: Pose) -> SX:
    """Return X⁻¹, (6, 6): v = X⁻¹ (ṗ, ω) of a frame at `pose`."""
    if representation is Representations.BODY_FIXED_REPRESENTATION:
        return cs.diagcat(pose.rotation.T, pose.rotation.T)
    if representation is Representations.INERTIAL_FIXED_REPRESENTATION:
        return _shear(pose.translation)
    return cs.SX.eye(6)


def to_mixed_rate(representation: Representations, pose: Pose, twist: SX) -> SX:
    """Return Ẋ, (6, 6), of a frame at `pose` that moves with `twist` = (ṗ, ω).

    Args:
        representation: how the frame's velocity is written.
        pose: of the frame in the world.
        twist: (ṗ, ω) of the frame in world axes, (6, 1) [m/s, rad/s].
    """
    if representation is Representations.BODY_FIXED_REPRESENTATION:
        turning = cs.skew(twist[3:]) @ pose.rotation
        return cs.diagcat(turning, turning)
    if representation is Representations.INERTIAL_FIXED_REPRESENTATION:
        return _shear(-twist[:3]) - cs.SX.eye(6)
    return cs.SX(6, 6)


def _shear(arm: SX) -> SX:
    """Return [1 S(a); 0 1], (6, 6)."""
    return cs.vertcat(cs.horzcat(cs.SX.eye(3), cs.skew(arm)), cs.horzcat(cs.SX(3, 3), cs.SX.eye(3)))
