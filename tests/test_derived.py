from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from multimodal_to.derived import base_poses
from multimodal_to.errors import InputError
from multimodal_to.resampling import resample
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
