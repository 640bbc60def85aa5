"""A push that a plan knows of is in its momentum, its torques and its audit, and nowhere outside of its stretch."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import multimodal_to as mt
from multimodal_to.auditing.findings import Motion
from multimodal_to.doctor import Severity
from multimodal_to.errors import ScenarioError, TrajectoryError
from multimodal_to.simulation import play, tracking
from multimodal_to.simulation.known import Known
from multimodal_to.simulation.stage import stage
from multimodal_to.trajectory import rules
from multimodal_to.trajectory.derived import generalised_forces, joint_torques
from multimodal_to.trajectory.pushes import acting
from solo import solo
from trots import trot

ASIDE = mt.KnownPush(of="base_link", force=(0.0, 3.0, 0.0), begin=0.3, end=0.5)
DOWN = mt.KnownPush(of="FL_LOWER_LEG", force=(0.0, 0.0, -2.0), begin=0.4, end=0.6)
REST = np.zeros(6), np.zeros(12)  # of base and joints


@pytest.fixture(scope="module")
def dog(tmp_path_factory):
    return solo(tmp_path_factory.mktemp("solo"))


@pytest.fixture(scope="module")
def pushed(dog):
    scenario = trot(dog, pushes=(ASIDE, DOWN))
    problem = mt.build(dog, scenario)
    return problem, mt.solve(problem).trajectory


def worst(robot, motion, scenario):
    return {finding.name: finding for finding in mt.audit(robot, motion, scenario).findings}


def test_a_plan_under_a_push_is_true_under_it_and_off_by_it_without(dog, pushed):
    problem, motion = pushed
    names = (
        "force balance",
        "moment balance",
        "unexplained base force",
        "unexplained base moment",
        "torque beyond effort",
    )
    under = worst(dog, motion, problem.scenario)
    assert all(under[name].holds for name in names)
    assert under["CoM off integrator, stretch"].holds
    assert under["base off integrator, stretch"].holds
    without = worst(dog, motion, replace(problem.scenario, pushes=()))
    assert without["force balance"].worst == pytest.approx(3.0, rel=1e-3)
    assert without["unexplained base force"].worst == pytest.approx(3.0, abs=0.05)
    assert not without["base off integrator, stretch"].holds


def test_rows_are_those_of_the_push_over_its_stretch_and_plain_elsewhere(pushed):
    """Under leapfrog the force of a knot is in the row of the interval that begins there."""
    problem, _ = pushed
    plain, under = (
        set(problem.rows[name].knots.tolist()) for name in ("momentum_dynamics", "momentum_dynamics_pushed")
    )
    assert under == set(range(19, 37))  # from knot 18 to 36
    assert plain == set(range(1, 61)) - under


@pytest.mark.parametrize("rule", [rules.LEAPFROG, rules.BACKWARD_EULER])
def test_the_impulse_of_a_push_is_force_times_its_stretch(dog, pushed, rule):
    _, motion = pushed
    forces = Motion.of(dog, replace(motion, rule=rule), (ASIDE,)).pushes[0]
    assert forces.sum(axis=0) * 0.02 == pytest.approx(np.array(ASIDE.force) * 0.2 * 1.2)


def test_sets_of_pushes_that_act_at_once_are_told_apart():
    knots = acting((ASIDE, DOWN), 10, rules.LEAPFROG)
    assert knots == {(0,): [3], (0, 1): [4], (1,): [5]}


def test_the_doctor_warns_of_a_push_that_carries_the_robot_away_and_refuses_one_on_nothing(dog):
    def found(push, severity):
        return [some.found for some in mt.doctor(dog, trot(dog, pushes=(push,))).of(severity) if some.name == "pushes"]

    assert not found(ASIDE, Severity.WARNING)
    (warning,) = found(replace(ASIDE, force=(0.0, 30.0, 0.0)), Severity.WARNING)
    assert "30 N along the ground push 'base_link'" in warning
    (error,) = found(replace(ASIDE, of="tail"), Severity.ERROR)
    assert "'tail'" in error


def test_a_push_that_is_none_is_refused():
    with pytest.raises(ScenarioError, match="three finite numbers"):
        mt.KnownPush(of="base_link", force=(0.0, 1.0, float("nan")))
    with pytest.raises(ScenarioError, match="expected a begin before the end"):
        mt.KnownPush(of="base_link", force=(0.0, 1.0, 0.0), begin=0.5, end=0.5)


def test_torques_of_a_motion_are_those_under_the_pushes_that_it_was_planned_with(dog, pushed):
    """The figures, the exports and the playback read the pushes from the task that the motion keeps."""
    problem, motion = pushed
    known = Motion.of(dog, motion, problem.scenario.pushes)
    forces = list(zip(known.pushed_frames, known.pushes.transpose(0, 2, 1), strict=True))
    under = generalised_forces(dog, motion, forces)
    np.testing.assert_array_equal(joint_torques(dog, motion), under[6:])
    assert np.abs(under[6:] - generalised_forces(dog, motion, ())[6:]).max() > 0.1  # [N m]


def test_the_playback_pushes_as_the_plan_knew(dog, pushed):
    """Without the push this plan is off by more than 2 cm."""
    pytest.importorskip("mujoco")
    followed = tracking(play(dog, pushed[1]))
    assert followed.survived
    assert followed.com < 0.005


def test_a_push_acts_at_the_origin_of_its_frame_and_over_its_stretch_in_the_playback(dog, pushed):
    """Jᵀ f by MuJoCo's Jacobian is what the simulation's bodies feel; before and after the stretch it is nothing."""
    mujoco = pytest.importorskip("mujoco")
    _, motion = pushed
    known, (simulation, _) = Known.of(dog, motion), stage(dog, motion)
    data = mujoco.MjData(simulation.model)
    simulation.set_state(
        data, motion.base_position[:, 25], motion.base_quaternion_xyzw[:, 25], motion.joint_positions[:, 25], *REST
    )
    mujoco.mj_fwdPosition(simulation.model, data)
    for time, some in ((0.2, False), (0.5, True), (0.65, True), (0.9, False)):
        data.xfrc_applied[:] = 0.0
        known.push(simulation, data, time)
        felt = np.zeros(simulation.model.nv)
        for body in np.flatnonzero(data.xfrc_applied.any(axis=1)):
            force, torque = data.xfrc_applied[body, :3], data.xfrc_applied[body, 3:]
            mujoco.mj_applyFT(simulation.model, data, force, torque, data.xipos[body], body, felt)
        np.testing.assert_allclose(felt, known.generalised(simulation, data, time), atol=1e-12)
        assert felt.any() == some


def test_pushes_that_a_file_keeps_and_nobody_can_read_are_refused(dog, pushed):
    broken = replace(pushed[1], scenario_json='{"pushes": [{"of": "base_link"}]}')
    with pytest.raises(TrajectoryError, match=r"the pushes kept with 'trot' cannot be read: .*lacks 'pushes.*force'"):
        joint_torques(dog, broken)
