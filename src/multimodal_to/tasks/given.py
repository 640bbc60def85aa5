"""What the starter tasks share: what is given of contacts and bounds, and what is refused."""

from __future__ import annotations

import math

import numpy as np

from multimodal_to.errors import ScenarioError
from multimodal_to.models.robot import Robot
from multimodal_to.scenarios.contacts import ContactState, ContactStretch

_TOES = 0.02
"""A sole points ahead or back from its ankle where its middle is farther from it along x than this [L]."""
_LINE = 0.02
"""Contact points that are no farther from a line are on it [L]."""


def looks(robot: Robot) -> float:
    """Return 1 where a robot looks along x of the world at home, −1 where its soles point back from their ankles."""
    tree = robot.kindyn.tree

    def ahead(name: str) -> float:
        ankle = tree.bodies[tree.frame(name).body].name
        return float(robot.pose_at_home(name)[0, 3] - robot.pose_at_home(ankle)[0, 3])

    ways = [
        ahead(robot.contact_names[point])
        for points in robot.feet.values()
        if len(points) > 2 and robot.joint_names
        for point in points
    ]
    return -1.0 if ways and float(np.mean(ways)) < -_TOES * robot.standing_height else 1.0


def given(robot: Robot, state: ContactState, begin: float, end: float, clearance: float = 0.0) -> ContactStretch:
    """Return a stretch that is given of all feet.

    Feet on legs without joints are not given to stand, but free to: they would be held by more rows than the body has
    ways to move.

    Args:
        robot: whose feet they are.
        state: what is given.
        begin: of the stretch, as a share of the horizon [1].
        end: of the stretch, as a share of the horizon [1].
        clearance: least height in its middle [m].
    """
    if state is ContactState.ON and not robot.joint_names:
        state = ContactState.FREE
    return ContactStretch(of=tuple(robot.feet), state=state, begin=begin, end=end, clearance=clearance)


def refuse_footless(robot: Robot, name: str) -> None:
    """Refuse a robot that does not stand for the task of a name.

    Raises:
        ScenarioError: it has no contact points, or all of them are on a line, about which it falls.
    """
    if not robot.contacts:
        raise ScenarioError(f"{robot.name} has no contact points; expected a robot with feet for '{name}'")
    places = np.array([robot.pose_at_home(name)[:2, 3] for name in robot.contact_names])
    if len(places) < 3 or np.linalg.svd(places - places.mean(axis=0))[1][1] < _LINE * robot.standing_height:
        raise ScenarioError(
            f"{robot.name} has its contact points on a line, about which it falls; expected feet that hold it upright "
            f"for '{name}', which starts or ends at rest"
        )


def positive(name: str, number: float, unit: str) -> float:
    """Return a number that has to be positive.

    Args:
        name: of the number.
        number: what it is.
        unit: of the number.

    Raises:
        ScenarioError: it is not positive.
    """
    if not 0.0 < number < math.inf:
        raise ScenarioError(f"{name} is {number}; expected a positive number [{unit}]")
    return number
