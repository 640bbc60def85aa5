"""Tasks of the iRonCub that no example solves and that take long: they are solved, and their motions are true."""

from __future__ import annotations

from dataclasses import replace
from math import radians, tan

import numpy as np
import pytest

import multimodal_to as mt
from multimodal_to.simulation import play, tracking

pytestmark = pytest.mark.robots

HOVER = replace(
    mt.scenarios.landing(),
    name="hover",
    initial_com=(0.0, 0.0, 0.7),
    final_com=(0.0, 0.0, 0.7),
    terminal=mt.Terminal.HOVER,
)
"""From a hover to a hover on the spot."""


def solved(robot, scenario):
    """The answer to a task, which is true."""
    solution = mt.solve(mt.build(robot, scenario))
    assert solution.status.solved
    report = mt.audit(robot, solution.trajectory, scenario)
    assert report.holds, [finding.name for finding in report.findings if not finding.holds]
    return solution


@pytest.mark.parametrize("direction", [(-1.0, 0.0), (1.0, 0.0), (0.0, 1.0)], ids=["uphill", "downhill", "across"])
def test_it_lands_on_15_degrees_with_the_weights_for_flat_ground(ironcub, direction):
    slope = mt.Plane(slope=tan(radians(15)), direction=direction)
    solved(ironcub, replace(mt.scenarios.landing(), surface=slope))


@pytest.mark.parametrize("aside", [0.0, 0.5], ids=["on the spot", "0.5 m aside"])
def test_from_hover_to_hover_its_start_guess_hangs_on_the_thrusts_and_it_is_solved(ironcub, aside):
    task = replace(HOVER, final_com=(0.0, aside, 0.7))
    problem = mt.build(ironcub, task)
    guess = problem.layout.read_horizon(problem.guess * problem.scale)
    assert guess["thrust"].sum(axis=0) == pytest.approx(np.full(task.knots + 1, ironcub.weight), rel=1e-6)
    assert np.abs(guess["contact_forces"]).max() < 1e-3 * ironcub.weight
    solved(ironcub, task)


def test_a_turn_by_45_degrees_hovers_in_mujoco(ironcub):
    turn = replace(HOVER, keyframes=(mt.Keyframe(when="end", yaw=radians(45)),))
    met = tracking(play(ironcub, solved(ironcub, turn).trajectory))
    assert met.end == "hovers"


def test_a_landing_keeps_limits_that_hold_for_a_while(ironcub):
    slow = mt.Limits(base_speed=0.05, joint_speeds={"legs": 0.5}, begin=0.5)
    weak = mt.Limits(thrusts={"left arm": 100.0}, begin=0.1, end=0.5)
    motion = solved(ironcub, replace(mt.scenarios.landing(), limits=(slow, weak))).trajectory
    assert np.abs(motion.base_linear_velocity[:, 36:]).max() <= 0.05 + 1e-6
    assert np.abs(motion.joint_velocities[ironcub.group_indices("legs"), 36:]).max() <= 0.5 + 1e-6
    assert motion.thrust[list(motion.jet_names).index("left arm"), 7:36].max() <= 100.0 + 1e-4
