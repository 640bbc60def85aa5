"""`Property`: one thing that an audit judges, with its unit, its limit, and when it is judged."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from multimodal_to.models.contact import FrictionCone
from multimodal_to.models.robot import Robot
from multimodal_to.scenarios.scenario import Scenario, Start, Terminal
from multimodal_to.trajectory import rules


class Judged(Enum):
    """When a property is judged; the value says it in words."""

    ALWAYS = "always"
    WITH_JETS = "the motion has jets"
    WITH_CAPSULES = "the robot has capsules"
    WITH_SCENARIO = "the scenario is known"
    WITH_MID_HEIGHT = "the scenario has a `mid_height_min`"
    STANDING_START = "the scenario starts standing"
    HOVERING_START = "the scenario starts in a hover"
    END_AT_REST = "the scenario ends standing or in a hover"
    STANDING_END = "the scenario ends standing"
    HOVERING_END = "the scenario ends in a hover"

    def applies(self, scenario: Scenario | None, robot: Robot) -> bool:
        """Return whether a motion of a robot is judged; without a scenario only its physics is."""
        physics = {
            Judged.ALWAYS: True,
            Judged.WITH_JETS: bool(robot.jets),
            Judged.WITH_CAPSULES: bool(robot.capsules),
        }
        if self in physics or scenario is None:
            return physics.get(self, False)
        return {
            Judged.WITH_SCENARIO: True,
            Judged.WITH_MID_HEIGHT: scenario.mid_height_min is not None,
            Judged.STANDING_START: scenario.start is Start.STANDING,
            Judged.HOVERING_START: scenario.start is Start.HOVER,
            Judged.END_AT_REST: scenario.terminal in (Terminal.STANDING, Terminal.HOVER),
            Judged.STANDING_END: scenario.terminal is Terminal.STANDING,
            Judged.HOVERING_END: scenario.terminal is Terminal.HOVER,
        }[self]


@dataclass(frozen=True, kw_only=True)
class Property:
    """One thing that an audit judges."""

    name: str
    unit: str
    limit: float  # largest value that holds, in `unit`; a share of m |g| where `of_weight`, of L where `of_height`
    reason: str  # where the limit comes from
    meaning: str  # what is compared with the limit
    judged: Judged = Judged.ALWAYS
    of_weight: bool = False
    of_height: bool = False
    second_order_limit: float | None = None  # the limit under the second-order friction cone, where it is another one
    first_order_limit: float | None = None  # the limit by an integration rule of order one, where it is another one

    def limit_for(self, robot: Robot, scenario: Scenario | None, rule: str = rules.LEAPFROG) -> float:
        """Return the limit in `unit`.

        Args:
            robot: whose weight or standing height the limit may be a share of.
            scenario: which says the friction cone, where it is known.
            rule: name of the motion's integration rule; every one with all at its knots is of order one.
        """
        limit = self.limit
        if self.first_order_limit is not None and rules.all_at_knots(rule):
            limit = self.first_order_limit
        if self.second_order_limit is not None and scenario and scenario.friction_cone is FrictionCone.SECOND_ORDER:
            limit = self.second_order_limit
        return limit * (robot.weight if self.of_weight else robot.standing_height if self.of_height else 1.0)
