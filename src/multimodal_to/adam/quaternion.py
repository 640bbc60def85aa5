"""Unit quaternions, scalar last (x y z w): product, rotation matrix, exponential and logarithm.

Source: J. Solà, J. Deray, D. Atchuthan, "A micro Lie theory for state estimation in robotics", 2018, in x y z w order.
"""

from __future__ import annotations

import casadi as cs

from multimodal_to.adam.spatial import SX

_SMALL = 1e-8
"""Below this squared angle [rad²] the series of sin(x)/x and its kin are exact to 1e-16."""


def product(left: SX, right: SX) -> SX:
    """Return left ∘ right, (4, 1): first the rotation `right`, then `left`."""
    return cs.vertcat(
        left[3] * right[:3] + right[3] * left[:3] + cs.cross(left[:3], right[:3]),
        left[3] * right[3] - cs.dot(left[:3], right[:3]),
    )


def conjugate(quaternion: SX) -> SX:
    """Return the inverse of a unit quaternion, (4, 1)."""
    return cs.vertcat(-quaternion[:3], quaternion[3])


def rotation_matrix(quaternion: SX) -> SX:
    """Return R(ρ) = 1 + 2 w S(v) + 2 S(v)², (3, 3), of a unit quaternion ρ = (v, w)."""
    x, y, z, w = cs.vertsplit(quaternion)
    x2, y2, z2 = 2 * x, 2 * y, 2 * z
    xx, yy, zz = x * x2, y * y2, z * z2
    xy, xz, yz = x * y2, x * z2, y * z2
    wx, wy, wz = w * x2, w * y2, w * z2
    return cs.vertcat(
        cs.horzcat(1 - yy - zz, xy - wz, xz + wy),
        cs.horzcat(xy + wz, 1 - xx - zz, yz - wx),
        cs.horzcat(xz - wy, yz + wx, 1 - xx - yy),
    )


def exp(rotation_vector: SX) -> SX:
    """Return Exp(φ) = (φ/|φ| sin(|φ|/2), cos(|φ|/2)), (4, 1), smooth through φ = 0; φ in rad, (3, 1)."""
    half_squared = cs.sumsqr(rotation_vector) / 4
    small = half_squared < _SMALL
    safe = cs.sqrt(cs.if_else(small, 1, half_squared))
    sinc = cs.if_else(small, 1 - half_squared / 6, cs.sin(safe) / safe)
    cosine = cs.if_else(small, 1 - half_squared / 2 + half_squared**2 / 24, cs.cos(safe))
    return cs.vertcat(sinc / 2 * rotation_vector, cosine)


def log(quaternion: SX) -> SX:
    """Return the rotation vector φ [rad], (3, 1), |φ| ≤ π, with Exp(φ) = ±ρ, smooth through the identity."""
    vector, scalar = quaternion[:3], quaternion[3]
    sign = cs.if_else(scalar < 0, -1, 1)
    squared = cs.sumsqr(vector)
    small = squared < _SMALL
    norm = cs.sqrt(cs.if_else(small, 1, squared))
    cosine = sign * scalar
    ratio = cs.if_else(small, 2 / cosine * (1 - squared / (3 * cosine**2)), 2 * cs.atan2(norm, cosine) / norm)
    return sign * ratio * vector
