"""Engines of every order: their laws, their throttles, and what a rotor's drag and direction do to a robot."""

from __future__ import annotations

from dataclasses import replace

import casadi as cs
import numpy as np
import pytest

import multimodal_to as mt
from drones import drone
from multimodal_to.errors import InputError, ModelError
from multimodal_to.models.centroidal import drag_moment, thrust_force
from multimodal_to.models.jet import FirstOrder, StaticMap

FAN, MAP = FirstOrder(gain=0.075, time_constant=0.05), StaticMap(gain=0.02, curvature=5.5e-4)
SIDE_STEP = mt.Scenario(
    name="side-step",
    title="Hover to hover, half a metre to the left",
    knots=20,
    initial_com=(0.0, 0.0, 1.0),
    final_com=(0.0, 0.5, 1.0),
    start=mt.Start.HOVER,
    terminal=mt.Terminal.HOVER,
    interval_min=0.05,
    interval_max=0.1,
    weights=mt.Weights(
        com_velocity=10.0, angular_momentum=100.0, throttle=1e-3, throttle_rate=1e-3, contact_forces=1.0
    ),
)


@pytest.fixture(scope="module")
def turbine(ironcub):
    return ironcub.jets[0].model


def test_an_engine_is_in_balance_where_its_steady_throttle_holds_the_thrust(turbine):
    for engine in (turbine, FAN, MAP):
        for thrust in (0.0, 1.0, 5.0):
            throttle = engine.steady_throttle(thrust)
            assert float(engine.imbalance(thrust, throttle)) == pytest.approx(0.0, abs=1e-9)
            slopes = [float(value) for value in engine.slopes(thrust, 0.0, throttle)]
            assert slopes == pytest.approx([0.0, 0.0], abs=1e-9)


def test_a_throttle_gives_the_slope_that_was_asked_for(turbine):
    thrust, rate = 40.0, -3.0
    throttle = turbine.throttle_for(thrust, rate, 12.0, 100.0)
    assert float(turbine.slopes(thrust, rate, throttle)[1]) == pytest.approx(12.0)
    assert float(FAN.slopes(4.0, 0.0, FAN.throttle_for(4.0, 0.0, 7.0, 100.0))[0]) == pytest.approx(7.0)
    assert float(MAP.thrust(MAP.throttle_for(0.0, 0.0, 3.0, 100.0))) == pytest.approx(3.0)


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: FirstOrder(gain=0.0, time_constant=1.0), "gain is 0.0; expected a positive number"),
        (lambda: FirstOrder(gain=1.0, time_constant=-1.0), "time_constant is -1.0; expected a positive number"),
        (lambda: StaticMap(gain=-1.0), "gain is -1.0; expected zero or more"),
        (lambda: StaticMap(gain=0.0), "gain and curvature are zero"),
    ],
)
def test_an_engine_that_cannot_be_is_refused(make, sentence):
    with pytest.raises(InputError, match=sentence):
        make()


def test_drag_turns_the_robot_about_the_direction_of_the_thrust():
    rotation = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    force = np.array(thrust_force(cs.DM(rotation), 5.0)).ravel()
    moment = np.array(drag_moment(cs.DM(rotation), 5.0, 0.02)).ravel()
    assert moment == pytest.approx(0.02 * force)
    assert np.linalg.norm(force) == pytest.approx(5.0)


@pytest.mark.parametrize("engine", [FAN, MAP], ids=["first order", "static"])
def test_a_quadrotor_side_steps_with_a_plan_that_its_engines_follow(engine):
    """The audit integrates the engines, the drag and the body again, by code that shares no row with the problem."""
    robot = mt.load_robot("quadrotor")
    robot = replace(robot, jets=tuple(replace(jet, model=engine) for jet in robot.jets))
    solution = mt.solve(mt.build(robot, SIDE_STEP))
    assert solution.status.solved
    report = mt.audit(robot, solution.trajectory)
    assert report.holds, [finding for finding in report.findings if not finding.holds]
    assert report.airborne == pytest.approx(report.duration)
    spread = np.ptp(solution.trajectory.thrust, axis=0)
    assert spread.max() > 0.05  # it has to roll, and the drag of its rotors cancels
    wrong = replace(robot, jets=tuple(replace(jet, drag=0.5 * abs(jet.drag)) for jet in robot.jets))
    failed = {finding.name for finding in mt.audit(wrong, solution.trajectory).findings if not finding.holds}
    assert "moment balance" in failed


def test_a_plan_is_refused_for_an_engine_that_it_was_not_made_for():
    robot = mt.load_robot("quadrotor")
    solution = mt.solve(mt.build(robot, SIDE_STEP))
    slower = FirstOrder(gain=FAN.gain, time_constant=3.0 * FAN.time_constant)
    other = replace(robot, jets=tuple(replace(jet, model=slower) for jet in robot.jets))
    failed = {finding.name for finding in mt.audit(other, solution.trajectory).findings if not finding.holds}
    assert "thrust dynamics" in failed


def test_a_direction_of_thrust_is_as_good_as_a_frame_that_is_turned(tmp_path):
    """The drone's jets push along −z of frames that are turned over; without the turn, along +z of theirs."""
    for name in ("turned", "stated"):
        (tmp_path / name).mkdir()
    turned, stated = drone(tmp_path / "turned"), drone(tmp_path / "stated", tilt="0 0 0")
    path = tmp_path / "stated" / "robot.toml"
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace('model = "P220"', 'model = "P220"\nthrust_axis = [0, 0, 2]'), encoding="utf-8")
    stated = mt.load_robot(tmp_path / "stated")
    for one, other in zip(turned.jets, stated.jets, strict=True):
        poses = [
            np.array(robot.kindyn.forward_kinematics(jet.frame, robot.home.base_transform, np.zeros(0)))
            for robot, jet in ((turned, one), (stated, other))
        ]
        assert poses[0][:3, 2:] == pytest.approx(poses[1][:3, 2:])


def test_a_frame_of_robot_toml_is_where_a_link_of_the_urdf_would_be(tmp_path):
    robot = drone(
        tmp_path, more='[frames]\nnose = { link = "foot_0", position = [0.1, 0.2, 0.3], rpy = [0.3, -0.2, 0.5] }'
    )
    base = robot.home.base_transform
    foot = np.array(robot.kindyn.forward_kinematics("foot_0", base, np.zeros(0)))
    nose = np.array(robot.kindyn.forward_kinematics("nose", base, np.zeros(0)))
    assert nose[:3, 3] == pytest.approx(foot[:3, 3] + [0.1, 0.2, 0.3])
    roll, pitch, yaw = 0.3, -0.2, 0.5
    about_z = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
    about_y = np.array([[np.cos(pitch), 0, np.sin(pitch)], [0, 1, 0], [-np.sin(pitch), 0, np.cos(pitch)]])
    about_x = np.array([[1, 0, 0], [0, np.cos(roll), -np.sin(roll)], [0, np.sin(roll), np.cos(roll)]])
    assert nose[:3, :3] == pytest.approx(about_z @ about_y @ about_x)
    assert "nose" in robot.kindyn.frame_names
    (tmp_path / "twice").mkdir()
    with pytest.raises(ModelError, match="the frame 'foot_0' exists already"):
        drone(tmp_path / "twice", more='[frames]\nfoot_0 = { link = "body" }')


def test_a_robot_needs_no_table_that_would_be_empty(tmp_path):
    """A body without joints, groups, contacts and jets is a robot: it can only fall."""
    (tmp_path / "ball.urdf").write_text(
        '<robot name="ball"><link name="body"><inertial><mass value="2"/>'
        '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link></robot>'
    )
    (tmp_path / "robot.toml").write_text(
        'name = "ball"\nurdf = "ball.urdf"\n[home]\nbase_position = [0, 0, 1]\nbase_quaternion_xyzw = [0, 0, 0, 1]\n'
    )
    robot = mt.load_robot(tmp_path)
    assert (robot.joint_names, robot.contacts, robot.jets, robot.joint_groups) == ((), (), (), {})
    with pytest.raises(mt.MultimodalError, match="has no contact points to stand on"):
        mt.build(robot, replace(SIDE_STEP, start=mt.Start.STANDING))
