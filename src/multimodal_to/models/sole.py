"""The sole of a foot: where its contact points are in it, and the edges that a centre of pressure stays inside."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as cs
import numpy as np

from multimodal_to.adam.spatial import Array
from multimodal_to.models.robot import Robot
from multimodal_to.values import Value

PRESSURE_SLACK = 0.002
"""Moment about an edge of a sole that a plan may lack, so that a foot without load is inside the set [m g L]."""
_FLAT = 1e-6
"""Points nearer to one line than this share of their spread are no sole [1]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Sole(Value):
    """Contact points of one body that span a plane."""

    foot: str
    members: tuple[int, ...]  # the contact points, in the robot's order
    places: Array  # of each of them in the plane, from the sole's middle [m], (members, 2)
    corners: tuple[int, ...]  # rows of `places` that are corners, counter-clockwise

    def leverage(self, share: float) -> Array:
        """Return how far inside each edge of the shrunk sole each contact point is [m], (edges, members).

        With forces n_i normal to the sole, a centre of pressure is inside where no row of leverage × n is negative.

        Args:
            share: the size of the shrunk sole, as a share of the whole [1].
        """
        rows = []
        for here, there in zip(self.corners, (*self.corners[1:], self.corners[0]), strict=True):
            along = self.places[there] - self.places[here]
            inward = np.array([-along[1], along[0]]) / np.linalg.norm(along)
            rows.append((self.places - share * self.places[here]) @ inward)
        return np.array(rows)

    @property
    def edges(self) -> tuple[tuple[int, int], ...]:
        """Return the contact points at both ends of each edge, in the order of `leverage`."""
        ring = [self.members[corner] for corner in self.corners]
        return tuple(zip(ring, (*ring[1:], ring[0]), strict=True))


def soles(robot: Robot) -> tuple[Sole, ...]:
    """Return the soles of a robot: of each foot with at least three contact points on one body, not on one line.

    The middle of a sole is the mean of its corners.
    """
    return tuple(sole for foot, members in robot.feet.items() if (sole := _sole(robot, foot, members)) is not None)


def _sole(robot: Robot, foot: str, members: tuple[int, ...]) -> Sole | None:
    frames = [robot.kindyn.tree.frame(robot.contacts[index].frame) for index in members]
    if len(members) < 3 or len({frame.body for frame in frames}) > 1:
        return None
    points = np.array([np.array(cs.DM(frame.translation)).ravel() for frame in frames])
    middle = points.mean(axis=0)
    _, spread, axes = np.linalg.svd(points - middle)
    if spread[1] <= _FLAT * spread[0]:
        return None
    places = (points - middle) @ axes[:2].T
    corners = _hull(places)
    places = places - places[list(corners)].mean(axis=0)
    return Sole(foot=foot, members=members, places=places, corners=corners)


def _hull(places: Array) -> tuple[int, ...]:
    """Return the corners of the convex hull of points (count, 2), counter-clockwise: Andrew's monotone chain."""
    order = [int(index) for index in np.lexsort((places[:, 1], places[:, 0]))]

    def chain(indices: list[int]) -> list[int]:
        kept: list[int] = []
        for index in indices:
            while len(kept) > 1 and _turn(places[kept[-2]], places[kept[-1]], places[index]) <= 0.0:
                kept.pop()
            kept.append(index)
        return kept[:-1]

    return (*chain(order), *chain(order[::-1]))


def _turn(first: Array, second: Array, third: Array) -> float:
    """Return twice the area of a triangle in the plane, positive counter-clockwise [m²]."""
    one, other = second - first, third - first
    return float(one[0] * other[1] - one[1] * other[0])
