"""Limits that are narrower over a stretch of the horizon than those of the robot and of the scenario."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from multimodal_to.arguments import check_fields, refuse_negative
from multimodal_to.errors import ScenarioError, unknown
from multimodal_to.models.robot import Robot
from multimodal_to.trajectory.instants import Instant, check_stretch, knot_at
from multimodal_to.trajectory.quantities import XYZ
from multimodal_to.values import FrozenMapping


@dataclass(frozen=True, kw_only=True)
class Limits:
    """Greatest speeds and thrusts over a stretch: of each interval in it, and at each knot of it.

    Raises:
        ScenarioError: a number makes no sense, the stretch has no length, or nothing is limited.
    """

    base_speed: float | None = None
    """Greatest speed of the base along each axis of the world [m/s]."""
    turning_speed: float | None = None
    """Greatest speed at which the base turns about each axis of the world [rad/s]."""
    joint_speeds: Mapping[str, float] = field(default_factory=dict)
    """Greatest speeds of joints, by joint or by joint group [rad/s or m/s]."""
    thrusts: Mapping[str, float] = field(default_factory=dict)
    """Greatest thrusts, by jet [N]."""
    begin: Instant = 0.0
    """From when on: a share of the horizon, "start" or "end" [1]."""
    end: Instant = 1.0
    """Until when, likewise [1]."""

    def __post_init__(self) -> None:
        check_fields(self, ScenarioError, "limits: ")
        for name in ("joint_speeds", "thrusts"):
            kept = {key: float(value) for key, value in getattr(self, name).items()}
            object.__setattr__(self, name, FrozenMapping(kept))
        check_stretch(self.begin, self.end, "limits", ScenarioError)
        asked = {name: getattr(self, name) for name in ("base_speed", "turning_speed")}
        asked |= {f"joint_speeds.{name}": value for name, value in self.joint_speeds.items()}
        asked |= {f"thrusts.{name}": value for name, value in self.thrusts.items()}
        found = {name: value for name, value in asked.items() if value is not None}
        for name, value in found.items():
            refuse_negative(f"limits: {name}", value, ScenarioError)
        if not found:
            raise ScenarioError("limits: nothing is limited; expected base_speed, turning_speed, joint_speeds, thrusts")


@dataclass(frozen=True, kw_only=True)
class Limited:
    """A row of a quantity whose size is limited over a stretch."""

    quantity: str  # of the trajectory
    row: int  # of that quantity
    what: str  # reports call it
    most: float  # its greatest size, in its own unit
    knots: range  # at which it holds


def limited(limits: Sequence[Limits], robot: Robot, knots: int) -> tuple[Limited, ...]:
    """Return what some limits hold.

    Args:
        limits: of a scenario.
        robot: whose motion it is, with the jets that it uses.
        knots: N, the number of intervals.

    Raises:
        ScenarioError: there is no joint, joint group or jet of a name.
    """
    return tuple(
        Limited(quantity=quantity, row=row, what=what, most=most, knots=_knots(one, quantity, knots))
        for one in limits
        for quantity, row, what, most in _rows(one, robot)
    )


def _knots(one: Limits, quantity: str, knots: int) -> range:
    """Return the knots of a stretch; a velocity is that of the interval that ends at its knot.

    Args:
        one: the limits.
        quantity: that is limited.
        knots: N, the number of intervals.
    """
    first, last = knot_at(one.begin, knots), knot_at(one.end, knots)
    return range(first if quantity == "thrust" else min(first + 1, last), last + 1)


def _rows(one: Limits, robot: Robot) -> Iterator[tuple[str, int, str, float]]:
    for quantity, what, most in (
        ("base_linear_velocity", "base", one.base_speed),
        ("base_angular_velocity", "base about", one.turning_speed),
    ):
        if most is not None:
            yield from ((quantity, row, f"{what} {axis}", most) for row, axis in enumerate(XYZ))
    for name, most in one.joint_speeds.items():
        known = (*robot.joint_names, *robot.joint_groups)
        if name not in known:
            raise ScenarioError(f"limits: {unknown('joint or joint group', name, known)}")
        rows = [robot.joint_names.index(name)] if name in robot.joint_names else robot.group_indices(name)
        yield from (("joint_velocities", int(row), robot.joint_names[row], most) for row in rows)
    for name, most in one.thrusts.items():
        if name not in robot.jet_names:
            raise ScenarioError(f"limits: {unknown('jet', name, robot.jet_names)}")
        yield "thrust", list(robot.jet_names).index(name), name, most
