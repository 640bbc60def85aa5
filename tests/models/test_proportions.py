from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import multimodal_to as mt
from drones import drone
from multimodal_to.models import proportions
from multimodal_to.models.loading import bundled_robots, load_robot
from solo import solo


def offsets(robot, frames):
    """Frames from the CoM in the home posture, (frames, 3) [m]."""
    home = robot.home
    com = np.array(robot.kindyn.CoM_position(home.base_transform, home.joint_positions)).ravel()
    fk = robot.kindyn.forward_kinematics
    points = [np.array(fk(name, home.base_transform, home.joint_positions))[:3, 3] - com for name in frames]
    return np.reshape(points, (-1, 3))


@pytest.fixture
def quadruped(tmp_path):
    return solo(tmp_path)


def test_the_ironcub_keeps_the_numbers_of_its_file(ironcub):
    assert ironcub.contact_reach.tolist() == [0.3, 0.3, 0.6]
    assert ironcub.jet_reach.tolist() == [0.5, 0.5, 0.5]
    assert (ironcub.gait.lift, ironcub.gait.swing) == (0.04, 0.65)


def test_the_defaults_of_the_ironcub_are_of_the_size_of_its_numbers(ironcub, tmp_path):
    text = (bundled_robots()["ironcub"] / "robot.toml").read_text(encoding="utf-8")
    start, end = text.index("[reach]"), text.index("[[jet]]")
    (tmp_path / "robot.toml").write_text(text[:start] + text[end:], encoding="utf-8")
    (tmp_path / "ironcub.urdf").write_bytes((bundled_robots()["ironcub"] / "ironcub.urdf").read_bytes())
    bare = load_robot(tmp_path)
    assert bare.standing_height == pytest.approx(0.5765, abs=1e-4)
    np.testing.assert_allclose(bare.contact_reach, ironcub.contact_reach, rtol=0.21)
    np.testing.assert_allclose(bare.jet_reach, ironcub.jet_reach, rtol=0.06)
    assert bare.gait.lift == pytest.approx(ironcub.gait.lift, rel=0.02)


def test_the_unit_of_length_is_the_height_of_the_com_above_the_feet(quadruped, tmp_path):
    assert quadruped.standing_height == pytest.approx(-offsets(quadruped, quadruped.contact_names)[:, 2].mean())
    assert quadruped.standing_height == pytest.approx(0.199, abs=1e-3)


def test_points_are_within_reach_at_home_however_the_robot_is_turned_about_the_vertical(quadruped):
    points = offsets(quadruped, quadruped.contact_names)
    for yaw in np.linspace(0, np.pi, 7):
        turn = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
        assert (np.abs(points @ turn.T) < quadruped.contact_reach).all()


def test_jets_are_within_reach_at_home_however_the_robot_is_turned(tmp_path):
    robot = drone(tmp_path)
    away = np.linalg.norm(offsets(robot, [jet.frame for jet in robot.jets]), axis=1)
    assert away.max() < robot.jet_reach.min()
    np.testing.assert_allclose(robot.jet_reach, 0.2 + proportions.BEYOND_HOME * 0.4)


def test_a_robot_twice_as_large_reaches_and_lifts_twice_as_far():
    rng = np.random.default_rng(3)
    contacts, jets = rng.normal(size=(4, 3)) - [0, 0, 5], rng.normal(size=(2, 3))
    height, double = (proportions.standing_height(scale * contacts, scale * jets) for scale in (1, 2))
    assert double == pytest.approx(2 * height)
    contact_reach, turned_reach = proportions.contact_reach, proportions.turned_reach
    np.testing.assert_allclose(contact_reach(2 * contacts, double), 2 * contact_reach(contacts, height))
    np.testing.assert_allclose(turned_reach(2 * jets, double), 2 * turned_reach(jets, height))


def test_a_robot_without_feet_is_measured_by_its_jets_and_one_with_nothing_by_the_metre(tmp_path):
    robot = replace(drone(tmp_path), contacts=())
    assert robot.standing_height == pytest.approx(0.2)
    assert robot.with_jets(()).standing_height == 1.0


def test_a_table_that_states_one_number_leaves_the_other_as_it_follows(tmp_path):
    stated = solo(tmp_path, more="[reach]\ncontacts = [0.5, 0.5, 0.4]\n[gait]\nswing = 0.3")
    assert stated.contact_reach.tolist() == [0.5, 0.5, 0.4]
    assert stated.gait.swing == 0.3
    assert stated.gait.lift == pytest.approx(proportions.LIFT * stated.standing_height)
    assert stated.jet_reach == pytest.approx(proportions.BEYOND_HOME * stated.standing_height)


def test_leaving_jets_off_changes_no_reach(tmp_path):
    robot = drone(tmp_path)
    assert robot.with_jets(()).jet_reach is robot.jet_reach


def step_forward():
    return mt.Scenario(
        name="steps",
        title="A small robot steps 15 cm forward",
        knots=24,
        initial_com=(-0.0159, 0.0, 0.1989),
        final_com=(0.14, 0.0, 0.1989),
        terminal=mt.Terminal.STANDING,
        interval_min=0.05,
        interval_max=0.1,
        guess_steps=4,
        weights=mt.Weights(com_acceleration=1.0, angular_momentum=1e2, joint_velocities={"legs": 0.1}, posture=1.0),
    )


def test_feet_of_a_small_robot_swing_low_in_the_start_guess(quadruped):
    problem = mt.build(quadruped, step_forward())
    guess = problem.layout.read_horizon(problem.guess * problem.scale)
    heights = guess["contact_positions"][2::3]
    assert heights.max() == pytest.approx(quadruped.gait.lift, rel=0.15)
    assert heights.max() < 0.015


def test_a_small_robot_without_jets_walks(quadruped):
    """Every foot ends where it was led, all stay within the robot's own reach, and loads stay on the ground."""
    assert not mt.doctor(quadruped, step_forward()).hopeless
    solution = mt.solve(mt.build(quadruped, step_forward()))
    assert solution.status.solved
    motion = solution.trajectory
    arms = motion.per_contact("contact_positions") - motion.com_position
    assert (np.abs(arms) <= quadruped.contact_reach[:, None] * (1 + 1e-6)).all()
    assert motion.com_position[0, -1] == pytest.approx(0.14, abs=1e-6)
    report = mt.audit(quadruped, motion)
    assert report["normal force × height"].holds
    assert report["slip under load"].holds
