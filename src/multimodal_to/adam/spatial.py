"""Rotations and rigid-body inertias as functions on CasADi types (SX, MX or DM).

A rotation ``R`` is a (3, 3) matrix that maps components in the child to components in the parent.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as cs
import numpy as np
from numpy.typing import NDArray

from multimodal_to.values import Value

SX = Any
"""A CasADi matrix: SX, MX or DM (CasADi carries no types)."""
Array = NDArray[np.float64]
"""An array of numbers."""


def rotation_about_z(cosine: SX, sine: SX) -> SX:
    """Return Rz(q), (3, 3), from cos q and sin q."""
    return cs.vertcat(cs.horzcat(cosine, -sine, 0), cs.horzcat(sine, cosine, 0), cs.horzcat(0, 0, 1))


def rotation_from_rpy(roll: float, pitch: float, yaw: float) -> np.ndarray:
    """Return R = Rz(yaw) Ry(pitch) Rx(roll), (3, 3), angles in rad: URDF's convention.

    Args:
        roll: about x [rad].
        pitch: about y [rad].
        yaw: about z [rad].
    """
    (cr, cp, cy), (sr, sp, sy) = np.cos([roll, pitch, yaw]), np.sin([roll, pitch, yaw])
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def symmetric(matrix: SX) -> SX:
    """Return the matrix with its lower triangle replaced by the mirrored upper one, so that both share one graph."""
    return cs.triu2symm(cs.triu(matrix))


def homogeneous(rotation: SX, translation: SX) -> SX:
    """Return H = [R p; 0 1], (4, 4)."""
    return cs.vertcat(cs.horzcat(rotation, translation), cs.horzcat(cs.DM(1, 3), 1))


@dataclass(frozen=True, eq=False)
class Inertia(Value):
    """A rigid body's mass [kg], first moment m c [kg m], and inertia about the frame's origin [kg m²], in its frame."""

    mass: Any
    first_moment: Any  # (3, 1)
    about_origin: Any  # (3, 3), symmetric

    @classmethod
    def zero(cls) -> Inertia:
        """Return the inertia of nothing."""
        return cls(0.0, cs.DM.zeros(3, 1), cs.DM.zeros(3, 3))

    def __add__(self, other: Inertia) -> Inertia:
        return Inertia(
            self.mass + other.mass, self.first_moment + other.first_moment, self.about_origin + other.about_origin
        )

    def rotated(self, rotation: SX) -> Inertia:
        """Return the same body in axes rotated by R: m, R h, R I Rᵀ."""
        return Inertia(self.mass, rotation @ self.first_moment, symmetric(rotation @ (self.about_origin @ rotation.T)))

    def rotated_about_z(self, cosine: SX, sine: SX) -> Inertia:
        """Return the same body in axes rotated by Rz(q), with as few operations as there are.

        What is symmetric about z stays as it is: with J = Iyy, only (Ixx − J, Ixy) turn with 2q, (Ixz, Iyz) with q.
        """
        inertia, first = self.about_origin, self.first_moment
        difference, product = inertia[0, 0] - inertia[1, 1], inertia[0, 1]
        half = difference * cosine - 2 * product * sine
        xx = cosine * half
        xy = sine * half + product
        yy = difference - xx
        xz = cosine * inertia[0, 2] - sine * inertia[1, 2]
        yz = sine * inertia[0, 2] + cosine * inertia[1, 2]
        kept = inertia[1, 1]
        return Inertia(
            self.mass,
            cs.vertcat(cosine * first[0] - sine * first[1], sine * first[0] + cosine * first[1], first[2]),
            cs.vertcat(cs.horzcat(kept + xx, xy, xz), cs.horzcat(xy, kept + yy, yz), cs.horzcat(xz, yz, inertia[2, 2])),
        )

    def shifted(self, offset: SX) -> Inertia:
        """Return the same body about a new origin from which the old one is seen at `offset` (parallel axes).

        I' = I + (2 p·h + m p·p) 1 − p hᵀ − h pᵀ − m p pᵀ = I + Σ-form with b = h + m p / 2:
        2 (p·b) 1 − p bᵀ − b pᵀ.
        """
        middle = self.first_moment + 0.5 * self.mass * offset
        products = offset * middle  # (3, 1), p_i b_i: the diagonal of p bᵀ

        def off_diagonal(i: int, j: int) -> SX:
            return self.about_origin[i, j] - (offset[i] * middle[j] + offset[j] * middle[i])

        def diagonal(i: int) -> SX:
            j, k = (i + 1) % 3, (i + 2) % 3
            return self.about_origin[i, i] + 2 * (products[j] + products[k])

        xy, xz, yz = off_diagonal(0, 1), off_diagonal(0, 2), off_diagonal(1, 2)
        return Inertia(
            self.mass,
            self.first_moment + self.mass * offset,
            cs.vertcat(
                cs.horzcat(diagonal(0), xy, xz), cs.horzcat(xy, diagonal(1), yz), cs.horzcat(xz, yz, diagonal(2))
            ),
        )
