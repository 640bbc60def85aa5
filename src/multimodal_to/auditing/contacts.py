"""Whether contact points do what a scenario gives: bear nothing where they are off, stand and stay where they are on.

The knots follow from the stretches' own shares, by code that shares nothing with the problem's schedule.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from multimodal_to.auditing.findings import Motion, Worst, worst_of
from multimodal_to.auditing.property import Judged, Of, Property
from multimodal_to.models.robot import Robot
from multimodal_to.models.stiff_legs import CREEP, on_stiff_legs
from multimodal_to.scenarios.contacts import ContactState, ContactStretch
from multimodal_to.scenarios.scenario import Scenario
from multimodal_to.trajectory import rules
from multimodal_to.trajectory.derived import surface_frames
from multimodal_to.trajectory.instants import knot_at

CONTACTS = (
    Property(
        name="given off: contact force",
        unit="N",
        limit=1e-3,
        of=Of.POINT,
        reason="zero is asked for: a bound, which the solver holds; the limit is for rounding",
        meaning="largest component of the force of a contact point that is given to be off",
        judged=Judged.WITH_CONTACTS,
    ),
    Property(
        name="given on: off the ground",
        unit="m",
        limit=2e-5,
        reason="the problem lets a sole's corner be 1e-5 m high, and a feasible motion may miss it by as much",
        meaning="distance of a contact point that is given to be on from the ground",
        judged=Judged.WITH_CONTACTS,
    ),
    Property(
        name="given on: moved",
        unit="m",
        limit=1e-4,
        of=Of.HEIGHT,
        reason="chosen: misses of 1e-5 m may add up over some intervals, and a sole's corners turn with it",
        meaning="way along the ground of a contact point, from where a stretch on which it is given to be on begins; "
        "on legs with too few joints to keep it, beyond 1.4e-5 m an interval",
        judged=Judged.WITH_CONTACTS,
    ),
    Property(
        name="given off: below the clearance",
        unit="m",
        limit=1e-5,
        reason="what a feasible motion may miss its row by",
        meaning="how far a contact point is below the clearance in the middle of a stretch on which it is off",
        judged=Judged.WITH_CONTACTS,
    ),
)


@dataclass(frozen=True, kw_only=True)
class _Given:
    """What holds of a contact point from knot `first` to knot `last`."""

    point: int
    state: ContactState
    first: int
    last: int
    clearance: float  # [m]


def contact_findings(motion: Motion, scenario: Scenario) -> list[Worst]:
    """Compare the contact points of a motion with what its scenario gives; without any there is nothing to judge."""
    if not (scenario.contacts or scenario.gait):
        return []
    robot, knots = motion.robot, motion.trajectory.knots
    heights, _, tangents = surface_frames(scenario.surface, motion.points)
    forces = np.abs(motion.contact_forces).max(axis=2)
    creep = np.sqrt(2.0) * CREEP.of(robot.units) * on_stiff_legs(robot)
    loads, off_ground, moved, below = (np.zeros((len(robot.contacts), knots + 1)) for _ in range(4))
    for given in _given(robot, scenario, knots):
        knots_within = slice(given.first, given.last + 1)
        if given.state is ContactState.OFF:
            begins = 0 if given.first == 0 or rules.acts_after(motion.trajectory.rule) else 1
            within = slice(given.first + begins, given.last + 1)
            loads[given.point, within] = forces[given.point, within]
            middle = (given.first + given.last) // 2
            below[given.point, middle] = given.clearance - heights[given.point, middle] if given.clearance else 0.0
        else:
            places = motion.points[given.point, knots_within]
            off_ground[given.point, knots_within] = np.abs(heights[given.point, knots_within])
            ways = np.einsum("kxt,kx->kt", tangents[given.point, knots_within], places - places[0])
            crept = creep[given.point] * np.arange(len(places))
            moved[given.point, knots_within] = np.maximum(np.linalg.norm(ways, axis=1) - crept, 0.0)
    names = robot.contact_names
    return [
        worst_of("given off: contact force", loads, names),
        worst_of("given on: off the ground", off_ground, names),
        worst_of("given on: moved", moved, names),
        worst_of("given off: below the clearance", below, names),
    ]


def _given(robot: Robot, scenario: Scenario, knots: int) -> list[_Given]:
    """Return what holds of each contact point, one stretch after the other; a later one takes the place of earlier."""
    found = []
    for point, contact in enumerate(robot.contacts):
        told: list[ContactStretch | None] = [None] * knots
        for stretch in (*(scenario.gait.stretches(robot) if scenario.gait else ()), *scenario.contacts):
            if contact.foot in stretch.of or contact.frame in stretch.of:
                for interval in range(knot_at(stretch.begin, knots), knot_at(stretch.end, knots)):
                    told[interval] = stretch
        first = 0
        for interval in range(1, knots + 1):
            before = told[interval - 1]
            if interval < knots and told[interval] is before:
                continue
            if before is not None and before.state is not ContactState.FREE:
                whole = (first, interval) == (knot_at(before.begin, knots), knot_at(before.end, knots))
                found.append(
                    _Given(
                        point=point,
                        state=before.state,
                        first=first,
                        last=interval,
                        clearance=before.clearance if whole else 0.0,
                    )
                )
            first = interval
    return found
