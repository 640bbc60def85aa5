from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from multimodal_to.errors import InputError
from multimodal_to.models.terrain import FlatGround
from multimodal_to.trajectory.derived import base_poses, footsteps
from multimodal_to.trajectory.resampling import resample
from synthetic import DURATION, take_off


@pytest.fixture(scope="module")
def trajectory(ironcub):
    return take_off(ironcub)


def test_at_its_own_knots_a_resampled_trajectory_is_itself(trajectory):
    again = resample(trajectory, trajectory.time)
    for name in ("joint_positions", "thrust", "contact_forces", "base_quaternion_xyzw"):
        np.testing.assert_allclose(getattr(again, name), getattr(trajectory, name), atol=1e-12)


def test_between_knots_the_base_turns_at_constant_rate_the_shorter_way(trajectory):
    quaternions = np.zeros((4, trajectory.time.size))
    angles = 3.0 * trajectory.time
    quaternions[2:] = np.sin(angles / 2), np.cos(angles / 2)
    quaternions[:, 1::2] *= -1.0  # the same turns, written with the other sign
    turning = replace(trajectory, base_quaternion_xyzw=quaternions)
    times = np.linspace(0.0, DURATION, 47)
    poses = base_poses(resample(turning, times))
    np.testing.assert_allclose(poses[:, 0, 0], np.cos(3.0 * times), atol=1e-12)
    np.testing.assert_allclose(poses[:, 1, 0], np.sin(3.0 * times), atol=1e-12)


def test_between_knots_everything_else_is_linear(trajectory):
    half = resample(trajectory, (trajectory.time[1:] + trajectory.time[:-1]) / 2)
    expected = (trajectory.joint_positions[:, 1:] + trajectory.joint_positions[:, :-1]) / 2
    np.testing.assert_allclose(half.joint_positions, expected, atol=1e-12)


@pytest.mark.parametrize("times", [[-0.1, 1.0], [0.0, DURATION + 0.1]])
def test_a_time_outside_the_trajectory_is_refused(trajectory, times):
    with pytest.raises(InputError, match="expected 0 to 2 s"):
        resample(trajectory, times)


def walking(robot, trajectory, *, lift, length):
    """A trajectory whose base goes by `length` and up by `lift` in the middle, with the load off both feet there."""
    position, forces = trajectory.base_position.copy(), np.zeros_like(trajectory.contact_forces)
    position[:] = robot.home.base_position[:, None]
    position[0] += np.linspace(0.0, length, position.shape[1])
    position[2, 8:13] += lift
    forces[2::3] = 50.0
    forces[:, 8:13] = 0.0
    standing = np.repeat(robot.home.base_quaternion_xyzw[:, None], position.shape[1], axis=1)
    joints = np.repeat(robot.home.joint_positions[:, None], position.shape[1], axis=1)
    return replace(
        trajectory, base_position=position, base_quaternion_xyzw=standing, joint_positions=joints, contact_forces=forces
    )


def test_a_foot_that_lifts_and_comes_down_elsewhere_has_stepped(ironcub, trajectory):
    steps = footsteps(ironcub, walking(ironcub, trajectory, lift=0.02, length=0.4), FlatGround())
    assert [step.foot for step in steps] == ["left", "right"]
    for step in steps:
        assert (step.lift_off, step.touch_down) == pytest.approx((0.7, 1.3))
        assert step.length == pytest.approx(0.12)  # six of twenty intervals
        assert step.lift == pytest.approx(0.02, abs=2e-3)


@pytest.mark.parametrize(("lift", "length"), [(0.005, 0.4), (0.02, 0.1)], ids=["it skims", "it comes down near"])
def test_a_foot_that_skims_or_comes_down_near_has_not_stepped(ironcub, trajectory, lift, length):
    assert footsteps(ironcub, walking(ironcub, trajectory, lift=lift, length=length), FlatGround()) == []


def test_a_foot_that_stays_in_the_air_has_not_stepped(ironcub, trajectory):
    assert footsteps(ironcub, trajectory, FlatGround()) == []


def test_how_high_a_foot_lifts_is_seen_from_the_ground_below_it(ironcub, trajectory):
    walk = walking(ironcub, trajectory, lift=0.02, length=0.4)
    (left, _) = footsteps(ironcub, walk, FlatGround(height=-0.5))
    assert left.lift == pytest.approx(0.52, abs=2e-3)
