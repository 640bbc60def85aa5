"""Terms of a user's own hold, are named in every report, and say in a sentence what is wrong with them."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace

import casadi as cs
import numpy as np
import pytest

import multimodal_to as mt
from drones import HOP, drone
from multimodal_to.errors import FormulationError
from multimodal_to.ocp import BackwardEuler, Variable, margins, paper
from multimodal_to.ocp.knot import VARIABLE_NAMES
from multimodal_to.trajectory.derived import frame_poses

SQUAT = replace(
    mt.scenarios.take_off(),
    name="squat",
    knots=6,
    interval_max=0.2,
    final_com=(0.0, 0.0, 0.54),
    terminal=mt.Terminal.STANDING,
    jets=False,
)
PAPER = mt.Formulation.paper()


def slow_turns(knot, parameters):
    """ω."""
    return knot.base_angular_velocity


def elbow_height(knot, parameters):
    """z of the left elbow."""
    return knot.pose("l_elbow_1").translation[2]


def left_of_wall(knot, parameters):
    """y of the CoM."""
    return knot.com_position[1]


def gentle_force(interval, parameters):
    """ḟ."""
    return interval.rate(lambda knot: knot.contact_forces)


TURNS = mt.Cost(residual=slow_turns, weight=1e6, unit="rad/s")
ELBOW = mt.Constraint(value=elbow_height, within=mt.at_least(0.58), unit="m")
WALL = mt.Constraint(value=left_of_wall, within=mt.at_least(0.0), unit="m", holds=mt.Where.LATER_KNOTS)
GENTLE = mt.Constraint(
    value=gentle_force, within=mt.between(-250.0, 250.0), unit="N/s", scale=500.0, holds=mt.Where.EVERY_INTERVAL
)


@pytest.fixture(scope="module")
def plain(ironcub):
    return mt.solve(mt.build(ironcub, SQUAT, PAPER))


@pytest.fixture(scope="module")
def problem(ironcub):
    return mt.build(ironcub, SQUAT, PAPER.with_terms(TURNS, ELBOW, WALL, GENTLE))


@pytest.fixture(scope="module")
def solution(problem):
    return mt.solve(problem)


def height_of_elbow(robot, trajectory):
    return frame_poses(robot, trajectory, "l_elbow_1")[:, 2, 3]


# -------------------------------------------------------------------- what they do


def test_own_constraints_hold_where_they_did_not_before(problem, plain, solution):
    assert solution.status is mt.Status.OPTIMAL
    before, after = (height_of_elbow(problem.robot, some.trajectory)[1:].min() for some in (plain, solution))
    assert before < 0.57
    assert after > 0.58 - 1e-6
    assert plain.trajectory.com_position[1, 1:].min() < -4e-6
    assert solution.trajectory.com_position[1, 1:].min() > -1e-8
    steepest = [np.abs(some.trajectory.contact_force_rates[:, 1:]).max() for some in (plain, solution)]
    assert steepest[0] > 300.0
    assert steepest[1] < 250.0 + 1e-3


def test_an_own_cost_makes_what_it_weighs_smaller_and_has_its_share_in_the_report(ironcub, plain):
    charged = mt.solve(mt.build(ironcub, SQUAT, PAPER.with_terms(TURNS)))
    turned = [float(np.sum(some.trajectory.base_angular_velocity**2)) for some in (plain, charged)]
    assert turned[1] < 0.5 * turned[0]
    dt = charged.trajectory.duration / SQUAT.knots
    assert charged.costs["slow_turns"] == pytest.approx(1e6 * dt * turned[1], rel=1e-9)
    assert sum(charged.costs.values()) == pytest.approx(charged.objective)


def test_the_derivatives_with_own_terms_are_exact(problem):
    rng = np.random.default_rng(3)
    x = problem.guess + 0.1 * rng.normal(size=problem.guess.size)
    along, multipliers = rng.normal(size=x.size), cs.DM(rng.normal(size=problem.row_lower.size))
    ends = [x - 1e-6 * along, x + 1e-6 * along]
    before, after = (np.array(problem.nlp.rows(end)).ravel() for end in ends)
    moved = np.array(problem.nlp.jacobian(x, [])[1] @ cs.DM(along)).ravel()
    assert moved == pytest.approx((after - before) / 2e-6, rel=1e-5, abs=1e-4)

    def slope(at):
        curved = problem.nlp.jacobian(at, [])[1].T @ multipliers
        return np.array(0.3 * problem.nlp.gradient(at, [])[1] + curved).ravel()

    bent = np.array(cs.triu2symm(problem.nlp.hessian(x, [], 0.3, multipliers)) @ cs.DM(along)).ravel()
    expected = (slope(ends[1]) - slope(ends[0])) / 2e-6
    assert np.abs(bent - expected).max() < 1e-5 * np.abs(expected).max()


def test_a_row_of_one_variable_is_a_bound_and_keeps_its_name(problem):
    """The wall is y ≥ 0 of the CoM: no row of g, and still in every report by its own name."""
    assert "left_of_wall" not in problem.rows
    x = problem.guess.copy()
    x[2 * problem.layout.size + problem.layout.rows["com_position"].start + 1] = -0.25
    assert problem.largest_violations(x)["left_of_wall"] == pytest.approx(0.25)
    assert problem.largest_violations(x)["bounds of com_position"] == 0.0
    assert problem.unit("left_of_wall") == "m"
    assert problem.scaled_violation(x, problem.rows_at(x)) >= 0.25


def test_a_slope_and_a_constant_of_such_a_row_are_undone(ironcub):
    """5 − 2 y ≤ 4 says that y is at least ½."""
    term = mt.Constraint(
        name="bent", value=lambda knot, _: 5.0 - 2.0 * knot.com_position[1], within=mt.at_most(4.0), unit="m"
    )
    problem = mt.build(ironcub, replace(SQUAT, terminal=mt.Terminal.FREE, final_com=(0, 0.6, 0.54)), _plus(term))
    lower = problem.layout.read_horizon(problem.lower * problem.scale)["com_position"]
    assert lower[1, 1:-1] == pytest.approx(0.5)
    x = problem.guess.copy()
    x[problem.layout.size + problem.layout.rows["com_position"].start + 1] = 0.4
    assert problem.largest_violations(x)["bent"] == pytest.approx(0.2)


def test_a_term_holds_where_it_says(ironcub):
    knots = {}
    for where in mt.Where:
        value = (lambda at, _: at.duration**2) if where.of_intervals else (lambda at, _: cs.sumsqr(at.contact_forces))
        term = mt.Constraint(name="here", value=value, within=mt.at_least(0.0), unit="1", holds=where)
        knots[where] = np.unique(mt.build(ironcub, SQUAT, _plus(term)).rows["here"].knots).tolist()
    later = [1, 2, 3, 4, 5, 6]
    assert knots == {
        mt.Where.FIRST_KNOT: [0],
        mt.Where.LATER_KNOTS: later,
        mt.Where.EVERY_KNOT: later,
        mt.Where.LAST_KNOT: [6],
        mt.Where.EVERY_INTERVAL: later,
        mt.Where.FIRST_INTERVAL: [1],
        mt.Where.LAST_INTERVAL: [6],
    }
    air = replace(mt.scenarios.landing(), knots=6)
    everywhere = mt.Constraint(
        name="here", value=lambda knot, _: cs.sumsqr(knot.joint_positions), within=mt.at_least(0.0), unit="1"
    )
    assert np.unique(mt.build(ironcub, air, _plus(everywhere)).rows["here"].knots).tolist() == [0, *later]


def test_costs_are_charged_where_they_say_per_second_or_once(ironcub):
    def one(at, parameters):
        return cs.SX(1.0)

    for where, count in ((mt.Where.FIRST_KNOT, 1), (mt.Where.EVERY_INTERVAL, 6), (mt.Where.LAST_KNOT, 1)):
        for per_second in (True, False):
            cost = mt.Cost(residual=one, weight=3.0, unit="1", charged=where, per_second=per_second)
            problem = mt.build(ironcub, SQUAT, _plus(cost))
            dt = problem.guess[-1] * problem.scale[-1]
            assert problem.costs(problem.guess)["one"] == pytest.approx(3.0 * count * (dt if per_second else 1.0))


def test_a_weight_or_a_limit_may_be_a_function_of_the_parameters(ironcub):
    cost = replace(TURNS, weight=lambda parameters: np.array([1.0, 2.0, 3.0]) * parameters.robot.mass)
    limit = replace(ELBOW, within=mt.at_least(lambda parameters: -parameters.scenario.initial_com[2]))
    problem = mt.build(ironcub, SQUAT, _plus(cost, limit))
    x = problem.guess.copy()
    first = problem.layout.size + problem.layout.rows["base_angular_velocity"].start
    x[first : first + 3] = [1.0, 1.0, 1.0]
    dt = x[-1] * problem.scale[-1]
    assert problem.costs(x)["slow_turns"] == pytest.approx(6.0 * ironcub.mass * dt)
    assert problem.row_lower[problem.rows["elbow_height"].index] == pytest.approx(-0.57)


# -------------------------------------------------------------------- what follows them


def test_a_violated_term_is_named_with_its_knot_row_amount_and_unit(ironcub):
    high = replace(ELBOW, within=mt.at_least(1.5))
    ended = mt.solve(mt.build(ironcub, SQUAT, _plus(high)), mt.Ipopt(max_iterations=25))
    named = {some.name: some for some in ended.unmet}["elbow_height"]
    lowest = height_of_elbow(ironcub, ended.trajectory)[named.knot]
    assert named.amount == pytest.approx(1.5 - lowest, abs=1e-2)
    assert str(named).startswith(f"elbow_height at knot {named.knot}, by ")
    assert named.unit == "m"


def test_a_row_that_asks_for_the_impossible_gives_way_by_its_name(ironcub):
    short = replace(SQUAT, knots=4, interval_min=0.05, interval_max=0.05)
    high = mt.build(ironcub, short, _plus(replace(ELBOW, within=mt.at_least(1.5))))
    (found,) = mt.relax(high, terms=["elbow_height"]).gives_way
    assert found.name == "elbow_height"
    assert 0.5 < found.amount < 1.0


def test_a_bound_that_contradicts_the_end_is_named(ironcub):
    """The CoM ends at y = 0, which is not left of a wall at 0.2 m."""
    with pytest.raises(FormulationError, match="the term 'left_of_wall' contradicts the start or the end: com_posi"):
        mt.build(ironcub, SQUAT, _plus(replace(WALL, within=mt.at_least(0.2))))


def test_a_bound_that_contradicts_other_rows_gives_way_by_its_name(ironcub):
    """Feet that may not slip, and a wall for the contact points that is beyond them."""
    wall = mt.Constraint(
        name="feet_left_of_wall",
        value=lambda knot, _: knot.points[0][1],
        within=mt.at_least(0.4),
        unit="m",
        holds=mt.Where.LATER_KNOTS,
    )
    problem = mt.build(ironcub, replace(SQUAT, knots=4), _plus(wall))
    assert set(problem.bound_rows) >= {"feet_left_of_wall"}
    relaxation = mt.relax(problem, terms=["feet_left_of_wall"])
    assert relaxation.status is mt.Status.OPTIMAL
    (found,) = relaxation.gives_way
    assert (found.name, found.violated, found.unit) == ("feet_left_of_wall", 4, "m")
    y = relaxation.trajectory.per_contact("contact_positions")[0, 1, found.knot]
    assert found.amount == pytest.approx(0.4 - y, abs=1e-4)


def test_the_file_keeps_the_names_of_own_terms_and_a_reader_says_them(problem, solution, tmp_path):
    loaded = mt.Trajectory.load(solution.trajectory.save(tmp_path / "own.npz"))
    record = loaded.solve_record()
    own = ["slow_turns", "elbow_height", "left_of_wall", "gentle_force"]
    assert record["formulation"] == {"rule": "backward Euler", "own_terms": own, "left_out": []}
    assert {"elbow_height", "left_of_wall", "gentle_force"} <= set(record["violations"])
    assert record["costs"]["slow_turns"] == pytest.approx(solution.costs["slow_turns"])
    assert loaded.unusual_formulation() == f"terms of its own: {', '.join(own)}"


def test_the_papers_problem_is_nothing_unusual(plain):
    assert plain.trajectory.unusual_formulation() == ""


@pytest.mark.parametrize("spoiled", ['"odd"', "[1, 2]", '{"own_terms": 3}', '{"own_terms": [], "rule": 4}'])
def test_a_record_that_says_nonsense_of_its_formulation_is_read_all_the_same(plain, spoiled):
    odd = replace(plain.trajectory, solve_json=json.dumps({"formulation": json.loads(spoiled)}))
    assert odd.unusual_formulation() == ""


def test_a_solve_with_own_terms_goes_on_from_its_checkpoint(problem, solution, tmp_path):
    path = tmp_path / "checkpoint.npz"
    mt.solve(problem, progress=lambda iterate: path.exists(), checkpoint=path)
    checkpoint = mt.Trajectory.load(path)
    assert checkpoint.solve_record()["formulation"]["own_terms"][0] == "slow_turns"
    resumed = mt.solve(problem, start=checkpoint)
    assert resumed.status is mt.Status.OPTIMAL
    assert resumed.objective == pytest.approx(solution.objective, rel=1e-2)


def test_the_doctor_weighs_own_costs(ironcub):
    def found(weight, scale):
        cost = replace(TURNS, weight=weight, scale=scale)
        return [some.found for some in mt.doctor(ironcub, SQUAT, _plus(cost)).findings if "slow_turns" in some.found]

    assert found(1e4, 1.0) == []
    assert "slow_turns costs 1.0e-04" in found(1e-4, 1.0)[0]
    assert "the greatest cost, slow_turns, is" in found(1e4, 1e6)[-1]


def test_the_doctor_says_what_is_wrong_with_a_term(ironcub):
    broken = replace(ELBOW, value=lambda knot, _: knot.pose("l_elbow").translation[2])
    diagnosis = mt.doctor(ironcub, SQUAT, _plus(broken))
    assert diagnosis.hopeless
    assert "the term 'elbow_height': unknown frame 'l_elbow'" in diagnosis.findings[0].found


# -------------------------------------------------------------------- what is wrong with one


def _plus(*terms):
    return PAPER.with_terms(*terms)


def _value(function):
    return mt.Constraint(name="mine", value=function, within=mt.at_least(0.0), unit="1")


WRONG = {
    "a matrix": (
        lambda: _value(lambda knot, _: cs.horzcat(knot.com_position, knot.com_velocity)),
        "the term 'mine': the function returns the shape (3, 2); expected a column, (m, 1)",
    ),
    "nothing": (
        lambda: _value(lambda knot, _: None),
        "the term 'mine': the function returns None; expected a CasADi column, (m, 1)",
    ),
    "a function that fails": (
        lambda: _value(lambda knot, _: knot.com_postion),
        "the term 'mine' fails: AttributeError: 'Knot' object has no attribute 'com_postion'",
    ),
    "a value that is no number": (
        lambda: _value(lambda knot, _: cs.log(knot.com_velocity[0] - 1.0)),
        "the term 'mine': its value at the start guess is no finite number, at knot 1; expected a function that is "
        "smooth there",
    ),
    "a slope that is no number": (
        lambda: _value(lambda knot, _: cs.norm_2(knot.com_velocity)),
        "the term 'mine': its derivative at the start guess is no finite number, at knot 1; expected",
    ),
    "a cost that is no number": (
        lambda: mt.Cost(name="mine", residual=lambda knot, _: cs.log(knot.com_velocity[0]), weight=1.0, unit="1"),
        "the term 'mine': its value at the start guess is no finite number",
    ),
    "a cost whose slope is no number": (
        lambda: mt.Cost(
            name="mine", residual=lambda knot, _: cs.sqrt(cs.sqrt(knot.com_velocity[0])), weight=1.0, unit="1"
        ),
        "the term 'mine': its derivative at the start guess is no finite number",
    ),
    "a name that is taken": (
        lambda: replace(TURNS, name="posture"),
        "the term name posture is taken already; expected each name once",
    ),
    "too few labels": (
        lambda: replace(_value(slow_turns), labels=("x", "y")),
        "the term 'mine': there are 2 labels for 3 rows; expected one for each row",
    ),
    "a set that falls": (
        lambda: replace(ELBOW, within=mt.between(1.0, 0.0)),
        "the term 'elbow_height': the set is 1 to 0; expected numbers that do not fall",
    ),
    "a limit that fails": (
        lambda: replace(ELBOW, within=mt.at_least(lambda parameters: parameters.hight)),
        "the term 'elbow_height': its set fails: AttributeError: 'Parameters' object has no attribute 'hight'",
    ),
    "a condition that fails": (
        lambda: replace(TURNS, when=lambda parameters: 1 / 0),
        "the term 'slow_turns': its condition fails: ZeroDivisionError: division by zero",
    ),
    "a weight that is no number": (
        lambda: replace(TURNS, weight=lambda _: "much"),
        "the term 'slow_turns': the weight is 'much'; expected numbers of at least zero",
    ),
    "weights of another number": (
        lambda: replace(TURNS, weight=lambda _: np.ones(4)),
        "the term 'slow_turns': there are weights of shape (4,) for 3 rows; expected one for each row",
    ),
}


@pytest.mark.parametrize(("make", "sentence"), WRONG.values(), ids=WRONG)
def test_what_is_wrong_with_a_term_is_one_sentence_that_names_it(ironcub, make, sentence):
    with pytest.raises(FormulationError) as error:
        mt.build(ironcub, SQUAT, _plus(make()))
    assert str(error.value).startswith(sentence)


MADE_WRONG = {
    "an unknown unit": (
        lambda: replace(TURNS, unit="degrees"),
        "the term 'slow_turns': the unit is 'degrees'; expected one made of m, s, kg, N, rad, J, W, 1, %, as 'm/s²' or "
        "'N m'",
    ),
    "no name": (
        lambda: mt.Cost(residual=lambda knot, _: knot.thrust, weight=1.0, unit="N"),
        "the term '<lambda>': no report can call it that; expected name=... of at most 60 printable characters",
    ),
    "knots and intervals": (
        lambda: replace(ELBOW, holds=(mt.Where.LAST_KNOT, mt.Where.EVERY_INTERVAL)),
        "the term 'elbow_height': 'holds' names knots and intervals; expected only knots, or only intervals",
    ),
    "no place": (
        lambda: replace(TURNS, charged=()),
        "the term 'slow_turns': 'charged' is (); expected different members of Where, or Knots",
    ),
    "a weight below zero": (
        lambda: replace(TURNS, weight=-1.0),
        "the term 'slow_turns': the weight is -1.0; expected a number of at least zero, or a function",
    ),
    "a scale of zero": (
        lambda: replace(ELBOW, scale=0.0),
        "the term 'elbow_height': the scale is 0.0; expected a positive number",
    ),
    "no set": (
        lambda: replace(ELBOW, within=0.5),
        "the term 'elbow_height': 'within' is 0.5; expected equal(), at_least(), at_most() or between()",
    ),
    "no function": (
        lambda: replace(ELBOW, value=3.0),
        "the term 'elbow_height': what it asks for is 3.0; expected a function",
    ),
}


@pytest.mark.parametrize(("make", "sentence"), MADE_WRONG.values(), ids=MADE_WRONG)
def test_a_term_that_nothing_can_be_made_of_is_refused_when_it_is_made(make, sentence):
    with pytest.raises(FormulationError) as error:
        make()
    assert str(error.value) == sentence


@pytest.mark.parametrize("unit", ["m", "m/s²", "kg m²/s", "N m", "rad/s", "1", "%", "%/s", "1/s", "N/s²", "J", "W"])
def test_the_units_of_mechanics_are_known(unit):
    assert replace(TURNS, unit=unit).unit == unit


# -------------------------------------------------------------------- the formulation


def test_the_executable_one_is_the_default(ironcub):
    executable = mt.Formulation.executable()
    explicit, default = mt.build(ironcub, SQUAT, executable), mt.build(ironcub, SQUAT)
    assert default.formulation == executable
    assert np.array_equal(explicit.rows_at(explicit.guess), default.rows_at(default.guess))
    for formulation in (executable, PAPER):
        assert (formulation.own_terms, formulation.left_out) == ((), ())


def test_the_executable_one_holds_all_of_the_papers_terms_and_the_margins():
    names = [term.name for term in mt.Formulation.executable().terms]
    assert names[: len(PAPER.terms)] == [term.name for term in PAPER.terms]
    assert names[len(PAPER.terms) :] == [term.name for term in (*paper.LEAPFROG, *margins.TERMS)]


def test_a_term_of_the_paper_can_be_left_out(ironcub):
    less = PAPER.without("jet_reach", "posture")
    problem = mt.build(ironcub, replace(SQUAT, jets=True), less)
    assert "jet_reach" not in problem.rows
    assert "posture" not in problem.cost_names
    assert less.left_out == ("jet_reach", "posture")
    with pytest.raises(FormulationError, match="unknown term 'jet_reech'; did you mean 'jet_reach'"):
        PAPER.without("jet_reech")


def test_a_variable_may_have_another_scale_and_the_motion_stays(ironcub, plain):
    scaled = mt.build(ironcub, SQUAT, PAPER.with_scales({"contact_forces": 100.0}))
    place = scaled.layout.rows["contact_forces"].start
    assert scaled.scale[place] == 100.0
    assert mt.solve(scaled).objective == pytest.approx(plain.objective, rel=1e-4)
    with pytest.raises(FormulationError, match="unknown variable 'contact_force'"):
        PAPER.with_scales({"contact_force": 1.0})
    with pytest.raises(FormulationError, match="the scale of 'thrust' is 0"):
        Variable("thrust", 0.0)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"variables": PAPER.variables[1:]}, "the formulation lacks the variables com_position"),
        ({"variables": (*PAPER.variables, Variable("thrust_acceleration"))}, "thrust_acceleration cannot be variables"),
        ({"variables": (*PAPER.variables, Variable("thrust"))}, "the variable name thrust is taken already"),
        ({"terms": (*PAPER.terms, slow_turns)}, "is no term; expected a Constraint or a Cost"),
        ({"interval_scale": 0.0}, "interval_scale is 0.0"),
    ],
)
def test_a_formulation_that_makes_no_problem_is_refused(change, sentence):
    with pytest.raises(FormulationError) as error:
        replace(PAPER, **change)
    assert sentence in str(error.value)


@pytest.mark.parametrize("formulation", [PAPER, mt.Formulation.executable()], ids=["paper", "executable"])
def test_every_term_says_its_formula_and_has_a_name_of_its_own(formulation):
    assert len({term.name for term in formulation.terms}) == len(formulation.terms)
    assert all(term.formula for term in formulation.terms)


@dataclass(frozen=True)
class Midpoint:
    """The trapezoid: what acts is the mean of both ends."""

    name: str = "trapezoid"

    def over(self, quantity, start, end):
        return (quantity(start) + quantity(end)) / 2.0

    def at_accelerations(self, start, end):
        names = VARIABLE_NAMES
        return replace(end, **{name: 0.5 * (getattr(start, name) + getattr(end, name)) for name in names})

    def at_velocities(self, end, duration):
        return end


def test_an_integration_rule_of_ones_own_is_one_value(tmp_path):
    """The same flight of a body by two rules; each closes its own gaps, and the file says which it was."""
    robot = drone(tmp_path)
    for rule in (BackwardEuler(), Midpoint()):
        motion = mt.solve(mt.build(robot, HOP, replace(PAPER, rule=rule))).trajectory
        assert motion.solve_record()["status"] == "optimal"
        rise, speed = np.diff(motion.com_position[2]), motion.com_velocity[2]
        acting = speed[1:] if rule.name == "backward Euler" else (speed[1:] + speed[:-1]) / 2
        assert rise == pytest.approx(motion.duration / 30 * acting, abs=1e-7)
        assert motion.unusual_formulation() == ("" if rule.name == "backward Euler" else "integration by trapezoid")


def test_rows_of_the_paper_say_which_face_or_axis_they_are(ironcub):
    problem = mt.build(ironcub, replace(mt.scenarios.take_off(), knots=3))
    assert problem.rows["friction_cone"].components[0] == "l_sole_1 +x"
    assert set(problem.rows["friction_cone"].components) == {
        f"{point} {face}" for point in ironcub.contact_names for face in ("+x", "+y", "-x", "-y")
    }
    assert "l_sole_1 y" in problem.rows["sliding"].components
    assert set(problem.rows["static_equilibrium"].units) == {"N", "N m"}
    x = problem.guess.copy()
    place = problem.layout.size + problem.layout.rows["contact_forces"].start
    x[place] = 10.0  # 500 N to the front of the first point
    worst = {some.name: some for some in mt.solving.violations.unmet(problem, x, 1e-6)}["friction_cone"]
    assert (worst.component, worst.knot) == ("l_sole_1 +x", 1)
