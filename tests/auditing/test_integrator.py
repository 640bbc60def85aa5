"""The integrator of a plan's controls against motions that are known exactly."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from drones import drone
from multimodal_to.auditing import PROPERTIES
from multimodal_to.auditing.audit import audit
from multimodal_to.auditing.findings import Motion
from multimodal_to.auditing.integrator import (
    STRETCH,
    Controls,
    angles,
    integrator_findings,
    natural_time,
    rotations,
    spline,
)
from multimodal_to.trajectory import QUANTITIES, Trajectory, rules
from multimodal_to.trajectory.derived import frame_poses

KNOTS, STEP = 20, 0.05


def motion(robot, rule, **values):
    """A motion of zeros at home but for some quantities, over KNOTS intervals of STEP."""
    bodies = {"robot": 1, "joint": len(robot.joint_names), "contact": len(robot.contact_names), "jet": len(robot.jets)}
    arrays = {name: np.zeros((entry.rows * bodies[entry.of], KNOTS + 1)) for name, entry in QUANTITIES.items()}
    arrays["base_quaternion_xyzw"][3] = 1.0
    for name, value in values.items():
        arrays[name] = arrays[name] + value
    return Trajectory(
        robot=robot.name,
        scenario="by hand",
        time=STEP * np.arange(KNOTS + 1),
        joint_names=robot.joint_names,
        contact_names=robot.contact_names,
        jet_names=robot.jet_names,
        rule=rule,
        **arrays,
    )


def thrown(robot, rule):
    """A throw at 2 m/s, as the rule's own rows make it: what differs is only where velocities are."""
    time, columns = STEP * np.arange(KNOTS + 1), np.arange(KNOTS + 1)
    instants = time - rules.instant(rule, "com_velocity") * STEP
    speed = 2.0 + robot.gravity[2] * instants
    height = np.cumsum(np.where(columns, speed * STEP, 0.0))
    up = np.array([[0.0], [0.0], [1.0]])
    return motion(robot, rule, com_position=up * height, base_position=up * height, com_velocity=up * speed)


def found(robot, trajectory):
    return {entry.name: entry for entry in integrator_findings(Motion.of(robot, trajectory))}


def stretch(robot):
    """The number of intervals of a stretch."""
    return round(STRETCH * natural_time(robot) / STEP)


@pytest.mark.parametrize("rule", [rules.LEAPFROG, rules.STAGGERED])
def test_a_throw_with_velocities_in_the_middles_of_intervals_is_exact(rule, tmp_path):
    robot = drone(tmp_path, jets=False)
    for entry in found(robot, thrown(robot, rule)).values():
        assert entry.worst < 1e-12


def test_a_throw_by_backward_euler_falls_half_an_interval_early(tmp_path):
    """Backward Euler's fall over n intervals is g Δt² n (n + 1) / 2 in place of g (n Δt)² / 2."""
    robot = drone(tmp_path, jets=False)
    entries = found(robot, thrown(robot, rules.BACKWARD_EULER))
    half = 0.5 * -robot.gravity[2] * STEP**2
    assert entries["CoM off integrator, stretch"].worst == pytest.approx(half * stretch(robot), rel=1e-9)
    assert entries["CoM off integrator, horizon"].worst == pytest.approx(half * KNOTS, rel=1e-9)
    assert entries["CoM off integrator, horizon"].knot == KNOTS
    assert entries["base off integrator, stretch"].worst < 1e-12


def hovering(robot, rule=rules.LEAPFROG):
    """Upright, with thrusts that carry the weight and throttles that keep them."""
    thrust = robot.weight / len(robot.jets)
    throttle = np.array([[jet.model.steady_throttle(thrust)] for jet in robot.jets])
    return motion(robot, rule, thrust=thrust, throttle=throttle)


def test_a_hover_stays_where_it_is(tmp_path):
    robot = drone(tmp_path)
    for entry in found(robot, hovering(robot)).values():
        assert entry.worst < 1e-9


PUSHES = pytest.mark.parametrize(
    ("rule", "first", "lost", "middle"),
    [(rules.STAGGERED, 4, 0.5, 4.5), (rules.LEAPFROG, 5, 0.125, 5.0)],
    ids=["staggered", "leapfrog"],
)
"""What column 5 does: from which knot its stretch leads farthest, how much of the stretch is lost, when its middle is.

Under leapfrog it acts from half an interval before knot 5 to half an interval after it. A stretch from that knot starts
with half of the speed, and the other half comes within half an interval: 1/8 of an interval is lost.
"""


@PUSHES
def test_a_push_that_the_plan_does_not_follow_moves_the_com_as_newton_says(rule, first, lost, middle, tmp_path):
    """A force F for Δt leaves a speed F Δt / m, from the middle of the time in which it acts on."""
    robot, push = drone(tmp_path), 30.0
    plan = hovering(robot, rule)
    forces = plan.contact_forces.copy()
    forces[2::3, 5] = push / len(robot.contacts)
    plan = replace(plan, contact_forces=forces)
    entries = found(robot, plan)
    gain = push / robot.mass * STEP**2
    near, far = entries["CoM off integrator, stretch"], entries["CoM off integrator, horizon"]
    assert near.worst == pytest.approx(gain * (stretch(robot) - lost), rel=1e-6)
    assert near.knot == first + stretch(robot)
    assert far.worst == pytest.approx(gain * (KNOTS - middle), rel=1e-6)
    assert entries["base off integrator, stretch"].worst < 1e-9


@PUSHES
def test_a_moment_that_the_plan_does_not_follow_turns_the_base_as_euler_says(rule, first, lost, middle, tmp_path):
    """A couple about the vertical for Δt leaves a rate M Δt / I, from the middle of the time in which it acts on."""
    robot, push, arm = drone(tmp_path, arm=0.2), 2.0, 0.2
    plan = hovering(robot, rule)
    feet = [frame_poses(robot, plan, name)[0, :3, 3] for name in robot.contact_names]
    forces = plan.contact_forces.copy()
    for row, foot in enumerate(feet):
        forces[3 * row + 1, 5] = push * np.sign(foot[0])
    plan = replace(plan, contact_forces=forces)
    entry = found(robot, plan)["base off integrator, stretch"]
    gain = len(feet) * push * arm / 0.4 * STEP**2  # 0.4 kg m² is the drone's inertia about the vertical
    assert entry.worst == pytest.approx(gain * (stretch(robot) - lost), rel=1e-6)
    assert entry.knot == first + stretch(robot)


def test_a_spinning_body_keeps_its_energy(tmp_path):
    robot = drone(tmp_path, jets=False)
    plan = motion(robot, rules.BACKWARD_EULER, angular_momentum=np.array([[1.0], [0.4], [0.8]]))
    controls = Controls.of(Motion.of(robot, plan))
    state, first = controls.starts[:1], np.array([0])

    def energy():
        momentum = rotations(state[:, 9:13])[0].T @ state[0, 6:9]
        return 0.5 * momentum @ controls.inertia_inverse[0] @ momentum

    before, start = energy(), state[:, 9:13]
    for interval in range(KNOTS):
        state = controls.advanced(state, first + interval)
    assert angles(state[:, 9:13], start)[0] > 1.0
    assert energy() == pytest.approx(before, rel=1e-5)


def test_the_base_turns_so_that_the_momentum_of_the_posture_is_that_of_the_state(ironcub):
    """The angular part of J_CMM(q) ν, with the base's turn over one fine interval, at its middle."""
    robot, rng = ironcub.with_jets(()), np.random.default_rng(3)
    time, n = STEP * np.arange(KNOTS + 1), len(ironcub.joint_names)
    moves = 0.4 * np.sin(3.0 * time + rng.uniform(0, 6, size=(n, 1)))
    plan = motion(
        robot,
        rules.BACKWARD_EULER,
        joint_positions=ironcub.home.joint_positions[:, None] + moves,
        angular_momentum=np.array([[1.0], [2.0], [-1.5]]),
    )
    controls = Controls.of(Motion.of(robot, plan), steps=200)
    state, first = controls.starts[:1], np.array([0])
    for interval in range(7):
        state = controls.advanced(state, first + interval)
    instant = np.array([2 * controls.steps * 7])
    turning = controls.slope(state, instant, np.array([8]))[0, 9:13]
    x, y, z, w = state[0, 9:13]
    omega = 2.0 * np.array([[w, -z, y, -x], [z, w, -x, -y], [-y, x, w, -z]]) @ turning  # ω = 2 vec(ρ̇ ∘ ρ⁻¹)
    joints, velocities = spline(time, plan.joint_positions.T, time[7:8])
    base = np.eye(4)
    base[:3, :3] = rotations(state[:, 9:13])[0]
    matrix = np.array(robot.kindyn.centroidal_momentum_matrix_fun()(base, joints[0]))
    momentum = matrix @ np.concatenate([np.zeros(3), omega, velocities[0]])
    assert momentum[3:] == pytest.approx(state[0, 6:9], abs=1e-6)
    assert np.abs(matrix[3:, 6:] @ velocities[0]).max() > 0.1


def test_what_runs_away_is_far_off_without_a_warning(tmp_path):
    robot = drone(tmp_path)
    plan = hovering(robot)
    throttle = plan.throttle.copy()
    throttle[0, 3] = 1e9
    entries = found(robot, replace(plan, throttle=throttle))
    assert entries["CoM off integrator, stretch"].worst > 1e6


def test_a_spline_is_exact_on_cubics_and_a_straight_line_between_two_knots():
    time = np.array([0.0, 0.1, 0.3, 0.35, 0.6, 1.0])
    at = np.linspace(0.0, 1.0, 31)
    values, slopes = spline(time, np.array([time**3 - time, 2.0 * time]).T, at)
    cubic, line = values.T
    assert cubic == pytest.approx(at**3 - at, abs=1e-12)
    assert line == pytest.approx(2.0 * at, abs=1e-12)
    assert slopes[:, 0] == pytest.approx(3 * at**2 - 1, abs=1e-11)
    assert slopes[:, 1] == pytest.approx(2.0, abs=1e-11)
    for knots in (2, 3):
        values, slopes = spline(time[:knots], 5.0 * time[:knots, None], np.array([0.05]))
        assert (values[0, 0], slopes[0, 0]) == pytest.approx((0.25, 5.0))


def test_the_angle_between_attitudes_does_not_depend_on_signs_and_lengths():
    half = np.array([0.0, 0.4, 1e-9]) / 2
    turned = np.array([np.zeros(3), np.sin(half), np.zeros(3), np.cos(half)]).T
    still = np.tile([0.0, 0.0, 0.0, 1.0], (3, 1))
    assert angles(still, turned) == pytest.approx(2 * half, abs=1e-12)
    assert angles(2.0 * still, -3.0 * turned) == pytest.approx(2 * half, abs=1e-12)
    assert rotations(turned)[1] @ [0.0, 0.0, 1.0] == pytest.approx([np.sin(0.4), 0.0, np.cos(0.4)])


def test_a_rule_of_order_one_has_limits_of_its_own(ironcub, take_off):
    names = [name for name, entry in PROPERTIES.items() if entry.first_order_limit is not None]
    assert len(names) == 5
    first, second = (
        audit(ironcub, replace(take_off.trajectory, rule=rule)) for rule in (rules.BACKWARD_EULER, rules.LEAPFROG)
    )
    for name in names:
        entry = PROPERTIES[name]
        size = entry.of.size(ironcub)
        assert first[name].limit == pytest.approx(entry.first_order_limit * size)
        assert second[name].limit == pytest.approx(entry.limit * size)
        assert np.isfinite(first[name].worst)
