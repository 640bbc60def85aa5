"""Keyframes become bounds, rows and costs at their knot, and plans meet them."""

from __future__ import annotations

import math
from dataclasses import replace

import casadi as cs
import numpy as np
import pytest

import multimodal_to as mt
from hopper import heading, hop
from hopper import hopper as make_hopper
from multimodal_to.adam import quaternion
from multimodal_to.errors import FormulationError, ScenarioError
from multimodal_to.models.units import REFERENCE
from multimodal_to.ocp import keyframes
from multimodal_to.ocp.knot import Knot
from multimodal_to.ocp.outline import formulate, prepared
from multimodal_to.ocp.variables import Layout


@pytest.fixture(scope="module")
def hopper(tmp_path_factory):
    return make_hopper(tmp_path_factory.mktemp("hopper"))


def bounds(problem, name):
    """The bounds of a variable in its own unit, (dim, knots + 1) each."""
    return tuple(problem.layout.read_horizon(side * problem.scale)[name] for side in (problem.lower, problem.upper))


def height(knot, parameters):
    return knot.com_position[2]


def squared(knot, parameters):
    return knot.com_position[2] ** 2


def climb(interval, parameters):
    return interval.end.com_position[2] * interval.start.com_position[2]


def with_term(robot, **changes):
    term = mt.Constraint(value=height, within=mt.at_most(9.0), unit="m", **changes)
    return mt.build(robot, hop(robot, knots=6), mt.Formulation.executable().with_terms(term))


# ------------------------------------------------------------------------------------------ terms at chosen knots


def test_a_row_at_chosen_knots_that_is_a_variable_becomes_a_bound_there_only(hopper):
    problem = with_term(hopper, holds=mt.Knots((2, 4)))
    assert "height" not in problem.rows
    _, upper = bounds(problem, "com_position")
    assert np.flatnonzero(upper[2] == 9.0).size == 0  # com_range is tighter
    tight = mt.Constraint(value=height, within=mt.at_most(0.55), unit="m", holds=mt.Knots((2, 4)))
    problem = mt.build(hopper, hop(hopper, knots=6), mt.Formulation.executable().with_terms(tight))
    assert np.flatnonzero(bounds(problem, "com_position")[1][2] == 0.55).tolist() == [2, 4]


def test_a_term_at_chosen_knots_and_intervals_has_rows_there_and_nowhere_else(hopper):
    square = mt.Constraint(value=squared, within=mt.at_most(9.0), unit="m²", holds=mt.Knots((5, 2)))
    product = mt.Constraint(value=climb, within=mt.at_most(9.0), unit="m²", holds=mt.Intervals((3,)))
    cost = mt.Cost(residual=height, weight=3.0, unit="m", charged=mt.Knots((4,)), per_second=False)
    plain = mt.build(hopper, hop(hopper, knots=6))
    problem = mt.build(hopper, hop(hopper, knots=6), mt.Formulation.executable().with_terms(square, product, cost))
    assert problem.rows["squared"].knots.tolist() == [2, 5]
    assert problem.rows["climb"].knots.tolist() == [3]
    assert problem.row_lower.size == plain.row_lower.size + 3
    x = np.random.default_rng(0).normal(size=problem.guess.size)
    z = problem.layout.read_horizon(x * problem.scale)["com_position"][2]
    values = problem.rows_at(x)
    squares, products = problem.rows["squared"], problem.rows["climb"]
    assert values[squares.index] * squares.scale == pytest.approx(z[[2, 5]] ** 2)
    assert values[products.index] * products.scale == pytest.approx([z[2] * z[3]])
    assert problem.costs(x)["height"] == pytest.approx(3.0 * z[4] ** 2)


@pytest.mark.parametrize(
    ("place", "sentence"),
    [
        (lambda: mt.Knots(()), "Knots is of (); expected different whole numbers of at least 0"),
        (lambda: mt.Knots((3, 3)), "Knots is of (3, 3)"),
        (lambda: mt.Intervals((0,)), "Intervals is of (0,); expected different whole numbers of at least 1"),
        (lambda: mt.Knots((1.5,)), "Knots: knots is (1.5,)"),
    ],
)
def test_places_that_do_not_exist_are_refused(place, sentence):
    with pytest.raises(FormulationError) as error:
        place()
    assert sentence in str(error.value)


def test_a_term_beyond_the_last_knot_is_refused(hopper):
    with pytest.raises(FormulationError, match="the term 'height' is at knot 7; expected knots from 0 to 6, the last"):
        with_term(hopper, holds=mt.Knots((7,)))


# ------------------------------------------------------------------------------------------ what is off


def knot_with(robot, **values):
    layout = Layout.of(robot)
    numbers = {name: cs.SX(np.zeros(rows.stop - rows.start)) for name, rows in layout.rows.items()}
    return Knot(robot, **{**numbers, **{name: cs.SX(value) for name, value in values.items()}})


class Only:
    """The parameters that the functions here read."""

    def __init__(self, robot):
        self.robot = robot


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("angle", [-2.9, -0.4, 0.0, 1.2, 3.0])
def test_a_yaw_is_the_turn_about_the_vertical_whatever_the_sign_of_the_quaternion(hopper, angle, sign):
    lean = np.array([0.05, -0.1, 0.0, 1.0])
    tilted = quaternion.product(cs.DM(heading(angle)), cs.DM(lean / np.linalg.norm(lean)))
    off = keyframes.off_yaw(knot_with(hopper, base_quaternion_xyzw=sign * tilted), Only(hopper), asked=0.5)
    expected = math.remainder(angle - 0.5, 2 * math.pi)
    assert float(cs.evalf(off)) == pytest.approx(expected, abs=0.01)  # the lean has a little yaw of its own
    level = knot_with(hopper, base_quaternion_xyzw=sign * heading(angle))
    assert float(cs.evalf(keyframes.off_yaw(level, Only(hopper), asked=0.5))) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("size", [0.0, 1e-6, 0.3, 3.0])
def test_an_orientation_is_off_by_its_rotation_vector(hopper, size):
    vector = size * np.array([0.6, 0.0, 0.8])
    asked = np.array([0.1, 0.7, -0.1, 0.7]) / 1.0
    asked /= np.linalg.norm(asked)
    turned = quaternion.product(cs.DM(asked), quaternion.exp(cs.DM(vector)))
    for sign in (1.0, -1.0):
        off = keyframes.off_orientation(knot_with(hopper, base_quaternion_xyzw=sign * turned), None, tuple(asked))
        assert np.array(cs.evalf(off)).ravel() == pytest.approx(vector, abs=1e-9)
    rotation = cs.SX(quaternion.rotation_matrix(quaternion.exp(cs.DM(vector))))
    assert np.array(cs.evalf(keyframes.rotation_vector(rotation))).ravel() == pytest.approx(vector, abs=1e-9)


def test_the_slopes_of_orientations_are_finite_where_nothing_is_off(hopper):
    rho = cs.SX.sym("rho", 4)
    knot = replace(knot_with(hopper), base_quaternion_xyzw=rho)
    for off in (
        keyframes.off_orientation(knot, None, (0.0, 0.0, 0.0, 1.0)),
        keyframes.off_yaw(knot, Only(hopper), 0.0),
        keyframes.off_frame_orientation(knot, None, "body", (0.0, 0.0, 0.0, 1.0)),
    ):
        hessians = [cs.hessian(off[row], rho)[0] for row in range(off.shape[0])]
        slopes = cs.Function("slopes", [rho], [cs.jacobian(off, rho), *hessians])
        assert all(np.isfinite(np.array(part)).all() for part in slopes([0.0, 0.0, 0.0, 1.0]))


# ------------------------------------------------------------------------------------------ in a problem


ASKED = {
    "com": (mt.Keyframe(knot=3, com={"z": 0.5}), "com_position", 2, 0.5, 0.5),
    "com_min": (mt.Keyframe(knot=3, com_min={"z": 0.5}), "com_position", 2, 0.5, 1.5 * 0.4 / REFERENCE.length),
    "base_position": (mt.Keyframe(when=0.5, base_position={"x": 0.1}), "base_position", 0, 0.1, 0.1),
    "joints": (
        mt.Keyframe(knot=3, joints={"left_pitch": 0.2}, joint_tolerance=0.05),
        "joint_positions",
        0,
        0.15,
        0.25,
    ),
    "momentum": (
        mt.Keyframe(when="end", momentum=mt.Momentum(angular={"z": 0.3})),
        "angular_momentum",
        2,
        0.3,
        0.3,
    ),
}


@pytest.mark.parametrize("kind", ASKED)
def test_what_is_asked_of_a_variable_is_a_bound_at_the_knot(hopper, kind):
    keyframe, variable, row, low, high = ASKED[kind]
    task = hop(hopper, knots=6, terminal=mt.Terminal.FREE)
    plain, problem = mt.build(hopper, task), mt.build(hopper, replace(task, keyframes=(keyframe,)))
    assert problem.row_lower.size == plain.row_lower.size
    lower, upper = bounds(problem, variable)
    knot = keyframe.at(6)
    assert (lower[row, knot], upper[row, knot]) == pytest.approx((low, high))
    before = np.array(bounds(plain, variable))
    others = [index for index in range(7) if index != knot]
    assert np.array_equal(np.array([lower, upper])[..., others], before[..., others])


def test_what_is_beyond_a_range_is_refused_by_the_name_of_the_keyframe(hopper):
    task = hop(hopper, knots=6, keyframes=(mt.Keyframe(knot=3, joints={"left_pitch": 1.5}),))
    sentence = r"left_pitch has to be 1\.5 at knot 3 for 'keyframe 1: joints', outside its range -0\.8 to 0\.8"
    with pytest.raises(ScenarioError, match=sentence):
        mt.build(hopper, task)


def test_keyframes_in_a_flight_are_met_by_the_structured_solver(hopper):
    asked = (
        mt.Keyframe(knot=26, com_min={"z": 0.55}, yaw=0.0, orientation_tolerance=0.02),
        mt.Keyframe(knot=23, frames={"front_left": mt.FrameTarget(position={"z": 0.04}, position_tolerance=0.002)}),
        mt.Keyframe(when="end", joints={"left_pitch": 0.02}, weight=1e3),
    )
    problem = mt.build(hopper, hop(hopper, keyframes=asked))
    solution = mt.solve(problem, mt.Ipopt(linear_solver="stages"))
    assert solution.status.solved
    assert solution.statistics["linear_solver"] == "stages"
    assert problem.nlp.taped
    motion = solution.trajectory
    assert motion.com_position[2, 26] >= 0.55 - 1e-8
    foot = motion.per_contact("contact_positions")[hopper.contact_names.index("front_left")]
    assert foot[2, 23] == pytest.approx(0.04, abs=0.0021)
    assert solution.costs["keyframe 3: joints"] > 0.0


def test_a_hover_on_the_way_is_at_rest_on_thrust_alone(hopper):
    asked = mt.Keyframe(knot=25, com={"z": 0.5}, hover=True)
    solution = mt.solve(mt.build(hopper, hop(hopper, knots=36, keyframes=(asked,))))
    motion = solution.trajectory
    assert solution.status.solved
    for name in ("base_linear_velocity", "base_angular_velocity", "joint_velocities"):
        assert np.abs(getattr(motion, name)[:, 25]).max() < 1e-8
    assert motion.com_velocity[:, 26] == pytest.approx(np.zeros(3), abs=1e-8)  # no acceleration there
    assert np.abs(motion.contact_forces[:, 25]).max() < 0.011
    assert motion.thrust[:, 25].sum() == pytest.approx(hopper.weight, rel=1e-3)


# ------------------------------------------------------------------------------------------ short names


def said_by_keyframes(scenario):
    """The scenario with keyframes in place of the short names."""
    start = {mt.Start.HOVER: {"hover": True}, mt.Start.STANDING: {"standing": True}}[scenario.start]
    end = {mt.Terminal.HOVER: {"hover": True}, mt.Terminal.STANDING: {"standing": True}}[scenario.terminal]
    asked = [mt.Keyframe(when="start", com=scenario.initial_com, **start)]
    if scenario.mid_height_min is not None:
        asked.append(mt.Keyframe(knot=scenario.knots // 2, com_min={"z": scenario.mid_height_min}))
    asked.append(mt.Keyframe(when="end", com=scenario.final_com, **end))
    nothing = dict.fromkeys(("start", "terminal", "initial_com", "final_com", "mid_height_min"))
    return replace(scenario, keyframes=tuple(asked), **nothing)


@pytest.mark.parametrize("name", mt.scenarios.SCENARIOS)
def test_a_bundled_scenario_said_by_keyframes_is_the_same_problem(ironcub, name):
    scenario = mt.scenarios.find(name)
    said = said_by_keyframes(scenario)
    assert (said.start, said.terminal) == (scenario.start, scenario.terminal)
    robot, standing = prepared(ironcub, scenario)
    one, other = (formulate(robot, some, standing, mt.Formulation.executable()) for some in (scenario, said))
    for side in ("lower", "upper"):
        for variable, values in getattr(one.bounds, side).items():
            assert np.array_equal(values, getattr(other.bounds, side)[variable]), variable
    rows = [
        [(name, len(some.components)) for stage in each.stages for name, some in stage.rows] for each in (one, other)
    ]
    assert rows[0] == rows[1]


def test_the_take_off_said_by_keyframes_has_the_same_answer(ironcub, take_off):
    again = mt.solve(mt.build(ironcub, said_by_keyframes(mt.scenarios.take_off())))
    assert (again.iterations, again.objective) == (take_off.iterations, take_off.objective)


def test_an_end_that_only_asks_for_a_height_finds_where_it_hovers(hopper):
    end = mt.Keyframe(when="end", com={"z": 0.6}, hover=True)
    task = replace(hop(hopper, allowances={"throttle rate": 1e3}), terminal=None, final_com=None, keyframes=(end,))
    assert task.terminal is mt.Terminal.HOVER
    assert not mt.doctor(hopper, task).hopeless
    solution = mt.solve(mt.build(hopper, task))
    assert solution.status.solved
    assert solution.trajectory.com_position[2, -1] == pytest.approx(0.6, abs=1e-8)
    report = mt.audit(hopper, solution.trajectory)
    assert report.holds
    assert "end: CoM" not in {finding.name for finding in report.findings}


def test_a_planner_keeps_the_keyframes_on_the_way_to_another_end(hopper):
    on_the_way = mt.Keyframe(knot=24, com_min={"z": 0.55})
    planner = mt.Planner(hopper, hop(hopper, keyframes=(on_the_way,)))
    solution = planner.solve(final_com=(0.0, 0.0, 0.62))
    assert solution.status.solved
    assert solution.trajectory.com_position[:, -1] == pytest.approx([0.0, 0.0, 0.62], abs=1e-8)
    assert solution.trajectory.com_position[2, 24] >= 0.55 - 1e-8
    held = planner.problem.bound_rows["end: CoM"]
    assert held.lower * held.scale == pytest.approx([0.0, 0.0, 0.62])


def test_a_turn_of_a_hover_is_guessed_and_made(hopper):
    task = hop(
        hopper,
        start=mt.Start.HOVER,
        initial_com=(0.0, 0.0, 0.6),
        keyframes=(mt.Keyframe(when="end", yaw=0.5),),
    )
    problem = mt.build(hopper, task)
    first, last = (
        problem.layout.read_horizon(problem.guess * problem.scale)["base_quaternion_xyzw"][:, k] for k in (0, -1)
    )
    assert abs(first @ last) == pytest.approx(np.cos(0.25), abs=1e-6)
    solution = mt.solve(problem)
    assert solution.status.solved
    assert mt.audit(hopper, solution.trajectory).holds
    end = solution.trajectory.base_quaternion_xyzw[:, -1]
    assert abs(end @ heading(0.5)) == pytest.approx(1.0, abs=1e-6)


def test_weight_stays_off_feet_in_the_air_between_two_hovers(hopper):
    task = hop(
        hopper,
        start=mt.Start.HOVER,
        initial_com=(0.0, 0.0, 0.6),
        final_com=(0.0, 0.5, 0.6),
        keyframes=(mt.Keyframe(when=0.5, com={"z": 0.7}, hover=True),),
    )
    problem = mt.build(hopper, task)
    guess = problem.layout.read_horizon(problem.guess * problem.scale)
    assert np.abs(guess["contact_forces"]).max() < 0.011
    assert guess["thrust"].sum(axis=0) == pytest.approx(np.full(31, hopper.weight))
    assert guess["com_position"][2, 15] == pytest.approx(0.7)
    assert mt.solve(problem).status.solved
