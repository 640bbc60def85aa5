"""The audit of keyframes: a plan that meets them passes, and each kind of miss is found by its amount."""

from __future__ import annotations

from dataclasses import replace

import casadi as cs
import numpy as np
import pytest

import multimodal_to as mt
from multimodal_to.adam import quaternion
from multimodal_to.auditing.keyframes import _quaternion, rotation_vector
from multimodal_to.models.attitude import product
from synthetic import take_off as synthetic_take_off

KNOT = 17


@pytest.fixture(scope="module")
def motion(ironcub):
    return synthetic_take_off(ironcub)


def turned(angle, motion):
    """The base's attitude at the knot, turned to the left about the vertical."""
    about = np.array([0.0, 0.0, np.sin(angle / 2), np.cos(angle / 2)])
    return tuple(product(about, motion.base_quaternion_xyzw[:, KNOT]))


def worst(robot, motion, kind, **asked):
    task = replace(
        mt.scenarios.take_off(),
        knots=motion.knots,
        keyframes=(mt.Keyframe(when="end", joints={"l_knee": 0.0}, weight=1.0), mt.Keyframe(knot=KNOT, **asked)),
    )
    found = mt.audit(robot, motion, task)[f"keyframes: {kind}"]
    assert found.knot == KNOT
    return found


def pose(robot, motion, frame):
    base = np.eye(4)
    base[:3, :3] = np.array(quaternion.rotation_matrix(cs.DM(motion.base_quaternion_xyzw[:, KNOT])))
    base[:3, 3] = motion.base_position[:, KNOT]
    return np.array(robot.kindyn.forward_kinematics(frame, base, motion.joint_positions[:, KNOT]))


def test_a_position_is_off_by_its_largest_axis(ironcub, motion):
    com = motion.com_position[:, KNOT]
    found = worst(ironcub, motion, "CoM", com=tuple(com + np.array([0.0, 0.02, -0.03])))
    assert (found.worst, found.body) == (pytest.approx(0.03, abs=1e-9), "keyframe 2 z")
    assert not found.holds
    assert worst(ironcub, motion, "CoM", com={"y": com[1]}).holds
    assert worst(ironcub, motion, "CoM", com_min={"z": com[2] + 0.04}).worst == pytest.approx(0.04)
    assert worst(ironcub, motion, "CoM", com_max={"z": com[2] + 0.04}).worst == pytest.approx(-0.04)
    base = motion.base_position[:, KNOT]
    assert worst(ironcub, motion, "base position", base_position={"x": base[0] + 0.01}).worst == pytest.approx(0.01)


def test_joints_and_frames_are_let_go_within_their_tolerance(ironcub, motion):
    knee = motion.joint_positions[ironcub.joint_names.index("l_knee"), KNOT]
    found = worst(ironcub, motion, "joints", joints={"l_knee": knee + 0.3}, joint_tolerance=0.1)
    assert (found.worst, found.body, found.unit) == (pytest.approx(0.2), "l_knee", "rad")
    there = pose(ironcub, motion, "l_arm_jet_turbine")
    target = mt.FrameTarget(position=tuple(there[:3, 3] + [0.05, 0.0, 0.0]), position_tolerance=0.04)
    assert worst(ironcub, motion, "frame position", frames={"l_arm_jet_turbine": target}).worst == pytest.approx(0.01)
    same = tuple(_quaternion(there[:3, :3]))
    target = mt.FrameTarget(orientation=same)
    assert worst(ironcub, motion, "frame orientation", frames={"l_arm_jet_turbine": target}).worst < 1e-9


def test_a_turn_is_off_by_its_angle_whatever_the_sign(ironcub, motion):
    for sign in (1.0, -1.0):
        asked = tuple(sign * part for part in turned(0.4, motion))
        found = worst(ironcub, motion, "orientation", base_orientation=asked, orientation_tolerance=0.1)
        assert found.worst == pytest.approx(0.3, abs=1e-2)
    here = worst(ironcub, motion, "yaw", yaw=0.0).worst
    assert worst(ironcub, motion, "yaw", yaw=0.0, orientation_tolerance=0.01).worst == pytest.approx(here - 0.01)


def test_a_pure_yaw_at_a_hover_is_upright(ironcub, motion):
    level = replace(motion, base_quaternion_xyzw=np.tile(np.reshape(upright(ironcub, 0.7), (4, 1)), motion.knots + 1))
    assert worst(ironcub, level, "base off upright", hover=True, yaw=0.7).worst < 1e-6
    assert worst(ironcub, level, "yaw", hover=True, yaw=0.7).holds
    assert worst(ironcub, level, "yaw", hover=True, yaw=0.6).worst == pytest.approx(0.1, abs=3e-3)


def upright(robot, yaw):
    about = np.array([0.0, 0.0, np.sin(yaw / 2), np.cos(yaw / 2)])
    return product(about, robot.upright.base_quaternion_xyzw)


def test_what_moves_or_is_in_the_air_neither_rests_nor_stands(ironcub, motion):
    moving = replace(motion, joint_velocities=np.full_like(motion.joint_velocities, 0.2))
    assert worst(ironcub, moving, "speed", rest=True).worst == pytest.approx(0.2)
    points = motion.per_contact("contact_positions")[:, 2, KNOT]
    assert worst(ironcub, motion, "feet off the ground", standing=True).worst == pytest.approx(np.abs(points).max())


def test_a_momentum_is_off_by_its_difference(ironcub, motion):
    there = ironcub.mass * motion.com_velocity[2, KNOT : KNOT + 1].mean()
    asked = mt.Momentum(linear={"z": there + 1.0}, angular={"z": 100.0})
    found = worst(ironcub, motion, "linear momentum", momentum=asked)
    assert found.worst > 0.01
    assert found.unit == "kg m/s"
    assert worst(ironcub, motion, "angular momentum asked", momentum=asked).worst > 50.0


@pytest.mark.parametrize("seed", range(5))
def test_the_quaternion_of_a_matrix_is_that_of_its_rotation(seed):
    rho = np.random.default_rng(seed).normal(size=4) * [1.0, 1.0, 1.0, 0.1]
    rho /= np.linalg.norm(rho)
    found = _quaternion(np.array(quaternion.rotation_matrix(cs.DM(rho))))
    assert abs(found @ rho) == pytest.approx(1.0, abs=1e-12)
    assert np.abs(rotation_vector(rho, found)).max() < 1e-7
