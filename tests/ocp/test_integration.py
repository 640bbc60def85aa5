from __future__ import annotations

import casadi as cs
import numpy as np
import pytest

from multimodal_to.adam import quaternion
from multimodal_to.ocp.integration import BACKWARD_EULER, Interval


def test_the_gap_closes_when_the_end_is_the_start_plus_rate_times_interval():
    interval = Interval(1.0, 1.6, 0.3, BACKWARD_EULER)
    assert interval.gap(lambda position: position, lambda position: 2.0) == pytest.approx(0.0)
    assert interval.rate(lambda position: position) == pytest.approx(2.0)


def test_a_constant_angular_velocity_turns_the_whole_angle():
    """Ten intervals about a world axis, against the rotation by the whole angle at once."""
    rng = np.random.default_rng(0)
    omega, dt = rng.normal(size=3), 0.1
    start = rng.normal(size=4)
    start /= np.linalg.norm(start)
    end = cs.DM(start)
    for _ in range(10):
        still = Interval(end, end, dt, BACKWARD_EULER)  # the gap of standing still is what has to be moved
        end = end - still.rotation_gap(lambda quaternion: quaternion, lambda quaternion: cs.DM(omega))
    whole = quaternion.rotation_matrix(quaternion.exp(cs.DM(omega * 10 * dt)))
    expected = np.array(whole) @ np.array(quaternion.rotation_matrix(cs.DM(start)))
    assert np.array(quaternion.rotation_matrix(end)) == pytest.approx(expected, abs=1e-12)
    assert float(cs.norm_2(end)) == pytest.approx(1.0, abs=1e-12)
