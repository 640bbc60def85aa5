"""The paper's own transcription in benchmarks/, on a few knots."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import multimodal_to as mt
import paper_reference

KNOTS = 3


@pytest.fixture(scope="module")
def standing() -> paper_reference.Transcription:
    """The jump without its height: nothing asks the robot to leave the ground."""
    case = replace(paper_reference.CASES["jump"], knots=KNOTS, mid_height=None)
    problem = paper_reference.Transcription(case)
    problem.solve(max_iterations=2000, verbose=False)
    return problem


def test_a_robot_that_may_stay_on_the_ground_stands_there(standing):
    assert standing.opti.stats()["success"]
    assert standing.violation() < 1e-4
    trajectory = standing.trajectory("standing")
    assert trajectory.vertical_contact_force()[1:] == pytest.approx(standing.robot.weight, rel=0.01)
    assert np.abs(trajectory.com_position[2] - 0.57).max() < 1e-3


def test_the_audit_finds_the_physics_of_the_equations_in_the_answer(standing):
    report = mt.audit(standing.robot, standing.trajectory("standing"))
    exact = [
        finding for finding in report.findings if finding.name.startswith("gap of") or "consistency" in finding.name
    ]
    assert len(exact) == 12
    for finding in exact:
        if finding.name != "momentum consistency":  # the velocities of the first knot enter no dynamics
            assert finding.worst < 1e-4, finding


@pytest.mark.parametrize("name", ["take-off", "walk-to-fly"])
def test_a_case_with_jets_builds_and_iterates(name):
    problem = paper_reference.Transcription(replace(paper_reference.CASES[name], knots=KNOTS))
    problem.solve(max_iterations=2, verbose=False)
    assert problem.opti.stats()["iter_count"] == 2
    assert set(problem.variables) == {*mt.trajectory.QUANTITIES, "complementarity_slack", "sliding_slack"}
