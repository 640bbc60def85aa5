"""Attitudes as unit quaternions x y z w: one rule for their sign, and how far one is tilted from another.

ρ and −ρ are the same rotation, and files of others hold either. Here the first one of a motion has w ≥ 0, and each that
follows has the sign with which it is the nearer one to that before it.
"""

from __future__ import annotations

import numpy as np

from multimodal_to.adam.spatial import Array

_ZERO = 1e-12
"""A part smaller than this says nothing of a sign, and of an axis that it is not along it [1]."""


def signed(quaternion: Array) -> Array:
    """Return ρ or −ρ, (4,): w is positive or, where it is zero, the last of x, y and z that is not.

    Args:
        quaternion: x y z w of any length, (4,).
    """
    telling = np.flatnonzero(np.abs(quaternion) > _ZERO)
    return np.asarray(-quaternion if telling.size and quaternion[telling[-1]] < 0.0 else quaternion)


def signed_like(quaternion: Array, other: Array) -> Array:
    """Return ρ or −ρ, (4,), whichever is the nearer one to another.

    Args:
        quaternion: x y z w, (4,).
        other: x y z w, (4,).
    """
    return np.asarray(-quaternion if quaternion @ other < 0.0 else quaternion)


def continuous(quaternions: Array) -> Array:
    """Return the quaternions of a motion without jumps of sign, (4, count); the first is `signed`.

    Args:
        quaternions: x y z w of any length, (4, count).
    """
    if not quaternions.shape[1]:
        return quaternions
    turned = (quaternions[:, 1:] * quaternions[:, :-1]).sum(axis=0) < 0.0
    first = -1.0 if (signed(quaternions[:, 0]) != quaternions[:, 0]).any() else 1.0
    signs = first * np.cumprod(np.append(1.0, np.where(turned, -1.0, 1.0)))
    return quaternions if (signs > 0.0).all() else np.asarray(quaternions * signs)


def product(first: Array, second: Array) -> Array:
    """Return ρ₁ ∘ ρ₂, (4,): the second rotation, then the first."""
    v, w = first[:3], first[3]
    u, s = second[:3], second[3]
    return np.append(w * u + s * v + np.cross(v, u), w * s - v @ u)


def conjugate(quaternion: Array) -> Array:
    """Return the inverse of a unit quaternion, (4,)."""
    return np.append(-quaternion[:3], quaternion[3])


def tidied(values: Array) -> Array:
    """Return values with those next to 0, 1 and −1 put there: what a product leaves of them is rounding."""
    nearest = np.round(values)
    return np.asarray(np.where(np.abs(values - nearest) < _ZERO, nearest, values) + 0.0)


def tilt(rotation: Array, other: Array, up: Array) -> float:
    """Return the angle between the vertical in one base's axes and in another's [rad]: turns about it do not count.

    Args:
        rotation: world-from-base, (3, 3).
        other: world-from-base, (3, 3).
        up: unit vector along the vertical in world axes, (3,).
    """
    one, two = rotation.T @ up, other.T @ up
    return float(np.arctan2(np.linalg.norm(np.cross(one, two)), one @ two))


def axes_about(up: Array) -> Array:
    """Return three unit axes in rows, (3, 3), right-handed: the last is `up`, the first the own axis most across it.

    Args:
        up: unit vector along the vertical in a base's axes, (3,).
    """
    third = tidied(up)
    across = np.eye(3)[int(np.abs(third).argmin())]
    first = across - (across @ third) * third
    first /= np.linalg.norm(first)
    return tidied(np.array([first, np.cross(third, first), third]))
