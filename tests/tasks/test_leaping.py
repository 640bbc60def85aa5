"""How high motors can throw a robot: a body on one sliding leg, of which that is known on paper."""

from __future__ import annotations

import math

import pytest

import multimodal_to as mt
from multimodal_to.errors import ScenarioError
from multimodal_to.tasks.leaping import STROKE, STRONGEST, leap_height
from multimodal_to.tasks.on_feet import HEIGHT

MASS, HIGH, G = 10.0, 0.5, 9.80665  # kg, m, m/s²
_URDF = """
<robot name="piston"><link name="body"><inertial><mass value="{mass}"/>
<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="foot"><inertial><mass value="1e-6"/>
<inertia ixx="1e-9" iyy="1e-9" izz="1e-9" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="leg" type="prismatic"><parent link="body"/><child link="foot"/><origin xyz="0 0 -{high}"/>
<axis xyz="0 0 1"/><limit lower="-0.2" upper="{shorter}" effort="{effort}" velocity="100"/></joint></robot>"""
_TOML = """
name = "piston"
urdf = "piston.urdf"
[joints]
leg = {{ lower = -0.2, upper = {shorter}, speed = {speed}, home = 0.0 }}
[frames]
a = {{ link = "foot", position = [0.1, 0.1, 0.0] }}
b = {{ link = "foot", position = [-0.1, 0.1, 0.0] }}
c = {{ link = "foot", position = [-0.1, -0.1, 0.0] }}
d = {{ link = "foot", position = [0.1, -0.1, 0.0] }}
[home]
base_position = [0.0, 0.0, {high}]
base_quaternion_xyzw = [0.0, 0.0, 0.0, 1.0]
[contact]
friction = 0.5
[contact.feet]
foot = ["a", "b", "c", "d"]
"""


def piston(folder, *, push=2.0, speed=50.0, shorter=0.3):
    """A body that the motor pushes up by `push` m g of the nine tenths that plans may use."""
    numbers = {"mass": MASS, "high": HIGH, "effort": push * MASS * G / 0.9, "speed": speed, "shorter": shorter}
    (folder / "piston.urdf").write_text(_URDF.format(**numbers), encoding="utf-8")
    (folder / "robot.toml").write_text(_TOML.format(**numbers), encoding="utf-8")
    return mt.load_robot(folder)


def test_a_motor_throws_by_the_work_that_it_does_beyond_the_weights(tmp_path):
    assert leap_height(piston(tmp_path, push=1.5)) == pytest.approx(0.5 * STROKE * HIGH, rel=1e-4)
    assert leap_height(piston(tmp_path, push=9.0)) == pytest.approx((STRONGEST - 1.0) * STROKE * HIGH, rel=1e-4)


def test_a_leg_that_bends_less_does_less_work(tmp_path):
    """Of the depths that are looked at, half of the stroke is the deepest that its range allows."""
    half = piston(tmp_path, push=1.5, shorter=0.6 * STROKE * HIGH)
    assert leap_height(half) == pytest.approx(0.25 * STROKE * HIGH, rel=1e-4)


def test_a_motor_throws_no_faster_than_it_is(tmp_path):
    assert leap_height(piston(tmp_path, speed=0.8)) == pytest.approx(0.8**2 / (2.0 * G), rel=1e-4)


def test_a_robot_jumps_as_high_as_it_can_and_not_higher_than_a_share_of_its_height(tmp_path):
    def asked(robot):
        return mt.tasks.jump(robot).mid_height_min - robot.home_com[2]

    weak = piston(tmp_path, push=1.5)
    assert asked(weak) == pytest.approx(leap_height(weak))
    assert asked(piston(tmp_path, push=9.0)) == pytest.approx(HEIGHT * HIGH, rel=1e-4)


def test_a_robot_that_is_too_weak_or_too_slow_is_refused_unless_a_height_is_said(tmp_path):
    for weak in ({"push": 0.9}, {"speed": 0.1}):
        with pytest.raises(ScenarioError, match="the joints of piston are too weak or too slow for a jump"):
            mt.tasks.jump(piston(tmp_path, **weak))
    heavy = piston(tmp_path, push=0.9)
    height = 0.02
    flight = 2.0 * math.sqrt(2.0 * height / G)
    scenario = mt.tasks.jump(heavy, height=height)
    off = scenario.contacts[1]
    assert (off.end - off.begin) * scenario.knots * scenario.interval_max == pytest.approx(flight, rel=1e-6)
