"""A solve that starts from the answer of a task much like it."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

import multimodal_to as mt
from multimodal_to.errors import InputError
from multimodal_to.solving.linear_solvers import choose


@pytest.fixture(scope="module")
def answer(ironcub, stand):
    return mt.solve(mt.build(ironcub, stand))


def test_an_answer_is_its_own_start(ironcub, stand, answer):
    problem = mt.build(ironcub, stand)
    again = mt.solve(problem, start=answer.trajectory)
    assert max(problem.largest_violations(problem.start_from(answer.trajectory)).values()) < 1e-6
    assert again.status is mt.Status.OPTIMAL
    assert again.iterations < answer.iterations / 2
    assert again.objective == pytest.approx(answer.objective, rel=1e-3)


def test_a_changed_target_and_another_grid_end_where_a_cold_solve_does(ironcub, stand, answer):
    changed = replace(stand, knots=12, final_com=(0.0, 0.0, 0.545))
    cold, warm = mt.solve(mt.build(ironcub, changed)), mt.solve(mt.build(ironcub, changed), start=answer.trajectory)
    assert warm.status is mt.Status.OPTIMAL
    assert warm.iterations < cold.iterations
    assert warm.objective == pytest.approx(cold.objective, rel=1e-3)
    assert np.allclose(warm.trajectory.com_position[:, -1], changed.final_com)


def test_a_motion_with_other_jets_is_refused(ironcub, answer):
    with pytest.raises(
        InputError,
        match="the motion to start from is for another robot: its jets are none",
    ):
        mt.build(ironcub, replace(mt.scenarios.take_off(), knots=5)).start_from(answer.trajectory)


def test_the_answer_keeps_how_it_was_solved(answer):
    record = answer.trajectory.solve_record()
    assert (record["kind"], record["status"], record["message"]) == ("answer", "optimal", "Solve_Succeeded")
    assert (record["iterations"], record["objective"]) == (answer.iterations, answer.objective)
    assert (record["costs"], record["violations"]) == (answer.costs, answer.violations)
    assert record["linear_solver"] == choose().name
    assert record["threads"]["blas"] == 1
    assert re.fullmatch(r"3\.\d+\.\d+", record["versions"]["ipopt"])
    assert {"multimodal-to", "casadi", "numpy", "python"} <= set(record["versions"])
