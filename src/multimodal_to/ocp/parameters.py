"""`Parameters`: what the terms of a problem may read beside its variables; it is fixed while a problem is solved."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from multimodal_to.models.robot import Posture, Robot
from multimodal_to.models.terrain import CachedSurface, Surface
from multimodal_to.ocp.schedule import Schedule
from multimodal_to.scenarios.scenario import Scenario
from multimodal_to.trajectory import rules


@dataclass(frozen=True, kw_only=True)
class Parameters:
    """What is given in a problem: the robot, the task, the ground, and the posture that the motion stands in."""

    robot: Robot  # with the jets that the scenario uses
    scenario: Scenario
    surface: Surface
    friction: float  # Coulomb's coefficient [1]
    complementarity_max: float  # ε_n [N m]
    sliding_max: float  # ε_t [N m]
    standing: Posture  # near home, with the CoM where the motion starts
    target: Posture  # what posture costs pull to: that of the end where the motion ends standing, else the same
    rule: str = rules.LEAPFROG  # name of the integration rule

    @cached_property
    def contacts(self) -> Schedule:
        """Return what the scenario gives of each contact point at each knot."""
        return Schedule.of(self.robot, self.scenario, self.rule)

    @classmethod
    def of(
        cls,
        robot: Robot,
        scenario: Scenario,
        standing: Posture,
        target: Posture | None = None,
        rule: str = rules.LEAPFROG,
    ) -> Parameters:
        """Return the parameters of a scenario; what it leaves open is the robot's.

        Args:
            robot: with the jets that the scenario uses.
            scenario: the task.
            standing: posture near home, with the CoM where the motion starts.
            target: what posture costs pull to; by default the same.
            rule: name of the integration rule.
        """
        complementarity_max, sliding_max = scenario.contact_bounds(robot)
        return cls(
            robot=robot,
            scenario=scenario,
            surface=CachedSurface(scenario.surface),
            friction=scenario.friction or robot.friction,
            complementarity_max=complementarity_max,
            sliding_max=sliding_max,
            standing=standing,
            target=target or standing,
            rule=rule,
        )
