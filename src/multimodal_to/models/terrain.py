"""Surfaces that the robot stands on: distance d, normal n and tangents t of a point p."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import casadi as cs

from multimodal_to.adam.spatial import SX


class Surface(Protocol):
    """What a contact needs to know of the ground; points are (3, 1) in the world [m]."""

    def distance(self, point: SX) -> SX:
        """Return d(p) [m]: positive above the surface, zero on it."""
        ...

    def normal(self, point: SX) -> SX:
        """Return the unit normal n(p), (3, 1), out of the ground."""
        ...

    def tangents(self, point: SX) -> SX:
        """Return two unit tangents t(p) as columns, (3, 2), orthogonal to n(p) and to each other."""
        ...


@dataclass(frozen=True, kw_only=True)
class FlatGround:
    """The plane z = `height`."""

    height: float = 0.0  # [m]

    def distance(self, point: SX) -> SX:
        """Return the height of a point above the plane [m]."""
        return point[2] - self.height

    def normal(self, point: SX) -> SX:
        """Return the vertical, (3, 1)."""
        return cs.DM([0.0, 0.0, 1.0])

    def tangents(self, point: SX) -> SX:
        """Return the world's x and y as columns, (3, 2)."""
        return cs.DM.eye(3)[:, :2]
