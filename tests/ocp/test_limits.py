"""Limits over a stretch: bounds there and nowhere else, kept by plans, seen by the audit, the doctor and `relax`."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import multimodal_to as mt
from drones import HOP, drone
from hopper import hop
from hopper import hopper as make_hopper
from multimodal_to.doctor import Severity
from multimodal_to.errors import ScenarioError

SLOW = mt.Limits(base_speed=0.08, thrusts={"left": 110.0}, begin=0.7, end=0.9)


@pytest.fixture(scope="module")
def plane(tmp_path_factory):
    return drone(tmp_path_factory.mktemp("drone"))


@pytest.fixture(scope="module")
def hopper(tmp_path_factory):
    return make_hopper(tmp_path_factory.mktemp("hopper"))


@pytest.fixture(scope="module")
def plans(plane):
    """The hop without limits, and with some."""
    return [mt.solve(mt.build(plane, scenario)) for scenario in (HOP, replace(HOP, limits=(SLOW,)))]


def errors(robot, scenario, name):
    return [one.found for one in mt.doctor(robot, scenario).of(Severity.ERROR) if one.name == name]


def test_a_limit_is_a_bound_over_its_stretch_and_no_row(plane):
    """A speed is that of an interval, which ends at its knot; a thrust is that at a knot."""
    free, problem = mt.build(plane, HOP), mt.build(plane, replace(HOP, limits=(SLOW,)))
    assert problem.row_lower.size == free.row_lower.size
    assert "limits" in problem.bound_rows
    for name, rows, most, knots in (
        ("base_linear_velocity", slice(None), 0.08, range(22, 28)),
        ("thrust", [plane.jet_names.index("left")], 110.0, range(21, 28)),
    ):
        lower, upper = (
            problem.layout.read_horizon(side * problem.scale)[name][rows] for side in (problem.lower, problem.upper)
        )
        before = free.layout.read_horizon(free.upper * free.scale)[name][rows]
        narrowed = (upper < before).all(axis=0)
        assert np.flatnonzero(narrowed).tolist() == list(knots)
        assert upper[:, narrowed] == pytest.approx(most)
        assert lower[:, narrowed] == pytest.approx(0.0 if name == "thrust" else -most)


def test_joints_are_limited_by_name_or_by_group(hopper):
    (group,) = hopper.joint_groups
    slow = mt.Limits(joint_speeds={group: 0.5, "left_pitch": 0.2}, begin=0.5)
    problem = mt.build(hopper, hop(hopper, knots=6, limits=(slow,)))
    upper = problem.layout.read_horizon(problem.upper * problem.scale)["joint_velocities"]
    wanted = np.where(np.array(hopper.joint_names) == "left_pitch", 0.2, 0.5)
    assert upper[:, 5] == pytest.approx(wanted)
    assert upper[:, 3] == pytest.approx(hopper.joint_limits.speed)


def test_a_plan_keeps_its_limits_and_the_audit_sees_one_that_does_not(plane, plans):
    free, slow = plans
    assert free.status.solved
    assert slow.status.solved
    assert 0.075 < np.abs(slow.trajectory.base_linear_velocity[:, 22:28]).max() < 0.08 + 1e-6
    judged = {one.name: one.holds for one in mt.audit(plane, slow.trajectory).findings if "limits" in one.name}
    assert judged == dict.fromkeys(
        ["limits: base speed", "limits: turning speed", "limits: joint speed", "limits: thrust"], True
    )
    report = mt.audit(plane, free.trajectory, replace(HOP, limits=(SLOW,)))
    finding = report["limits: base speed"]
    assert not finding.holds
    assert finding.body == "base z"
    assert finding.knot in range(22, 28)
    fastest = np.abs(free.trajectory.base_linear_velocity[:, 22:28]).max()
    assert finding.worst == pytest.approx(fastest - 0.08)


def test_a_way_that_limits_leave_no_time_for_gives_way_by_their_name(plane):
    """In 8 intervals of 0.1 s at 0.05 m/s it comes 4 cm far, of 20; what is asked gives way, not physics."""
    task = replace(
        HOP,
        knots=8,
        start=mt.Start.HOVER,
        initial_com=(0.0, 0.0, 0.5),
        final_com=(0.0, 0.0, 0.7),
        interval_max=0.1,
        limits=(mt.Limits(base_speed=0.05),),
    )
    (said,) = [one for one in mt.doctor(plane, task).findings if one.name == "time for the distance"]
    assert "and `limits` are less" in said.found
    relaxed = mt.relax(mt.build(plane, task))
    assert relaxed.status.solved
    assert {one.name for one in relaxed.gives_way} <= {"limits", "end: CoM"}
    assert relaxed.gives_way


def test_the_doctor_compares_limits_with_the_weight_in_a_hover_and_with_ways_of_joints(plane, hopper):
    weak = replace(HOP, limits=(mt.Limits(thrusts={"left": 80.0, "right": 80.0}, begin=0.9),))
    (said,) = errors(plane, weak, "limits")
    assert "end hovers at knot 30, the robot weighs 196 N, and the limits let its jets hold at most 160 N there" in said
    earlier = replace(weak, limits=(replace(weak.limits[0], begin=0.1, end=0.9),))
    assert not errors(plane, earlier, "limits")
    bent = hop(hopper, keyframes=(mt.Keyframe(knot=20, joints={"left_pitch": 0.5}),))
    assert not errors(hopper, bent, "keyframe 1")
    (said,) = errors(hopper, replace(bent, limits=(mt.Limits(joint_speeds={"left_pitch": 0.1}),)), "keyframe 1")
    assert "its greatest speed is 3 rad/s and `limits` are less" in said


def test_a_turn_that_limits_leave_no_time_for_is_said(plane):
    turn = replace(HOP, keyframes=(mt.Keyframe(when="end", hover=True, yaw=1.0),))
    assert not errors(plane, turn, "keyframe 1")
    (said,) = errors(plane, replace(turn, limits=(mt.Limits(turning_speed=0.05),)), "keyframe 1")
    assert "the base has to turn by 1 rad" in said
    assert "and `limits` are less" in said


@pytest.mark.parametrize(
    ("limits", "says"),
    [
        ({"joint_speeds": {"tail": 1.0}}, "unknown joint or joint group 'tail'"),
        ({"thrusts": {"tail": 1.0}}, "unknown jet 'tail'"),
    ],
)
def test_limits_of_what_is_not_there_are_refused(plane, limits, says):
    task = replace(HOP, limits=(mt.Limits(**limits),))
    with pytest.raises(ScenarioError, match=says):
        mt.build(plane, task)
    assert any(says in one for one in errors(plane, task, "limits"))


@pytest.mark.parametrize(
    ("fields", "says"),
    [
        ({}, "nothing is limited"),
        ({"base_speed": -1.0}, "base_speed is -1.0; expected a number of at least zero"),
        ({"thrusts": {"left": float("nan")}}, "thrusts.left is nan"),
        ({"base_speed": 1.0, "begin": 0.5, "end": 0.5}, "expected a begin before the end"),
    ],
)
def test_limits_that_make_no_sense_are_refused(fields, says):
    with pytest.raises(ScenarioError, match=says):
        mt.Limits(**fields)
