"""The landing, with all its knots, from the plain start guess."""

from __future__ import annotations

import numpy as np
import pytest

import multimodal_to as mt
from multimodal_to.derived import contact_points, vertical_thrust


@pytest.fixture(scope="module")
def landing(ironcub) -> mt.Solution:
    return mt.solve(mt.build(ironcub, mt.scenarios.landing()))


def test_it_ends_optimal_and_is_physically_true(ironcub, landing):
    assert landing.status is mt.Status.OPTIMAL
    assert [finding for finding in mt.audit(ironcub, landing.trajectory).findings if not finding.holds] == []


def test_it_starts_in_a_hover(ironcub, landing):
    trajectory = landing.trajectory
    assert trajectory.com_position[:, 0] == pytest.approx([0.0, 0.0, 0.70], abs=1e-8)
    assert trajectory.vertical_contact_force()[0] < 0.1
    assert vertical_thrust(ironcub, trajectory)[0] == pytest.approx(ironcub.weight, rel=1e-3)
    assert contact_points(ironcub, trajectory)[:, 0, 2].min() > 0.05


def test_it_ends_standing_at_rest_on_both_feet_with_the_jets_spooling_down(ironcub, landing):
    trajectory = landing.trajectory
    assert np.abs(contact_points(ironcub, trajectory)[:, -1, 2]).max() < 2e-5
    assert np.abs(trajectory.joint_velocities[:, -1]).max() < 1e-5
    assert trajectory.vertical_contact_force()[-1] > 0.8 * ironcub.weight
    assert vertical_thrust(ironcub, trajectory)[-1] < 0.15 * ironcub.weight


def test_the_feet_touch_down_slowly(ironcub, landing):
    heights = contact_points(ironcub, landing.trajectory)[:, :, 2]
    falls = (heights[:, :-1] - heights[:, 1:]) / np.diff(landing.trajectory.time)
    touching = (heights[:, 1:] < 1e-3) & (heights[:, :-1] >= 1e-3)
    assert touching.any(axis=1).all()
    assert falls[touching].max() <= 0.3
