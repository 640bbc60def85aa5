"""Rotors in MuJoCo: their drag turns the body, their engines lag, and a robot without joints or feet plays back."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import multimodal_to as mt
from multimodal_to import simulation
from multimodal_to.models.jet import FirstOrder, StaticMap
from multimodal_to.simulation.model import build_model, mujoco_module
from multimodal_to.simulation.playback import _spooled


def test_the_drag_of_a_rotor_turns_the_body_as_its_moment_over_its_inertia():
    robot = mt.load_robot("quadrotor")
    mujoco, model = mujoco_module(), build_model(robot)
    data = mujoco.MjData(model.model)
    model.set_state(
        data, np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.0, 0.0, 1.0]), np.zeros(0), np.zeros(6), np.zeros(0)
    )
    data.ctrl[:] = [4.0, 0.0, 4.0, 0.0]  # two that turn the same way
    mujoco.mj_forward(model.model, data)
    about_z = 8.0 * 0.016 / 0.0245
    assert data.qacc[5] == pytest.approx(about_z)
    assert data.qacc[2] == pytest.approx(8.0 / 1.5 + robot.gravity[2])


def test_a_step_of_an_engine_is_its_exact_one():
    jet = mt.load_robot("quadrotor").jets[0]
    engine = jet.model
    assert isinstance(engine, FirstOrder)
    rate, thrust = _spooled(jet, (2.0, 0.0), 60.0)
    end = engine.gain * 60.0
    assert thrust == pytest.approx(end + (2.0 - end) * np.exp(-simulation.model.TIME_STEP / engine.time_constant))
    assert rate == pytest.approx((thrust - 2.0) / simulation.model.TIME_STEP)
    quick = replace(jet, model=StaticMap(gain=0.1))
    assert _spooled(quick, (2.0, 0.0), 60.0)[1] == pytest.approx(6.0)


def test_a_quadrotor_without_feet_plays_a_climb_back_and_hovers(tmp_path):
    """No joints, no contact points: every table of its file that would be empty is left out."""
    robot = mt.load_robot("quadrotor")
    robot = replace(robot, contacts=())
    climb = mt.Scenario(
        name="climb",
        title="30 cm up",
        knots=12,
        initial_com=(0.0, 0.0, 1.0),
        final_com=(0.0, 0.0, 1.3),
        start=mt.Start.HOVER,
        terminal=mt.Terminal.HOVER,
        interval_min=0.05,
        interval_max=0.1,
        weights=mt.Weights(com_velocity=1e7, angular_momentum=1e8, throttle=1e3, throttle_rate=1e3),
    )
    assert not mt.doctor(robot, climb).findings
    solution = mt.solve(mt.build(robot, climb))
    assert solution.status.solved
    assert mt.audit(robot, solution.trajectory).holds
    outcome = simulation.tracking(simulation.play(robot, solution.trajectory))
    assert outcome.end == "hovers"
    assert outcome.com < 0.03
