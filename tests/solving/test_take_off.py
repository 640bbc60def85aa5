"""The main job: the take-off, judged from its saved file."""

from __future__ import annotations

import numpy as np
import pytest

from multimodal_to.auditing.audit import audit
from multimodal_to.solving import Status
from multimodal_to.trajectory import Trajectory
from multimodal_to.trajectory.derived import contact_points, flight_phases, vertical_thrust


@pytest.fixture(scope="module")
def saved(take_off, tmp_path_factory) -> Trajectory:
    return Trajectory.load(take_off.trajectory.save(tmp_path_factory.mktemp("take-off") / "trajectory.npz"))


def test_it_ends_optimal_with_its_rows_met(take_off):
    assert take_off.status is Status.OPTIMAL
    assert max(take_off.violations.values()) <= 1e-5
    assert sum(take_off.costs.values()) == pytest.approx(take_off.objective)


def test_every_property_of_the_audit_holds(ironcub, saved):
    failed = [finding for finding in audit(ironcub, saved).findings if not finding.holds]
    assert failed == []


def test_it_starts_standing_with_forces_that_hold_the_weight(ironcub, saved):
    assert saved.com_position[:, 0] == pytest.approx([0.0, 0.0, 0.57], abs=1e-9)
    assert saved.vertical_contact_force()[0] == pytest.approx(ironcub.weight, rel=1e-6)
    assert np.abs(saved.thrust[:, 0]).max() == 0.0
    assert np.abs(saved.joint_velocities[:, 0]).max() == 0.0


def test_it_ends_at_rest_in_the_air(ironcub, saved):
    assert saved.com_position[:, -1] == pytest.approx([0.0, 0.0, 0.70], abs=1e-8)
    for name in ("com_velocity", "com_acceleration", "angular_momentum", "base_linear_velocity", "joint_velocities"):
        assert np.abs(getattr(saved, name)[:, -1]).max() < 1e-5, name
    assert vertical_thrust(ironcub, saved)[-1] == pytest.approx(ironcub.weight, rel=0.01)
    assert contact_points(ironcub, saved)[:, -1, 2].min() > 0.05


def test_it_flies_once_and_for_at_least_half_a_second(ironcub, saved):
    phases = flight_phases(ironcub, saved)
    assert len(phases) == 1
    assert phases[0][1] - phases[0][0] >= 0.5
    assert phases[0][1] == pytest.approx(saved.duration)


def test_the_thrust_takes_the_weight_over_smoothly(ironcub, saved):
    ground, thrust = saved.vertical_contact_force(), vertical_thrust(ironcub, saved)
    last = np.flatnonzero(ground > 0.02 * ironcub.weight)[-1]
    assert np.diff(ground[: last - 1]).max() < 0.005 * ironcub.weight  # it falls, but for ripples,
    assert np.diff(ground).max() < 0.05 * ironcub.weight  # until the toes push off
    assert np.abs(np.diff(ground)).max() < 0.1 * ironcub.weight  # without a step
    assert np.abs(ground + thrust - ironcub.weight).max() < 0.1 * ironcub.weight  # together they carry the robot


def test_every_point_stays_where_it_stood_until_it_has_carried_its_last_load(ironcub, saved):
    points = contact_points(ironcub, saved)
    loaded = saved.per_contact("contact_forces")[:, 2] > 5.0
    for point, load in zip(points, loaded, strict=True):
        last = np.flatnonzero(load)[-1]
        assert np.abs(point[: last + 1, :2] - point[0, :2]).max() < 2e-3  # all slips together, over some fifty knots
