"""MuJoCo as a second opinion."""

from __future__ import annotations

import builtins
import sys
from dataclasses import replace

import numpy as np
import pytest

from multimodal_to.adam.urdf import read_urdf
from multimodal_to.errors import OutputError, TrajectoryError
from multimodal_to.models.terrain import FlatGround, Plane, Stairs, frame_function
from multimodal_to.simulation import (
    ServoController,
    build_model,
    disagreement,
    play,
    random_states,
    simulated_trajectory,
    states_along,
    tracking,
)
from multimodal_to.simulation.model import POINT_RADIUS
from multimodal_to.simulation.reference import reference
from multimodal_to.simulation.stabiliser import _ridge, _unborne, rotation_vector
from multimodal_to.trajectory import rules
from multimodal_to.trajectory.resampling import regrid, resample
from synthetic import take_off as synthetic_take_off

mujoco = pytest.importorskip("mujoco")


@pytest.fixture(scope="module")
def playback(ironcub, take_off):
    return play(ironcub, take_off.trajectory)


def test_inverse_dynamics_agrees_with_rnea_at_random_states(ironcub):
    assert disagreement(ironcub, random_states(ironcub, 100)) < 1e-10


def test_inverse_dynamics_agrees_with_rnea_along_a_motion(ironcub):
    assert disagreement(ironcub, states_along(synthetic_take_off(ironcub))) < 1e-10


def test_every_link_has_the_mass_and_inertia_of_the_urdf(ironcub):
    model = build_model(ironcub, FlatGround()).model
    links, _ = read_urdf(ironcub.urdf)
    assert model.body_mass.sum() == pytest.approx(ironcub.mass, rel=1e-14)
    for link in links:
        body = model.body(link.name)
        turn = np.zeros(9)
        mujoco.mju_quat2Mat(turn, body.iquat)
        inertia = turn.reshape(3, 3) @ np.diag(body.inertia) @ turn.reshape(3, 3).T
        assert body.mass[0] == link.mass
        np.testing.assert_allclose(body.ipos, link.com, atol=1e-15)
        np.testing.assert_allclose(inertia, link.inertia, atol=1e-12)


@pytest.mark.parametrize(
    "surface",
    [FlatGround(height=0.1), Plane(slope=0.2, direction=(1.0, 1.0)), Stairs(edges=(0.3,), heights=(0.0, 0.1))],
)
def test_a_contact_point_touches_where_its_distance_is_zero(ironcub, surface):
    simulation = build_model(ironcub, surface)
    data = mujoco.MjData(simulation.model)
    ground = simulation.model.geom("ground").id
    mujoco.mj_kinematics(simulation.model, data)
    down = np.array([0.0, 0.0, -1.0])
    for x, y in ((0.01, 0.02), (0.8, -0.4)):
        start = np.array([x, y, 2.0])
        depth = simulation_ray(simulation.model, data, ground, start, down)
        distance, normal, _ = (np.array(part).ravel() for part in frame_function(surface)([x, y, 2.0 - depth]))
        assert distance[0] == pytest.approx(-POINT_RADIUS, abs=2e-4)
        assert normal[2] > 0.9


def simulation_ray(model, data, geom, start, direction):
    if model.geom(geom).type[0] == mujoco.mjtGeom.mjGEOM_HFIELD:
        return mujoco.mj_rayHfield(model, data, geom, start, direction)
    return mujoco.mju_rayGeom(
        data.geom_xpos[geom],
        data.geom_xmat[geom],
        model.geom_size[geom],
        start,
        direction,
        mujoco.mjtGeom.mjGEOM_PLANE,
    )


def test_the_take_off_survives_the_simulator(playback):
    errors = tracking(playback)
    assert errors.com < 0.04
    assert errors.attitude < 4.0
    assert errors.end == "hovers"
    assert playback.fell is None
    assert all(abs(switch.simulated - switch.planned) < 0.3 for switch in errors.switches)


def test_turbines_obey_their_own_dynamics_and_range(ironcub, playback):
    time = playback.time
    for index, jet in enumerate(ironcub.jets):
        throttle = playback.throttle[:, index]
        assert jet.throttle_min <= throttle.min() <= throttle.max() <= jet.throttle_max
        rate = np.diff(playback.thrust_rate[:, index]) / np.diff(time)
        own = [
            float(jet.model.acceleration(*state))
            for state in zip(
                playback.thrust[:-1:50, index], playback.thrust_rate[:-1:50, index], throttle[:-1:50], strict=True
            )
        ]
        np.testing.assert_allclose(rate[::50], own, atol=1e-6)


def test_what_happened_is_a_trajectory_on_the_grid_of_the_plan(playback, tmp_path):
    motion = simulated_trajectory(playback)
    plan = playback.plan
    np.testing.assert_array_equal(motion.time, plan.time)
    assert np.linalg.norm(motion.com_position - plan.com_position, axis=0).max() < 0.04
    assert motion.scenario == "take-off in MuJoCo"
    assert motion.scenario_json == plan.scenario_json
    weight = motion.vertical_contact_force()[1:6].mean()
    assert weight == pytest.approx(plan.vertical_contact_force()[1:6].mean(), rel=0.05)
    motion.save(tmp_path / "simulated.npz")


def test_velocities_of_what_happened_are_those_of_the_instants_that_the_rule_of_the_plan_has(playback):
    """Positions follow from velocities in the middles of intervals to second order, from those at the ends to first."""
    plan = playback.plan
    gaps = {}
    for rule in (rules.BACKWARD_EULER, rules.LEAPFROG):
        motion = simulated_trajectory(replace(playback, plan=regrid(plan, plan.knots, rule)))
        assert motion.rule == rule
        moved = np.diff(motion.joint_positions, axis=1)
        gaps[rule] = np.abs(moved - motion.joint_velocities[:, 1:] * np.diff(plan.time)).max()
        gaps[rule, "CoM"] = np.abs(
            np.diff(motion.com_position, axis=1) - motion.com_velocity[:, 1:] * np.diff(plan.time)
        ).max()
    assert gaps[rules.LEAPFROG, "CoM"] < 0.6 * gaps[rules.BACKWARD_EULER, "CoM"]


def test_without_a_balance_feedback_the_take_off_tips_and_lies_still(ironcub, take_off):
    playback = play(ironcub, take_off.trajectory, ServoController(stabilise=False))
    assert tracking(playback).end == "fell"
    assert playback.fell < take_off.trajectory.duration
    after = playback.qpos[playback.time >= playback.fell]
    assert len(after) > 1
    assert (after == after[0]).all()


def test_a_wide_stance_bears_roll_and_a_line_of_heels_leaves_pitch_to_the_jets():
    arms = np.array([[0.0, 0.15, 0.0], [0.0, -0.15, 0.0]])
    left = _unborne(arms, np.array([0.5, 0.5]), 0.1)
    width, radius = 0.15**2, 0.1**2
    np.testing.assert_allclose(left, np.diag([radius / (width + radius), 1.0, radius / (width + radius)]), atol=1e-12)
    turned = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    np.testing.assert_allclose(
        _unborne(arms @ turned.T, np.array([0.5, 0.5]), 0.1), turned @ left @ turned.T, atol=1e-12
    )


def test_contact_forces_are_those_that_carry_the_robot(ironcub, playback):
    standing = (playback.time > 0.2) & (playback.time < 1.0)
    vertical = playback.contact_forces[standing, :, 2].sum(axis=1).mean()
    up = -ironcub.mass * ironcub.gravity[2]
    thrust = playback.thrust[standing].sum(axis=1).mean()
    assert up - thrust < vertical < up
    assert (playback.contact_forces[:, :, 2] >= 0.0).all()


def test_a_short_stand_stays_where_it_is(ironcub, take_off):
    plan = take_off.trajectory
    short = resample(plan, np.linspace(plan.time[0], plan.time[0] + 0.5, 11))
    errors = tracking(play(ironcub, short))
    assert errors.com < 0.01
    assert errors.fell is None


def standing_half_a_second(take_off):
    start = take_off.trajectory.time[0]
    return resample(take_off.trajectory, np.linspace(start, start + 0.5, 11))


def with_effort(robot, joint, effort):
    efforts = robot.joint_limits.effort.copy()
    efforts[robot.joint_names.index(joint)] = effort
    return replace(robot, joint_limits=replace(robot.joint_limits, effort=efforts))


def test_a_motor_too_weak_for_its_load_lets_its_joint_sag(ironcub, take_off):
    plan, joint = standing_half_a_second(take_off), "l_knee"
    index = ironcub.joint_names.index(joint)
    load = np.abs(reference(ironcub, plan, np.array([0.2, 0.3])).torques[0, index])
    weak = with_effort(ironcub, joint, 0.3 * load)
    limited, unlimited = play(weak, plan), play(weak, plan, torque_limits=False)
    sag, held = (
        np.degrees(np.abs(one.qpos[:, 7 + index] - one.reference.joints[:, index]).max())
        for one in (limited, unlimited)
    )
    assert held < 1.0
    assert sag > 5.0
    assert unlimited.fell is None


def test_a_motor_gives_what_is_asked_up_to_its_limit_and_no_more(ironcub, take_off):
    plan, joint = standing_half_a_second(take_off), "l_hip_roll"
    index = ironcub.joint_names.index(joint)
    weak = with_effort(ironcub, joint, 5.0)
    limited, unlimited = play(weak, plan), play(weak, plan, torque_limits=False)
    asked, given = limited.asked_torques[:, index], limited.torques[:, index]
    assert np.abs(asked).max() > 6.0
    np.testing.assert_allclose(given, np.clip(asked, -5.0, 5.0), atol=1e-9)
    assert (np.abs(limited.torques) <= weak.joint_limits.effort).all()
    np.testing.assert_allclose(unlimited.torques, unlimited.asked_torques, atol=1e-9)


def test_the_report_says_what_was_asked_of_each_motor_and_for_how_long_it_was_clipped(ironcub, take_off):
    weak = with_effort(ironcub, "l_hip_roll", 5.0)
    playback = play(weak, standing_half_a_second(take_off))
    outcome = tracking(playback)
    steps = playback.time.size if playback.fell is None else round(playback.fell / 1e-3) + 1
    asked = np.abs(playback.asked_torques[:steps, ironcub.joint_names.index("l_hip_roll")])
    worst = outcome.torques[0]
    assert worst.joint == "l_hip_roll"
    assert worst.over_effort == outcome.torque_over_effort == pytest.approx(asked.max() / 5.0)
    assert worst.when == pytest.approx(playback.time[asked.argmax()])
    assert worst.beyond == outcome.longest_beyond == pytest.approx(1e-3 * (asked > 5.0).sum())
    assert outcome.clipped
    assert {torque.joint for torque in outcome.torques} == set(ironcub.joint_names)


def test_the_take_off_stays_within_its_motors(playback):
    outcome = tracking(playback)
    assert 0.1 < outcome.torque_over_effort < 1.0
    assert outcome.longest_beyond == 0.0


def test_a_joint_without_an_effort_limit_is_not_clipped(ironcub):
    robot = with_effort(ironcub, "l_knee", np.inf)
    model = build_model(robot).model
    assert not model.actuator("l_knee").forcelimited[0]
    np.testing.assert_array_equal(model.actuator("r_knee").forcerange, [-37.0, 37.0])
    np.testing.assert_array_equal(model.actuator("r_elbow").forcerange, [-20.0, 20.0])
    assert not build_model(robot, torque_limits=False).model.actuator_forcelimited.any()


def test_a_plan_for_other_jets_is_refused(ironcub):
    with pytest.raises(
        TrajectoryError, match=r"the plan is for another robot: its jets are .*; those of ironcub are none"
    ):
        play(ironcub.with_jets(()), synthetic_take_off(ironcub))


def test_least_squares_with_wide_spreads_solve_exactly():
    matrix = np.random.default_rng(0).normal(size=(6, 9))
    target = np.arange(6.0)
    np.testing.assert_allclose(matrix @ _ridge(matrix, target, np.full(9, 1e4), np.ones(6)), target, atol=1e-5)


def test_a_rotation_vector_is_the_logarithm():
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    np.testing.assert_allclose(rotation_vector(turn), [0.0, 0.0, np.pi / 2], atol=1e-12)


def test_a_missing_package_is_named_with_what_to_install(ironcub, monkeypatch):
    real = builtins.__import__

    def without(name, *rest):
        if name == "mujoco":
            raise ImportError(name)
        return real(name, *rest)

    monkeypatch.delitem(sys.modules, "mujoco", raising=False)
    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(OutputError, match=r"multimodal-to\[sim\]"):
        build_model(ironcub)


def test_a_scenario_with_less_friction_reaches_the_simulator(ironcub):
    model = build_model(ironcub, FlatGround(), 0.1).model
    assert model.geom("ground").friction[0] == 0.1
    assert model.geom(ironcub.contact_names[0]).friction[0] == 0.1


def test_by_leapfrog_the_joints_accelerate_while_the_forces_of_their_knot_act(ironcub):
    """Throttles and forces change in the middles of intervals, where the acceleration of the planned motion does."""
    plan = replace(synthetic_take_off(ironcub), rule=rules.LEAPFROG)
    plan = replace(plan, joint_velocities=np.cumsum(plan.joint_positions, axis=1))
    step, knot = plan.duration / plan.knots, 6
    times = plan.time[knot] + step * np.array([-0.52, -0.48, 0.0, 0.48, 0.52])
    wanted = reference(ironcub, plan, times)
    columns = [knot - 1, knot, knot, knot, knot + 1]
    np.testing.assert_array_equal(wanted.throttle, plan.throttle[:, columns].T)
    np.testing.assert_array_equal(wanted.contact_forces.reshape(5, -1), plan.contact_forces[:, columns].T)
    at_knot = reference(ironcub, plan, plan.time[[knot]]).joint_accelerations[0]
    expected = np.diff(plan.joint_velocities, axis=1)[:, knot] / step
    np.testing.assert_allclose(at_knot, expected, rtol=1e-9)


def test_forces_of_what_happened_by_leapfrog_are_means_about_the_knots(ironcub, playback):
    plan = regrid(playback.plan, playback.plan.knots, rules.LEAPFROG)
    motion, half = simulated_trajectory(replace(playback, plan=plan)), 0.5 * plan.duration / plan.knots
    knot = plan.knots // 2
    for values, means in ((playback.throttle, motion.throttle), (playback.contact_forces, motion.contact_forces)):
        rows = values.reshape(playback.time.size, -1)
        within = (playback.time >= plan.time[knot] - half) & (playback.time < plan.time[knot] + half)
        np.testing.assert_allclose(means[:, knot], rows[within].mean(axis=0), rtol=0.02, atol=1e-2)


def test_a_reference_passes_through_the_knots_with_a_smooth_velocity(ironcub, take_off):
    plan = take_off.trajectory
    at_knots = reference(ironcub, plan, plan.time - plan.time[0])
    np.testing.assert_allclose(at_knots.com, plan.com_position.T, atol=1e-9)
    np.testing.assert_allclose(at_knots.joints, plan.joint_positions.T, atol=1e-9)
    times = np.arange(0.0, plan.duration - 1e-3, 1e-3)
    wanted = reference(ironcub, plan, times)
    for place, speed in (("com", "com_velocity"), ("base_position", "base_velocity"), ("joints", "joint_velocities")):
        moved, speeds = np.diff(getattr(wanted, place), axis=0) / 1e-3, getattr(wanted, speed)
        means = (speeds[1:] + speeds[:-1])[:, : moved.shape[1]] / 2.0
        np.testing.assert_allclose(moved, means, atol=1e-3)


def test_the_base_of_a_reference_turns_as_its_angular_velocity_says(ironcub, take_off):
    wanted = reference(ironcub, take_off.trajectory, np.arange(0.1, 6.9, 1e-3))
    turns = wanted.rotation[1:] @ wanted.rotation[:-1].transpose(0, 2, 1)
    spins = np.array([rotation_vector(turn) for turn in turns[::100]]) / 1e-3
    means = (wanted.base_velocity[:-1:100, 3:] + wanted.base_velocity[1::100, 3:]) / 2.0
    np.testing.assert_allclose(spins, means, atol=1e-4)
