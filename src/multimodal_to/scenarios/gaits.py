"""Gaits: patterns of steps that fill the contacts of a scenario, for robots of two legs or more.

A gait is a list of groups of feet. The groups swing in turn; all other feet stand meanwhile.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np

from multimodal_to.adam.spatial import Array
from multimodal_to.arguments import check_fields, checked
from multimodal_to.errors import ScenarioError, listed, shown
from multimodal_to.models.robot import Robot
from multimodal_to.scenarios.contacts import ContactState, ContactStretch
from multimodal_to.trajectory.instants import Instant, check_stretch, share


class GaitKind(Enum):
    """Which feet swing together."""

    WALK = "walk"
    """One foot after the other; with four feet each hind foot before the front foot of its side."""
    TROT = "trot"
    """The feet that are diagonal to each other; with two feet it is the walk."""
    BOUND = "bound"
    """The front feet, then the hind feet; with two feet both at once."""
    JUMP = "jump"
    """All feet at once."""


@dataclass(frozen=True, kw_only=True)
class GaitPlan:
    """Steps at even times over a stretch of the horizon; outside of it all feet stand.

    Raises:
        ScenarioError: numbers that contradict each other.
    """

    kind: GaitKind
    """Which feet swing together."""
    steps: int
    """How many swings there are, of all groups of feet together [1]."""
    begin: Instant = 0.1
    """When the first step begins: a share of the horizon, "start" or "end" [1]."""
    end: Instant = 0.9
    """When the last step ends, likewise [1]."""
    swing: float = 0.75
    """Share of a step's time in which its feet are in the air [1]; with 1 the next feet leave as these land."""
    clearance: float | None = None
    """Least height of a foot in the middle of its swing [m]; where there is none, half of the robot's `gait.lift`."""
    first: str | None = None
    """A foot that swings first; where there is none, the gait's own order holds."""

    def __post_init__(self) -> None:
        check_fields(self, ScenarioError, "gait: ")
        if self.steps < 1:
            raise ScenarioError(f"gait: steps is {shown(self.steps)}; expected at least one")
        check_stretch(self.begin, self.end, "gait", ScenarioError)
        if not 0.0 < self.swing <= 1.0:
            raise ScenarioError(f"gait: swing is {shown(self.swing)}; expected a number above 0 and at most 1")
        if self.clearance is not None and not 0.0 <= self.clearance < float("inf"):
            raise ScenarioError(f"gait: clearance is {shown(self.clearance)}; expected at least zero [m]")

    @checked
    def stretches(self, robot: Robot) -> tuple[ContactStretch, ...]:
        """Return what the gait gives of every foot of a robot, over the whole horizon.

        Raises:
            ScenarioError: the robot has no such gait, or no foot of the name `first`.
        """
        groups = _led_by(self.first, groups_of(robot, self.kind))
        clearance = 0.5 * robot.gait.lift if self.clearance is None else self.clearance
        begin = share(self.begin)
        step = (share(self.end) - begin) / self.steps
        swings = {foot: list[tuple[float, float]]() for foot in robot.feet}
        for index in range(self.steps):
            middle, half = begin + (index + 0.5) * step, 0.5 * self.swing * step
            for foot in groups[index % len(groups)]:
                swings[foot].append((middle - half, middle + half))
        found = list[ContactStretch]()
        for foot, in_air in swings.items():
            lands = 0.0
            for leaves, next_landing in in_air:
                if leaves > lands:
                    found.append(ContactStretch(of=(foot,), state=ContactState.ON, begin=lands, end=leaves))
                found.append(
                    ContactStretch(
                        of=(foot,), state=ContactState.OFF, begin=leaves, end=next_landing, clearance=clearance
                    )
                )
                lands = next_landing
            if lands < 1.0:
                found.append(ContactStretch(of=(foot,), state=ContactState.ON, begin=lands))
        return tuple(found)


def groups_of(robot: Robot, kind: GaitKind) -> list[list[str]]:
    """Return which feet of a robot swing together in a gait, in their order.

    Front and hind, left and right follow from where the feet are at home: front is along the x of the robot's base.

    Raises:
        ScenarioError: the robot has not the number of feet that the gait is for.
    """
    feet = list(robot.feet)
    if kind is GaitKind.JUMP:
        return [feet]
    if len(feet) == 2:
        return [feet] if kind is GaitKind.BOUND else [[foot] for foot in feet]
    if len(feet) != 4:
        raise ScenarioError(
            f"gait: {robot.name} has {len(feet)} feet, {listed(feet)}; a {kind.value} is for two or four, and others "
            "are given by `contacts`"
        )
    front, hind = _sorted(robot, feet)
    return {
        GaitKind.WALK: [[hind[0]], [front[0]], [hind[1]], [front[1]]],
        GaitKind.TROT: [[front[0], hind[1]], [front[1], hind[0]]],
        GaitKind.BOUND: [front, hind],
    }[kind]


def _sorted(robot: Robot, feet: list[str]) -> tuple[list[str], list[str]]:
    """Return the front and the hind feet of a robot with four, left ones first, seen from its base at home.

    Raises:
        ScenarioError: they are not two and two.
    """
    places = {foot: _place(robot, foot) for foot in feet}
    middle = np.mean(list(places.values()), axis=0)
    corners = {(place[0] > middle[0], place[1] > middle[1]): foot for foot, place in places.items()}
    if len(corners) < 4:
        raise ScenarioError(
            f"gait: the feet {listed(feet)} of {robot.name} do not stand at four corners, seen along its base's axes; "
            "give them by `contacts`"
        )
    return [corners[True, True], corners[True, False]], [corners[False, True], corners[False, False]]


def _place(robot: Robot, foot: str) -> Array:
    """Return where the middle of a foot is at home, in the base's axes [m], (3,)."""
    joints = robot.home.joint_positions
    points = [
        np.array(robot.kindyn.forward_kinematics(robot.contact_names[index], np.eye(4), joints))[:3, 3]
        for index in robot.feet[foot]
    ]
    return np.asarray(np.mean(points, axis=0))


def _led_by(first: str | None, groups: list[list[str]]) -> list[list[str]]:
    """Return groups in turn from the one that has a foot."""
    if first is None:
        return groups
    known = [foot for group in groups for foot in group]
    if first not in known:
        raise ScenarioError(f"gait: first is '{first}'; expected one of {listed(known)}")
    lead = next(index for index, group in enumerate(groups) if first in group)
    return groups[lead:] + groups[:lead]
