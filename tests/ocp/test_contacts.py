"""Contacts that are given: rows leave the problem, forces and heights are held, and feet are where they are given."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import multimodal_to as mt
from hopper import hopper
from multimodal_to.errors import ScenarioError
from multimodal_to.ocp.guess import contact_positions
from multimodal_to.ocp.schedule import Schedule, knots_of, runs
from multimodal_to.trajectory import rules
from multimodal_to.trajectory.derived import surface_frames
from solo import LEGS, solo
from trots import trot

ON, OFF, FREE = mt.ContactState.ON, mt.ContactState.OFF, mt.ContactState.FREE


def given(of, state, begin=0.0, end=1.0, **more):
    return mt.ContactStretch(of=of, state=state, begin=begin, end=end, **more)


@pytest.fixture(scope="module")
def dog(tmp_path_factory):
    return solo(tmp_path_factory.mktemp("solo"))


@pytest.fixture(scope="module")
def trotting(dog):
    return mt.build(dog, trot(dog))


@pytest.fixture(scope="module")
def trotted(trotting):
    return mt.solve(trotting, mt.Ipopt(linear_solver="stages"))


# ------------------------------------------------------------------------------------- when a point bears force


SWING = (given("FL", ON, 0.0, 0.4), given("FL", OFF, 0.4, 0.7, clearance=0.02), given("FL", ON, 0.7))


def test_under_leapfrog_a_point_bears_force_from_one_knot_after_it_lands_to_one_before_it_leaves(dog):
    schedule = Schedule.of(dog, trot(dog, knots=10, gait=None, contacts=SWING))
    assert runs(schedule.unloaded[0]) == [(4, 7)]
    assert runs(schedule.stands[0]) == [(0, 4), (7, 10)]
    assert runs(schedule.on[0]) == [(1, 4), (8, 10)]  # over the intervals that end there
    assert not schedule.given[1:].any()


def test_by_backward_euler_a_force_acts_until_its_knot_so_that_a_point_still_bears_it_as_it_leaves(dog):
    schedule = Schedule.of(dog, trot(dog, knots=10, gait=None, contacts=SWING), rules.BACKWARD_EULER)
    assert runs(schedule.unloaded[0]) == [(5, 7)]
    assert runs(schedule.stands[0]) == [(0, 4), (7, 10)]


def test_a_point_that_is_off_from_the_start_or_to_the_end_bears_nothing_there(dog):
    for rule in (rules.LEAPFROG, rules.BACKWARD_EULER):
        schedule = Schedule.of(dog, trot(dog, knots=10, gait=None, contacts=(given("FL", OFF, 0.0, 0.5),)), rule)
        assert runs(schedule.unloaded[0]) == [(0, 5)]
    schedule = Schedule.of(dog, trot(dog, knots=10, gait=None, contacts=(given("FL", OFF, 0.5),)))
    assert runs(schedule.unloaded[0]) == [(5, 10)]


def test_the_clearance_is_asked_for_in_the_middle_of_a_swing(dog):
    schedule = Schedule.of(dog, trot(dog, knots=10, gait=None, contacts=SWING))
    assert np.flatnonzero(schedule.clearance[0]).tolist() == [5]
    assert schedule.clearance[0, 5] == 0.02


def test_a_foot_means_all_of_its_points_and_a_point_itself_alone(ironcub):
    scenario = replace(mt.scenarios.take_off(), contacts=(given(["left", "r_sole_2"], ON, 0.0, 0.5),))
    on = Schedule.of(ironcub, scenario).on.any(axis=1)
    assert [name for name, flag in zip(ironcub.contact_names, on, strict=True) if flag] == [
        *(f"l_sole_{index}" for index in (1, 2, 3, 4)),
        "r_sole_2",
    ]


def test_contacts_hold_in_place_of_the_gait_and_free_takes_back(dog):
    free = trot(dog, contacts=(given("FL", FREE, 0.3, 0.6), given("HR", ON)))
    schedule = Schedule.of(dog, free)
    first, last = knots_of(given("FL", FREE, 0.3, 0.6), free.knots)
    assert not schedule.given[0, first + 1 : last + 1].any()
    assert schedule.on[LEGS.index("HR"), 1:].all()
    assert not schedule.clearance[LEGS.index("HR")].any()


# ------------------------------------------------------------------------------------- rows


FOUND = ("complementarity", "complementarity_before", "complementarity_after", "sliding", "sliding_after")


def test_where_all_contacts_are_given_no_row_is_left_that_finds_them(trotting, dog):
    found = mt.build(dog, trot(dog, gait=None))
    assert not set(FOUND) & set(trotting.rows)
    assert set(FOUND) < set(found.rows)
    assert trotting.row_lower.size < 0.8 * found.row_lower.size


def test_a_force_that_is_given_to_be_zero_and_a_height_on_flat_ground_are_bounds(trotting):
    assert "given_off" not in trotting.rows
    schedule = Schedule.of(trotting.robot, trotting.scenario)
    bounds = [trotting.layout.read_horizon(side * trotting.scale) for side in (trotting.lower, trotting.upper)]
    for side in bounds:
        forces = side["contact_forces"].reshape(4, 3, -1)
        assert (np.abs(forces).transpose(0, 2, 1)[schedule.unloaded] == 0.0).all()
        heights = side["contact_positions"].reshape(4, 3, -1)[:, 2, 1:]
        assert heights[schedule.stands[:, 1:]] == pytest.approx(0.0, abs=1.1e-5)


def test_a_point_that_stands_since_the_start_keeps_the_height_it_starts_with(trotting):
    stands = Schedule.of(trotting.robot, trotting.scenario).stands
    since_start = np.logical_and.accumulate(stands, axis=1)[:, 1:]
    start = contact_positions(trotting.robot, trotting.parameters.standing)[2::3]
    assert start.min() > 0.0
    for side in (trotting.lower, trotting.upper):
        heights = trotting.layout.read_horizon(side * trotting.scale)["contact_positions"].reshape(4, 3, -1)[:, 2, 1:]
        for point in range(4):
            assert heights[point][since_start[point]] == pytest.approx(start[point], rel=1e-6)
        assert heights[stands[:, 1:] & ~since_start].min() > 2 * start.max()  # where it comes down later


def test_rigid_legs_stand_where_they_start_until_they_leave(tmp_path):
    """Any other height of their feet contradicts the balance of the start, from which the CoM has no speed."""
    robot = hopper(tmp_path)
    solution = mt.solve(mt.build(robot, mt.tasks.take_off(robot)), mt.Ipopt(max_iterations=100))
    assert solution.status is mt.Status.OPTIMAL
    assert mt.audit(robot, solution.trajectory).holds


def test_rows_of_a_point_that_is_found_stay_where_it_is_found(dog):
    scenario = trot(dog, contacts=(given("FL", FREE),))
    problem = mt.build(dog, scenario)
    for name in FOUND[:3]:
        assert set(problem.rows[name].components) == {"FL_FOOT"}
        assert problem.rows[name].knots.size == scenario.knots
    assert not np.isin(problem.rows["given_in_place"].components, ["FL_FOOT x", "FL_FOOT y"]).any()


@pytest.mark.parametrize("formulation", [mt.Formulation.executable(), mt.Formulation.paper()])
def test_every_row_says_its_knot_whatever_stage_it_is_in(dog, formulation):
    """A height of one point at one knot moves rows of that knot and its neighbours alone."""
    problem = mt.build(dog, trot(dog, knots=20), formulation)
    knots = np.full(problem.row_lower.size, -1)
    for rows in problem.rows.values():
        assert (knots[rows.index] == -1).all()  # no row twice
        knots[rows.index] = rows.knots
    assert (knots >= 0).all()
    x, place = problem.guess.copy(), problem.layout.rows["contact_positions"].start + 2 + 9 * problem.layout.size
    before = problem.rows_at(x)
    x[place] += 0.01
    moved = np.unique(knots[np.abs(problem.rows_at(x) - before) > 1e-12])
    assert set(moved) <= {9, 10}
    assert 9 in moved


# ------------------------------------------------------------------------------------- answers


def test_a_trot_that_is_given_solves_in_few_iterations_and_is_true(trotted, dog):
    assert trotted.status is mt.Status.OPTIMAL
    assert trotted.iterations < 80
    assert mt.audit(dog, trotted.trajectory, trot(dog)).holds


def test_the_structured_linear_solver_takes_the_problem(trotted):
    assert trotted.statistics["linear_solver"] == "stages"


def test_feet_of_the_trot_bear_nothing_in_the_air_are_high_enough_and_do_not_slip(trotted, trotting):
    schedule, motion = Schedule.of(trotting.robot, trotting.scenario), trotted.trajectory
    forces = motion.per_contact("contact_forces")
    points = motion.per_contact("contact_positions").transpose(0, 2, 1)
    heights = surface_frames(trotting.scenario.surface, points)[0]
    assert np.abs(forces.transpose(0, 2, 1)[schedule.unloaded]).max() == 0.0
    assert (heights >= schedule.clearance - 1e-6).all()
    slips = np.linalg.norm(np.diff(points[..., :2], axis=1), axis=2)
    assert slips[schedule.on[:, 1:]].max() < 2e-5
    assert np.abs(heights[schedule.stands]).max() < 2e-5


# ------------------------------------------------------------------------------------- what is refused


@pytest.mark.parametrize(
    ("contacts", "says"),
    [
        ((given("tail", ON),), "unknown foot or contact point 'tail'"),
        ((given("FL", ON, 0.0, 0.5), given("FL_FOOT", OFF, 0.4, 0.8)), "says the opposite"),
        ((given("FL", ON, 0.5, 0.501),), "shorter than an interval"),
    ],
)
def test_contacts_that_make_no_sense_for_a_robot_are_refused(dog, contacts, says):
    with pytest.raises(ScenarioError, match=says):
        mt.build(dog, trot(dog, gait=None, contacts=contacts))


@pytest.mark.parametrize(
    ("fields", "says"),
    [
        ({"of": (), "state": ON}, "'of' is empty"),
        ({"of": "FL", "state": ON, "begin": 0.5, "end": 0.5}, "expected a begin before the end"),
        ({"of": "FL", "state": ON, "begin": -0.1}, "begin is -0.1; expected a share from 0 to 1"),
        ({"of": "FL", "state": OFF, "clearance": -1.0}, "clearance is -1.0"),
        ({"of": "FL", "state": ON, "clearance": 0.1}, "asks for a foot that is off"),
    ],
)
def test_a_stretch_that_makes_no_sense_is_refused(fields, says):
    with pytest.raises(ScenarioError, match=says):
        mt.ContactStretch(**fields)


# ------------------------------------------------------------------------------------- solved again, and explained


def test_a_planner_solves_a_trot_with_another_end_from_the_last_answer(dog):
    scenario = trot(dog, terminal=mt.Terminal.FREE)
    planner = mt.Planner(dog, scenario)
    first = planner.solve()
    x, y, z = scenario.final_com
    again = planner.solve(final_com=(x - 0.05, y, z))
    assert first.feasible
    assert again.feasible
    assert again.iterations < first.iterations
    assert again.trajectory.com_position[0, -1] == pytest.approx(x - 0.05, abs=1e-6)
    assert "given_off" in planner.problem.bound_rows
    unloaded = Schedule.of(dog, scenario).unloaded
    assert np.abs(again.trajectory.per_contact("contact_forces").transpose(0, 2, 1)[unloaded]).max() == 0.0


def test_an_answer_is_a_warm_start_for_the_same_contacts(trotted, trotting):
    again = mt.solve(trotting, start=trotted.trajectory)
    assert again.status is mt.Status.OPTIMAL
    assert again.objective == pytest.approx(trotted.objective, rel=1e-3)


def test_what_gives_way_names_what_was_given(dog):
    """A flight that the speed of the base does not allow: feet that have to stay up give way, or what holds it up."""
    scenario = trot(dog, knots=20, gait=None, interval_min=0.05, interval_max=0.05, base_speed_max=0.5)
    hop = replace(
        scenario, contacts=(given(LEGS, OFF, 0.25, 0.75), given(LEGS, ON, 0.0, 0.25)), final_com=scenario.initial_com
    )
    relaxed = mt.relax(mt.build(dog, hop))
    assert relaxed.status.solved
    names = [term.name for term in relaxed.gives_way]
    assert names[0] == "given_off"
    assert set(names) <= {"given_off", "end: CoM", "touch_down", "joint_torques"}  # and no physics


@pytest.mark.parametrize("stretch", [(0.2, 0.9), (0.8, 1.0)], ids=["for too long", "at a standing end"])
def test_feet_that_are_off_where_they_have_to_carry_the_robot_are_what_gives_way(dog, stretch):
    scenario = trot(dog, knots=20, gait=None, interval_min=0.05, interval_max=0.05)
    off = replace(scenario, contacts=(given(LEGS, OFF, *stretch),), final_com=scenario.initial_com)
    relaxed = mt.relax(mt.build(dog, off))
    assert relaxed.status.solved
    assert [term.name for term in relaxed.gives_way] == ["given_off"]


# ------------------------------------------------------------------------------------- gaits and their start guess


@pytest.mark.parametrize(
    ("kind", "swings"),
    [
        (mt.GaitKind.TROT, [{"FL", "HR"}, {"FR", "HL"}]),
        (mt.GaitKind.BOUND, [{"FL", "FR"}, {"HL", "HR"}]),
        (mt.GaitKind.JUMP, [set(LEGS)]),
        (mt.GaitKind.WALK, [{"HL"}, {"FL"}, {"HR"}, {"FR"}]),
    ],
)
def test_a_gait_lifts_its_feet_together_and_all_others_stand(dog, kind, swings):
    plan = mt.GaitPlan(kind=kind, steps=len(swings), begin=0.2, end=0.8, clearance=0.02)
    schedule = Schedule.of(dog, trot(dog, gait=plan))
    together = [{LEGS[foot] for foot in np.flatnonzero(column)} for column in schedule.unloaded.T]
    assert [feet for feet, before in zip(together[1:], together, strict=False) if feet and feet != before] == swings
    assert not schedule.unloaded[:, 0].any()
    assert (schedule.stands | schedule.unloaded).all()


def test_the_guess_of_a_flight_that_is_given_is_on_a_ballistic_arc(dog):
    """Between lift-off and landing, t apart, the CoM rises by g t² / 8 over the straight way."""
    leap = trot(dog, gait=mt.GaitPlan(kind=mt.GaitKind.JUMP, steps=1, begin=0.4, end=0.6, swing=1.0, clearance=0.0))
    problem = mt.build(dog, leap)
    guess = problem.layout.read_horizon(problem.guess * problem.scale)
    height, step = guess["com_position"][2], leap.interval_max
    air = np.flatnonzero(Schedule.of(dog, leap).in_air)
    falls = np.diff(height[air], 2) / step**2
    assert falls == pytest.approx(np.full(falls.size, -np.linalg.norm(dog.gravity)), rel=1e-6)
    time = (air[-1] - air[0] + 1) * step
    assert height.max() - height[0] == pytest.approx(np.linalg.norm(dog.gravity) * time**2 / 8, rel=0.02)
    assert np.abs(guess["contact_forces"][:, air]).max() < 0.01 * dog.weight
