"""Second derivatives through lifted quantities are those of the plain expression."""

from __future__ import annotations

import casadi as cs
import numpy as np
import pytest

import multimodal_to as mt
from multimodal_to.ocp.lifting import Lifted
from multimodal_to.ocp.outline import formulate, prepared


def numbers(expression, symbols, at):
    return np.array(cs.Function("numbers", symbols, [expression])(*at))


def test_a_chain_of_quantities_gives_the_hessian_of_what_it_stands_for():
    x, lifted = cs.SX.sym("x", 4), Lifted()
    first = lifted(cs.vertcat(x[0] * x[1], cs.sin(x[2])))
    second = lifted(first[0] * cs.exp(first[1]) + x[3] ** 2)
    unused = lifted(cs.log(x[0]))
    function = second**2 * x[1] + cs.cos(first[0]) * x[3]
    plain = (x[0] * x[1] * cs.exp(cs.sin(x[2])) + x[3] ** 2) ** 2 * x[1] + cs.cos(x[0] * x[1]) * x[3]
    at = [np.array([0.3, -0.7, 1.1, 0.4])]
    assert numbers(lifted.expand(function), [x], at) == pytest.approx(numbers(plain, [x], at), rel=1e-15)
    expected = np.triu(numbers(cs.hessian(plain, x)[0], [x], at))
    assert numbers(lifted.hessian(function, x), [x], at) == pytest.approx(expected, rel=1e-13, abs=1e-14)
    assert not cs.depends_on(lifted.expand(function), unused)


def test_what_holds_no_symbol_is_derived_as_it_is():
    x = cs.SX.sym("x", 2)
    lifted = Lifted()
    lifted(x[0] ** 2)
    expected = cs.triu(cs.hessian(x[0] ** 3 * x[1], x)[0])
    assert cs.is_equal(lifted.hessian(x[0] ** 3 * x[1], x)[0, 1], expected[0, 1], 20)


@pytest.mark.parametrize(("formulation", "share"), [(mt.Formulation.paper(), 0.9), (mt.Formulation.executable(), 0.75)])
def test_the_hessian_of_a_problem_is_that_of_its_rows_and_costs_without_lifts(ironcub, formulation, share):
    scenario = mt.scenarios.landing()
    robot, standing = prepared(ironcub, scenario)
    stage = max(formulate(robot, scenario, standing, formulation).stages, key=lambda named: named.stage.repeats).stage
    function, pattern = stage.hessian()
    arguments = cs.vertcat(stage.start, stage.end, stage.interval)
    sigma, multipliers = cs.SX.sym("sigma"), cs.SX.sym("multipliers", stage.rows.shape[0])
    lagrangian = sigma * cs.sum1(stage.costs) + cs.dot(multipliers, stage.rows)
    plain = cs.Function(
        "plain",
        [stage.start, stage.end, stage.interval, sigma, multipliers],
        [cs.triu(cs.hessian(lagrangian, arguments)[0])],
    )
    random = np.random.default_rng(2)
    at = [random.uniform(0.2, 1.0, shape) for shape in (*(each.shape for each in plain.sx_in()[:3]), (1, 1))]
    at.append(random.normal(size=multipliers.shape[0]))
    expected = np.array(plain(*at))
    found = np.array(cs.DM(pattern, function(*at)))
    assert np.abs(found - expected).max() < 1e-11 * np.abs(expected).max()
    assert function.n_instructions() < share * plain.n_instructions()
