"""How scenarios start, pass and end, read off the bounds of short problems."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from multimodal_to import scenarios
from multimodal_to.ocp import Formulation, build
from multimodal_to.scenarios import Start, Terminal

SHORT = {"knots": 4}


def bounds(problem, name):
    """The bounds of a variable in its own unit, (dim, knots + 1) each."""
    size = problem.layout.size
    return tuple(
        problem.layout.read((side * problem.scale)[:-1].reshape(size, -1, order="F"))[name]
        for side in (problem.lower, problem.upper)
    )


@pytest.fixture(scope="module")
def landing(ironcub):
    return build(ironcub, replace(scenarios.landing(), **SHORT))


def test_a_hovering_start_finds_its_posture_and_holds_its_thrust(landing):
    lower, upper = bounds(landing, "joint_positions")
    assert (lower[:, 0] < upper[:, 0]).all()
    at_first_knot = {name for name, rows in landing.rows.items() if 0 in rows.knots}
    assert at_first_knot == {
        "com_kinematics",
        "contact_kinematics",
        "static_equilibrium",
        "steady_thrust",
        "unit_quaternion",
        "friction_cone",
        "centre_of_pressure",
        "link_distances",
    }
    assert np.abs(np.hstack(bounds(landing, "contact_forces"))[:, [0, 5]]).max() <= 0.01


def test_a_standing_end_has_every_contact_point_on_the_ground(landing):
    lower, upper = bounds(landing, "contact_positions")
    assert np.array_equal(lower[2::3, -1], np.zeros(8))
    assert upper[2::3, -1] == pytest.approx(np.full(8, 1e-5))
    assert np.isinf(upper[2::3, 1:-1]).all()


def test_a_standing_end_is_in_balance_where_no_interval_follows_its_forces(landing):
    assert set(landing.rows["final_equilibrium"].knots) == {4}
    paper = build(landing.robot, landing.scenario, Formulation.paper())
    assert "final_equilibrium" not in paper.rows


@pytest.mark.parametrize(
    ("formulation", "free"), [(Formulation.executable(), [1, 2]), (Formulation.paper(), [1, 2, 3])]
)
def test_a_hover_at_the_end_has_no_contact_force_where_one_would_push_it_off(ironcub, formulation, free):
    """By leapfrog the forces of the last knot but one make the last velocity."""
    problem = build(ironcub, replace(scenarios.take_off(), **SHORT), formulation)
    lower, upper = bounds(problem, "contact_forces")
    pushed = (np.maximum(np.abs(lower), np.abs(upper)) > 0.011).any(axis=0)
    assert np.flatnonzero(pushed)[1:].tolist() == free


def test_the_height_at_mid_horizon_is_a_bound_there_only(ironcub):
    problem = build(ironcub, replace(scenarios.take_off(), **SHORT, mid_height_min=0.65))
    lower, _ = bounds(problem, "com_position")
    assert lower[2, 2] == pytest.approx(0.65)
    assert (lower[2, [1, 3]] < 0).all()


def test_a_free_end_only_asks_for_the_com(ironcub):
    problem = build(ironcub, replace(scenarios.take_off(), **SHORT, terminal=Terminal.FREE))
    lower, upper = bounds(problem, "com_position")
    assert np.array_equal(lower[:, -1], upper[:, -1])
    for name in ("joint_velocities", "contact_forces", "thrust_rate"):
        lower, upper = bounds(problem, name)
        assert (lower[:, -1] < upper[:, -1]).all(), name


def test_a_scenario_without_jets_has_none_in_its_problem(ironcub):
    scenario = replace(
        scenarios.take_off(),
        **SHORT,
        jets=False,
        start=Start.STANDING,
        terminal=Terminal.STANDING,
        final_com=(0.0, 0.0, 0.57),
    )
    problem = build(ironcub, scenario)
    assert problem.robot.jets == ()
    assert problem.layout.rows["thrust"] == slice(problem.layout.size, problem.layout.size)
    assert not {"thrust_dynamics", "thrust_integration", "jet_reach"} & set(problem.rows)
