"""What the doctor says of keyframes that cannot be met, or hardly, and that it lets pass those that can."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import multimodal_to as mt
from drones import drone
from hopper import hop
from hopper import hopper as make_hopper
from multimodal_to.doctor import Severity
from multimodal_to.doctor.posture import extent

HAND = "l_arm_jet_turbine"
AT_HOME = (-0.25, -0.2415, -0.161)
"""Where the left hand is from the CoM at home [m]."""


@pytest.fixture(scope="module")
def hopper(tmp_path_factory):
    return make_hopper(tmp_path_factory.mktemp("hopper"))


def hovering(**keyframe):
    task = replace(mt.scenarios.landing(), terminal=mt.Terminal.HOVER, final_com=(0.0, 0.0, 0.7))
    return replace(task, keyframes=(mt.Keyframe(**keyframe),))


def found(robot, task, label="keyframe 1"):
    return [one for one in mt.doctor(robot, task).findings if one.name == label and one.severity is not Severity.NOTE]


@pytest.mark.parametrize(
    ("asked", "severity", "sentence"),
    [
        (
            {"knot": 30, "joints": {"l_knee": 0.5}},
            Severity.ERROR,
            "l_knee has to be 0.5 rad, and its range is -1.745 to 0 rad",
        ),
        (
            {"knot": 30, "frames": {HAND: mt.FrameTarget(position=(9.0, 0.0, 0.7))}, "com": (0.0, 0.0, 0.7)},
            Severity.ERROR,
            f"{HAND} has to be 9 m from the CoM, and the robot is at most",
        ),
        (
            {"knot": 30, "frames": {HAND: mt.FrameTarget(position=(-0.8, 0.0, 0.7))}, "com": (0.0, 0.0, 0.7)},
            Severity.WARNING,
            f"asked for at once: CoM x stays 0.0699 m off, {HAND} position x stays",
        ),
        ({"knot": 2, "yaw": 1.0, "hover": True}, Severity.ERROR, "the base has to turn by 1 rad from the start"),
        ({"knot": 3, "yaw": 0.7}, Severity.WARNING, "the base has to turn by 0.7 rad from the start in at most 0.3 s"),
        ({"knot": 40, "standing": True, "com": (0.0, 0.0, 0.7)}, Severity.ERROR, "0.7 m above the feet, beyond"),
        ({"knot": 40, "standing": True, "com": (0.0, 0.0, 0.2)}, Severity.WARNING, "no posture of ironcub"),
        (
            {"knot": 30, "com": {"z": 0.7}, "base_position": {"z": 3.0}},
            Severity.ERROR,
            "the base has to be 2.3 m from the CoM, and the robot reaches",
        ),
        (
            {"knot": 30, "com": {"z": 0.7}, "base_position": {"z": 0.4}},
            Severity.WARNING,
            "no posture was found with all that is asked for at once: ",
        ),
        (
            {"knot": 40, "standing": True, "frames": {"l_sole_1": mt.FrameTarget(position={"z": 0.1})}},
            Severity.WARNING,
            "no posture was found with all that is asked for at once: ",
        ),
        (
            {"knot": 40, "hover": True, "base_orientation": (0.0, math.sqrt(0.5), 0.0, math.sqrt(0.5))},
            Severity.WARNING,
            "no posture was found with all that is asked for at once: balance",
        ),
        (
            {
                "knot": 40,
                "base_orientation": (0.0, 0.0, 0.0, 1.0),
                "frames": {"root_link": mt.FrameTarget(orientation=(0.0, 0.0, 0.5, 1.0))},
            },
            Severity.WARNING,
            "no posture was found with all that is asked for at once: ",
        ),
        (
            {"knot": 40, "momentum": mt.Momentum(linear={"x": 1e3})},
            Severity.WARNING,
            "linear momentum x asks the CoM to go at",
        ),
    ],
)
def test_a_keyframe_that_cannot_be_met_is_named_with_what_stands_against_it(ironcub, asked, severity, sentence):
    (finding,) = found(ironcub, hovering(**asked))
    assert finding.severity is severity
    assert sentence in finding.found


@pytest.mark.parametrize(
    "asked",
    [
        {"knot": 30, "joints": {"l_knee": -0.5}},
        {"knot": 30, "frames": {HAND: mt.FrameTarget(position=(-0.3, -0.28, 0.58))}, "com": (0.0, 0.0, 0.7)},
        {"knot": 30, "yaw": 1.0, "hover": True},
    ],
)
def test_a_keyframe_that_can_be_met_passes(ironcub, asked):
    assert found(ironcub, hovering(**asked)) == []


def test_a_joint_that_has_to_go_too_fast_is_refused(hopper):
    asked = (
        mt.Keyframe(knot=20, joints={"left_pitch": 0.5}),
        mt.Keyframe(knot=21, joints={"left_pitch": -0.3}, joint_tolerance=0.1),
    )
    (finding,) = found(hopper, hop(hopper, keyframes=asked), "keyframe 2")
    assert (
        "left_pitch has to go 0.7 rad from keyframe 1 in at most 0.2 s, and its greatest speed is 3 rad/s"
        in finding.found
    )
    early = (mt.Keyframe(knot=1, joints={"left_pitch": 0.7}),)
    (finding,) = found(hopper, hop(hopper, keyframes=early))
    assert "from the start in at most 0.2 s" in finding.found


def test_a_way_between_keyframes_that_is_too_long_for_its_time_is_refused(hopper):
    asked = (mt.Keyframe(knot=20, com={"x": 0.0}), mt.Keyframe(knot=21, com_min={"x": 1.2}))
    (finding,) = found(hopper, hop(hopper, keyframes=asked), "time for the distance")
    assert "1.2 m along x from keyframe 1 to keyframe 2 in at most 0.2 s (1 intervals" in finding.found


def test_a_hover_on_the_way_asks_for_time_to_spool_up(hopper):
    early = hop(hopper, keyframes=(mt.Keyframe(knot=10, hover=True),))
    (finding,) = found(hopper, early, "spool-up")
    assert "the time until the hover at knot 10 is at most 2 s long" in finding.found
    assert mt.doctor(hopper, early).hopeless
    assert found(hopper, replace(early, keyframes=(mt.Keyframe(knot=25, hover=True),)), "spool-up") == []
    no_jets = replace(early, jets=False, terminal=mt.Terminal.STANDING, final_com=(0.0, 0.0, 0.4))
    (finding,) = found(hopper, no_jets, "thrust")
    assert "has to hover at the keyframe 1 without jets" in finding.found


def test_a_jump_at_a_keyframe_needs_time_speed_and_short_intervals(ironcub):
    def jump(height, knot=50, **changes):
        steps = {"knots": 100, "interval_min": 0.02, "interval_max": 0.02, "mid_height_min": None}
        task = replace(mt.scenarios.jump(), **steps | changes)
        return replace(task, keyframes=(mt.Keyframe(knot=knot, com_min={"z": height}),))

    assert found(ironcub, jump(0.65), "leap") == []
    (finding,) = found(ironcub, jump(0.7, knot=3), "leap")
    assert finding.severity is Severity.ERROR
    assert "knot 3 is at most 0.06 s after the start" in finding.found
    (finding,) = found(ironcub, jump(1.2, base_speed_max=2.0), "leap")
    rise = 1.2 - ironcub.contact_reach[2]
    assert f"lifts off at {math.sqrt(2 * 9.81 * rise):.2g} m/s" in finding.found
    (finding,) = found(ironcub, jump(0.61, interval_min=0.1, interval_max=0.1), "leap")
    assert finding.severity is Severity.WARNING
    assert "less than 4 intervals of 0.1 s" in finding.found


def test_a_yaw_that_no_force_makes_is_said(tmp_path):
    robot = drone(tmp_path)
    task = mt.Scenario(
        name="turn",
        title="turn",
        knots=30,
        start=mt.Start.HOVER,
        initial_com=(0.0, 0.0, 0.6),
        final_com=(0.0, 0.0, 0.6),
        terminal=mt.Terminal.HOVER,
        interval_min=0.1,
        interval_max=0.1,
        weights=mt.Weights(com_velocity=1e3),
        keyframes=(mt.Keyframe(when="end", yaw=0.5),),
    )
    (finding,) = found(robot, task)
    assert "no force turns the robot about it while it is in the air" in finding.found


@pytest.mark.parametrize("seed", range(20))
def test_no_posture_has_its_com_beyond_the_extent_from_a_frame(ironcub, seed):
    limits = ironcub.joint_limits
    joints = np.random.default_rng(seed).uniform(limits.lower, limits.upper)
    com = np.array(ironcub.kindyn.CoM_position(np.eye(4), joints)).ravel()
    for frame in (HAND, "l_sole_1"):
        there = np.array(ironcub.kindyn.forward_kinematics(frame, np.eye(4), joints))[:3, 3]
        assert np.linalg.norm(there - com) < extent(ironcub, frame)


def test_a_way_of_the_base_between_keyframes_that_is_too_long_is_refused(hopper):
    asked = (mt.Keyframe(knot=20, base_position={"x": 0.0}), mt.Keyframe(knot=21, base_position={"x": 1.2}))
    (finding,) = found(hopper, hop(hopper, keyframes=asked), "time for the distance")
    assert "the base has to go 1.2 m along x from keyframe 1 to keyframe 2 in at most 0.2 s" in finding.found


def test_a_momentum_that_gravity_cannot_take_in_time_is_refused(ironcub):
    """From 80 kg m/s up to as much down gravity needs 0.36 s, 18 intervals of 0.02 s."""

    def thrown(knots):
        asked = (
            mt.Keyframe(knot=40, momentum=mt.Momentum(linear={"z": 80.0})),
            mt.Keyframe(knot=40 + knots, momentum=mt.Momentum(linear={"z": -80.0})),
        )
        return replace(mt.scenarios.jump(), interval_min=0.02, interval_max=0.02, keyframes=asked)

    (finding,) = found(ironcub, thrown(10), "keyframe 2")
    assert finding.severity is Severity.ERROR
    assert "the momentum upwards has to fall by 160 kg m/s from keyframe 1, and gravity takes at most" in finding.found
    assert found(ironcub, thrown(20), "keyframe 2") == []
