"""The start guess: a robot that is in one piece, and whose feet carry it only where they stand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import multimodal_to as mt
from hopper import hop, hopper
from multimodal_to.ocp.gait import GROUNDED
from multimodal_to.ocp.guess import LANDED
from multimodal_to.trajectory.derived import surface_frames


def guessed(robot, scenario):
    problem = mt.build(robot, replace(scenario, knots=20), mt.Formulation.paper())
    values = problem.layout.read_horizon(problem.guess * problem.scale)
    return problem.largest_violations(problem.guess), {name: np.array(value) for name, value in values.items()}


def heights(scenario, values):
    points = values["contact_positions"].reshape(-1, 3, values["contact_positions"].shape[1]).transpose(0, 2, 1)
    return surface_frames(scenario.surface, points)[0]


@pytest.mark.parametrize("name", ["take-off", "landing", "jump", "step-up"])
def test_com_base_and_joints_of_the_guess_are_those_of_one_robot(ironcub, name):
    violations, _ = guessed(ironcub, mt.scenarios.find(name))
    assert violations["com_kinematics"] < 1e-3
    assert violations["non_penetration"] < 1e-3


@pytest.mark.parametrize("name", ["landing", "step-up"])
def test_a_robot_that_lands_flies_its_feet_down_and_hands_its_weight_over_on_the_ground(ironcub, name):
    scenario = mt.scenarios.find(name)
    violations, values = guessed(ironcub, scenario)
    above, load = heights(scenario, values), values["contact_forces"][2::3].sum(axis=0)
    landed = round(LANDED * 20)
    assert (above[:, : landed // 2] > 0.01).all()
    assert np.abs(above[:, landed:]).max() < 1e-3
    assert (load[: landed + 1] == 0.0).all()
    assert load[-1] == pytest.approx(ironcub.weight)
    assert violations["complementarity"] < 1e-2
    assert values["com_position"][:, -1] == pytest.approx(scenario.final_com)


def test_a_robot_that_stays_in_the_air_is_carried_by_its_jets_all_the_way(ironcub):
    aside = replace(
        mt.scenarios.landing(), final_com=(0.3, 0.0, 0.72), terminal=mt.Terminal.HOVER, surface=mt.FlatGround()
    )
    _, values = guessed(ironcub, aside)
    assert values["contact_forces"] == pytest.approx(0.0, abs=0.02)
    assert values["thrust"].sum(axis=0) == pytest.approx(np.full(21, ironcub.weight))
    assert (heights(aside, values) > 0.05).all()


def test_a_robot_whose_feet_no_joint_moves_stands_until_its_thrusts_carry_it(tmp_path):
    robot = hopper(tmp_path)
    violations, values = guessed(robot, hop(robot))
    leaves = round(GROUNDED * 20)
    height, lifted = values["com_position"][2], values["contact_positions"][2::3]
    assert (height[: leaves + 1] == height[0]).all()
    assert height[-1] == pytest.approx(0.6)
    assert lifted == pytest.approx(np.tile(height - height[0], (4, 1)), abs=1e-5)
    carried = values["thrust"].sum(axis=0) + values["contact_forces"][2::3].sum(axis=0)
    assert carried == pytest.approx(robot.weight, rel=1e-6)
    assert violations["contact_kinematics"] < 1e-5
    assert violations["contact_reach"] == 0.0
