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
"""Points nearer to a line than this share of its length do not hold a body from turning about it [1]."""
_TAKEN = {1: 3, 2: 5, 3: 6}
"""How many degrees of freedom a body loses to the points that hold it."""


def supports(robot: Robot, members: list[int]) -> list[int]:
    """Return up to three of the contact points of a body that are far from each other and not on one line.

    They hold it: the places of its other contact points follow from theirs, but for the turn about the line of two.
    """
    frames = [robot.kindyn.tree.frame(robot.contact_names[index]) for index in members]
    places = np.array([np.array(cs.DM(frame.translation)).ravel() for frame in frames])
    away = np.linalg.norm(places - places[0], axis=1)
    second = int(away.argmax())
    if not away[second]:
        return members[:1]
    along = (places[second] - places[0]) / away[second]
    off = np.linalg.norm(np.cross(places - places[0], along), axis=1)
    third = int(off.argmax())
    chosen = [0, second, third] if off[third] > _LINE * away[second] else [0, second]
    return [members[index] for index in chosen]


def on_stiff_legs(robot: Robot) -> NDArray[np.bool_]:
    """Return which contact points are on a leg with fewer joints than a foot that stands takes of them, (contacts,).

    A point takes three, points on a line five, and a sole six. Points of the base are on no leg.
    """
    tree = robot.kindyn.tree
    bodies = [tree.frame(name).body for name in robot.contact_names]
    stiff = np.zeros(len(bodies), dtype=bool)
    for body in dict.fromkeys(bodies):
        members = [index for index, other in enumerate(bodies) if other == body]
        stiff[members] = 0 < len(tree.path(body)) < _TAKEN[len(supports(robot, members))]
    return stiff
