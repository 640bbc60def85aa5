"""A robot's folder from its URDF alone: it loads at once, stands on its feet, and says what it guessed."""

from __future__ import annotations

import re
import shutil

import numpy as np
import pytest

from adam_robots import example_robots
from multimodal_to.errors import ModelError, OutputError
from multimodal_to.files.packages import package_file
from multimodal_to.models.loading import load_robot
from multimodal_to.robots import check, init

ICUB = package_file("icub-models", "iCubGazeboV2_5/model.urdf")
ROTORS = tuple(f"iris__rotor_{index}" for index in range(4))
WALKERS = {
    "solo12": ("solo_description/robots/solo12.urdf", (1, 1, 1, 1), 12),
    "anymal": ("anymal_b_simple_description/robots/anymal.urdf", (1, 1, 1, 1), 12),
    "talos": ("talos_data/robots/talos_reduced.urdf", (4, 4), 30),
    "hyq": ("hyq_description/robots/hyq_no_sensors.urdf", (1, 1, 1, 1), 12),
    "bolt": ("bolt_description/robots/bolt.urdf", (1, 1), 6),
    "go2": ("go2_description/urdf/go2.urdf", (1, 1, 1, 1), 12),
    "a1": ("a1_description/urdf/a1.urdf", (1, 1, 1, 1), 12),
    "b1": ("b1_description/urdf/b1.urdf", (1, 1, 1, 1), 12),
    "romeo": ("romeo_description/urdf/romeo_small.urdf", (4, 4), 29),
    "laikago": ("laikago_description/urdf/laikago.urdf", (1, 1, 1, 1), 12),
}
"""Where the URDF is, how many contact points each foot has, and how many joints move."""
ARMS = {"panda": "panda_description/urdf/panda.urdf", "ur5": "ur_description/urdf/ur5_robot.urdf"}


def made(path, folder, **more):
    return init(example_robots() / path, folder / "robot", **more).robot


def contacts(robot):
    """Where the contact points are at home [m], (contacts, 3)."""
    pose = robot.home.base_transform, robot.home.joint_positions
    return np.array([np.array(robot.kindyn.forward_kinematics(name, *pose))[:3, 3] for name in robot.contact_names])


@pytest.mark.parametrize("name", WALKERS)
def test_a_robot_that_walks_stands_on_its_feet_without_a_change_to_what_was_made(name, tmp_path):
    path, feet, joints = WALKERS[name]
    robot = made(path, tmp_path)
    assert tuple(len(points) for points in robot.feet.values()) == feet
    assert len(robot.joint_names) == joints
    points, unit = contacts(robot), robot.standing_height
    assert np.abs(points[:, 2]).max() < 0.03 * unit  # on one level, on the ground
    com = robot.com_at(robot.home)
    assert (points[:, :2].min(axis=0) - 0.005 * unit < com[:2]).all()  # Bolt's two points are on a line
    assert (com[:2] < points[:, :2].max(axis=0) + 0.005 * unit).all()
    limits, home = robot.joint_limits, robot.home.joint_positions
    assert (limits.lower <= home).all()
    assert (home <= limits.upper).all()
    assert (np.abs(contacts(robot) - com).max(axis=0) < robot.contact_reach).all()
    grouped = {joint for members in robot.joint_groups.values() for joint in members}
    assert grouped == set(robot.joint_names)
    assert check(tmp_path / "robot").holds


@pytest.mark.skipif(ICUB is None, reason="icub-models is not installed")
def test_a_robot_that_looks_back_is_turned_and_its_straight_legs_are_bent(tmp_path):
    """The iCub's root looks to −x, which its soles tell; all of its joints are at zero with straight legs."""
    result = init(ICUB, tmp_path / "icub")
    robot = result.robot
    assert robot.home.base_quaternion_xyzw == pytest.approx([0.0, 0.0, 1.0, 0.0])
    assert "straight legs were bent at home: right_leg, left_leg" in result.notes
    assert tuple(len(points) for points in robot.feet.values()) == (4, 4)
    points = contacts(robot)
    assert np.abs(points[:, 2]).max() < 2e-3
    knees = [robot.home.joint_positions[robot.joint_names.index(f"{side}_knee")] for side in "lr"]
    assert knees[0] == pytest.approx(knees[1], abs=1e-3)
    assert knees[0] < -0.4
    assert (tmp_path / "icub" / "model.urdf").is_symlink()  # its meshes are found only from where it is
    left = [index for index, name in enumerate(robot.contact_names) if name.startswith("left")]
    assert (points[left, 1] > 0).all()


def test_an_unbent_leg_bends_ahead_with_a_level_sole(tmp_path):
    robot = made("g1_description/urdf/g1_29dof_rev_1_0.urdf", tmp_path)
    assert np.abs(contacts(robot)[:, 2]).max() < 2e-3
    pose = robot.home.base_transform, robot.home.joint_positions
    for side in ("left", "right"):
        hip, knee, ankle = (
            np.array(robot.kindyn.forward_kinematics(f"{side}_{link}_link", *pose))[:3, 3]
            for link in ("hip_pitch", "knee", "ankle_roll")
        )
        assert knee[0] > max(hip[0], ankle[0]) + 0.02


def test_folded_legs_stand_on_their_feet_and_not_on_their_knees(tmp_path):
    robot = made("laikago_description/urdf/laikago.urdf", tmp_path)
    pose = robot.home.base_transform, robot.home.joint_positions
    knees = [np.array(robot.kindyn.forward_kinematics(f"{leg}_calf", *pose))[2, 3] for leg in ("FR", "FL", "RR", "RL")]
    assert min(knees) > contacts(robot)[:, 2].max() + 0.2 * robot.standing_height


def test_a_quadrotor_has_rotors_that_push_up_and_holds_its_propellers_still(tmp_path):
    result = init(example_robots() / "iris_description/robots/iris.urdf", tmp_path / "iris", jets=ROTORS)
    robot = result.robot
    assert robot.joint_names == ()
    assert robot.jet_names == ROTORS
    for jet in robot.jets:
        pose = np.array(robot.kindyn.forward_kinematics(jet.frame, robot.home.base_transform, np.zeros(0)))
        assert -pose[:3, 2] == pytest.approx([0.0, 0.0, 1.0])
    assert sum(jet.thrust_max for jet in robot.jets) == pytest.approx(2.0 * robot.weight, rel=0.03)
    assert any("iris__rotor_0_joint" in note for note in result.notes)
    assert len(robot.contacts) == 4
    assert sum(np.sign(jet.drag) for jet in robot.jets) == 0  # two turn each way, so that it can turn about z
    assert min(abs(jet.drag) for jet in robot.jets) > 0


@pytest.mark.parametrize("name", ARMS)
def test_an_arm_is_refused_with_the_reason_and_made_without_feet_where_asked(name, tmp_path):
    with pytest.raises(ModelError, match=r"no feet were found: .* An arm on a table or a robot on wheels is none"):
        made(ARMS[name], tmp_path)
    assert not (tmp_path / "robot" / "robot.toml").exists()
    result = init(example_robots() / ARMS[name], tmp_path / "robot", contacts=False)
    assert result.robot.contacts == ()
    assert "the robot touches nothing" in result.notes


def test_the_home_of_an_srdf_is_taken(tmp_path):
    robot = made("solo_description/robots/solo12.urdf", tmp_path)
    home = dict(zip(robot.joint_names, robot.home.joint_positions, strict=True))
    assert (home["FL_HAA"], home["FL_HFE"], home["HL_KFE"]) == (0.1, 0.8, 1.6)
    text = (tmp_path / "robot" / "robot.toml").read_text(encoding="utf-8")
    assert "the state 'standing' of solo.srdf" in text


def test_every_placeholder_is_named_with_what_takes_its_place(tmp_path):
    """Of Solo12, ranges of ±10 rad and speeds of 1000 rad/s; 1000 N m are no torque of a robot of 2.5 kg."""
    made("solo_description/robots/solo12.urdf", tmp_path)
    lines = (tmp_path / "robot" / "robot.toml").read_text(encoding="utf-8").splitlines()
    joints = [line for line in lines if re.match(r"[FH][LR]_\w+ = \{", line)]
    assert len(joints) == 12
    for line in joints:
        assert "range guessed" in line
        assert "speed guessed: the URDF has 1000" in line
        assert "the URDF's effort 1000 limits nothing; state the motor's own, perhaps effort = " in line
    robot = load_robot(tmp_path / "robot")
    knees = [index for index, name in enumerate(robot.joint_names) if name.endswith("KFE")]
    limits = robot.joint_limits
    assert (limits.lower[knees] * limits.upper[knees] > 0).all()  # they bend one way


def test_a_joint_that_the_urdf_gives_no_range_is_named(tmp_path):
    notes = init(example_robots() / "quadruped_description/urdf/quadruped.urdf", tmp_path / "robot").notes
    assert "the URDF leaves FL_KFE, FR_KFE, BL_KFE, BR_KFE no range to move in; state one there" in notes
    assert "# it cannot move: the URDF's range is 0 to 0" in (tmp_path / "robot" / "robot.toml").read_text("utf-8")


def test_mjcf_is_not_read_and_said_to_be_none(tmp_path):
    for name in ("robot.xml", "robot.urdf"):
        (tmp_path / name).write_text("<mujoco><worldbody/></mujoco>")
        with pytest.raises(ModelError, match=r"MJCF.* is not read"):
            init(tmp_path / name, tmp_path / "robot")


def test_a_urdf_of_a_package_stays_there_and_another_is_copied_or_linked(tmp_path):
    source = example_robots() / "bolt_description/robots/bolt.urdf"
    init(source, tmp_path / "packaged")
    text = (tmp_path / "packaged" / "robot.toml").read_text(encoding="utf-8")
    assert 'urdf = "package://example-robot-data/robots/bolt_description/robots/bolt.urdf"' in text
    assert [path.name for path in (tmp_path / "packaged").iterdir()] == ["robot.toml"]
    (tmp_path / "own").mkdir()
    shutil.copy(source, tmp_path / "own" / "bolt.urdf")  # its meshes are addressed by their package
    init(tmp_path / "own" / "bolt.urdf", tmp_path / "copied")
    assert not (tmp_path / "copied" / "bolt.urdf").is_symlink()
    assert load_robot(tmp_path / "copied").mass == load_robot(tmp_path / "packaged").mass


def test_a_robot_that_is_there_already_is_kept(tmp_path):
    (tmp_path / "robot.toml").write_text("mine")
    with pytest.raises(OutputError, match=r"robot.toml' exists"):
        init(example_robots() / "bolt_description/robots/bolt.urdf", tmp_path)
    assert (tmp_path / "robot.toml").read_text() == "mine"


def test_a_jet_in_no_link_is_named_with_the_links_that_exist(tmp_path):
    with pytest.raises(ModelError, match="unknown frame 'iris__rotor_9'; did you mean 'iris__rotor_"):
        made("iris_description/robots/iris.urdf", tmp_path, jets=("iris__rotor_9",))
