"""`Flight`: a simulation that goes on step by step, with a plan that can be replaced and a push from outside."""

from __future__ import annotations

import numpy as np

from multimodal_to.arguments import checked
from multimodal_to.errors import InputError, TrajectoryError
from multimodal_to.models.robot import Robot
from multimodal_to.models.state import State
from multimodal_to.simulation.controller import Controller
from multimodal_to.simulation.disturbance import Disturbance, Push
from multimodal_to.simulation.model import TIME_STEP
from multimodal_to.simulation.playback import Playback, Player
from multimodal_to.simulation.reference import reference
from multimodal_to.simulation.servos import ServoController
from multimodal_to.trajectory import Trajectory
from multimodal_to.trajectory.sameness import refuse_other_robot


class Flight:
    """A simulation like that of `play`, which goes on as far as it is told to.

    Args:
        robot: that moves.
        plan: its motion, at whose first knot the simulation starts and which it follows until there is another one.
        controller: what carries the plans out; by default the `ServoController`.
        push: what pushes the robot, if anything does.
        torque_limits: clip the torque of each joint's motor at its effort limit.

    Raises:
        OutputError: MuJoCo is not installed.
        TrajectoryError: the plan is not one of this robot with these jets.
    """

    @checked
    def __init__(
        self,
        robot: Robot,
        plan: Trajectory,
        controller: Controller | None = None,
        *,
        push: Push | None = None,
        torque_limits: bool = True,
    ) -> None:
        refuse_other_robot(plan, robot, what="the plan", error=TrajectoryError)
        self._robot = robot
        self._player = Player(
            robot, plan, controller or ServoController(), Disturbance(push=push), torque_limits=torque_limits
        )
        self._plan, self._since = plan, 0.0

    @property
    def time(self) -> float:
        """Return how much time has been simulated [s]."""
        return self._player.time

    @property
    def fell(self) -> float | None:
        """Return when the robot fell [s], if it did."""
        return self._player.fell

    @property
    def state(self) -> State:
        """Return the state of the robot now."""
        return self._player.state()

    @property
    def playback(self) -> Playback:
        """Return what the simulation has done; its `plan` is the first one, its `reference` what was followed."""
        return self._player.playback()

    @checked
    def follow(self, plan: Trajectory, since: float) -> None:
        """Follow another plan from now on.

        Args:
            plan: of the same robot.
            since: when its first knot is or was [s]: a plan that took time is followed from where it has got to.

        Raises:
            TrajectoryError: the plan is not one of this robot with these jets.
        """
        refuse_other_robot(plan, self._robot, what="the plan", error=TrajectoryError)
        self._plan, self._since = plan, since
        self._player.follow(plan, since)

    @checked
    def advance(self, duration: float) -> None:
        """Simulate for some time [s], to the nearest step of the simulation; after a plan's end it is held there.

        Raises:
            InputError: the duration is negative.
        """
        if not 0.0 <= duration < np.inf:
            raise InputError(f"the duration is {duration} s; expected a number of at least zero")
        times = self.time + TIME_STEP * np.arange(round(duration / TIME_STEP), dtype=np.float64)
        if not times.size:
            return
        self._player.run(reference(self._robot, self._plan, times - self._since))
