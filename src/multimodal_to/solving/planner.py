"""`Planner`: a problem that is built once and solved again and again."""

from __future__ import annotations

import weakref
from dataclasses import replace

import numpy as np

from multimodal_to.adam.spatial import Array
from multimodal_to.arguments import checked
from multimodal_to.errors import InputError
from multimodal_to.models.robot import Posture, Robot
from multimodal_to.models.state import State
from multimodal_to.ocp.building import build
from multimodal_to.ocp.formulation import Formulation
from multimodal_to.ocp.problem import Problem
from multimodal_to.ocp.rebinding import rebind, same_terms
from multimodal_to.scenarios.scenario import Scenario, Start, Vector3
from multimodal_to.solving.ipopt import Ipopt
from multimodal_to.solving.solution import Progress, Solution, solve_from
from multimodal_to.solving.solver import Solver, StartPoint
from multimodal_to.solving.stages import KeptStages
from multimodal_to.trajectory import Trajectory, rules


class Planner:
    """A problem that is built once and solved again and again, each time from the last answer.

    Only bounds change from solve to solve. The functions, the structure of the linear solver and its memory stay. The
    one exception: a scenario that ends standing is built anew for another `final_com`, since its posture costs pull to
    the posture there.

    A term of your own that reads `final_com`, `initial_com`, `mid_height_min`, `interval_min` or `interval_max` from
    its parameters goes on with those of the scenario that the planner was made with. A planner is for one thread at a
    time.

    Args:
        robot: whose motion it is.
        scenario: the task; with the start `Start.GIVEN` every solve starts in a state of its own.
        formulation: what the problem is made of; by default `Formulation.executable()`.
        solver: what minimises, by default `Ipopt()`.

    Raises:
        ScenarioError: the scenario contradicts itself or does not fit the robot.
        FormulationError: a term does not return what it has to, or is not a number at the start guess.
    """

    @checked
    def __init__(
        self,
        robot: Robot,
        scenario: Scenario,
        formulation: Formulation | None = None,
        solver: Solver | None = None,
    ) -> None:
        scenario = scenario.for_robot(robot)
        self._robot, self._scenario, self._formulation = robot, scenario, formulation
        self._solver = solver or Ipopt()
        self._problem = self._built(scenario, None)
        self._bound_for = scenario
        self._last: Trajectory | None = None
        self._age = 0.0  # of the last answer [s]
        self._kept = KeptStages()
        weakref.finalize(self, self._kept.close)

    @property
    def problem(self) -> Problem:
        """Return the problem as it was solved last."""
        return self._problem

    @checked
    def solve(
        self,
        *,
        initial: State | None = None,
        final_com: Vector3 | None = None,
        mid_height_min: float | None = None,
        interval: tuple[float, float] | None = None,
        elapsed: float = 0.0,
        progress: Progress | None = None,
    ) -> Solution:
        """Solve the problem, from the last answer if there is one, else from the start guess.

        What is left out is as in the scenario of the planner. After a solve without an answer the next one starts from
        the answer before it, as much later as time has gone on since.

        Args:
            initial: the state of the robot now, where the scenario starts in a given one.
            final_com: where the CoM ends, in the world [m].
            mid_height_min: least height of the CoM at mid-horizon [m].
            interval: least and greatest Δt [s].
            elapsed: how much time has gone on since the last call [s]: the last answer is taken from there on, and what
                is beyond its end stands still there.
            progress: told of every iteration; it may stop the solve by returning True.

        Raises:
            ScenarioError: the changed scenario contradicts itself, or there is no state for a given start.
            InputError: there is a state for a scenario with another start, or the elapsed time is negative.
            SolverError: the solver could not be run, or its linear solver is not here.
        """
        if not 0.0 <= elapsed < np.inf:
            raise InputError(f"elapsed is {elapsed} s; expected a number of at least zero")
        low, high = interval or (self._scenario.interval_min, self._scenario.interval_max)
        scenario = replace(
            self._scenario,
            final_com=final_com or self._scenario.final_com,
            mid_height_min=self._scenario.mid_height_min if mid_height_min is None else mid_height_min,
            interval_min=low,
            interval_max=high,
        )
        if same_terms(scenario, self._bound_for):
            self._problem = rebind(self._problem, scenario, initial)
        else:
            self._problem = self._built(scenario, initial)
        self._bound_for = scenario
        self._age += elapsed
        point = StartPoint(x=self._problem.guess, kept=self._kept)
        if self._last is not None:
            x = np.clip(shifted(self._problem, self._last, self._age), self._problem.lower, self._problem.upper)
            point = StartPoint(x=x, record={}, kept=self._kept)
        solution = solve_from(self._problem, self._solver, point, progress)
        if solution.feasible:
            self._last, self._age = solution.trajectory, 0.0
        return solution

    def forget(self) -> None:
        """Let the next solve start from the start guess."""
        self._last, self._age = None, 0.0

    def _built(self, scenario: Scenario, initial: State | None) -> Problem:
        if scenario.start is Start.GIVEN and initial is None:
            initial = _at_rest(self._robot if scenario.jets else self._robot.with_jets(()), scenario)
        return build(self._robot, scenario, self._formulation, initial=initial)


def shifted(problem: Problem, trajectory: Trajectory, elapsed: float) -> Array:
    """Return x for an answer of a problem from some time after its start on; beyond its end nothing moves.

    Args:
        problem: whose answer it is.
        trajectory: the answer.
        elapsed: since its start [s].
    """
    columns = np.vstack([getattr(trajectory, name) for name in problem.layout.rows])
    knots, interval = trajectory.knots, trajectory.duration / trajectory.knots
    if elapsed:
        at = np.arange(knots + 1) + elapsed / interval
        before = np.minimum(at.astype(int), knots - 1)
        share = np.minimum(at - before, 1.0)
        columns = (1.0 - share) * columns[:, before] + share * columns[:, before + 1]
        over = at > knots
        for name in rules.VELOCITIES:
            columns[problem.layout.rows[name], over] = 0.0
        turns = problem.layout.rows["base_quaternion_xyzw"]
        columns[turns] /= np.linalg.norm(columns[turns], axis=0)
    return np.append(columns.ravel(order="F"), interval) / problem.scale


def _at_rest(robot: Robot, scenario: Scenario) -> State:
    """Return the home posture at rest, with its CoM where the scenario says; what a planner is built with."""
    home = State.at_rest(robot)
    posture = Posture(
        base_position=home.base_position + np.array(scenario.start_com) - home.com(robot),
        base_quaternion_xyzw=home.base_quaternion_xyzw,
        joint_positions=home.joint_positions,
    )
    return State.at_rest(robot, posture)
