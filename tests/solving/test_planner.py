"""A problem that is built once and solved again and again, and motions that start in a given state."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import multimodal_to as mt
from drones import drone
from multimodal_to.errors import InputError, ScenarioError
from multimodal_to.ocp.rebinding import rebind
from multimodal_to.solving import planner as planners
from multimodal_to.solving.planner import shifted
from multimodal_to.trajectory.derived import at_knots

HIGH = (0.0, 0.0, 0.9)


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    """A body of 20 kg with two turbines, which can turn about y only by pushing its feet: it moves up and down."""
    return drone(tmp_path_factory.mktemp("drone"))


@pytest.fixture(scope="module")
def task():
    """From a state that is given to a hover at 0.9 m, in 2.4 s."""
    return replace(
        mt.scenarios.take_off(),
        name="onwards",
        knots=12,
        start=mt.Start.GIVEN,
        initial_com=HIGH,
        final_com=HIGH,
        interval_min=0.2,
        interval_max=0.2,
        weights=mt.Weights(com_velocity=10.0, thrust_rate=1e-3, throttle_rate=1e-2, com_acceleration=1.0),
        guess_steps=0,
    )


@pytest.fixture(scope="module")
def moving(robot):
    """In the air, sinking at 0.2 m/s, with thrusts that carry the weight and grow."""
    rest = mt.State.at_rest(robot, thrust=np.full(2, robot.weight / 2))
    return replace(
        rest,
        base_position=rest.base_position + np.array(HIGH) - rest.com(robot),
        base_linear_velocity=np.array([0.0, 0.0, -0.2]),
        thrust_rate=np.full(2, 5.0),
    )


@pytest.fixture(scope="module")
def planned(robot, task, moving):
    planner = mt.Planner(robot, task)
    return planner, planner.solve(initial=moving)


@pytest.mark.parametrize("formulation", [mt.Formulation.paper(), mt.Formulation.executable()])
def test_a_motion_starts_in_the_moving_state_that_is_given(robot, task, moving, formulation):
    solution = mt.solve(mt.build(robot, task, formulation, initial=moving))
    assert solution.status is mt.Status.OPTIMAL
    for name in mt.State.__dataclass_fields__:
        assert at_knots(solution.trajectory, name)[:, 0] == pytest.approx(getattr(moving, name), abs=1e-7)
    audit = mt.audit(robot, solution.trajectory)
    if formulation.rule.name == "leapfrog":
        assert audit.holds
    assert not {"start: speed", "start: force balance"} & {finding.name for finding in audit.findings}


def test_a_given_start_is_of_the_order_of_the_rule(robot, task, moving):
    """With half the interval the error of a throttle held from a moving state on falls to a quarter.

    A start of order one, with the velocity of the knot for that of the interval before it, would leave half of it.
    """
    free = replace(
        task,
        terminal=mt.Terminal.FREE,
        weights=mt.Weights(com_velocity=10.0, thrust_rate=1e-2, throttle=1e-2, com_acceleration=1.0),
    )

    def height(knots: int) -> float:
        """Return z of the CoM after 0.2 s with the throttle held at one value."""
        held = mt.Constraint(
            name="held",
            value=lambda knot, parameters: knot.throttle - 60.0,
            within=mt.equal(),
            unit="%",
            holds=(mt.Where.FIRST_KNOT, mt.Where.LATER_KNOTS),
        )
        away = replace(free, knots=knots, interval_min=0.4 / knots, interval_max=0.4 / knots)
        formulation = mt.Formulation.executable().with_terms(held)
        problem = mt.build(robot, away, formulation, initial=moving)
        lower, upper = problem.lower.copy(), problem.upper.copy()
        last = problem.layout.size * knots
        here = problem.layout.rows["com_position"]
        lower[last + here.start : last + here.stop] = -1.5  # the end is found
        upper[last + here.start : last + here.stop] = 1.5
        solution = mt.solve(replace(problem, lower=lower, upper=upper))
        assert solution.status is mt.Status.OPTIMAL
        return float(solution.trajectory.com_position[2, knots // 2])

    exact, coarse, fine = height(64), height(8), height(16)
    assert (coarse - exact) / (fine - exact) == pytest.approx(4.0, rel=0.25)


def test_a_plan_started_anew_is_the_one_that_a_cold_solve_finds(planned, robot, task):
    planner, first = planned
    state = mt.state_at(first.trajectory, 0.2)
    again = planner.solve(initial=state, elapsed=0.2)
    cold = mt.solve(mt.build(robot, task, initial=state))
    assert again.status is mt.Status.OPTIMAL
    assert again.iterations < 0.7 * cold.iterations
    assert again.objective == pytest.approx(cold.objective, rel=1e-3)


def test_only_bounds_change_from_solve_to_solve(robot, task, moving, monkeypatch):
    planner = mt.Planner(robot, task)
    before = planner.problem
    monkeypatch.setattr(planners, "build", None)
    planner.solve(initial=moving)
    other = planner.solve(initial=moving, final_com=(0.0, 0.0, 0.95), interval=(0.21, 0.22))
    assert planner.problem.nlp is before.nlp
    assert other.trajectory.com_position[:, -1] == pytest.approx([0.0, 0.0, 0.95], abs=1e-6)
    assert 0.21 - 1e-6 <= other.trajectory.time[1] <= 0.22 + 1e-6


def test_bounds_are_those_of_a_problem_built_for_the_task(robot, task, moving):
    changed = replace(task, final_com=(0.0, 0.0, 0.92), mid_height_min=0.8, interval_max=0.3)
    rest = mt.State.at_rest(robot)
    once = rebind(mt.build(robot, task, initial=rest), changed, moving)
    anew = mt.build(robot, changed, initial=moving)
    for name in ("lower", "upper", "box_lower", "box_upper", "row_lower", "row_upper"):
        assert np.array_equal(getattr(once, name), getattr(anew, name)), name
    assert once.scenario == anew.scenario


def test_a_planner_finds_what_a_problem_built_anew_has(ironcub):
    """Also where posture costs pull to the end's posture, which is another one for another end."""
    stand = replace(
        mt.scenarios.paper("jump"),
        knots=6,
        mid_height_min=None,
        final_com=(0.0, 0.0, 0.55),
        interval_min=0.1,
        interval_max=0.1,
    )
    paper = mt.Formulation.paper()
    planner = mt.Planner(ironcub, stand, paper)
    planner.solve()
    found = planner.solve(final_com=(0.0, 0.0, 0.545))
    anew = mt.solve(mt.build(ironcub, replace(stand, final_com=(0.0, 0.0, 0.545)), paper))
    assert found.status is mt.Status.OPTIMAL
    assert found.iterations < anew.iterations
    assert found.objective == pytest.approx(anew.objective, rel=1e-4)


def test_what_is_beyond_the_end_stands_still_there(planned):
    planner, solution = planned
    problem, trajectory = planner.problem, solution.trajectory
    same = problem.layout.read_horizon(shifted(problem, trajectory, 0.0) * problem.scale)
    late = problem.layout.read_horizon(shifted(problem, trajectory, 0.5) * problem.scale)
    for name, values in same.items():
        assert np.array_equal(values, getattr(trajectory, name))
    z = trajectory.com_position[2]
    assert late["com_position"][2, :10] == pytest.approx((z[2:12] + z[3:13]) / 2)
    assert late["com_position"][2, 10:] == pytest.approx(np.full(3, z[-1]), abs=1e-3)
    assert not late["base_linear_velocity"][:, -2:].any()


def test_a_planner_gets_back_after_a_solve_without_an_answer(robot, task, moving):
    planner = mt.Planner(robot, task)
    good = planner.solve(initial=moving)
    assert not planner.solve(initial=moving, final_com=(0.0, 0.0, 1.49), interval=(0.06, 0.06)).feasible
    again = planner.solve(initial=moving)
    assert again.status is mt.Status.OPTIMAL
    assert again.objective == pytest.approx(good.objective, rel=1e-3)


def test_a_state_of_a_motion_has_its_velocities_at_the_instant(planned, robot):
    trajectory = planned[1].trajectory
    state = mt.state_at(trajectory, trajectory.time[3])
    mean = (trajectory.base_linear_velocity[:, 3] + trajectory.base_linear_velocity[:, 4]) / 2
    assert state.base_linear_velocity == pytest.approx(mean)
    assert state.com(robot) == pytest.approx(trajectory.com_position[:, 3], abs=1e-6)
    with pytest.raises(InputError, match=r"the time is 9 s; expected 0 to 2\.4 s"):
        mt.state_at(trajectory, 9.0)


def test_a_state_and_a_start_have_to_fit_each_other(robot, task, moving, ironcub):
    with pytest.raises(ScenarioError, match="'onwards' starts in a given state, and none is given"):
        mt.build(robot, task)
    with pytest.raises(ScenarioError, match="none is given"):
        mt.Planner(robot, task).solve()
    with pytest.raises(InputError, match="but 'onwards' starts in 'hover'"):
        mt.build(robot, replace(task, start=mt.Start.HOVER), initial=moving)
    with pytest.raises(InputError, match="the state has 0 joints"):
        mt.build(ironcub, replace(task, initial_com=(0.0, 0.0, 0.57)), initial=moving)
    with pytest.raises(InputError, match="elapsed is -1 s"):
        mt.Planner(robot, task).solve(initial=moving, elapsed=-1)


def test_a_state_refuses_what_is_none(robot):
    rest = mt.State.at_rest(robot)
    with pytest.raises(InputError, match="base_position has the shape"):
        replace(rest, base_position=np.zeros(2))
    with pytest.raises(InputError, match="expected finite numbers"):
        replace(rest, thrust=np.array([0.0, np.nan]))
    with pytest.raises(InputError, match="expected a quaternion"):
        replace(rest, base_quaternion_xyzw=np.zeros(4))
    with pytest.raises(InputError, match="expected as many as thrust"):
        replace(rest, thrust_rate=np.zeros(3))


def test_the_doctor_says_that_a_given_start_needs_a_state(robot, task):
    errors = [finding.found for finding in mt.doctor(robot, task).findings]
    assert any("starts in a given state, and none is given" in error for error in errors)
