from __future__ import annotations

import json
from dataclasses import fields, replace

import numpy as np
import pytest

from drones import drone
from hopper import hopper
from multimodal_to import scenario_files, scenarios
from multimodal_to.errors import ModelError, ScenarioError
from multimodal_to.models.terrain import FlatGround, Plane, Stairs, heights_below
from multimodal_to.models.units import REFERENCE
from multimodal_to.ocp import build
from multimodal_to.ocp.guess import contact_positions, standing_posture
from multimodal_to.ocp.variables import Layout, ranges
from multimodal_to.scenarios import Margins, Weights
from multimodal_to.scenarios.data import from_dict, to_json


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
        ({"final_com": (0.0, 0.0, 2.0), "com_range": (1.0, 1.0, 1.5)}, "beyond com_range"),
        (
            {"initial_com": (0.0, -1.6, 0.57), "com_range": (1.5, 1.5, 1.5)},
            "initial_com has y = -1.6 m, beyond com_range",
        ),
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
        ScenarioError, match=r"base_quaternion_xyzw\[0\] has to be 0 at knot 70, outside its range 0.2 to inf"
    ):
        bounds.fix("base_quaternion_xyzw", scenario.knots, np.array([0.0, 0.0, 0.0, 1.0]))


def test_an_unknown_scenario_is_named_with_those_that_exist():
    with pytest.raises(
        ScenarioError, match=r"unknown scenario 'takeof'; did you mean 'take-off'\? Available: take-off, take-off-and-l"
    ):
        scenarios.find("takeof")


def test_the_standing_posture_stands_where_it_should(ironcub, scenario):
    posture = standing_posture(ironcub, scenario.surface, scenario.initial_com)
    assert com_of(ironcub, posture) == pytest.approx(scenario.initial_com, abs=1e-8)
    heights = contact_positions(ironcub, posture)[2::3]
    assert heights.min() > -1e-8
    assert heights.max() < 2e-6
    assert np.abs(posture.joint_positions - ironcub.home.joint_positions).max() < 0.2


def stiff(robot):
    """The robot with hips that turn, and feet that lean aside, by hardly 0.1 rad from home."""
    limits, home = robot.joint_limits, robot.home.joint_positions
    lower, upper = limits.lower.copy(), limits.upper.copy()
    for index, name in enumerate(robot.joint_names):
        if name.endswith(("hip_roll", "hip_yaw", "ankle_roll")):
            lower[index], upper[index] = home[index] - 0.1, home[index] + 0.1
    return replace(robot, joint_limits=replace(limits, lower=lower, upper=upper))


def same(robot):
    return robot


@pytest.mark.parametrize(
    ("change", "surface", "upright"),
    [
        (same, Plane(slope=0.2, direction=(-1.0, 0.0)), True),  # uphill
        (same, Plane(slope=0.3, direction=(1.0, 1.0), height=-0.05), True),
        (same, Plane(slope=0.6, direction=(0.0, 1.0)), True),  # more than the ankles roll: it turns its feet
        (stiff, Plane(slope=0.6, direction=(0.0, 1.0)), False),
        (same, Stairs(edges=(0.0,), heights=(0.0, 0.05), direction=(0.0, 1.0)), True),  # one foot on the step
    ],
)
def test_a_robot_stands_on_slopes_and_steps_and_tilts_its_base_only_where_it_has_to(ironcub, change, surface, upright):
    com = (0.0, 0.0, 0.57)
    posture = standing_posture(change(ironcub), surface, com)
    points = contact_positions(ironcub, posture).reshape(-1, 3).T
    assert np.abs(points[2] - heights_below(surface, points)).max() < 2e-6
    assert com_of(ironcub, posture) == pytest.approx(com, abs=1e-8)
    assert np.linalg.norm(posture.base_quaternion_xyzw) == pytest.approx(1.0)
    turned = np.abs(posture.base_quaternion_xyzw - ironcub.home.base_quaternion_xyzw).max()
    assert (turned < 1e-9) == upright
    assert turned < 0.3


def test_a_rigid_body_on_a_slope_leans_by_just_the_slope(tmp_path):
    robot = drone(tmp_path)
    com = np.array(standing_posture(robot, FlatGround(), (0.0, 0.0, 0.4)).base_position)
    angle = np.arctan(0.3)
    normal = np.array([-np.sin(angle), 0.0, np.cos(angle)])
    posture = standing_posture(robot, Plane(slope=0.3, direction=(1.0, 0.0)), tuple(0.4 * normal))
    assert 2.0 * np.arccos(posture.base_quaternion_xyzw[3]) == pytest.approx(angle, abs=1e-4)
    assert posture.base_position == pytest.approx(com[2] * normal, abs=1e-4)


@pytest.mark.parametrize("height", [0.60, 0.57, 0.54, 0.51, 0.48, 0.45, 0.42])
def test_a_robot_that_crouches_keeps_its_feet_where_they_are_at_home(ironcub, height):
    """Seen from the CoM, and within 2 cm; without their places they are 0.25 m off at 0.42 m."""
    posture = standing_posture(ironcub, FlatGround(), (0.0, 0.0, height))
    there, at_home = (
        contact_positions(ironcub, some).reshape(-1, 3)[:, :2] - com_of(ironcub, some)[:2]
        for some in (posture, ironcub.home)
    )
    assert np.abs(there - at_home).max() < 0.02
    assert posture.base_quaternion_xyzw == pytest.approx(ironcub.home.base_quaternion_xyzw, abs=1e-9)


@pytest.mark.parametrize("height", [0.35, 0.33])
def test_a_deep_crouch_is_upright_as_long_as_there_is_a_posture(ironcub, height):
    """Feet cannot stay under the robot here; they go apart before the base leans."""
    posture = standing_posture(ironcub, FlatGround(), (0.0, 0.0, height))
    assert com_of(ironcub, posture) == pytest.approx((0.0, 0.0, height), abs=1e-8)
    assert posture.base_quaternion_xyzw == pytest.approx(ironcub.home.base_quaternion_xyzw, abs=1e-9)


def com_of(robot, posture):
    """The CoM of a posture in the world [m]."""
    return np.array(robot.kindyn.CoM_position(posture.base_transform, posture.joint_positions)).ravel()


# ------------------------------------------------------------------------------------------ margins


def test_margins_are_read_and_written_as_toml_and_json(scenario, tmp_path):
    margins = Margins(torque=0.8, friction=0.0, pressure=0.5, touch_down_speed=0.1, distance=0.02)
    task = replace(scenario, margins=margins)
    assert scenario_files.load(scenario_files.save(task, tmp_path / "mine.toml")) == task
    assert from_dict(json.loads(to_json(task))) == task
    changed = scenario_files.change(scenario, ["margins.torque=0.7"])
    assert changed.margins == replace(scenario.margins, torque=0.7)


@pytest.mark.parametrize("name", [entry.name for entry in fields(Margins)])
def test_a_margin_below_zero_is_refused_in_one_sentence(name):
    with pytest.raises(ScenarioError) as error:
        Margins(**{name: -0.1})
    assert str(error.value) == f"margin '{name}' is -0.1; expected a number of at least zero"
    with pytest.raises(ScenarioError, match=f"margin '{name}' is nan"):
        Margins(**{name: float("nan")})


@pytest.mark.parametrize("name", scenarios.SCENARIOS)
def test_bundled_scenarios_allow_nothing_beyond_the_audit_and_ask_for_every_margin(name):
    scenario = scenarios.find(name)
    assert scenario.allowances == {}
    assert all(getattr(scenario.margins, entry.name) > 0.0 for entry in fields(Margins))


@pytest.mark.parametrize("name", scenarios.SCENARIOS)
def test_a_scenario_as_in_the_paper_has_no_margins_and_no_cost_of_later(name):
    scenario = scenarios.paper(name)
    assert scenario.margins == Margins.none()
    weights = scenario.weights
    added = (weights.throttle_rate, weights.joint_accelerations, weights.foot_tilt, weights.skimming)
    assert added == (0.0, 0.0, 0.0, 0.0)


def test_ranges_that_a_scenario_leaves_open_follow_from_the_robot_and_what_is_asked(ironcub, scenario, tmp_path):
    small = hopper(tmp_path)
    length = small.units.length / REFERENCE.length
    assert scenario.base_speeds(ironcub) == (2.0, 2.0)
    assert scenario.com_box(ironcub) == (1.5, 1.5, 1.5)
    assert scenario.base_speeds(small) == pytest.approx((2.0 * length**0.5, 2.0 * length**-0.5), rel=1e-3)
    assert scenario.com_box(small) == pytest.approx((1.5 * length,) * 3, rel=1e-3)
    leap = replace(scenario, final_com=(2.0, 0.0, 0.57), mid_height_min=1.0)
    assert leap.com_box(ironcub)[0] == pytest.approx(2.0 + 0.5 * ironcub.standing_height)
    assert leap.base_speeds(ironcub.with_jets(()))[0] == pytest.approx(1.5 * (2.0 * 9.80665 * 0.43) ** 0.5)
    stated = replace(scenario, base_speed_max=3.0, com_range=(1.0, 1.0, 0.9))
    assert (stated.base_speeds(small), stated.com_box(small)) == ((3.0, 3.0), (1.0, 1.0, 0.9))


def test_a_point_that_bears_its_share_is_let_as_near_to_the_ground_by_every_robot(ironcub, scenario, tmp_path):
    for robot in (ironcub, hopper(tmp_path)):
        bounds = np.array(replace(scenario, complementarity_max=None, sliding_max=None).contact_bounds(robot))
        assert bounds * len(robot.contacts) / robot.weight / robot.standing_height == pytest.approx([1.6e-4, 6.4e-5])
