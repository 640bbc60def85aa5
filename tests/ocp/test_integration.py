"""Integration rules: their gaps close where they should, and their order is what they say."""

from __future__ import annotations

from dataclasses import replace

import casadi as cs
import numpy as np
import pytest

import multimodal_to as mt
from drones import drone
from multimodal_to.adam import quaternion
from multimodal_to.ocp import constraints, paper
from multimodal_to.ocp.integration import BACKWARD_EULER, LEAPFROG, Interval
from multimodal_to.ocp.knot import VARIABLE_NAMES, Knot
from multimodal_to.trajectory import rules
from multimodal_to.trajectory.resampling import regrid, resample

RULES = {BACKWARD_EULER: 1, LEAPFROG: 2}
"""Each rule with its order."""


def test_the_gap_closes_when_the_end_is_the_start_plus_rate_times_interval():
    interval = Interval(1.0, 1.6, 0.3, BACKWARD_EULER)
    assert interval.gap(lambda position: position, lambda position: 2.0) == pytest.approx(0.0)
    assert interval.rate(lambda position: position) == pytest.approx(2.0)


def test_a_constant_angular_velocity_turns_the_whole_angle():
    """Ten intervals about a world axis, against the rotation by the whole angle at once."""
    rng = np.random.default_rng(0)
    omega, dt = rng.normal(size=3), 0.1
    start = rng.normal(size=4)
    start /= np.linalg.norm(start)
    end = cs.DM(start)
    for _ in range(10):
        still = Interval(end, end, dt, BACKWARD_EULER)  # the gap of standing still is what has to be moved
        end = end - still.rotation_gap(lambda quaternion: quaternion, lambda quaternion: cs.DM(omega))
    whole = quaternion.rotation_matrix(quaternion.exp(cs.DM(omega * 10 * dt)))
    expected = np.array(whole) @ np.array(quaternion.rotation_matrix(cs.DM(start)))
    assert np.array(quaternion.rotation_matrix(end)) == pytest.approx(expected, abs=1e-12)
    assert float(cs.norm_2(end)) == pytest.approx(1.0, abs=1e-12)


def knot(robot, **values):
    """A knot of zeros but for some variables."""
    sizes = {"base_quaternion_xyzw": 4, "contact_positions": 3 * len(robot.contacts)}
    sizes |= dict.fromkeys(("joint_positions", "joint_velocities"), len(robot.joint_names))
    sizes |= {"contact_forces": sizes["contact_positions"]}
    sizes |= dict.fromkeys(("thrust", "thrust_rate", "throttle"), len(robot.jets))
    zeros = {name: cs.SX.zeros(sizes.get(name, 3)) for name in VARIABLE_NAMES}
    return Knot(robot, **(zeros | values))


def spun(robot, rule, steps):
    """Where a torque-free body with three different inertias has turned after 1 s, by the problem's own rows."""
    end, start, duration = cs.SX.sym("end", 7), cs.SX.sym("start", 4), 1.0 / steps
    momentum = cs.DM([1.0, 0.4, 0.8])
    interval = Interval(
        knot(robot, base_quaternion_xyzw=start, angular_momentum=momentum),
        knot(robot, base_quaternion_xyzw=end[:4], base_angular_velocity=end[4:], angular_momentum=momentum),
        cs.SX(duration),
        rule,
    )
    rows = cs.vertcat(
        constraints.base_orientation_integration(interval, None),
        constraints.angular_momentum_kinematics(interval, None),
    )
    step = cs.rootfinder("step", "newton", {"x": end, "p": start, "g": rows}, {"abstol": 1e-13})
    state = cs.DM([0.0, 0.0, 0.0, 1.0, 2.0, 1.0, 2.0])
    for _ in range(steps):
        state = step(state, state[:4])
    return np.array(state[:4]).ravel()


def spooled(robot, rule, steps):
    """The thrust of the first jet after 2 s of a smooth throttle, by the problem's own rows."""
    end, start, duration = cs.SX.sym("end", 3), cs.SX.sym("start", 3), 2.0 / steps
    before, after = (knot(robot, thrust=some[0], thrust_rate=some[1], throttle=some[2]) for some in (start, end))
    interval = Interval(before, after, cs.SX(duration), rule)
    rows = cs.vertcat(
        constraints.thrust_integration(interval, None), constraints.thrust_dynamics(interval, None), end[2] - start[2]
    )
    throttle = cs.SX.sym("throttle")
    rows = cs.substitute(rows, end[2], throttle)
    unknown = end[:2]
    step = cs.rootfinder("step", "newton", {"x": unknown, "p": cs.vertcat(start, throttle), "g": rows[:2]})
    idle = robot.jets[0].model.steady_throttle(0.0)

    def at(index):
        return idle + 60.0 * (1.0 - np.cos(np.pi * index * duration / 2.0)) / 2.0

    state = cs.DM([0.0, 0.0])
    for index in range(steps):
        state = step(state, cs.vertcat(state, at(index), at(index + 1)))
    return float(state[0])


@pytest.mark.parametrize(("rule", "order"), RULES.items(), ids=lambda value: getattr(value, "name", value))
def test_a_spinning_body_is_followed_with_the_order_that_the_rule_says(rule, order, tmp_path):
    robot = drone(tmp_path, jets=False, arm=0.2)
    exact = spun(robot, LEAPFROG, 2000)
    errors = [np.linalg.norm(spun(robot, rule, steps) - exact) for steps in (20, 40, 80)]
    slopes = np.log2(np.array(errors[:-1]) / errors[1:])
    assert slopes == pytest.approx(order, abs=0.15)


@pytest.mark.parametrize(("rule", "order"), RULES.items(), ids=lambda value: getattr(value, "name", value))
def test_a_turbine_spools_with_the_order_that_the_rule_says(rule, order, tmp_path):
    robot = drone(tmp_path)
    robot = robot.with_jets(robot.jet_names[:1])
    exact = spooled(robot, LEAPFROG, 2000)
    errors = [abs(spooled(robot, rule, steps) - exact) for steps in (20, 40, 80)]
    slopes = np.log2(np.array(errors[:-1]) / errors[1:])
    assert slopes == pytest.approx(order, abs=0.25)


def test_a_force_that_alternates_from_knot_to_knot_moves_the_body(tmp_path):
    """So no force can ring unseen: forces ±F at knots leave velocities F Δt / m and zero in turns."""
    robot, force, dt = drone(tmp_path, jets=False), 30.0, 0.05
    parameters = mt.Parameters.of(robot, mt.scenarios.jump(), robot.home)
    count, speed, speeds = len(robot.contacts), 0.0, []
    for index in range(6):
        push = [0.0, 0.0, (-1) ** index * force / count - robot.mass * robot.gravity[2] / count]
        start = knot(robot, com_velocity=cs.DM([0.0, 0.0, speed]), contact_forces=cs.DM(push * count))
        rows = constraints.momentum_dynamics(Interval(start, knot(robot), cs.SX(dt), LEAPFROG), parameters)
        speed = -float(cs.evalf(rows[2]))
        speeds.append(speed)
    assert speeds == pytest.approx([force * dt / robot.mass, 0.0] * 3, abs=1e-12)


# -------------------------------------------------------------------- a motion by leapfrog


PAPER = mt.Formulation.paper()
BY_LEAPFROG = replace(PAPER, rule=LEAPFROG, terms=(*paper.TERMS, *paper.LEAPFROG))
"""The paper's problem by the other rule."""
TOUCH_DOWN = replace(mt.scenarios.paper("landing"), knots=35, interval_min=0.2, interval_max=0.2)


@pytest.fixture(scope="module")
def touch_down(ironcub, once):
    """The landing with half its knots, by either rule."""

    def solved():
        return [mt.solve(mt.build(ironcub, TOUCH_DOWN, formulation)) for formulation in (PAPER, BY_LEAPFROG)]

    return once("touch-down-by-both-rules", solved)


def test_a_motion_by_leapfrog_passes_the_audit_by_its_own_instants(ironcub, touch_down):
    _, second = touch_down
    assert second.status is mt.Status.OPTIMAL
    report = mt.audit(ironcub, second.trajectory)
    assert [finding.name for finding in report.findings if not finding.holds] == []
    for rule in (rules.BACKWARD_EULER, rules.STAGGERED):
        wrong = mt.audit(ironcub, replace(second.trajectory, rule=rule))
        assert not wrong["force balance"].holds
        assert not wrong["thrust dynamics"].holds


def test_its_thrusts_are_nearer_to_those_of_an_accurate_integrator(ironcub, touch_down):
    first, second = (mt.audit(ironcub, some.trajectory)["thrust off CVODES, horizon"].worst for some in touch_down)
    assert second < 0.6 * first


def test_its_controls_through_an_accurate_integrator_lead_nearer_to_it(ironcub, touch_down):
    first, second = (mt.audit(ironcub, some.trajectory) for some in touch_down)
    for name in ("CoM off integrator, stretch", "base off integrator, stretch"):
        assert second[name].worst < 0.5 * first[name].worst
    assert second["CoM off integrator, horizon"].worst < 0.05 * first["CoM off integrator, horizon"].worst


def test_a_force_has_its_foot_on_the_ground_at_the_knots_before_and_after_it_as_well(touch_down):
    motion = touch_down[1].trajectory
    heights = motion.per_contact("contact_positions")[:, 2]
    forces = motion.per_contact("contact_forces")[:, 2]
    assert (forces * heights).max() < 5.1e-3
    assert (forces[:, 1:] * heights[:, :-1]).max() < 5.1e-3
    assert (forces[:, :-1] * heights[:, 1:]).max() < 5.1e-3
    moves = np.linalg.norm(np.diff(motion.per_contact("contact_positions"), axis=2)[:, :2], axis=1)
    for loaded in (forces[:, 1:], forces[:, :-1]):
        assert (loaded * moves).max() < 2.1e-3 * np.sqrt(2.0)


def test_the_file_says_the_rule_and_one_without_it_is_of_backward_euler(touch_down, tmp_path):
    first, second = (some.trajectory for some in touch_down)
    file = second.save(tmp_path / "second.npz")
    assert mt.Trajectory.load(file).rule == "leapfrog"
    assert "joint_torques" in mt.Trajectory.load(file).unusual_formulation()  # a term that is usual by this rule
    assert first.unusual_formulation() == ""
    with np.load(first.save(tmp_path / "first.npz")) as stored:
        older = {name: stored[name] for name in stored.files if name != "rule"} | {"format_version": np.array(3)}
    np.savez(tmp_path / "older.npz", **older)
    assert mt.Trajectory.load(tmp_path / "older.npz").rule == "backward Euler"


def test_other_times_are_read_between_the_instants_of_each_quantity(touch_down):
    motion = touch_down[1].trajectory
    middles = 0.5 * (motion.time[1:] + motion.time[:-1])
    there = resample(motion, middles)
    assert there.contact_forces == pytest.approx(0.5 * (motion.contact_forces[:, 1:] + motion.contact_forces[:, :-1]))
    assert there.com_velocity == pytest.approx(motion.com_velocity[:, 1:])
    assert there.com_position == pytest.approx(0.5 * (motion.com_position[:, 1:] + motion.com_position[:, :-1]))
    again = regrid(motion, motion.knots, motion.rule)
    assert again.throttle == pytest.approx(motion.throttle)
    assert again.joint_positions == pytest.approx(motion.joint_positions)


def test_a_solve_starts_from_a_motion_of_the_other_rule(ironcub, touch_down):
    warm = mt.solve(mt.build(ironcub, TOUCH_DOWN, PAPER), start=touch_down[1].trajectory)
    assert warm.status is mt.Status.OPTIMAL
    assert warm.iterations < 0.6 * touch_down[0].iterations
