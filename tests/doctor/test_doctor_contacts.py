"""The doctor finds contacts that contradict each other, the start, the end, the time, or a margin."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest

import multimodal_to as mt
from multimodal_to.doctor import Severity
from solo import LEGS, solo
from trots import trot

ON, OFF = mt.ContactState.ON, mt.ContactState.OFF


def given(of, state, begin=0.0, end=1.0, **more):
    return mt.ContactStretch(of=of, state=state, begin=begin, end=end, **more)


@pytest.fixture(scope="module")
def dog(tmp_path_factory):
    return solo(tmp_path_factory.mktemp("solo"))


def found(robot, scenario, severity):
    return [symptom.found for symptom in mt.doctor(robot, scenario).of(severity) if symptom.name == "contacts"]


def test_a_trot_that_solves_has_nothing_wrong_with_its_contacts(dog):
    assert not [symptom for symptom in mt.doctor(dog, trot(dog)).findings if symptom.name == "contacts"]


@pytest.mark.parametrize(
    ("contacts", "says"),
    [
        ((given(["FL", "FR"], OFF, 0.0, 0.2),), "starts standing, and FL, FR are off at the start; the others leave"),
        ((given(LEGS, OFF, 0.9, 1.0),), "ends standing, and all feet are off at the end"),
        ((given("FL", ON, 0.0, 0.5), given("FL", OFF, 0.4, 0.6)), "says the opposite"),
        ((given("nose", ON),), "unknown foot or contact point 'nose'"),
    ],
)
def test_contacts_that_no_motion_can_have_are_errors(dog, contacts, says):
    (error,) = found(dog, trot(dog, gait=None, contacts=contacts), Severity.ERROR)
    assert says in error


def test_a_foot_may_be_off_at_the_start_where_the_others_hold_the_robot(dog):
    """Its CoM is behind the middle of its feet, so that it falls over a hind foot that is missing."""
    front, hind = (trot(dog, gait=None, contacts=(given(foot, OFF, 0.0, 0.2),)) for foot in ("FL", "HL"))
    assert not found(dog, front, Severity.ERROR)
    assert found(dog, hind, Severity.ERROR)


def test_a_flight_that_is_too_long_for_the_speed_is_an_error_and_one_that_is_long_a_warning(dog):
    def flight(end, **changes):
        return trot(dog, gait=None, contacts=(given(LEGS, OFF, 0.3, end),), **changes)

    (error,) = found(dog, flight(0.9), Severity.ERROR)
    assert re.search(r"at least 0\.74 s.* take off at 3\.6\d* m/s", error)
    assert not found(dog, flight(0.45), Severity.ERROR)
    (warning,) = found(dog, flight(0.45, base_speed_max=0.9), Severity.WARNING)
    assert "base_speed_max is 0.9 m/s" in warning


def test_a_clearance_from_which_a_foot_cannot_come_down_as_gently_as_asked_is_an_error(dog):
    gentle = trot(dog, margins=mt.Margins(touch_down_speed=0.04))
    (error,) = found(dog, gentle, Severity.ERROR)
    assert "0.03 m high" in error
    assert not found(dog, trot(dog, margins=mt.Margins(touch_down_speed=0.0)), Severity.ERROR)


def test_feet_that_stand_at_the_end_of_a_hover_are_a_warning(ironcub):
    hover = replace(mt.scenarios.take_off(), contacts=(given("left", ON),))
    (warning,) = found(ironcub, hover, Severity.WARNING)
    assert "ends in a hover, and left is on at the end" in warning


def test_a_keyframe_on_the_way_that_the_contacts_contradict_is_named(ironcub, dog):
    hover = replace(
        mt.scenarios.take_off(),
        contacts=(given("left", ON, 0.4, 0.6),),
        keyframes=(mt.Keyframe(when=0.5, hover=True, com=(0.0, 0.0, 0.65)),),
    )
    (warning,) = found(ironcub, hover, Severity.WARNING)
    assert "keyframe 1 hovers at knot 35, and left is on there" in warning
    jump = trot(dog, gait=None, contacts=(given(LEGS, OFF, 0.4, 0.6),))
    stands = replace(jump, keyframes=(mt.Keyframe(when=0.5, standing=True),))
    assert any(
        "keyframe 1 stands at knot 30, all feet are off there" in one for one in found(dog, stands, Severity.ERROR)
    )


def test_a_frame_that_a_keyframe_asks_to_be_where_a_box_keeps_it_out_is_an_error(dog):
    """2 cm inside a box that it keeps 1 cm away from is 3 cm too far; outside of its stretch there is no box."""
    box = mt.Box(lower=(0.0, 0.0, 0.2), upper=(1.0, 1.0, 0.4), of=("base_link",), distance=0.01, begin=0.4)
    asked = mt.Keyframe(when=0.5, frames={"base_link": mt.FrameTarget(position=(0.15, 0.02, 0.23))})
    inside = trot(dog, boxes=(box,), keyframes=(asked,))
    (error,) = [one for one in mt.doctor(dog, inside).of(Severity.ERROR) if one.name == "keyframe 1"]
    assert "base_link has to be at (0.15, 0.02, 0.23) m, 0.03 m beyond where" in error.found
    earlier = replace(inside, keyframes=(replace(asked, when=0.2),))
    assert not [one for one in mt.doctor(dog, earlier).of(Severity.ERROR) if one.name == "keyframe 1"]
