"""A task that asks for more than its rows allow: what is missed is named, and what has to give way."""

from __future__ import annotations

from dataclasses import replace

import casadi as cs
import numpy as np
import pytest

import multimodal_to as mt
from multimodal_to.errors import InputError
from multimodal_to.solving import relaxation as room
from multimodal_to.trajectory import labels

LEGS = 0.6
"""How far below the iRonCub's CoM a contact point may be [m], its `contact_reach`; a standing CoM cannot be higher."""


@pytest.fixture(scope="module")
def too_high(ironcub, stand):
    """To stand with the CoM 10 cm higher than the reach of the legs."""
    return mt.build(ironcub, replace(stand, final_com=(0.0, 0.0, 0.70)))


@pytest.fixture(scope="module")
def solution(too_high):
    return mt.solve(too_high)


def test_an_infeasible_end_names_rows_knot_component_and_amount(too_high, solution):
    assert solution.status is mt.Status.INFEASIBLE
    assert not solution.feasible
    worst = solution.unmet[0]
    assert {some.name for some in solution.unmet} <= set(solution.violations)
    assert (worst.name, worst.knot) == ("contact_reach", 10)
    assert worst.amount == pytest.approx(solution.violations["contact_reach"])
    foot = worst.component.removesuffix(" z")
    index = solution.trajectory.contact_names.index(foot)
    arm = (solution.trajectory.per_contact("contact_positions")[index] - solution.trajectory.com_position)[2, 10]
    assert worst.amount == pytest.approx(-arm / LEGS - 1.0, abs=1e-6)
    assert str(worst).startswith(f"contact_reach at knot 10, {foot} z, by 0.1")


def test_what_is_asked_gives_way_before_physics_and_by_as_much_as_it_asks_too_much(too_high, solution):
    relaxation = mt.relax(too_high, solution.trajectory)
    assert relaxation.status is mt.Status.OPTIMAL
    (end,) = relaxation.gives_way
    assert (end.name, end.component, end.knot, end.violated) == ("end: CoM", "z", 10, 1)
    assert end.amount == pytest.approx(0.70 - LEGS, rel=0.05)
    assert relaxation.price == pytest.approx(end.scaled, rel=1e-3)


def test_a_reach_that_the_start_is_beyond_is_accused_and_no_integration(ironcub, stand):
    short = replace(ironcub, contact_reach=np.array([0.3, 0.3, 0.56]))
    reached = mt.build(short, replace(stand, final_com=(0.0, 0.0, 0.5)))
    (found,) = mt.relax(reached).gives_way
    assert (found.name, found.knot, found.amount) == ("contact_reach", 1, pytest.approx(0.57 / 0.56 - 1, abs=1e-3))
    (error,) = [one for one in mt.doctor(short, reached.scenario).findings if one.name == "reach"]
    assert error.severity.value == "error"
    assert "from knot 1 on, when a robot that starts at rest has not moved yet" in error.found


def test_only_the_terms_that_may_give_way_do_and_the_others_hold(too_high, solution):
    chosen = {"contact_reach", "com_kinematics"}
    relaxation = mt.relax(too_high, solution.trajectory, terms=sorted(chosen))
    assert relaxation.status is mt.Status.OPTIMAL
    assert {some.name for some in relaxation.gives_way} == chosen
    met = too_high.largest_violations(too_high.start_from(relaxation.trajectory))
    assert max(amount for name, amount in met.items() if name not in chosen) < 1e-5
    for some in relaxation.gives_way:
        assert some.amount == pytest.approx(met[some.name], abs=1e-5)


def test_a_term_that_cannot_make_up_for_it_is_not_called_the_answer(too_high, solution):
    relaxation = mt.relax(too_high, solution.trajectory, mt.Ipopt(max_iterations=60), terms=["sliding"])
    assert not relaxation.status.solved


def test_where_the_rows_can_be_met_nothing_gives_way(ironcub, stand):
    problem = mt.build(ironcub, stand)
    relaxation = mt.relax(problem)
    assert (relaxation.status, relaxation.gives_way) == (mt.Status.OPTIMAL, ())
    assert problem.largest_violations(problem.start_from(relaxation.trajectory))["com_kinematics"] < 1e-4


def test_constraints_that_do_not_exist_are_refused(too_high):
    with pytest.raises(InputError, match="unknown constraint 'com_kinematic'; did you mean 'com_kinematics'"):
        mt.relax(too_high, terms=["com_kinematic"])


def test_the_derivatives_of_the_relaxed_problem_are_those_of_its_functions(too_high):
    """Along a random direction, by central differences of g and of the Lagrangian's gradient."""
    random = np.random.default_rng(0)
    chosen = np.sort(random.choice(too_high.row_lower.size, 50, replace=False))
    start = too_high.guess
    whole = room._Elastic.of(too_high, tuple(too_high.rows))
    elastic = replace(whole, chosen=chosen, weights=np.linspace(1.0, 3.0, 50))
    nlp, functions = room._relaxed(too_high, elastic, start)
    rows_at = cs.Function("rows", [nlp["x"]], [nlp["g"]])
    objective = cs.Function("objective", [nlp["x"]], [nlp["f"]])
    y = np.concatenate([start + 0.01 * random.normal(size=start.size), random.uniform(size=100)])
    way, lam, h = random.normal(size=y.size), random.normal(size=too_high.row_lower.size), 1e-6

    def lagrangian_gradient(at):
        jacobian = functions["jac_g"](at, [])[1]
        return 2.0 * np.array(functions["grad_f"](at, [])[1]).ravel() + np.array(cs.mtimes(jacobian.T, lam)).ravel()

    jacobian = functions["jac_g"](y, [])[1]
    assert np.array_equal(functions["jac_g"](y, [])[0].full(), rows_at(y).full())
    rows = [np.array(rows_at(y + sign * h * way)).ravel() for sign in (1, -1)]
    assert np.allclose(cs.mtimes(jacobian, way).full().ravel(), (rows[0] - rows[1]) / (2 * h), rtol=1e-5, atol=1e-4)
    value, gradient = functions["grad_f"](y, [])
    assert float(value) == float(objective(y))
    slope = float(objective(y + h * way) - objective(y - h * way)) / (2 * h)
    assert float(cs.dot(gradient, way)) == pytest.approx(slope, rel=1e-5)
    upper = functions["hess_lag"](y, [], 2.0, lam)
    hessian = upper + cs.triu(upper, False).T
    turned = (lagrangian_gradient(y + h * way) - lagrangian_gradient(y - h * way)) / (2 * h)
    assert np.allclose(cs.mtimes(hessian, way).full().ravel(), turned, rtol=1e-4, atol=1e-3)


def test_every_row_of_every_term_has_a_knot_and_a_name(ironcub):
    problem = mt.build(ironcub, replace(mt.scenarios.take_off(), knots=5))
    for name, rows in problem.rows.items():
        assert rows.index.size == rows.knots.size == rows.components.size, name
        assert rows.knots.min() >= 0, name
        assert rows.knots.max() == (0 if name == "static_equilibrium" else 5), name
    assert sorted(np.concatenate([rows.index for rows in problem.rows.values()])) == list(range(problem.row_lower.size))
    assert set(problem.rows["contact_kinematics"].components) == set(labels("contact_positions", ironcub))
    assert set(problem.rows["thrust_dynamics"].components) == set(ironcub.jet_names)
    assert problem.rows["static_equilibrium"].components[3] == "angular x"
