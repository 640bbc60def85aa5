"""Controllers of a plan, what disturbs them, and trials."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from contextlib import suppress
from dataclasses import asdict, fields, replace
from pathlib import Path

import numpy as np
import pytest

import multimodal_to as mt
from drones import HOP, drone
from multimodal_to.errors import InputError
from multimodal_to.scenarios.data import to_json
from multimodal_to.simulation import (
    Command,
    Disturbance,
    Draws,
    Push,
    ServoController,
    ServoGains,
    Servos,
    WholeBodyController,
    build_model,
    draw,
    play,
    run_trial,
    run_trials,
    tracking,
)
from multimodal_to.simulation.controller import Belief, drawn
from multimodal_to.simulation.known import Known
from multimodal_to.simulation.look_ahead import Feedback, LookAhead
from multimodal_to.simulation.noise import Estimate, Noise
from multimodal_to.simulation.reference import reference
from multimodal_to.trajectory.resampling import resample
from synthetic import take_off as synthetic_take_off

pytest.importorskip("mujoco")


@pytest.fixture(scope="module")
def step_up(ironcub, once):
    return once("step-up", lambda: mt.solve(mt.build(ironcub, mt.scenarios.step_up()))).trajectory


def part_of(plan, start, end):
    """The plan's motion between two times, on a grid of 0.05 s."""
    return resample(plan, plan.time[0] + np.linspace(start, end, round((end - start) / 0.05) + 1))


class Holding:
    """A controller of one's own: servos at the plan's first posture, and a throttle from some time on."""

    def __init__(self, since: float = 0.0, throttle: float = 0.0) -> None:
        self.since, self.throttle, self.seen = since, throttle, []

    @property
    def period(self):
        return 5e-3

    def reset(self, robot, plan, since):
        units, self.robot = robot.units, robot
        count = len(robot.joint_names)
        self.servos = Servos(
            positions=plan.joint_positions[:, 0],
            velocities=np.zeros(count),
            stiffness=np.full(count, 1.2 * units.moment),
            damping=np.full(count, 0.16 * units.moment / units.frequency),
        )

    def command(self, state, time):
        self.seen.append((time, state))
        throttle = np.full(len(self.robot.jets), self.throttle * (time >= self.since - 1e-9))
        return Command(torques=np.zeros(len(self.robot.joint_names)), throttle=throttle, servos=self.servos)


def test_a_controller_of_ones_own_is_asked_at_its_own_period_for_the_state_as_it_is(ironcub, take_off):
    plan, own = part_of(take_off.trajectory, 0.0, 0.2), Holding()
    played = play(ironcub, plan, own)
    np.testing.assert_allclose([time for time, _ in own.seen], np.arange(len(own.seen)) * 5e-3, atol=1e-12)
    time, state = own.seen[-1]
    row = round(time / 1e-3)
    np.testing.assert_array_equal(state.joint_positions, played.qpos[row, 7:])
    np.testing.assert_array_equal(state.thrust, played.thrust[row])


@pytest.mark.parametrize("delay", [0.0, 0.004])
def test_a_command_acts_after_the_delay(ironcub, take_off, delay):
    plan = part_of(take_off.trajectory, 0.0, 0.2)
    played = play(ironcub, plan, Holding(since=0.02, throttle=30.0), disturbance=Disturbance(delay=delay))
    first = played.time[(played.throttle[:, 0] > 29.0).argmax()]
    assert first == pytest.approx(0.02 + delay, abs=1e-9)


def test_a_motor_gain_scales_what_is_asked_of_the_motor(ironcub, take_off):
    plan = part_of(take_off.trajectory, 0.0, 0.1)
    weak = Disturbance(motor_gains={"l_knee": 0.5})
    knee = ironcub.joint_names.index("l_knee")
    whole, half = (play(ironcub, plan, disturbance=some).asked_torques[0] for some in (None, weak))
    assert half[knee] == pytest.approx(0.5 * whole[knee])
    np.testing.assert_allclose(np.delete(half, knee), np.delete(whole, knee))


def test_a_disturbance_changes_masses_and_friction_of_the_simulated_robot(ironcub):
    simulation = build_model(ironcub, mt.FlatGround())
    before = simulation.model.body_mass.copy()
    Disturbance(masses={"chest": 1.05}, friction=0.8).apply(simulation)
    changed = np.flatnonzero(simulation.model.body_mass != before)
    assert [simulation.model.body(int(body)).name for body in changed] == ["chest"]
    assert simulation.model.body_mass[changed[0]] == pytest.approx(1.05 * before[changed[0]])
    assert simulation.model.geom("ground").friction[0] == pytest.approx(0.8 * ironcub.friction)


def test_draws_stay_within_what_the_documentation_says(ironcub):
    for seed in range(20):
        one = draw(ironcub, 7.0, np.random.default_rng(seed))
        assert all(0.95 <= factor <= 1.05 for factor in one.masses.values())
        assert all(0.8 <= factor <= 1.2 for factor in [*one.motor_gains.values(), one.friction])
        assert 0.002 <= one.delay <= 0.01
        assert np.linalg.norm(one.push.force) == pytest.approx(0.114 * ironcub.weight)
        assert one.push.force[2] == 0.0
        assert 0.0 <= one.push.start <= 6.8
        late = draw(ironcub, 7.0, np.random.default_rng(seed), push_starts=(3.0, 4.0))
        assert 3.0 <= late.push.start <= 4.0
        assert replace(late, push=one.push) == one


def test_a_draw_of_no_number_is_refused():
    with pytest.raises(InputError, match=r"expected finite numbers of at least zero"):
        Disturbance(friction=-1.0)
    with pytest.raises(InputError, match=r"a push of at least zero"):
        Draws(push=-1.0)
    for starts in ((2.0, 1.0), (0.0, np.inf), (0.0,)):
        with pytest.raises(InputError, match=r"two finite numbers that do not fall"):
            Draws(push_starts=starts)


def test_drawn_gains_are_each_within_their_spread():
    gains, other = ServoGains(), drawn(ServoGains(), np.random.default_rng(0), 0.2)
    for whole, part in ((gains, other), (gains.look_ahead, other.look_ahead)):
        numbers = [field.name for field in fields(whole) if field.name != "look_ahead"]
        ratios = np.array([getattr(part, name) / getattr(whole, name) for name in numbers])
        assert (np.abs(ratios - 1.0) <= 0.2).all()
        assert len(set(ratios)) == len(numbers)


def test_gains_are_those_of_the_robots_own_size(ironcub):
    """A robot twice as heavy has servos twice as stiff; 300 N m/rad are right for the iRonCub alone."""
    units = ironcub.units
    assert ServoGains().stiffness * units.moment == pytest.approx(300.0, rel=0.05)
    assert replace(units, mass=2 * units.mass).moment == 2 * units.moment


@pytest.fixture(scope="module")
def at_the_end(ironcub, take_off):
    """The hover at the end of the take-off, with its feedback."""
    plan = reference(ironcub, take_off.trajectory, np.arange(0.0, 7.0, 2e-3))
    belief = Belief(ironcub, take_off.trajectory)
    return Feedback(belief, plan, 2e-3, LookAhead(), Known.of(ironcub, take_off.trajectory)), belief, plan


def advice(feedback, belief, plan, step, **off):
    """What is advised where the base is off the plan, with the thrusts of the plan."""
    belief.put_plan(plan, step)
    position, quaternion = belief.data.qpos[:3].copy(), belief.data.qpos[[4, 5, 6, 3]].copy()
    state = mt.State(
        base_position=position + off.get("place", np.zeros(3)),
        base_quaternion_xyzw=quaternion,
        joint_positions=plan.joints[step],
        base_linear_velocity=plan.com_velocity[step],
        base_angular_velocity=np.zeros(3),
        joint_velocities=np.zeros(plan.joints.shape[1]),
        thrust=plan.thrust[step],
        thrust_rate=plan.thrust_rate[step],
    )
    belief.put(state)
    return feedback.advise(state, step)


def test_a_hover_that_is_too_low_gets_more_throttle_and_one_too_high_less(at_the_end):
    low, high = (advice(*at_the_end, 3400, place=np.array([0.0, 0.0, off])).throttle for off in (-0.02, 0.02))
    assert (low > 0.5).all()
    assert (high < -0.5).all()


def test_thrusts_stay_with_the_plan_while_the_feet_carry_the_robot(at_the_end):
    standing = advice(*at_the_end, 100, place=np.array([0.01, 0.0, -1e-3])).throttle
    flying = advice(*at_the_end, 3400, place=np.array([0.01, 0.0, 0.0])).throttle
    assert np.abs(standing).max() < 0.2 * np.abs(flying).max()


def test_the_plan_is_followed_where_the_feet_stand_and_goes_back_in_flight(at_the_end):
    aside = np.array([0.03, -0.01, -5e-4])  # 0.5 mm into the ground, so that the feet touch
    for _ in range(500):
        standing = advice(*at_the_end, 0, place=aside)
    np.testing.assert_allclose(standing.footing, [0.03, -0.01, 0.0], atol=1e-4)
    np.testing.assert_allclose(standing.errors[:2], 0.0, atol=1e-4)
    for _ in range(2000):
        flying = advice(*at_the_end, 3400, place=aside)
    np.testing.assert_allclose(flying.errors[:2], aside[:2], atol=1e-4)


@pytest.mark.parametrize("scenario", ["take-off", "step-up"])
def test_a_plan_survives_one_push_with_torques_within_their_limits(ironcub, take_off, step_up, scenario):
    """From before the feet change to the end; 50 N on the iRonCub."""
    plan = {"take-off": take_off.trajectory, "step-up": step_up}[scenario]
    start = 4.0 if scenario == "take-off" else 1.0
    push = Push(force=(0.0, 0.114 * ironcub.weight, 0.0), start=0.5, duration=0.2)
    played = play(ironcub, part_of(plan, start, plan.duration), disturbance=Disturbance(push=push))
    outcome = tracking(played)
    assert outcome.survived
    assert outcome.com < 0.1
    assert (np.abs(played.torques) <= ironcub.joint_limits.effort + 1e-9).all()


def test_a_quadratic_program_holds_a_stand_within_torques_and_friction(ironcub, take_off):
    pytest.importorskip("piqp")
    plan = part_of(take_off.trajectory, 0.0, 0.4)
    push = Push(force=(0.114 * ironcub.weight, 0.0, 0.0), start=0.1, duration=0.2)
    played = play(ironcub, plan, WholeBodyController(), disturbance=Disturbance(push=push))
    assert tracking(played).survived
    assert tracking(played).com < 0.03
    carried = played.contact_forces[played.time > 1.0].sum(axis=1)[:, 2].mean()
    assert carried == pytest.approx(ironcub.weight - plan.thrust[:, -1].sum(), rel=0.05)


def test_a_program_survives_motors_that_give_half(ironcub, take_off):
    """More torque than the limits allow is not asked: the program finds other accelerations."""
    pytest.importorskip("piqp")
    plan = part_of(take_off.trajectory, 0.0, 0.2)
    efforts = ironcub.joint_limits.effort * 0.5
    weak = replace(ironcub, joint_limits=replace(ironcub.joint_limits, effort=efforts))
    played = play(weak, plan, WholeBodyController())
    assert (np.abs(played.torques) <= efforts + 1e-9).all()
    assert tracking(played).survived


def test_a_trial_is_the_same_every_time_that_it_is_drawn(ironcub, take_off):
    plan = part_of(take_off.trajectory, 0.0, 0.2)
    (_, once), (_, again) = (run_trial(ironcub, plan, 3, Draws(seed=5)) for _ in range(2))
    assert replace(once, control_time=0.0) == replace(again, control_time=0.0)
    (_, other) = run_trial(ironcub, plan, 4, Draws(seed=5))
    assert other.draw != once.draw


def test_trials_say_what_a_program_needs_to_judge_them(ironcub, take_off):
    plan = part_of(take_off.trajectory, 0.0, 0.2)
    trials = [asdict(trial) for trial in run_trials(ironcub, plan, range(2), Draws(seed=1))]
    assert [trial["number"] for trial in trials] == [0, 1]
    for trial in trials:
        assert trial["survived"] is True
        assert 0.0 < trial["com_error_max"] < 0.05
        assert 0.0 < trial["base_error_max"] < 0.2
        assert 0.0 < trial["torque_ratio_max"] < 2.0
        assert trial["touch_down_speed_max"] >= 0.0
        assert set(trial["draw"]) == {"masses", "motor_gains", "friction", "delay", "push", "noise"}


def test_an_estimate_drifts_in_the_air_and_stays_where_a_foot_stands(ironcub):
    state, steps = mt.State.at_rest(ironcub), 5000
    errors = {}
    for stands in (True, False):
        estimate = Estimate(Noise(seed=1), 2e-3)
        seen = [estimate(state, stands).base_position - state.base_position for _ in range(steps)]
        errors[stands] = np.abs(seen).max()
    assert errors[True] == 0.0
    assert 1e-3 < errors[False] < 0.1


def hovering(robot):
    """A hover 1 m high for two seconds of a body whose jets carry it evenly."""
    motion = synthetic_take_off(robot)
    count, throttle = motion.time.size, [[jet.model.steady_throttle(0.5 * robot.weight)] for jet in robot.jets]
    return replace(
        motion,
        base_position=np.tile([[0.0], [0.0], [1.0]], count),
        base_quaternion_xyzw=np.tile([[0.0], [0.0], [0.0], [1.0]], count),
        com_position=np.tile([[0.0], [0.0], [1.0]], count),
        contact_forces=np.zeros_like(motion.contact_forces),
        thrust=np.full_like(motion.thrust, 0.5 * robot.weight),
        throttle=np.tile(throttle, count),
    )


@pytest.mark.parametrize("controller", [ServoController, WholeBodyController])
def test_a_robot_without_joints_hovers_as_planned(tmp_path, controller):
    pytest.importorskip("piqp")
    robot = drone(tmp_path)
    played = play(robot, part_of(hovering(robot), 0.0, 0.3), controller())
    assert tracking(played).survived
    assert tracking(played).com < 0.01
    assert played.torques.shape[1] == 0


def test_parallel_jets_on_the_body_lean_it_to_move_aside(tmp_path):
    """A robot that hovers 2 cm too far to the left turns its thrust to the right: the left jet pushes more."""
    robot = drone(tmp_path)
    still = hovering(robot)
    plan = reference(robot, still, np.arange(0.0, 1.0, 2e-3))
    belief = Belief(robot, still)
    feedback = Feedback(belief, plan, 2e-3, LookAhead(), Known.of(robot, still))
    left, right = advice(feedback, belief, plan, 0, place=np.array([0.0, 0.02, 0.0])).throttle
    assert robot.jet_names == ("left", "right")
    assert left > right + 0.1


@pytest.mark.parametrize(("at", "jet"), [(0.5, "left"), (0.0, "right")])
def test_a_jet_that_the_plan_has_fail_dies_in_the_playback_whatever_is_asked_of_it(tmp_path, at, jet):
    """From then on its throttle is at its least and its thrust runs down; one that never lights gives none."""
    robot = drone(tmp_path)
    failure = replace(HOP, knots=hovering(robot).knots, failures=(mt.JetFailure(jet=jet, at=at),))
    motion = part_of(replace(hovering(robot), scenario_json=to_json(failure)), 0.0, 0.4)
    row, other = robot.jet_names.index(jet), 1 - robot.jet_names.index(jet)
    played = play(robot, motion)
    before = played.time < Known.of(robot, motion).fails[row] - 1e-6
    assert before.any() == (at > 0.0)
    assert (played.throttle[before, row] > 10.0).all()
    assert (played.throttle[~before, row] == robot.jets[row].throttle_min).all()
    assert played.throttle[~before, other].max() > 10.0
    if at:
        assert played.thrust[before, row].min() > 90.0
        assert (np.diff(played.thrust[~before, row]) <= 0.0).mean() > 0.95
        assert played.thrust[-1, row] < 0.8 * played.thrust[0, row]
    else:
        assert (played.thrust[1:, row] == 0.0).all()


def test_the_feedback_asks_nothing_of_a_jet_from_when_it_has_failed(tmp_path):
    robot = drone(tmp_path)
    still = replace(hovering(robot), scenario_json=to_json(replace(HOP, failures=(mt.JetFailure(jet="left", at=0.5),))))
    plan, belief = reference(robot, still, np.arange(0.0, 2.0, 2e-3)), Belief(robot, still)
    known = Known.of(robot, still)
    feedback = Feedback(belief, plan, 2e-3, LookAhead(), known)
    before, after = (round((known.fails[0] + later) / 2e-3) for later in (-0.2, 0.1))
    aside = np.array([0.0, 0.02, 0.0])
    assert advice(feedback, belief, plan, before, place=aside).throttle.all()
    left, right = advice(feedback, belief, plan, after, place=aside).throttle
    assert left == 0.0
    assert right != 0.0


def children_of(process):
    """The processes that a process has started and that run, and those that they have, by Linux's tables."""
    found = []
    for table in Path("/proc", str(process), "task").glob("*/children"):
        with suppress(OSError):
            for child in map(int, table.read_text().split()):
                found += [child, *children_of(child)]
    return found


def runs(process):
    with suppress(OSError):
        return Path("/proc", str(process), "stat").read_text().rpartition(")")[2].split()[0] != "Z"
    return False


@pytest.mark.skipif(sys.platform != "linux", reason="looks at the tables of Linux")
def test_killed_trials_leave_no_process_and_a_file_of_those_that_were_done(tmp_path):
    robot = drone(tmp_path)
    file = part_of(hovering(robot), 0.0, 0.1).save(tmp_path / "plan.npz")
    asked = [sys.executable, "-m", "multimodal_to", "simulate", file, "--robot", tmp_path, "--trials", "1000"]
    process = subprocess.Popen(asked, stdout=subprocess.PIPE, text=True)
    with process.stdout as said:
        before, first = said.readline(), said.readline()
        children = children_of(process.pid)
        process.kill()
    process.wait()
    assert before.startswith("1000 to do, 2 at once")
    assert first.startswith("trial ")
    assert len(children) >= 2
    for _ in range(200):
        if not any(map(runs, children)):
            break
        time.sleep(0.05)
    assert not any(map(runs, children))
    kept = json.loads((tmp_path / "plan-trials.json").read_text())["runs"][0]["trials"]
    assert int(first.split()[1].rstrip(":")) in [trial["number"] for trial in kept]


def test_a_quadratic_program_bends_legs_that_stand_on_points():
    """A shank turns about the point that it stands on, as it cannot on a sole."""
    pytest.importorskip("piqp")
    robot = mt.load_robot("solo12")
    problem = mt.build(robot, mt.tasks.squat(robot))
    outcome = tracking(play(problem.robot, mt.solve(problem).trajectory, WholeBodyController()))
    assert outcome.survived
    assert outcome.com < 0.01 * robot.standing_height
    assert outcome.joint < 1.0
