"""`Task`: a robot and what is asked of it, with what several checks need to know; each is worked out once."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from multimodal_to.adam.spatial import Array
from multimodal_to.errors import ScenarioError
from multimodal_to.models.robot import Posture, Robot
from multimodal_to.models.state import State
from multimodal_to.models.terrain import FlatGround, Plane
from multimodal_to.models.turbines import greatest_held
from multimodal_to.ocp import given, paper, rebinding
from multimodal_to.ocp.formulation import Formulation
from multimodal_to.ocp.guess import standing_posture, starting_posture
from multimodal_to.ocp.parameters import Parameters
from multimodal_to.ocp.terms import Constraint
from multimodal_to.ocp.waypoints import com as com_path
from multimodal_to.scenarios.failures import failing_knots
from multimodal_to.scenarios.keyframes import Placed
from multimodal_to.scenarios.limits import Limited, limited
from multimodal_to.scenarios.scenario import Scenario, Start, Terminal, Vector3
from multimodal_to.trajectory import rules

_ROUNDING = 1e-9


@dataclass(frozen=True, kw_only=True, eq=False)
class Task:
    """A scenario for a robot with the jets that it uses, and what its problem is made of."""

    robot: Robot
    scenario: Scenario
    formulation: Formulation
    initial: State | None = None  # that a motion with a given start starts in

    @classmethod
    def of(
        cls,
        robot: Robot,
        scenario: Scenario,
        formulation: Formulation | None = None,
        initial: State | None = None,
    ) -> Task:
        """Return a scenario for a robot, whose jets are left out if the scenario leaves them off.

        Args:
            robot: whose motion it is.
            scenario: the task.
            formulation: what the problem is made of; by default `Formulation.executable()`.
            initial: the state that a motion with a given start starts in; by default that of the scenario's file.

        Raises:
            ScenarioError: a keyframe names a joint or a frame that the robot lacks, or contradicts another.
            TrajectoryError: the file of the state that it starts in is missing or broken.
            InputError: that state is of another robot.
        """
        scenario = scenario.for_robot(robot)
        robot = robot if scenario.jets else robot.with_jets(())
        initial = initial or given.measured(scenario)
        if initial is not None:
            initial.refuse_other_robot(robot)
            scenario = rebinding.started(robot, scenario, initial)
        made_of = formulation or Formulation.executable()
        return cls(robot=robot, scenario=scenario, formulation=made_of, initial=initial)

    # ---------------------------------------------------------------- time

    @property
    def longest(self) -> float:
        """Return the horizon's greatest duration [s]."""
        return self.scenario.knots * self.scenario.interval_max

    @property
    def moving_intervals(self) -> int:
        """Return over how many intervals the CoM can move: one that ends at rest stands still over the last two."""
        return self.scenario.knots - (0 if self.scenario.terminal is Terminal.FREE else 2)

    @property
    def rests_first(self) -> bool:
        """Return whether the CoM stands still over the first interval: from rest and equilibrium, by leapfrog."""
        by_rest = self.scenario.start is not Start.GIVEN and bool(self.held(paper.STATIC_EQUILIBRIUM))
        return by_rest and bool(rules.instant(self.formulation.rule.name, "com_velocity"))

    @cached_property
    def held_in_order(self) -> list[Placed]:
        """Return those of the scenario's `keyframes` that are held and no costs, by knot."""
        held = [one for one in self.scenario.own_keyframes() if one.keyframe.weight is None]
        return sorted(held, key=lambda one: one.knot)

    # ---------------------------------------------------------------- in the air

    @cached_property
    def hovers(self) -> dict[str, Vector3]:
        """Return where the CoM has to hover [m], by when; about where, if a keyframe does not say all of it."""
        scenario, where = self.scenario, dict[str, Vector3]()
        if scenario.start is Start.HOVER:
            where["start"] = scenario.start_com
        for one in scenario.keyframes_between():
            if one.keyframe.hover:
                x, y, z = (float(value) for value in com_path(scenario)[:, one.knot])
                where[one.label] = x, y, z
        if scenario.terminal is Terminal.HOVER:
            where["end"] = scenario.end_com
        return where

    @property
    def first_hover(self) -> int | None:
        """Return the first knot after the start that hovers, if there is one."""
        knots = [one.knot for one in self.scenario.placed() if one.knot and one.keyframe.hover]
        return min(knots, default=None)

    @cached_property
    def lost(self) -> set[int]:
        """Return the places of the jets that have failed where the motion hovers: by its end, or at its start."""
        known = [failure for failure in self.scenario.failures if failure.jet in self.robot.jet_names]
        failing = failing_knots(known, self.robot.jet_names, self.scenario.knots)
        return {row for row, knot in failing.items() if knot == 0 or "start" not in self.hovers}

    @cached_property
    def thrusts_held(self) -> Array:
        """Return the greatest thrust that each jet can hold [N], (jets,); zero of one that has failed."""
        return np.array([0.0 if row in self.lost else greatest_held(jet) for row, jet in enumerate(self.robot.jets)])

    @property
    def lifts(self) -> bool:
        """Return whether the jets, all pointing straight up, can hold the weight."""
        return float(self.thrusts_held.sum()) >= self.robot.weight

    # ---------------------------------------------------------------- on the ground

    @property
    def stands_at_start(self) -> bool:
        """Return whether the motion starts on its feet."""
        return self.scenario.start is Start.STANDING

    @property
    def stands_at_end(self) -> bool:
        """Return whether the motion has to end on its feet."""
        return self.scenario.terminal is Terminal.STANDING

    @property
    def on_plane(self) -> bool:
        """Return whether the ground is the same everywhere but for its height."""
        return isinstance(self.scenario.surface, FlatGround | Plane)

    @cached_property
    def start_posture(self) -> Posture | None:
        """Return the posture in which the motion starts on its feet, if it does and there is one."""
        if not self.stands_at_start:
            return None
        try:
            return starting_posture(self.robot, self.scenario)
        except ScenarioError:
            return None

    @cached_property
    def end_posture(self) -> Posture | None:
        """Return a posture in which the motion can end on its feet, if it has to and one is found."""
        if not self.stands_at_end:
            return None
        try:
            return standing_posture(self.robot, self.scenario.surface, self.scenario.end_com)
        except ScenarioError:
            return None

    @property
    def posture(self) -> Posture:
        """Return the posture that the problem is built around, as far as there is one; else upright."""
        return self.start_posture or self.end_posture or self.robot.upright

    @property
    def parameters(self) -> Parameters:
        """Return what the problem's terms may read."""
        return Parameters.of(self.robot, self.scenario, self.posture)

    def held(self, *constraints: Constraint) -> tuple[Constraint, ...]:
        """Return those of some constraints that the formulation has."""
        return tuple(term for term in constraints if term in self.formulation.terms)

    @cached_property
    def _limited(self) -> tuple[Limited, ...]:
        """Return what is limited over stretches; nothing where a limit is of what the robot has not."""
        try:
            return limited(self.scenario.limits, self.robot, self.scenario.knots)
        except ScenarioError:
            return ()

    def greatest(self, quantity: str, row: int, usual: float) -> Array:
        """Return how large a row of a quantity may be at each knot, (N + 1,).

        Args:
            quantity: of the trajectory.
            row: of it.
            usual: how large it may be without `limits`, in its unit.
        """
        most = np.full(self.scenario.knots + 1, float(usual))
        for one in self._limited:
            if (one.quantity, one.row) == (quantity, row):
                most[list(one.knots)] = np.minimum(most[list(one.knots)], one.most)
        return most

    def furthest(self, quantity: str, row: int, usual: float, between: tuple[int, int]) -> float:
        """Return how far something with a row of a velocity comes between two knots at most.

        Args:
            quantity: of the trajectory, a velocity.
            row: of it.
            usual: its greatest size without `limits`, in its unit.
            between: the knots.
        """
        first, last = between
        return float(self.greatest(quantity, row, usual)[first + 1 : last + 1].sum()) * self.scenario.interval_max

    @property
    def rigid(self) -> bool:
        """Return whether no joint can move."""
        return not np.any(self.robot.joint_limits.lower < self.robot.joint_limits.upper)


def narrowed(most: float, usual: float) -> str:
    """Return what a finding adds where `limits` of the scenario allow less than is usual; else nothing.

    Args:
        most: that is allowed, with `limits`.
        usual: that is allowed without them, in the same unit.
    """
    return " and `limits` are less" if most < usual - _ROUNDING else ""
