"""`Property`: one thing that an audit judges, with its unit, its limit, and when it is judged."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

from multimodal_to.arguments import checked
from multimodal_to.models.contact import FrictionCone
from multimodal_to.models.joint_units import joint_units
from multimodal_to.models.robot import Robot
from multimodal_to.models.sole import soles
from multimodal_to.models.units import Sized
from multimodal_to.scenarios.margins import Margins
from multimodal_to.scenarios.scenario import Scenario, Start, Terminal
from multimodal_to.trajectory import rules


class Judged(Enum):
    """When a property is judged; the value says it in words."""

    ALWAYS = "always"
    WITH_JETS = "the motion has jets"
    WITH_CAPSULES = "the robot has capsules"
    WITH_SOLES = "the robot has soles"
    WITH_SCENARIO = "the scenario is known"
    WITH_MARGINS = "the scenario asks for margins"
    WITH_TOUCH_DOWN = "the scenario asks for a `touch_down_speed`"
    WITH_KEYFRAMES = "a keyframe of the scenario asks for it"
    WITH_MID_HEIGHT = "the scenario has a `mid_height_min`"
    WITH_END_COM = "the scenario says where the CoM ends"
    WITH_CONTACTS = "the scenario gives contacts"
    WITH_FAILURES = "the scenario lets jets fail"
    WITH_REGIONS = "the scenario has walls or boxes"
    WITH_LIMITS = "the scenario has `limits`"
    STANDING_START = "the scenario starts standing"
    HOVERING_START = "the scenario starts in a hover"
    START_AT_REST = "the scenario starts standing or in a hover"
    END_AT_REST = "the scenario ends standing or in a hover"
    STANDING_END = "the scenario ends standing"
    HOVERING_END = "the scenario ends in a hover"

    @checked
    def applies(self, scenario: Scenario | None, robot: Robot) -> bool:
        """Return whether a motion of a robot is judged; without a scenario only its physics is."""
        physics = {
            Judged.ALWAYS: True,
            Judged.WITH_JETS: bool(robot.jets),
            Judged.WITH_CAPSULES: bool(robot.capsules),
            Judged.WITH_SOLES: bool(soles(robot)),
        }
        if self in physics or scenario is None:
            return physics.get(self, False)
        return {
            Judged.WITH_SCENARIO: True,
            Judged.WITH_MARGINS: scenario.margins != Margins.none(),
            Judged.WITH_TOUCH_DOWN: scenario.margins.touch_down_speed > 0.0,
            Judged.WITH_KEYFRAMES: bool(scenario.keyframes),
            Judged.WITH_MID_HEIGHT: scenario.mid_height_min is not None,
            Judged.WITH_END_COM: scenario.final_com is not None,
            Judged.WITH_CONTACTS: bool(scenario.contacts or scenario.gait),
            Judged.WITH_FAILURES: bool(scenario.failures),
            Judged.WITH_REGIONS: bool(scenario.walls or scenario.boxes),
            Judged.WITH_LIMITS: bool(scenario.limits),
            Judged.STANDING_START: scenario.start is Start.STANDING,
            Judged.HOVERING_START: scenario.start is Start.HOVER,
            Judged.START_AT_REST: scenario.start is not Start.GIVEN,
            Judged.END_AT_REST: scenario.terminal in (Terminal.STANDING, Terminal.HOVER),
            Judged.STANDING_END: scenario.terminal is Terminal.STANDING,
            Judged.HOVERING_END: scenario.terminal is Terminal.HOVER,
        }[self]


class Of(Enum):
    """What a limit is a share of, so that it is as strict for a small robot as for a large one; the value names it."""

    SIZE = ""
    """Nothing: the limit is in the property's unit for a robot of the iRonCub's size, and grows and shrinks with it."""
    POINT = "of a contact point"
    """The same for what goes by the load of one contact point."""
    WEIGHT = "m g"
    """The robot's weight [N]."""
    HEIGHT = "L"
    """Its standing height [m]."""
    MOMENT = "m g L"
    """Its weight at an arm of its standing height [N m]."""
    POINT_MOMENT = "m g L / n"
    """The share of one contact point in the weight, at an arm of the standing height [N m]."""
    SPEED = "√(g L)"
    """Its unit of speed [m/s]."""
    THRUST = "of the least `thrust_max`"
    """The greatest thrust of its smallest jet [N]; without jets it is infinite."""

    @checked
    def size(self, robot: Robot, unit: str = "1") -> float:
        """Return how much it is for a robot.

        Args:
            robot: whose size it is.
            unit: of the property; of several, as of a twist, the greatest.
        """
        if self in (Of.SIZE, Of.POINT):
            return max(Sized(1.0, part, self is Of.POINT).of(robot.units) for part in unit.split(", "))
        return {
            Of.WEIGHT: robot.weight,
            Of.HEIGHT: robot.standing_height,
            Of.MOMENT: robot.weight * robot.standing_height,
            Of.POINT_MOMENT: robot.weight * robot.standing_height / max(len(robot.contacts), 1),
            Of.SPEED: robot.units.of("m/s"),
            Of.THRUST: min((jet.thrust_max for jet in robot.jets), default=math.inf),
        }[self]


@dataclass(frozen=True, kw_only=True)
class Property:
    """One thing that an audit judges."""

    name: str
    unit: str  # of a joint that turns where the rows are joints
    limit: float  # largest value that holds, as a share of `of`
    reason: str  # where the limit comes from
    meaning: str  # what is compared with the limit
    judged: Judged = Judged.ALWAYS
    of: Of = Of.SIZE
    of_joints: bool = False  # the body of a finding is a joint, which has its own unit
    margin: str | None = None  # of the scenario's `Margins`: the limit is that much more
    unasked: float = 0.0  # what stands for the margin where the scenario is not known or asks for none
    second_order_limit: float | None = None  # the limit under the second-order friction cone, where it is another one
    first_order_limit: float | None = None  # the limit by an integration rule of order one, where it is another one

    @property
    def counted_in(self) -> str:
        """Return what the limit is a number of: the property's unit, or what it is a share of."""
        return self.unit if self.of in (Of.SIZE, Of.POINT) else self.of.value

    @checked
    def unit_for(self, robot: Robot, body: str) -> str:
        """Return the unit of a finding: that of a joint goes by whether it turns or slides.

        Args:
            robot: whose motion it is.
            body: of the finding, its joint where the property is one of joints.
        """
        if self.of_joints and body in robot.joint_names:
            return joint_units(robot, self.unit)[robot.joint_names.index(body)]
        return self.unit

    @checked
    def limit_for(self, robot: Robot, scenario: Scenario | None, rule: str = rules.LEAPFROG) -> float:
        """Return the limit in `unit`.

        Args:
            robot: whose size the limit may be a share of.
            scenario: which says the friction cone and the margins, where it is known.
            rule: name of the motion's integration rule; every one with all at its knots is of order one.
        """
        limit = self.limit
        if self.first_order_limit is not None and rules.all_at_knots(rule):
            limit = self.first_order_limit
        if self.second_order_limit is not None and scenario and scenario.friction_cone is FrictionCone.SECOND_ORDER:
            limit = self.second_order_limit
        if self.margin is not None:
            asked: float = getattr(scenario.margins, self.margin) if scenario else 0.0
            limit += asked or self.unasked
        return limit * self.of.size(robot, self.unit)
