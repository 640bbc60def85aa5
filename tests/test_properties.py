"""What holds for every rotation, trajectory, scenario and robot, tried on those that hypothesis draws."""

from __future__ import annotations

import math
from dataclasses import replace

import casadi as cs
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from lxml import etree
from scipy.spatial.transform import Rotation

from multimodal_to.adam import KinDynComputations, quaternion
from multimodal_to.adam.inspection import describe
from multimodal_to.models.contact import FrictionCone
from multimodal_to.models.terrain import FlatGround, HeightField, Plane, Stairs
from multimodal_to.scenarios import files as scenario_files
from multimodal_to.scenarios.data import from_dict, to_dict
from multimodal_to.scenarios.scenario import Scenario, Start, Terminal
from multimodal_to.scenarios.weights import Weights
from multimodal_to.trajectory import QUANTITIES, Trajectory
from multimodal_to.trajectory.resampling import resample
from random_trees import random_urdf

quick = settings(
    max_examples=40,
    deadline=None,
    derandomize=True,
    database=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
"""The same examples on every run."""

# ---------------------------------------------------------------- rotations

SMALL_ANGLES = st.floats(-12.0, -1.0).map(lambda power: 10.0**power)
ANGLES = st.one_of(
    st.just(0.0),
    SMALL_ANGLES,
    st.floats(0.0, math.pi),
    SMALL_ANGLES.map(lambda gap: math.pi - gap),
)
"""Angles from 0 to π [rad], many of them next to the ends."""
NUMBERS = st.floats(-1.0, 1.0)


@st.composite
def rotation_vectors(draw: st.DrawFn) -> np.ndarray:
    axis = np.array(draw(st.tuples(NUMBERS, NUMBERS, NUMBERS).filter(lambda axis: math.hypot(*axis) > 1e-3)))
    return draw(ANGLES) * axis / np.linalg.norm(axis)


def exp(vector: np.ndarray) -> np.ndarray:
    return np.array(quaternion.exp(cs.DM(vector))).ravel()


def log(rho: np.ndarray) -> np.ndarray:
    return np.array(quaternion.log(cs.DM(rho))).ravel()


def matrix(rho: np.ndarray) -> np.ndarray:
    return np.array(quaternion.rotation_matrix(cs.DM(rho)))


@quick
@given(rotation_vectors())
def test_exp_is_the_rotation_about_its_vector_and_log_takes_it_back(vector):
    rho = exp(vector)
    assert np.linalg.norm(rho) == pytest.approx(1.0, abs=1e-14)
    np.testing.assert_allclose(matrix(rho), Rotation.from_rotvec(vector).as_matrix(), atol=1e-14)
    for sign in (1.0, -1.0):  # both quaternions of the rotation
        again = log(sign * rho)
        assert np.linalg.norm(again) <= math.pi + 1e-14
        if np.linalg.norm(vector) < math.pi - 1e-9:
            np.testing.assert_allclose(again, vector, atol=1e-13, rtol=1e-13)
        else:  # half a turn either way
            np.testing.assert_allclose(np.outer(again, again), np.outer(vector, vector), atol=1e-7)


@quick
@given(rotation_vectors(), rotation_vectors())
def test_a_product_of_quaternions_is_one_of_rotations_and_the_conjugate_its_inverse(first, second):
    left, right = exp(first), exp(second)
    product = np.array(quaternion.product(cs.DM(left), cs.DM(right))).ravel()
    np.testing.assert_allclose(matrix(product), matrix(left) @ matrix(right), atol=1e-14)
    np.testing.assert_allclose(matrix(left) @ matrix(left).T, np.eye(3), atol=1e-14)
    assert np.linalg.det(matrix(left)) == pytest.approx(1.0, abs=1e-14)
    inverse = quaternion.conjugate(cs.DM(product))
    identity = np.array(quaternion.product(cs.DM(product), inverse)).ravel()
    np.testing.assert_allclose(identity, [0.0, 0.0, 0.0, 1.0], atol=1e-14)


# ---------------------------------------------------------------- trajectories

TEXTS = st.text(st.characters(exclude_categories=("Cs",), exclude_characters="\0"), max_size=20)
NAMES = st.lists(TEXTS, max_size=3, unique=True).map(tuple)


@st.composite
def trajectories(draw: st.DrawFn) -> Trajectory:
    labels = {name: draw(NAMES) for name in ("joint_names", "contact_names", "jet_names")}
    steps = draw(st.lists(st.floats(1e-3, 10.0), min_size=1, max_size=6))
    time = draw(st.floats(-10.0, 10.0)) + np.cumsum([0.0, *steps])
    bodies = {"robot": 1, **{name.removesuffix("_names"): len(entries) for name, entries in labels.items()}}
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    scale = draw(st.sampled_from([0.0, 1e-300, 1.0, 1e12]))
    arrays = {
        name: scale * rng.normal(size=(quantity.rows * bodies[quantity.of], time.size))
        for name, quantity in QUANTITIES.items()
    }
    vectors = [draw(rotation_vectors()) for _ in time]
    arrays["base_quaternion_xyzw"] = np.column_stack([rng.choice([-1.0, 1.0]) * exp(vector) for vector in vectors])
    return Trajectory(robot=draw(TEXTS), scenario=draw(TEXTS), scenario_json=draw(TEXTS), time=time, **labels, **arrays)


@quick
@given(trajectories())
def test_a_trajectory_survives_its_file_bit_by_bit(tmp_path, trajectory):
    again = Trajectory.load(trajectory.save(tmp_path / "motion.npz"))
    for name in ("time", *QUANTITIES):
        assert getattr(again, name).tobytes() == np.ascontiguousarray(getattr(trajectory, name)).tobytes()
    for name in ("robot", "scenario", "scenario_json", "joint_names", "contact_names", "jet_names"):
        assert getattr(again, name) == getattr(trajectory, name)


@quick
@given(trajectories(), st.lists(st.floats(0.0, 1.0), max_size=5))
def test_resampling_keeps_the_ends_and_turns_by_unit_quaternions(trajectory, shares):
    start, end = trajectory.time[0], trajectory.time[-1]
    between = np.clip(np.unique([start + share * trajectory.duration for share in shares]), start, end)
    times = np.unique([start, *between, end])
    sampled = resample(trajectory, times)
    np.testing.assert_array_equal(sampled.time, times)
    norms = np.linalg.norm(sampled.base_quaternion_xyzw, axis=0)
    np.testing.assert_allclose(norms, 1.0, atol=1e-14)
    for name in QUANTITIES:
        ends, own = getattr(sampled, name)[:, [0, -1]], getattr(trajectory, name)[:, [0, -1]]
        if name == "base_quaternion_xyzw":
            assert np.abs((ends * own).sum(axis=0)) == pytest.approx(1.0, abs=1e-12)
        else:
            np.testing.assert_array_equal(ends, own)
            low, high = getattr(trajectory, name).min(axis=1), getattr(trajectory, name).max(axis=1)
            room = 1e-12 * np.maximum(np.abs(low), np.abs(high))
            assert (getattr(sampled, name) >= (low - room)[:, None]).all()
            assert (getattr(sampled, name) <= (high + room)[:, None]).all()


# ---------------------------------------------------------------- scenarios

POSITIVE = st.floats(1e-9, 1e9)
LENGTHS = st.floats(-1.0, 1.0)
DIRECTIONS = st.tuples(LENGTHS, LENGTHS).filter(lambda way: math.hypot(*way) > 1e-3)
PLANES = st.builds(Plane, slope=LENGTHS, direction=DIRECTIONS, height=LENGTHS)


@st.composite
def stairs(draw: st.DrawFn) -> Stairs:
    rises = draw(st.lists(st.floats(0.1, 1.0), min_size=1, max_size=4))
    edges = tuple(np.cumsum(rises).tolist())
    heights = draw(st.lists(LENGTHS, min_size=len(edges) + 1, max_size=len(edges) + 1).map(tuple))
    return Stairs(edges=edges, heights=heights, direction=draw(DIRECTIONS), width=draw(st.floats(1e-3, 0.05)))


@st.composite
def fields(draw: st.DrawFn) -> HeightField:
    columns = draw(st.integers(4, 6))
    row = st.lists(LENGTHS, min_size=columns, max_size=columns).map(tuple)
    heights = draw(st.lists(row, min_size=4, max_size=6).map(tuple))
    return HeightField(x_range=(-1.0, draw(LENGTHS) + 2.5), y_range=(-2.0, 0.5), heights=heights)


WEIGHTS = st.builds(
    Weights,
    joint_velocities=st.dictionaries(TEXTS, POSITIVE, max_size=3),
    **{name: st.one_of(st.just(0.0), POSITIVE) for name in Weights.__dataclass_fields__ if name != "joint_velocities"},
)
PLAIN_NAMES = st.text(st.characters(exclude_categories=("C", "Z"), exclude_characters="/\\."), min_size=1, max_size=20)
SCENARIOS = st.builds(
    Scenario,
    name=PLAIN_NAMES,
    title=st.text(st.characters(exclude_categories=("Cs", "Cc"))),
    knots=st.integers(100, 10_000),
    initial_com=st.tuples(LENGTHS, LENGTHS, LENGTHS),
    final_com=st.tuples(LENGTHS, LENGTHS, LENGTHS),
    start=st.sampled_from(Start),
    terminal=st.sampled_from(Terminal),
    mid_height_min=st.none() | LENGTHS,
    jets=st.booleans(),
    interval_min=st.floats(0.01, 0.1),
    interval_max=st.floats(0.1, 10.0),
    weights=WEIGHTS,
    surface=st.one_of(st.builds(FlatGround, height=LENGTHS), PLANES, stairs(), fields()),
    friction=st.none() | POSITIVE,
    friction_cone=st.sampled_from(FrictionCone),
    complementarity_max=POSITIVE,
    sliding_max=POSITIVE,
    base_speed_max=st.floats(1.0, 1e9),
    allowances=st.dictionaries(TEXTS, st.floats(allow_nan=False, allow_infinity=False), max_size=3),
    guess_steps=st.integers(0, 100),
)


@quick
@given(SCENARIOS)
def test_a_scenario_survives_its_toml(tmp_path, scenario):
    assert scenario_files.load(scenario_files.save(scenario, tmp_path / "task.toml")) == scenario
    assert from_dict(to_dict(scenario)) == scenario
    higher = scenario_files.change(scenario, [f"final_com_height={scenario.initial_com[2]!r}"])
    assert higher == replace(scenario, final_com=(*scenario.final_com[:2], scenario.initial_com[2]))


# ---------------------------------------------------------------- robots


def zero_poses(robot: etree._Element) -> dict[str, np.ndarray]:
    """Return where the links are in the root's frame with all joints at zero, from the XML alone."""
    poses = {"link0": np.eye(4)}
    for joint in robot.iterfind("joint"):  # parents come first
        pose = np.eye(4)
        origin = joint.find("origin")
        pose[:3, :3] = Rotation.from_euler("xyz", [float(part) for part in origin.get("rpy").split()]).as_matrix()
        pose[:3, 3] = [float(part) for part in origin.get("xyz").split()]
        poses[joint.find("child").get("link")] = poses[joint.find("parent").get("link")] @ pose
    return poses


@settings(quick, max_examples=15)
@given(st.integers(2, 7), st.integers(0, 10_000), st.data())
def test_whatever_moves_or_is_held_a_robot_keeps_its_mass_and_its_frames(bodies, seed, data):
    text = random_urdf(bodies, seed)
    robot = etree.fromstring(text)
    movable = [joint.get("name") for joint in robot.iterfind("joint") if joint.get("type") != "fixed"]
    moving = data.draw(st.lists(st.sampled_from(movable), unique=True)) if movable else []
    kindyn, poses = KinDynComputations(text, moving), zero_poses(robot)
    masses = [float(mass.get("value")) for mass in robot.iterfind("link/inertial/mass")]
    assert kindyn.get_total_mass() == pytest.approx(sum(masses), rel=1e-14)
    mass_matrix = np.array(kindyn.mass_matrix(np.eye(4), np.zeros(len(moving))))
    np.testing.assert_allclose(mass_matrix[:3, :3], sum(masses) * np.eye(3), atol=1e-12)
    assert set(kindyn.frame_names) == set(poses)
    for name, pose in poses.items():
        found = np.array(kindyn.forward_kinematics(name, np.eye(4), np.zeros(len(moving))))
        np.testing.assert_allclose(found, pose, atol=1e-11)
    assert len(describe(text, moving).branches) == bodies
