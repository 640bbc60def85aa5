"""Legs with fewer joints than a foot on the ground takes: the ground holds the robot twice, and lets it creep a bit."""

from __future__ import annotations

import numpy as np
import pytest

import multimodal_to as mt
from hopper import hopper
from multimodal_to.models.stiff_legs import CREEP, on_stiff_legs
from multimodal_to.tasks.leaping import leap_height
from one_leg import one_leg
from places import example_robots


@pytest.fixture(scope="module")
def solo8(tmp_path_factory):
    """Solo with two joints in each leg, which cannot move a foot sideways."""
    folder = tmp_path_factory.mktemp("solo8") / "robot"
    return mt.robots.init(example_robots() / "solo_description/robots/solo.urdf", folder).robot


def test_a_leg_is_stiff_where_its_foot_takes_more_than_its_joints_give(tmp_path, solo8, ironcub):
    assert on_stiff_legs(solo8).all()
    assert not on_stiff_legs(mt.load_robot("solo12")).any()  # three joints to a point
    assert not on_stiff_legs(ironcub).any()  # six joints to a sole
    assert not on_stiff_legs(hopper(tmp_path / "hopper")).any()  # its feet are on the base
    assert not on_stiff_legs(one_leg(tmp_path)).any()


def test_solo_with_eight_joints_walks_and_its_feet_stay_where_they_are(solo8):
    problem = mt.build(solo8, mt.tasks.walk(solo8))
    solution = mt.solve(problem, mt.Ipopt(max_iterations=200))
    assert solution.status is mt.Status.OPTIMAL
    assert mt.audit(problem.robot, solution.trajectory).holds
    on = problem.parameters.contacts.on[:, 1:]
    points = solution.trajectory.per_contact("contact_positions")
    creep = np.abs(np.diff(points[:, :2], axis=2)).max(axis=1)[on]
    assert creep.max() < 1.1 * CREEP.of(solo8.units)


def test_solo_with_eight_joints_jumps_as_high_as_with_twelve(solo8):
    """Straight up, without any turn or way aside, its legs cannot throw it at all; nearly so they can."""
    assert leap_height(solo8) == pytest.approx(leap_height(mt.load_robot("solo12")), rel=0.1)
    problem = mt.build(solo8, mt.tasks.jump(solo8))
    motion = mt.solve(problem, mt.Ipopt(max_iterations=200)).trajectory
    report = mt.audit(problem.robot, motion)
    assert report.holds
    assert report.airborne > 0.1
