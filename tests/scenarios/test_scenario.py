from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from multimodal_to import scenarios
from multimodal_to.errors import ModelError, ScenarioError
from multimodal_to.models.terrain import Plane, Stairs, heights_below
from multimodal_to.ocp import build
from multimodal_to.ocp.guess import base_transform, contact_positions, standing_posture
from multimodal_to.ocp.variables import Layout, ranges
from multimodal_to.scenarios import Weights


@pytest.fixture
def scenario():
    return scenarios.take_off()


def test_the_take_off_has_the_numbers_of_the_paper(scenario):
    assert scenario.knots == 70
    assert (scenario.initial_com[2], scenario.final_com[2]) == (0.57, 0.70)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"knots": 2}, "knots is 2; expected 3 to"),
        ({"interval_min": 0.2}, "expected 0 < interval_min <= interval_max"),
        ({"final_com": (0.0, 0.0, float("nan"))}, "expected three finite numbers"),
        ({"final_com": (0.0, 0.0, 2.0)}, "beyond com_range"),
        ({"initial_com": (0.0, -1.6, 0.57)}, "initial_com has y = -1.6 m, beyond com_range"),
        ({"complementarity_max": 0.0}, "complementarity_max is 0.0; expected a positive number"),
        ({"sliding_max": -1.0}, "sliding_max is -1.0; expected a positive number"),
        ({"friction": -0.1}, "friction is -0.1; expected a positive number"),
        ({"guess_steps": -1}, "guess_steps is -1; expected"),
        ({"final_com": (1.0, 0.0, 0.7), "base_speed_max": 0.1}, "faster than base_speed_max"),
    ],
)
def test_numbers_that_contradict_each_other_are_refused(scenario, change, sentence):
    with pytest.raises(ScenarioError) as error:
        replace(scenario, **change)
    assert sentence in str(error.value)


def test_a_negative_weight_is_refused():
    with pytest.raises(ScenarioError, match="weight 'thrust' is -1"):
        Weights(thrust=-1.0)
    with pytest.raises(ScenarioError, match="weight 'joint_velocities' is nan"):
        Weights(joint_velocities={"legs": float("nan")})


def test_a_weight_for_joints_that_do_not_exist_is_refused(ironcub, scenario):
    weights = replace(scenario.weights, joint_velocities={"lgs": 1.0})
    with pytest.raises(ModelError, match="unknown joint group 'lgs'; did you mean 'legs'"):
        build(ironcub, replace(scenario, weights=weights))


def test_a_start_that_no_posture_reaches_is_refused(ironcub, scenario):
    with pytest.raises(ScenarioError, match="no posture of ironcub within its joint limits stands on the ground"):
        build(ironcub, replace(scenario, initial_com=(0.0, 0.0, 0.75)))


def test_a_start_that_contradicts_the_joint_limits_is_refused(ironcub, scenario):
    upper = ironcub.joint_limits.upper.copy()
    upper[[ironcub.joint_names.index(knee) for knee in ("l_knee", "r_knee")]] = -1.5  # kneeling
    limits = replace(ironcub.joint_limits, upper=upper)
    with pytest.raises(ScenarioError, match="no posture of ironcub within its joint limits"):
        build(replace(ironcub, joint_limits=limits), scenario)


def test_an_end_that_contradicts_the_bounds_is_refused(ironcub, scenario):
    """A hover has to end upright; a base that may not turn so far is told which variable at which knot."""
    bounds = ranges(ironcub, scenario, Layout.of(ironcub))
    bounds.lower["base_quaternion_xyzw"][0] = 0.2
    with pytest.raises(
        ScenarioError, match=r"base_quaternion_xyzw\[0\] has to be 0 at knot 70, outside its range 0.2 to 1"
    ):
        bounds.fix("base_quaternion_xyzw", scenario.knots, np.array([0.0, 0.0, 0.0, 1.0]))


def test_an_unknown_scenario_is_named_with_those_that_exist():
    with pytest.raises(
        ScenarioError, match=r"unknown scenario 'takeof'; did you mean 'take-off'\? Available: take-off, take-off-and-l"
    ):
        scenarios.find("takeof")


def test_the_standing_posture_stands_where_it_should(ironcub, scenario):
    posture = standing_posture(ironcub, scenario.surface, scenario.initial_com)
    com = np.array(ironcub.kindyn.CoM_position(base_transform(posture), posture.joint_positions)).ravel()
    assert com == pytest.approx(scenario.initial_com, abs=1e-8)
    heights = contact_positions(ironcub, posture)[2::3]
    assert heights.min() > -1e-8
    assert heights.max() < 2e-6
    assert np.abs(posture.joint_positions - ironcub.home.joint_positions).max() < 0.2


@pytest.mark.parametrize(
    ("surface", "upright"),
    [
        (Plane(slope=0.2, direction=(-1.0, 0.0)), True),  # uphill
        (Plane(slope=0.3, direction=(1.0, 1.0), height=-0.05), True),
        (Plane(slope=0.6, direction=(0.0, 1.0)), False),  # more than the ankles roll
        (Stairs(edges=(0.0,), heights=(0.0, 0.05), direction=(0.0, 1.0)), True),  # one foot on the step
    ],
)
def test_a_robot_stands_on_slopes_and_steps_and_tilts_its_base_only_where_it_has_to(ironcub, surface, upright):
    com = (0.0, 0.0, 0.57)
    posture = standing_posture(ironcub, surface, com)
    points = contact_positions(ironcub, posture).reshape(-1, 3).T
    assert np.abs(points[2] - heights_below(surface, points)).max() < 2e-6
    found = np.array(ironcub.kindyn.CoM_position(base_transform(posture), posture.joint_positions)).ravel()
    assert found == pytest.approx(com, abs=1e-8)
    assert np.linalg.norm(posture.base_quaternion_xyzw) == pytest.approx(1.0)
    turned = np.abs(posture.base_quaternion_xyzw - ironcub.home.base_quaternion_xyzw).max()
    assert (turned < 1e-9) == upright
    assert turned < 0.3
