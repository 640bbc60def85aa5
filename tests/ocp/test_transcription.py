"""The assembled derivatives are those of the whole problem, and the problem is the one that was asked for."""

from __future__ import annotations

from dataclasses import replace

import casadi as cs
import numpy as np
import pytest

from multimodal_to import scenarios
from multimodal_to.models.contact import FrictionCone
from multimodal_to.models.terrain import HeightField
from multimodal_to.ocp import Formulation, build
from multimodal_to.ocp.variables import Layout
from multimodal_to.scenarios import Terminal, Weights

ALL = {name: 1.0 + index for index, name in enumerate(Weights.__dataclass_fields__) if name != "joint_velocities"}


@pytest.fixture(scope="module")
def problem(ironcub):
    weights = Weights(**ALL, joint_velocities={"legs": 3.0, "arms": 5.0})
    return build(ironcub, replace(scenarios.take_off(), knots=3, weights=weights))


@pytest.fixture(scope="module")
def point(problem):
    rng = np.random.default_rng(5)
    x = problem.guess + 0.1 * rng.normal(size=problem.guess.size)
    x[-1] = 0.7
    return x, rng.normal(size=problem.row_lower.size)


def test_gradient_and_jacobian_match_finite_differences(problem, point):
    x, _ = point
    rng = np.random.default_rng(6)
    for _ in range(5):
        along = rng.normal(size=x.size)
        step = 1e-6
        costs = [float(problem.nlp.objective(x + sign * step * along)) for sign in (-1, 1)]
        rows = [np.array(problem.nlp.rows(x + sign * step * along)).ravel() for sign in (-1, 1)]
        gradient = np.array(problem.nlp.gradient(x, [])[1]).ravel()
        assert gradient @ along == pytest.approx((costs[1] - costs[0]) / (2 * step), rel=1e-6)
        jacobian = problem.nlp.jacobian(x, [])[1]
        expected = (rows[1] - rows[0]) / (2 * step)
        assert np.array(jacobian @ cs.DM(along)).ravel() == pytest.approx(expected, rel=1e-5, abs=1e-5)


def test_the_hessian_is_the_derivative_of_the_gradient_of_the_lagrangian(problem, point):
    x, multipliers = point
    sigma = 0.3

    def gradient(at):
        jacobian = problem.nlp.jacobian(at, [])[1]
        return (
            sigma * np.array(problem.nlp.gradient(at, [])[1]).ravel()
            + np.array(jacobian.T @ cs.DM(multipliers)).ravel()
        )

    hessian = cs.triu2symm(problem.nlp.hessian(x, [], sigma, multipliers))
    along = np.random.default_rng(7).normal(size=x.size)
    expected = (gradient(x + 1e-6 * along) - gradient(x - 1e-6 * along)) / 2e-6
    computed = np.array(hessian @ cs.DM(along)).ravel()
    assert np.abs(computed - expected).max() < 1e-6 * np.abs(expected).max()


def test_derivatives_are_exact_on_terrain_and_with_the_second_order_cone(ironcub):
    """Points are spread over a bumpy field; the Jacobian against the rows, the Hessian against the Jacobian."""
    field = HeightField.sampled(
        lambda x, y: 0.1 * np.sin(3 * x + y), x_range=(-0.8, 0.8), y_range=(-0.8, 0.8), spacing=0.3
    )
    task = replace(
        scenarios.landing(),
        knots=3,
        terminal=Terminal.FREE,
        surface=field,
        weights=Weights(),
        friction_cone=FrictionCone.SECOND_ORDER,
    )
    bumpy, rng = build(ironcub, task), np.random.default_rng(8)
    x = bumpy.guess + 0.1 * rng.normal(size=bumpy.guess.size)
    along, multipliers = rng.normal(size=x.size), cs.DM(rng.normal(size=bumpy.row_lower.size))
    ends = [x - 1e-6 * along, x + 1e-6 * along]
    before, after = (np.array(bumpy.nlp.rows(end)).ravel() for end in ends)
    moved = np.array(bumpy.nlp.jacobian(x, [])[1] @ cs.DM(along)).ravel()
    assert moved == pytest.approx((after - before) / 2e-6, rel=1e-5, abs=1e-4)
    before, after = (np.array(bumpy.nlp.jacobian(end, [])[1].T @ multipliers).ravel() for end in ends)
    bent = np.array(cs.triu2symm(bumpy.nlp.hessian(x, [], 0.0, multipliers)) @ cs.DM(along)).ravel()
    expected = (after - before) / 2e-6
    assert np.abs(bent - expected).max() < 1e-5 * np.abs(expected).max()


def test_the_hessian_of_the_costs_is_that_of_the_lagrangian_without_the_rows(problem, point):
    x, multipliers = point
    alone = problem.nlp.cost_hessian(x, [], 0.3, multipliers)
    whole = problem.nlp.hessian(x, [], 0.3, np.zeros_like(multipliers))
    assert float(cs.norm_fro(alone - whole)) < 1e-12 * float(cs.norm_fro(whole))


def test_derivatives_match_those_of_the_whole_graph(problem, point):
    """CasADi's own differentiation of the `Opti` problem, entry by entry, on a horizon short enough for it."""
    x, _ = point
    opti = problem.opti
    whole = cs.Function("whole", [opti.x], [cs.jacobian(opti.g[x.size :], opti.x)])
    difference = problem.nlp.jacobian(x, [])[1] - whole(x)
    assert float(cs.norm_inf(cs.vec(difference))) < 1e-9


def test_every_weight_names_a_cost_and_zero_weights_add_nothing(ironcub, problem):
    x = problem.guess + 0.05
    names = set(problem.costs(x))
    assert names == {*ALL, "joint_velocities"}
    assert sum(problem.costs(x).values()) == pytest.approx(float(problem.nlp.objective(x)))
    bare = build(ironcub, replace(problem.scenario, weights=Weights(thrust=2.0)))
    assert set(bare.cost_names) == {"thrust"}
    x[-1] = 1.0  # Δt = 0.1 s
    thrust = bare.layout.read((x * bare.scale)[:-1].reshape(bare.layout.size, -1, order="F"))["thrust"]
    assert bare.costs(x)["thrust"] == pytest.approx(2.0 * 0.1 * np.sum(thrust[:, 1:] ** 2))


PAPER_ROWS = {
    "com_kinematics",
    "angular_momentum_kinematics",
    "contact_kinematics",
    "friction_cone",
    "complementarity",
    "contact_reach",
    "jet_reach",
    "static_equilibrium",
    "momentum_dynamics",
    "com_integration",
    "base_position_integration",
    "base_orientation_integration",
    "joint_integration",
    "thrust_integration",
    "thrust_dynamics",
    "sliding",
}
LEAPFROG_ROWS = {"complementarity_before", "complementarity_after", "sliding_after", "final_steady_thrust"}
MARGIN_ROWS = {"centre_of_pressure", "touch_down", "joint_torques", "link_distances"}


def test_every_set_of_rows_has_the_name_of_its_function(problem):
    assert set(problem.rows) == PAPER_ROWS | LEAPFROG_ROWS | MARGIN_ROWS
    everything = np.sort(np.concatenate([rows.index for rows in problem.rows.values()]))
    assert np.array_equal(everything, np.arange(problem.row_lower.size))


def test_the_papers_problem_has_the_papers_rows_alone(ironcub):
    problem = build(ironcub, replace(scenarios.paper("take-off"), knots=3), Formulation.paper())
    assert set(problem.rows) == PAPER_ROWS


def test_rows_of_one_variable_become_bounds(problem):
    """On flat ground, non-penetration is a bound on the height of each contact point after the first knot."""
    layout: Layout = problem.layout
    lower = layout.read((problem.lower * problem.scale)[:-1].reshape(layout.size, -1, order="F"))["contact_positions"]
    assert np.array_equal(lower[2::3, 1:], np.zeros((8, 3)))
    assert np.isinf(lower[0::3, 1:]).all()


def test_nothing_at_the_first_knot_is_free_but_the_forces(problem):
    layout = problem.layout
    width = (problem.upper - problem.lower)[:-1].reshape(layout.size, -1, order="F")[:, 0]
    free = {name for name, values in layout.read(width).items() if np.any(values > 0)}
    assert free == {"contact_forces"}


def test_violations_are_reported_by_name_in_their_own_units(problem):
    x = problem.guess.copy()
    before = problem.largest_violations(x)
    assert before["joint_integration"] < 1e-12
    assert before["com_integration"] == pytest.approx(0.13 / 3, rel=1e-6)  # the CoM moves, its velocity is zero
    knot = 2
    index = knot * problem.layout.size + problem.layout.rows["thrust"].start
    x[index] += 1.0  # 100 N in solver units
    after = problem.largest_violations(x)
    assert after["thrust_integration"] == pytest.approx(100.0)
    assert problem.unit("thrust_integration") == "N"
    assert after["joint_integration"] == before["joint_integration"]
    x[index] = 5.0
    assert problem.largest_violations(x)["bounds of thrust"] == pytest.approx(500.0 - 160.0)
    assert problem.unit("bounds of thrust") == "N"
