"""`Schedule`: at which knots contact points are given to stand, to keep their place, and to bear no force."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from multimodal_to.adam.spatial import Array
from multimodal_to.errors import ScenarioError, unknown
from multimodal_to.models.robot import Robot
from multimodal_to.scenarios.contacts import ContactState, ContactStretch
from multimodal_to.scenarios.scenario import Scenario
from multimodal_to.trajectory import rules
from multimodal_to.trajectory.instants import knot_at, share
from multimodal_to.values import Value

Flags = NDArray[np.bool_]


@dataclass(frozen=True, kw_only=True, eq=False)
class Schedule(Value):
    """What a scenario gives of each contact point at each knot, (contacts, N + 1) each.

    A point that is on over an interval is on the ground at both of its knots. A point that is off bears no force
    that acts within the interval. Under leapfrog a force acts half an interval before and after its knot: a point that
    lands at knot a and leaves at knot b bears force at the knots a + 1 to b − 1. By backward Euler a force acts over
    the interval that ends at its knot, and the last of them is at knot b.
    """

    on: Flags  # column k: the point is given to be on over the interval that ends at knot k
    off: Flags  # column k: it is given to be off over the interval that ends at knot k
    stands: Flags  # column k: its height is zero at knot k
    unloaded: Flags  # column k: it bears no force at knot k
    clearance: Array  # least height at knot k [m]; zero where none is asked for

    @classmethod
    def of(cls, robot: Robot, scenario: Scenario, rule: str = rules.LEAPFROG) -> Schedule:
        """Return the schedule of a scenario.

        Args:
            robot: whose contact points they are.
            scenario: the task.
            rule: name of the integration rule.

        Raises:
            ScenarioError: there is no such foot or point, a stretch is shorter than an interval, or a point is given to
                be on and off at once.
        """
        count, knots = len(robot.contacts), scenario.knots
        states = np.full((count, knots), _FREE)
        clearance = np.zeros((count, knots + 1))
        for stretch in scenario.gait.stretches(robot) if scenario.gait else ():
            _give(states, clearance, robot, stretch)
        said = np.full_like(states, _FREE)
        for stretch in scenario.contacts:
            rows, first, last = _give(states, clearance, robot, stretch)
            before, given = said[rows, first:last], _NUMBERS[stretch.state]
            if given != _FREE and np.any((before != _FREE) & (before != given)):
                raise ScenarioError(
                    f"contacts: {_said(stretch)} meets a stretch that says the opposite, between the knots {first} and "
                    f"{last}; expected stretches that share at most a knot"
                )
            said[rows, first:last] = given
        on, off = (_by_end(states == number) for number in (_ON, _OFF))
        clearance[~(off & _shifted(off))] = 0.0
        stands = on | _shifted(on)
        unloaded = off.copy()
        unloaded[:, 0] = off[:, 1]
        if rules.acts_after(rule):
            unloaded |= _shifted(off)
        return cls(on=on, off=off, stands=stands, unloaded=unloaded, clearance=clearance)

    @property
    def given(self) -> Flags:
        """Return over which intervals something is given, (contacts, N + 1); column k is of the one that ends at k."""
        return self.on | self.off

    @property
    def in_air(self) -> Flags:
        """Return at which knots no point bears a force, (N + 1,)."""
        return np.asarray(self.unloaded.all(axis=0))


_FREE, _ON, _OFF = 0, 1, 2
_NUMBERS = {ContactState.FREE: _FREE, ContactState.ON: _ON, ContactState.OFF: _OFF}


def knots_of(stretch: ContactStretch, knots: int) -> tuple[int, int]:
    """Return the first and the last knot of a stretch, the nearest to its shares of the horizon.

    Args:
        stretch: of a scenario.
        knots: N, the number of intervals.

    Raises:
        ScenarioError: both are the same knot.
    """
    first, last = knot_at(stretch.begin, knots), knot_at(stretch.end, knots)
    if first == last:
        raise ScenarioError(
            f"contacts: {_said(stretch)} is shorter than an interval, with {knots} knots; expected a longer stretch or "
            "more knots"
        )
    return first, last


def _give(
    states: NDArray[np.int64], clearance: Array, robot: Robot, stretch: ContactStretch
) -> tuple[list[int], int, int]:
    """Write a stretch into states of intervals and clearances of knots; return its points, first and last knot.

    Args:
        states: of each contact point over each interval, (contacts, N).
        clearance: least height at each knot [m], (contacts, N + 1).
        robot: whose contact points they are.
        stretch: that is written.
    """
    first, last = knots_of(stretch, states.shape[1])
    rows = points_of(robot, stretch)
    states[rows, first:last] = _NUMBERS[stretch.state]
    clearance[rows, first : last + 1] = 0.0
    clearance[rows, (first + last) // 2] = stretch.clearance
    return rows, first, last


def points_of(robot: Robot, stretch: ContactStretch) -> list[int]:
    """Return which contact points a stretch is of: those of its feet, and those that it names.

    Raises:
        ScenarioError: there is no foot and no contact point of a name.
    """
    names, rows = robot.contact_names, dict[int, None]()
    for name in stretch.of:
        if name in robot.feet:
            rows |= dict.fromkeys(robot.feet[name])
        elif name in names:
            rows[names.index(name)] = None
        else:
            raise ScenarioError(f"contacts: {unknown('foot or contact point', name, [*robot.feet, *names])}")
    return list(rows)


def _said(stretch: ContactStretch) -> str:
    return f"{' and '.join(stretch.of)} '{stretch.state.value}' from {share(stretch.begin):g} to {share(stretch.end):g}"


def _by_end(intervals: Flags) -> Flags:
    """Return flags of intervals, (contacts, N), in the columns of the knots at which they end, (contacts, N + 1)."""
    return np.hstack([np.zeros((intervals.shape[0], 1), dtype=bool), intervals])


def _shifted(flags: Flags) -> Flags:
    """Return in each column what the next one has: of the interval that begins at a knot."""
    return np.hstack([flags[:, 1:], np.zeros((flags.shape[0], 1), dtype=bool)])


def runs(flags: Sequence[bool] | Flags) -> list[tuple[int, int]]:
    """Return the first and last place of every run of flags that are set."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], np.asarray(flags, dtype=bool), [False]]).astype(int)))
    return [(int(first), int(last) - 1) for first, last in edges.reshape(-1, 2)]
