"""What the bundled scenarios must show, each solved by its example: the jump in full, others with half the knots."""

from __future__ import annotations

import numpy as np
import pytest

import multimodal_to as mt
from multimodal_to.auditing.findings import Motion
from multimodal_to.trajectory.derived import contact_points, flight_phases, footsteps, vertical_thrust


def true_motion(robot, trajectory) -> Motion:
    """The motion, which passes the audit."""
    robot = robot.with_jets(trajectory.jet_names)
    assert [finding for finding in mt.audit(robot, trajectory).findings if not finding.holds] == []
    return Motion.of(robot, trajectory)


def foot_loads(motion) -> dict[str, np.ndarray]:
    """Vertical force on each foot [N], (knots + 1,)."""
    vertical = motion.contact_forces[:, :, 2]
    feet = [contact.foot for contact in motion.robot.contacts]
    return {name: vertical[[foot == name for foot in feet]].sum(axis=0) for name in dict.fromkeys(feet)}


def stands_on_its_feet(motion):
    """At the end the robot is at rest and the ground carries it; return the thrust of the last knots over weight."""
    trajectory, weight = motion.trajectory, motion.robot.weight
    thrust = vertical_thrust(motion.robot, trajectory)
    assert np.abs(trajectory.joint_velocities[:, -1]).max() < 1e-5
    assert min(load[-1] for load in foot_loads(motion).values()) > 0.25 * weight
    assert trajectory.vertical_contact_force()[-1] + thrust[-1] == pytest.approx(weight, rel=1e-3)
    return thrust[-5:] / weight


def spooled_down(thrust):
    """The jets carry little of the weight, and keep to that."""
    return thrust[-1] < 0.15 and np.ptp(thrust) < 0.01


@pytest.fixture(scope="module")
def walk(ironcub, run_example) -> Motion:
    return true_motion(ironcub, run_example("04_walk_to_fly")[1])


def test_the_walk_steps_with_either_foot_while_the_other_carries_load(ironcub, walk):
    steps, loads, time = footsteps(ironcub, walk.trajectory, mt.FlatGround()), foot_loads(walk), walk.trajectory.time
    assert len(steps) >= 3
    assert {step.foot for step in steps} == {"left", "right"}
    for step in steps:
        other = loads["left" if step.foot == "right" else "right"]
        swing = (time > step.lift_off) & (time < step.touch_down)
        assert other[swing].min() > 0.2 * ironcub.weight


def test_the_thrust_rises_from_step_to_step(ironcub, walk):
    thrust, time = vertical_thrust(ironcub, walk.trajectory), walk.trajectory.time
    for step in footsteps(ironcub, walk.trajectory, mt.FlatGround()):
        begin, end = np.searchsorted(time, (step.lift_off, step.touch_down))
        assert thrust[end] > thrust[begin]


def test_the_walk_ends_in_a_hover(ironcub, walk):
    trajectory = walk.trajectory
    begin, end = flight_phases(ironcub, trajectory)[-1]
    assert end == trajectory.duration
    assert end - begin >= 0.3
    assert vertical_thrust(ironcub, trajectory)[-1] == pytest.approx(ironcub.weight, rel=0.01)
    assert np.abs(trajectory.com_velocity[:, -1]).max() < 1e-5
    assert trajectory.com_position[:, -1] == pytest.approx([-0.9, 0.0, 0.70], abs=1e-8)


@pytest.fixture(scope="module")
def jump(ironcub, run_example) -> Motion:
    return true_motion(ironcub, run_example("05_jump")[1])


def test_the_jump_leaves_the_ground_with_both_feet_and_lands_on_both(ironcub, jump):
    trajectory, loads = jump.trajectory, foot_loads(jump)
    assert jump.points[:, :, 2].min(axis=0).max() >= 0.02
    middle, step = trajectory.knots // 2, trajectory.time[1]
    assert trajectory.com_position[2, middle] >= 0.65 - 1e-6
    (phase,) = flight_phases(ironcub, trajectory)
    assert phase[0] < trajectory.time[middle] < phase[1]
    for load in loads.values():
        carried = trajectory.time[load > 50.0]
        assert phase[0] - carried[carried < phase[0]].max() <= 6.001 * step  # the push fades while the foot leaves
        assert carried[carried > phase[1]].min() - phase[1] <= 6.001 * step


def test_the_jump_ends_where_and_as_it_started(jump):
    joints = jump.trajectory.joint_positions
    assert np.abs(joints[:, -1] - joints[:, 0]).max() < 0.02
    points = jump.points[:, [0, -1], :2]
    assert np.abs(points[:, 1] - points[:, 0]).max() < 0.03  # and where it stood


def test_take_off_and_landing_are_one_motion(ironcub, run_example):
    motion = true_motion(ironcub, run_example("03_take_off_and_landing")[1])
    trajectory = motion.trajectory
    assert trajectory.com_position[2, trajectory.knots // 2] >= 0.70
    assert max(end - begin for begin, end in flight_phases(ironcub, trajectory)) >= 1.0
    assert spooled_down(stands_on_its_feet(motion))


def test_the_landing_touches_down_slowly_out_of_a_hover(ironcub, run_example):
    motion = true_motion(ironcub, run_example("02_landing")[1])
    trajectory, heights = motion.trajectory, motion.points[:, :, 2]
    assert trajectory.com_position[:, 0] == pytest.approx([0.0, 0.0, 0.70], abs=1e-8)
    assert vertical_thrust(ironcub, trajectory)[0] == pytest.approx(ironcub.weight, rel=1e-3)
    assert heights[:, 0].min() > 0.05
    falls = (heights[:, :-1] - heights[:, 1:]) / np.diff(trajectory.time)
    assert falls[heights[:, 1:] < 2e-3].max() <= 0.3
    assert spooled_down(stands_on_its_feet(motion))


def test_the_step_up_ends_on_the_step(ironcub, run_example):
    motion = true_motion(ironcub, run_example("06_step_up")[1])
    end = contact_points(ironcub, motion.trajectory)[:, -1]
    assert end[:, 0].max() < -0.2  # past the edge
    assert end[:, 2] == pytest.approx(0.10, abs=2e-5)
    assert stands_on_its_feet(motion)[-1] < 0.3
