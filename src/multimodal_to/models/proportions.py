"""Proportions of a robot that a plan needs: how far contact points and jets may be from the CoM, and how feet swing.

A `robot.toml` may state them. What it leaves out follows from the robot's home posture, in the robot's own unit of
length L, the height of its CoM above its contact points there. All offsets are from the CoM at home, in world axes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from multimodal_to.adam.spatial import Array
from multimodal_to.arguments import check_fields
from multimodal_to.errors import ModelError

BEYOND_HOME = 0.25
"""How much farther from the CoM than at home contact points and jets may go by default, as a share of L [1]."""
LIFT = 0.07
"""How high a foot swings by default, as a share of L [1]."""
SWING = 0.65
"""Which share of a step's time its foot is in the air by default [1]."""

MOST_EFFORT = 20.0
"""No joint gives more torque than this, whatever a URDF says [m g L]; the strongest legs give less than one."""

PLUME_RADIUS = 0.1
"""Radius of a plume by default, as a share of its length: the half-width of a free round jet grows by about so much."""


@dataclass(frozen=True, kw_only=True)
class Gait:
    """How feet go in the start guess."""

    lift: float  # height of a swing [m]
    swing: float  # share of a step's time in which its foot is in the air [1]

    def __post_init__(self) -> None:
        check_fields(self, ModelError, "the gait's ", finite=True)


def standing_height(contacts: Array, jets: Array) -> float:
    """Return L [m]: the height of the CoM above the mean of the contact points.

    For a robot whose contact points are not below its CoM, or that has none, it is the distance of the farthest of them
    and of the jets. For a robot with nothing away from its CoM, it is 1 m.

    Args:
        contacts: offsets of the contact points [m], (contacts, 3).
        jets: offsets of the frames of the jets [m], (jets, 3).
    """
    below = -float(contacts[:, 2].mean()) if len(contacts) else 0.0
    if below > 0:
        return below
    farthest = float(np.linalg.norm(np.vstack([contacts, jets]), axis=1).max(initial=0.0))
    return farthest if farthest > 0 else 1.0


def contact_reach(contacts: Array, height: float) -> Array:
    """Return the default reach of contact points by world axis [m], (3,): as at home, and `BEYOND_HOME` of L more.

    x and y are alike, since the robot may turn about the vertical.

    Args:
        contacts: offsets of the contact points [m], (contacts, 3).
        height: L [m].
    """
    along = float(np.linalg.norm(contacts[:, :2], axis=1).max(initial=0.0))
    down = float(np.abs(contacts[:, 2]).max(initial=0.0))
    return np.array([along, along, down]) + BEYOND_HOME * height


def turned_reach(places: Array, height: float) -> Array:
    """Return the default reach of what turns with the robot [m], (3,): as at home, and `BEYOND_HOME` of L more.

    All axes are alike, since the robot may turn in the air.

    Args:
        places: offsets of jets, or of contact points that no joint moves [m], (places, 3).
        height: L [m].
    """
    away = float(np.linalg.norm(places, axis=1).max(initial=0.0))
    return np.full(3, away + BEYOND_HOME * height)
