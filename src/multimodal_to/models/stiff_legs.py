"""Legs with fewer joints than their feet on the ground take: with several of them the ground holds the robot twice."""

from __future__ import annotations

import casadi as cs
import numpy as np
from numpy.typing import NDArray

from multimodal_to.models.robot import Robot
from multimodal_to.models.units import Sized

CREEP = Sized(1e-5, "m")
"""How far a point on a stiff leg may move along the ground in an interval in which it is given to stand.

Rows that hold a robot twice have no derivative of full rank, and their multipliers grow without bound. Solo's eight
joints, which cannot move a foot sideways, stepped in more than 1000 iterations, and with this in 47.
"""
_LINE = 1e-3
"""Points nearer to a line than this share of their spread are on it [1]."""


def on_stiff_legs(robot: Robot) -> NDArray[np.bool_]:
    """Return which contact points are on a leg with fewer joints than a foot that stands takes of them, (contacts,).

    A point takes three, points on a line five, and a sole six. Points of the base are on no leg.
    """
    tree = robot.kindyn.tree
    frames = [tree.frame(name) for name in robot.contact_names]
    stiff = np.zeros(len(frames), dtype=bool)
    for body in {frame.body for frame in frames}:
        members = [index for index, frame in enumerate(frames) if frame.body == body]
        joints = len(tree.path(body))
        places = np.array([np.array(cs.DM(frames[index].translation)).ravel() for index in members])
        stiff[members] = 0 < joints < _taken(places)
    return stiff


def _taken(places: NDArray[np.float64]) -> int:
    """Return how many degrees of freedom points of a body take that keep their places, (points, 3)."""
    spread = np.linalg.svd(places - places.mean(axis=0), compute_uv=False)
    return 3 + sum((2, 1)[index] for index in range(min(2, len(spread))) if spread[index] > _LINE * spread[0] > 0)
