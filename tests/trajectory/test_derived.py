from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from multimodal_to.adam import KinDynComputations
from multimodal_to.errors import InputError
from multimodal_to.models.terrain import FlatGround
from multimodal_to.trajectory import QUANTITIES, rules
from multimodal_to.trajectory.derived import (
    acting_times,
    base_poses,
    contact_products,
    flight_force,
    flight_phases,
    footsteps,
    generalised_forces,
    joint_torques,
    largest_torques,
    loaded_force,
    step_length,
    step_lift,
)
from multimodal_to.trajectory.resampling import resample
from solo import solo
from synthetic import DURATION, KNOTS, LIFT_OFF, take_off


@pytest.fixture(scope="module")
def trajectory(ironcub):
    return take_off(ironcub)


def test_at_its_own_knots_a_resampled_trajectory_is_itself(trajectory):
    again = resample(trajectory, trajectory.time)
    for name in ("joint_positions", "thrust", "contact_forces", "base_quaternion_xyzw"):
        np.testing.assert_allclose(getattr(again, name), getattr(trajectory, name), atol=1e-12)


def test_between_knots_the_base_turns_at_constant_rate_the_shorter_way(trajectory):
    quaternions = np.zeros((4, trajectory.time.size))
    angles = 3.0 * trajectory.time
    quaternions[2:] = np.sin(angles / 2), np.cos(angles / 2)
    quaternions[:, 1::2] *= -1.0  # the same turns, written with the other sign
    turning = replace(trajectory, base_quaternion_xyzw=quaternions)
    times = np.linspace(0.0, DURATION, 47)
    poses = base_poses(resample(turning, times))
    np.testing.assert_allclose(poses[:, 0, 0], np.cos(3.0 * times), atol=1e-12)
    np.testing.assert_allclose(poses[:, 1, 0], np.sin(3.0 * times), atol=1e-12)


def test_between_knots_everything_else_is_linear(trajectory):
    half = resample(trajectory, (trajectory.time[1:] + trajectory.time[:-1]) / 2)
    expected = (trajectory.joint_positions[:, 1:] + trajectory.joint_positions[:, :-1]) / 2
    np.testing.assert_allclose(half.joint_positions, expected, atol=1e-12)


@pytest.mark.parametrize("times", [[-0.1, 1.0], [0.0, DURATION + 0.1]])
def test_a_time_outside_the_trajectory_is_refused(trajectory, times):
    with pytest.raises(InputError, match="expected 0 to 2 s"):
        resample(trajectory, times)


def walking(robot, trajectory, *, lift, length):
    """A trajectory whose base goes by `length` and up by `lift` in the middle, with the load off both feet there."""
    position, forces = trajectory.base_position.copy(), np.zeros_like(trajectory.contact_forces)
    position[:] = robot.home.base_position[:, None]
    position[0] += np.linspace(0.0, length, position.shape[1])
    position[2, 8:13] += lift
    forces[2::3] = 50.0
    forces[:, 8:13] = 0.0
    standing = np.repeat(robot.home.base_quaternion_xyzw[:, None], position.shape[1], axis=1)
    joints = np.repeat(robot.home.joint_positions[:, None], position.shape[1], axis=1)
    return replace(
        trajectory, base_position=position, base_quaternion_xyzw=standing, joint_positions=joints, contact_forces=forces
    )


def test_a_foot_that_lifts_and_comes_down_elsewhere_has_stepped(ironcub, trajectory):
    steps = footsteps(ironcub, walking(ironcub, trajectory, lift=0.02, length=0.4), FlatGround())
    assert [step.foot for step in steps] == ["left", "right"]
    for step in steps:
        assert (step.lift_off, step.touch_down) == pytest.approx((0.7, 1.3))
        assert step.length == pytest.approx(0.12)  # six of twenty intervals
        assert step.lift == pytest.approx(0.02, abs=2e-3)


@pytest.mark.parametrize(("lift", "length"), [(0.005, 0.4), (0.02, 0.1)], ids=["it skims", "it comes down near"])
def test_a_foot_that_skims_or_comes_down_near_has_not_stepped(ironcub, trajectory, lift, length):
    assert footsteps(ironcub, walking(ironcub, trajectory, lift=lift, length=length), FlatGround()) == []


def test_a_foot_that_stays_in_the_air_has_not_stepped(ironcub, trajectory):
    assert footsteps(ironcub, trajectory, FlatGround()) == []


def test_how_high_a_foot_lifts_is_seen_from_the_ground_below_it(ironcub, trajectory):
    walk = walking(ironcub, trajectory, lift=0.02, length=0.4)
    (left, _) = footsteps(ironcub, walk, FlatGround(height=-0.5))
    assert left.lift == pytest.approx(0.52, abs=2e-3)


# ------------------------------------------------------------------------- what counts, by weight and size


def test_what_counts_for_the_ironcub_is_a_few_newtons_and_centimetres(ironcub):
    assert flight_force(ironcub) == pytest.approx(1.1, abs=0.05)
    assert loaded_force(ironcub) == pytest.approx(5.0, abs=0.1)
    assert step_lift(ironcub) == pytest.approx(0.01, abs=2e-4)
    assert step_length(ironcub) == pytest.approx(0.05, abs=5e-4)


def test_what_counts_for_a_small_robot_is_a_small_part_of_what_its_feet_bear(tmp_path):
    small = solo(tmp_path)
    share = small.weight / len(small.contacts)
    assert 0.8 * share < 5.0  # a limit of 5 N would let it skate
    assert loaded_force(small) < 0.1 * share
    assert flight_force(small) < loaded_force(small)
    assert step_lift(small) < 0.005
    assert step_length(small) < 0.025


def test_a_motion_of_half_the_forces_by_half_the_robot_flies_and_steps_alike(ironcub, trajectory):
    """Under half the gravity all weights are half as much, and so is what counts."""
    light = light_of(ironcub)
    walk = walking(ironcub, trajectory, lift=0.02, length=0.4)
    lighter = replace(walk, contact_forces=0.5 * walk.contact_forces)
    assert footsteps(light, lighter, FlatGround()) == footsteps(ironcub, walk, FlatGround())
    slow = replace(trajectory, contact_forces=0.5 * trajectory.contact_forces)
    assert flight_phases(light, slow) == flight_phases(ironcub, trajectory)


def light_of(robot):
    return replace(robot, kindyn=KinDynComputations(robot.urdf, robot.joint_names, gravity=0.5 * robot.gravity))


# ------------------------------------------------------------------------- instants by leapfrog, and of older files


@pytest.fixture(scope="module")
def leapfrog(trajectory):
    return replace(trajectory, rule=rules.LEAPFROG)


@pytest.fixture(scope="module")
def staggered(trajectory):
    return replace(trajectory, rule=rules.STAGGERED)


def test_by_leapfrog_velocities_are_in_the_middles_of_intervals_and_forces_at_knots(trajectory, leapfrog):
    time, step = trajectory.time, DURATION / KNOTS
    for name in ("joint_positions", "thrust", "contact_forces", "throttle"):
        np.testing.assert_array_equal(leapfrog.times(name), time)
    for name in ("joint_velocities", "contact_force_rates", "thrust_rate"):
        np.testing.assert_allclose(leapfrog.times(name), time - step / 2, atol=1e-12)
    np.testing.assert_allclose(leapfrog.times("com_acceleration"), time - step, atol=1e-12)


def test_what_acts_acts_for_an_interval_within_the_motion(trajectory, leapfrog, staggered):
    time, step = trajectory.time, DURATION / KNOTS
    for motion in (trajectory, staggered):
        begins, ends = acting_times(motion)
        np.testing.assert_allclose(begins[1:], time[:-1], atol=1e-12)
        np.testing.assert_allclose(ends, time, atol=1e-12)
        assert begins[0] == ends[0]
    begins, ends = acting_times(leapfrog)
    np.testing.assert_allclose(begins, np.maximum(time - step / 2, 0.0), atol=1e-12)
    np.testing.assert_allclose(ends, np.minimum(time + step / 2, DURATION), atol=1e-12)
    np.testing.assert_allclose(begins[1:], ends[:-1], atol=1e-12)


def test_the_forces_of_a_motion_carry_its_weight_while_they_act(ironcub, trajectory, leapfrog):
    """The impulse of the contact forces is that of the weight which the robot stands with, on any grid."""
    grid = np.array([0.0, 0.1, 0.15, 0.4, 0.5])
    arrays = {name: getattr(leapfrog, name)[:, : grid.size] for name in QUANTITIES}
    arrays["contact_forces"] = np.tile([[0.0], [0.0], [ironcub.weight / 8]], (8, grid.size))
    begins, ends = acting_times(replace(leapfrog, time=grid, **arrays))
    impulse = (arrays["contact_forces"][2::3].sum(axis=0) * (ends - begins)).sum()
    assert impulse == pytest.approx(ironcub.weight * grid[-1])


def test_a_flight_by_leapfrog_begins_half_an_interval_before_its_first_knot_without_force(ironcub, leapfrog):
    half = 0.5 * DURATION / KNOTS
    assert flight_phases(ironcub, leapfrog) == [pytest.approx((LIFT_OFF - half, DURATION))]
    forces = leapfrog.contact_forces.copy()
    forces[2, -1] = 100.0
    landed = replace(leapfrog, contact_forces=forces)
    assert flight_phases(ironcub, landed) == [pytest.approx((LIFT_OFF - half, DURATION - half))]
    nothing = replace(leapfrog, contact_forces=np.zeros_like(forces))
    assert flight_phases(ironcub, nothing) == [(0.0, DURATION)]


def test_a_step_by_leapfrog_lasts_from_where_one_force_ends_to_where_the_next_begins(ironcub, trajectory):
    walk = replace(walking(ironcub, trajectory, lift=0.02, length=0.4), rule=rules.LEAPFROG)
    for step in footsteps(ironcub, walk, FlatGround()):
        assert (step.lift_off, step.touch_down) == pytest.approx((0.75, 1.25))


def test_a_force_by_leapfrog_counts_with_the_heights_and_slips_on_both_sides_of_its_knot(ironcub, leapfrog):
    """One foot moves at one knot: the forces of that knot and of both beside it see its height and its way."""
    knot, up, along = 6, 0.01, 0.03
    position, forces = leapfrog.base_position.copy(), np.zeros_like(leapfrog.contact_forces)
    position[:] = ironcub.home.base_position[:, None]
    position[2, knot] += up
    position[0, knot] += along
    forces[2] = 40.0
    standing = np.repeat(ironcub.home.base_quaternion_xyzw[:, None], KNOTS + 1, axis=1)
    joints = np.repeat(ironcub.home.joint_positions[:, None], KNOTS + 1, axis=1)
    hop = replace(
        leapfrog,
        base_position=position,
        base_quaternion_xyzw=standing,
        joint_positions=joints,
        contact_forces=forces,
    )
    heights, slips = (products[0] for products in contact_products(ironcub, hop, FlatGround()))
    raised, still = heights[[knot - 1, knot, knot + 1]], np.delete(heights, [knot - 1, knot, knot + 1])
    assert raised - still[0] == pytest.approx(40.0 * up)
    np.testing.assert_allclose(still, still[0], atol=1e-9)
    assert slips[[knot - 1, knot, knot + 1]] == pytest.approx(40.0 * along)
    np.testing.assert_allclose(np.delete(slips, [knot - 1, knot, knot + 1]), 0.0, atol=1e-9)


def test_each_quantity_of_a_staggered_motion_has_its_own_times(trajectory, staggered):
    time, step = trajectory.time, DURATION / KNOTS
    for name in ("joint_positions", "thrust"):
        np.testing.assert_array_equal(staggered.times(name), time)
    for name in ("joint_velocities", "contact_forces"):
        np.testing.assert_allclose(staggered.times(name), time - step / 2, atol=1e-12)
    np.testing.assert_allclose(staggered.times("com_acceleration"), time - step, atol=1e-12)
    np.testing.assert_array_equal(trajectory.times("com_acceleration"), time)
    with pytest.raises(InputError, match="unknown quantity 'joint_velocity'; did you mean 'joint_velocities'"):
        trajectory.times("joint_velocity")


def test_a_flight_of_a_staggered_motion_begins_with_the_first_interval_without_force(ironcub, trajectory, staggered):
    (plain,), (shifted,) = flight_phases(ironcub, trajectory), flight_phases(ironcub, staggered)
    assert plain == pytest.approx((LIFT_OFF, DURATION))
    assert shifted == pytest.approx((LIFT_OFF - DURATION / KNOTS, DURATION))
    nothing = replace(staggered, contact_forces=np.zeros_like(staggered.contact_forces))
    assert flight_phases(ironcub, nothing) == [(0.0, DURATION)]


def test_a_step_of_a_staggered_motion_ends_where_its_loaded_interval_begins(ironcub, trajectory):
    walk = replace(walking(ironcub, trajectory, lift=0.02, length=0.4), rule=rules.STAGGERED)
    for step in footsteps(ironcub, walk, FlatGround()):
        assert (step.lift_off, step.touch_down) == pytest.approx((0.7, 1.2))


def test_a_force_of_an_interval_counts_with_the_greater_height_of_its_ends(ironcub, trajectory, staggered):
    plain, _ = contact_products(ironcub, trajectory, FlatGround())
    both, _ = contact_products(ironcub, staggered, FlatGround())
    normal = trajectory.per_contact("contact_forces")[:, 2]
    heights = np.divide(plain, normal, out=np.zeros_like(plain), where=normal > 0.0)
    np.testing.assert_allclose(both[:, 1:], normal[:, 1:] * np.maximum(heights[:, 1:], heights[:, :-1]), atol=1e-9)


# ------------------------------------------------------------------------- torques


def test_joint_torques_give_the_power_that_moves_the_joints(ironcub, trajectory):
    """Without gravity, contact and thrust, τ ṡ + wᵀ ν is the rate of the kinetic energy ½ νᵀ M ν."""
    rng = np.random.default_rng(3)
    free = replace(ironcub, kindyn=KinDynComputations(ironcub.urdf, ironcub.joint_names, gravity=np.zeros(3)))
    step, count = 1e-4, 41
    time = step * np.arange(count)
    rate, acceleration = rng.normal(size=(23, 1)), rng.normal(size=(23, 1))
    home = ironcub.home
    still = {name: np.zeros((len(getattr(trajectory, name)), count)) for name in QUANTITIES}
    still["base_position"] = np.repeat(home.base_position[:, None], count, axis=1)
    still["base_quaternion_xyzw"] = np.repeat(home.base_quaternion_xyzw[:, None], count, axis=1)
    middle = time - step / 2
    still["joint_positions"] = home.joint_positions[:, None] + rate * time + 0.5 * acceleration * time**2
    still["joint_velocities"] = rate + acceleration * middle
    motion = replace(trajectory, time=time, rule=rules.LEAPFROG, **still)
    mass = free.kindyn.mass_matrix_fun()
    energy = []
    for knot in range(count):
        speed = np.concatenate([np.zeros(6), (rate + acceleration * time[knot]).ravel()])
        energy.append(0.5 * speed @ np.array(mass(home.base_transform, motion.joint_positions[:, knot])) @ speed)
    power = (joint_torques(free, motion) * (rate + acceleration * time)).sum(axis=0)
    np.testing.assert_allclose(power[1:-1], (np.array(energy)[2:] - np.array(energy)[:-2]) / (2 * step), rtol=1e-5)
    np.testing.assert_array_equal(joint_torques(free, motion), generalised_forces(free, motion)[6:])


def test_velocity_products_at_a_knot_are_the_mean_of_those_before_and_after_it(ironcub, trajectory):
    """Each of two velocities holds for half of the time; with the mean velocity alone a wrench is left for the base."""
    rng = np.random.default_rng(8)
    n, step, knot = len(ironcub.joint_names), DURATION / KNOTS, 7
    velocities = rng.normal(size=(6 + n, KNOTS + 1))
    motion = replace(
        trajectory,
        rule=rules.LEAPFROG,
        base_linear_velocity=velocities[:3],
        base_angular_velocity=velocities[3:6],
        joint_velocities=velocities[6:],
        contact_forces=np.zeros_like(trajectory.contact_forces),
        thrust=np.zeros_like(trajectory.thrust),
    )
    pose, joints = base_poses(motion)[knot], motion.joint_positions[:, knot]
    kindyn = ironcub.kindyn
    before, after = velocities[:, knot], velocities[:, knot + 1]
    bias = [np.array(kindyn.bias_force(pose, joints, one[:6], one[6:])).ravel() for one in (before, after)]
    mass = np.array(kindyn.mass_matrix(pose, joints))
    expected = mass @ (after - before) / step + 0.5 * (bias[0] + bias[1])
    asked = generalised_forces(ironcub, motion)[:, knot]
    np.testing.assert_allclose(asked, expected, atol=1e-8)
    middle = 0.5 * (before + after)
    alone = mass @ (after - before) / step + np.array(kindyn.bias_force(pose, joints, middle[:6], middle[6:])).ravel()
    assert np.abs(asked - alone)[:6].max() > 1.0


@pytest.mark.parametrize(("rule", "knot"), [(rules.BACKWARD_EULER, 0), (rules.LEAPFROG, KNOTS)])
def test_the_torques_of_the_knot_without_an_acceleration_do_not_count(ironcub, trajectory, rule, knot):
    forces = trajectory.contact_forces.copy()
    forces[2, knot] += 1e4
    motion = replace(trajectory, rule=rule, contact_forces=forces)
    torques = np.abs(joint_torques(ironcub, motion))
    pushed = ironcub.joint_names.index("l_hip_roll")
    assert torques[pushed].argmax() == knot
    found = {one.joint: one for one in largest_torques(ironcub, motion)}["l_hip_roll"]
    assert found.when != motion.time[knot]
    assert found.torque == np.delete(torques[pushed], knot).max() < torques[pushed, knot]


def test_the_joint_nearest_to_its_limit_comes_first_and_one_without_a_limit_last(ironcub, trajectory):
    efforts = ironcub.joint_limits.effort.copy()
    efforts[ironcub.joint_names.index("l_knee")] = np.inf
    efforts[ironcub.joint_names.index("r_elbow")] = 0.01
    robot = replace(ironcub, joint_limits=replace(ironcub.joint_limits, effort=efforts))
    found = largest_torques(robot, trajectory)
    assert found[0].joint == "r_elbow"
    assert (found[-1].joint, found[-1].over_effort) == ("l_knee", 0.0)
    row = np.abs(joint_torques(robot, trajectory)[robot.joint_names.index("r_elbow"), 1:])
    assert found[0].torque == row.max()
    assert found[0].when == trajectory.time[1 + row.argmax()]
    assert {one.joint for one in found} == set(robot.joint_names)


def test_a_motion_without_the_jets_of_its_robot_has_torques(ironcub, trajectory):
    none = np.zeros((0, trajectory.time.size))
    walker = replace(trajectory, jet_names=(), thrust=none, thrust_rate=none, thrust_acceleration=none, throttle=none)
    cold = replace(trajectory, thrust=np.zeros_like(trajectory.thrust))
    np.testing.assert_allclose(joint_torques(ironcub, walker), joint_torques(ironcub, cold), atol=1e-9)
