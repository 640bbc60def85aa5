"""Rotors that all push along one line: the row of a hover that follows from the others is left out."""

from __future__ import annotations

from dataclasses import replace

import pytest

import multimodal_to as mt
from multimodal_to.models.loading import bundled_robots
from multimodal_to.ocp.one_line import push_along_one_line


@pytest.fixture(scope="module")
def with_drag():
    return mt.load_robot(bundled_robots()["quadrotor"])


@pytest.fixture(scope="module")
def without_drag(with_drag):
    return replace(with_drag, jets=tuple(replace(jet, drag=0.0) for jet in with_drag.jets))


def rows(problem, name, knot):
    """The components of a term's rows that there are at a knot, or over the interval that ends there."""
    found = problem.rows[name]
    return {part for part, at in zip(found.components, found.knots, strict=True) if at == knot}


def test_only_rigid_rotors_without_drag_push_along_one_line(with_drag, without_drag, ironcub):
    assert push_along_one_line(without_drag)
    assert not push_along_one_line(with_drag)
    assert not push_along_one_line(ironcub)
    assert not push_along_one_line(replace(without_drag, jets=()))


def test_a_hover_lacks_the_row_of_the_moment_that_is_zero_whatever_the_rotors_do(with_drag, without_drag):
    for robot, asked in ((with_drag, 6), (without_drag, 5)):
        problem = mt.build(robot, mt.tasks.hover(robot))
        last = problem.scenario.knots
        assert len(rows(problem, "static_equilibrium", 0)) == asked
        assert len(rows(problem, "momentum_dynamics", last)) == asked
        assert len(rows(problem, "momentum_dynamics", last - 1)) == 6


def test_a_hover_on_the_way_keeps_all_rows(without_drag):
    plain = mt.tasks.hover(without_drag)
    problem = mt.build(without_drag, replace(plain, keyframes=(*plain.keyframes, mt.Keyframe(when=0.5, hover=True))))
    for knot in range(1, problem.scenario.knots + 1):
        assert len(rows(problem, "momentum_dynamics", knot)) == 6


@pytest.mark.parametrize("solver", ["auto", "mumps"])
def test_a_quadrotor_without_drag_takes_off_and_its_plan_is_true(without_drag, solver):
    problem = mt.build(without_drag, mt.tasks.take_off(without_drag))
    solution = mt.solve(problem, mt.Ipopt(linear_solver=solver, max_iterations=150))
    assert solution.status is mt.Status.OPTIMAL
    assert mt.audit(without_drag, solution.trajectory).holds
