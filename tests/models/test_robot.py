from __future__ import annotations

import re
import shutil

import numpy as np
import pytest

from multimodal_to.errors import ModelError
from multimodal_to.models.loading import bundled_robots, load_robot
from tied_hopper import tied_hopper


@pytest.fixture
def folder(tmp_path):
    target = tmp_path / "mine"
    shutil.copytree(bundled_robots()["ironcub"], target)
    return target


def edit(folder, old, new, count=1):
    path = folder / "robot.toml"
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, count), encoding="utf-8")


def test_the_bundled_robot_has_the_figures_of_the_ironcub(ironcub):
    assert ironcub.mass == pytest.approx(44.741798, abs=1e-9)
    assert len(ironcub.joint_names) == 23
    assert len(ironcub.kindyn.tree.bodies) == 24
    assert ironcub.contact_names == tuple(f"{side}_sole_{corner}" for side in "lr" for corner in (1, 2, 3, 4))
    assert [jet.thrust_max for jet in ironcub.jets] == [160.0, 160.0, 220.0, 220.0]
    assert ironcub.friction == 0.33
    assert ironcub.joint_names[ironcub.group_indices("legs")[0]] == "l_hip_pitch"


def test_groups_are_named_and_do_not_overlap(ironcub):
    indices = sorted(ironcub.group_indices("upper_body") + ironcub.group_indices("legs"))
    assert indices == list(range(23))


def test_the_planning_range_lies_within_the_mechanical_one(ironcub):
    for joint, lower, upper in zip(
        ironcub.kindyn.tree.joints, ironcub.joint_limits.lower, ironcub.joint_limits.upper, strict=True
    ):
        assert joint.lower <= lower < upper <= joint.upper


def test_the_standing_pose_stands_flat_on_the_ground(ironcub):
    transform = np.eye(4)
    transform[:3, 3] = ironcub.home.base_position
    from multimodal_to.ocp.guess import contact_positions

    heights = contact_positions(ironcub, ironcub.home).reshape(-1, 3)[:, 2]
    assert np.abs(heights).max() < 2e-6


def test_a_robot_is_loaded_from_its_folder(folder, ironcub):
    assert load_robot(folder).joint_names == ironcub.joint_names


def set_effort_of_the_urdf(folder, joint, effort):
    path = folder / "ironcub.urdf"
    text, count = re.subn(
        rf'(<joint name="{joint}" type="revolute">(?:(?!</joint>).)*?effort=")[^"]*',
        rf"\g<1>{effort}",
        path.read_text(encoding="utf-8"),
        flags=re.DOTALL,
    )
    assert count == 1
    path.write_text(text, encoding="utf-8")


def effort_of(robot, joint):
    return robot.joint_limits.effort[robot.joint_names.index(joint)]


@pytest.mark.parametrize("placeholder", ["50000", "10000", "0", "-1", "1e300"])
def test_a_placeholder_for_an_effort_limit_in_the_urdf_is_no_limit(folder, placeholder):
    set_effort_of_the_urdf(folder, "l_knee", placeholder)
    robot = load_robot(folder)
    assert effort_of(robot, "l_knee") == np.inf
    assert effort_of(robot, "r_knee") == 37.0


def test_an_effort_limit_is_that_of_robot_toml_and_else_that_of_the_urdf(folder):
    set_effort_of_the_urdf(folder, "l_knee", "9999")
    edit(folder, "home = -0.083910097 }", "home = -0.083910097, effort = 12.5 }")
    robot = load_robot(folder)
    assert effort_of(robot, "l_knee") == 9999.0
    assert effort_of(robot, "r_knee") == 12.5
    edit(folder, "home = 0.379599880, effort = 60.0 }", "home = 0.379599880 }")
    assert effort_of(load_robot(folder), "torso_pitch") == np.inf  # the URDF has a placeholder


def test_every_motor_of_the_ironcub_has_a_limit_and_holds_the_robot_up_by_its_jets(ironcub):
    """In a hover in the home posture, with the weight on the jets, no joint needs as much as half of its effort."""
    base, joints = ironcub.home.base_transform, ironcub.home.joint_positions
    held = np.array(ironcub.kindyn.gravity_term_fun()(base, joints)).ravel()
    effects = []
    for jet in ironcub.jets:
        axis = np.array(ironcub.kindyn.forward_kinematics(jet.frame, base, joints))[:3, 2]
        effects.append(-np.array(ironcub.kindyn.jacobian_fun(jet.frame)(base, joints))[:3].T @ axis)
    thrusts, *_ = np.linalg.lstsq(np.array(effects).T[:6], held[:6], rcond=None)
    torques = held[6:] - (np.array(effects).T @ thrusts)[6:]
    assert (thrusts > 0.0).all()
    assert np.isfinite(ironcub.joint_limits.effort).all()
    assert (np.abs(torques) < 0.5 * ironcub.joint_limits.effort).all()


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ('frame = "l_arm_jet_turbine"', 'frame = "l_arm_jet"', "unknown frame 'l_arm_jet'; did you mean"),
        ("torso_pitch      =", "torso_pich       =", "unknown joint 'torso_pich'; did you mean 'torso_pitch'"),
        ('model = "P160"', 'model = "P16"', "unknown jet model 'P16'; did you mean 'P160'"),
        ("friction = 0.33", "friction = -1", "'contact': friction is -1.0; expected a positive number"),
        ("friction = 0.33", "friction = nan", "'contact.friction' is nan; expected a finite number"),
        ("friction = 0.33", "frction = 0.33", "unknown key 'contact.frction'; did you mean 'contact.friction'"),
        ("friction = 0.33", "friction = 0.33\nmu = 1", "unknown key 'contact.mu'"),
        ("friction = 0.33", "", "the robot lacks 'contact.friction'"),
        ("speed = 7.0, ", "", "the robot lacks 'joints.torso_pitch.speed'"),
        (
            "effort = 60.0",
            "effort = 0",
            "'joints.torso_pitch': effort is 0.0; expected a number above 0 and below 10000",
        ),
        ("effort = 60.0", "effort = 5e4", "'joints.torso_pitch': effort is 50000.0; expected a number above 0 and"),
        ("speed = 7.0", "speed = 0", "'joints.torso_pitch': speed is 0.0; expected a positive number"),
        ('torso = ["torso_pitch", ', 'torso = ["torso_yaw", ', "joint group 'torso': joint given twice: torso_yaw"),
        ('torso = ["torso_pitch", ', "torso = [3, ", "'joint_groups.torso[0]' is 3; expected a text"),
        ('frame = "r_arm_jet_turbine"', "", "the robot lacks 'jet[1].frame'"),
        ("K_T = 0.306530", "", "the robot lacks 'jet_models.P160.K_T'"),
        ("home = 0.379599880", "home = 3.0", "'joints.torso_pitch': home 3.0 is not within its range"),
        ("0.999940330]", "0.5]", "'home': base_quaternion_xyzw has the norm"),
        ('urdf = "ironcub.urdf"', 'urdf = "other.urdf"', "other.urdf': No such file"),
        ('urdf = "ironcub.urdf"', 'urdf = "../../ironcub.urdf"', "outside the robot's folder"),
        ('name = "right arm"', 'name = "left arm"', "jet given twice: left arm"),
        ('"l_sole_2"', '"r_sole_1"', "contact point given twice: r_sole_1"),
        ("thrust_max = 160.0", "thrust_max = -5", "'jet[0]': thrust_max is -5.0; expected a positive number"),
        (
            "throttle = [0.0, 100.0]",
            "throttle = [100, 0]",
            "'jet[0]': throttle is [100.0, 0.0]; expected two",
        ),
        (
            "contacts = [0.3, 0.3, 0.6]",
            "contacts = [0.3, 0.6]",
            "'reach.contacts' is [0.3, 0.6]; expected a list of 3",
        ),
        ("jets = [0.5, 0.5, 0.5]", "jets = [0.5, 0, 0.5]", "'reach': jets is [0.5, 0.0, 0.5]; expected three positive"),
        ("jets = [0.5, 0.5, 0.5]", "jet = [0.5, 0.5, 0.5]", "unknown key 'reach.jet'; did you mean 'reach.jets'"),
        ("lift = 0.04", "lift = 0", "'gait': lift is 0.0; expected a positive number"),
        ("swing = 0.65", "swing = 65", "'gait': swing is 65.0; expected a number above 0 and at most 1"),
        ("radius = 0.064", "radius = -1", "'capsule[0]': radius is -1.0; expected a positive number"),
        ('link = "l_upper_leg"', 'link = "l_uper_leg"', "unknown frame 'l_uper_leg'; did you mean 'l_upper_leg'"),
        ('name = "left thigh"', 'name = "left foot"', "capsule given twice: left foot"),
        ("plume_length = 0.5", "plume_length = 0", "'jet[0]': plume_length is 0.0; expected a positive number"),
        ('["left forearm", "left thigh"]', '["left forearm", "left tigh"]', "unknown capsule 'left tigh'; did you"),
        ("ignore = []", 'ignore = [["head"]]', "'collision.ignore[0]' is ['head']; expected a list of 2"),
        ("ignore = []", 'ignore = [["left tigh", "head"]]', "'collision.ignore': unknown capsule 'left tigh'"),
        ("[joints]", "[joints", "not valid TOML"),
    ],
)
def test_a_broken_robot_file_says_what_is_wrong(folder, old, new, sentence):
    edit(folder, old, new)
    with pytest.raises(ModelError) as error:
        load_robot(folder)
    assert sentence in str(error.value)


def test_the_urdf_may_be_a_link_and_may_not_say_that_it_lies_outside(folder, tmp_path):
    """A workspace of colcon links each file, or the whole folder, to where it is written."""
    workspace, table = tmp_path / "workspace", (folder / "robot.toml").read_text(encoding="utf-8")
    workspace.mkdir()
    for name in ("robot.toml", "ironcub.urdf"):
        (workspace / name).symlink_to(folder / name)
    assert load_robot(workspace).urdf == workspace / "ironcub.urdf"
    (tmp_path / "whole").symlink_to(folder)
    assert load_robot(tmp_path / "whole").mass == load_robot(folder).mass
    for urdf in ("../workspace/ironcub.urdf", str(folder / "ironcub.urdf"), "a/../../ironcub.urdf", "..", "."):
        (workspace / "robot.toml").unlink(missing_ok=True)
        (workspace / "robot.toml").write_text(table.replace("ironcub.urdf", urdf, 1), encoding="utf-8")
        with pytest.raises(ModelError, match="which is outside the robot's folder"):
            load_robot(workspace)


def test_an_unknown_robot_is_named_with_those_that_exist():
    with pytest.raises(ModelError, match="unknown robot 'ironcup'; did you mean 'ironcub'"):
        load_robot("ironcup")


def test_an_unknown_group_is_named_with_those_that_exist(ironcub):
    with pytest.raises(ModelError, match="unknown joint group 'leg'; did you mean"):
        ironcub.group_indices("leg")


def test_a_joint_that_others_follow_is_planned_in_the_range_that_they_allow(tmp_path):
    """The right wing is at 0.8 q + 0.05 and goes to ±0.8 rad; the mast at 0.1 q + 0.1 in 0 to 0.2 m, at 1 m/s."""
    limits = tied_hopper(tmp_path).joint_limits
    assert (limits.lower.item(), limits.upper.item()) == (-0.8, 0.8)
    assert (limits.speed.item(), limits.effort.item()) == (3.0, 5.0)  # the mast's 50 N at 0.1 m/rad
    urdf = tmp_path / "hopper.urdf"
    narrow = urdf.read_text(encoding="utf-8").replace(
        'upper="0.2" effort="50" velocity="1"', 'upper="0.12" effort="50" velocity="0.2"'
    )
    urdf.write_text(narrow, encoding="utf-8")
    limits = load_robot(tmp_path).joint_limits
    assert limits.upper.item() == pytest.approx(0.2)
    assert limits.speed.item() == pytest.approx(2.0)
    table = tmp_path / "robot.toml"
    table.write_text(table.read_text(encoding="utf-8").replace("home = 0.0", "home = 0.5"), encoding="utf-8")
    with pytest.raises(ModelError, match=r"home 0.5 of 'left_pitch' is not within -0.8 to 0.2, the range in which its"):
        load_robot(tmp_path)


def test_a_urdf_of_a_package_is_found_where_the_package_is_and_else_refused_with_the_reason(folder, tmp_path):
    table = (folder / "robot.toml").read_text(encoding="utf-8")
    (tmp_path / "cub_description" / "urdf").mkdir(parents=True)
    urdf = tmp_path / "cub_description" / "urdf" / "cub.urdf"
    urdf.write_bytes((folder / "ironcub.urdf").read_bytes())
    (tmp_path / "robots" / "cub").mkdir(parents=True)

    def load(address):
        text = table.replace('urdf = "ironcub.urdf"', f'urdf = "{address}"', 1)
        (tmp_path / "robots" / "cub" / "robot.toml").write_text(text, encoding="utf-8")
        return load_robot(tmp_path / "robots" / "cub")

    assert load("package://cub_description/urdf/cub.urdf").urdf == urdf  # in a folder above
    for address, sentence in {
        "package://cub_description/urdf/cab.urdf": r"the folder '.*cub_description' has no 'urdf/cab.urdf'",
        "package://cab_description/urdf/cub.urdf": r"no folder 'cab_description' lies .* and no package",
        "package://cub_description/../secret.urdf": "expected a path inside the robot's folder, or package://",
        "https://example.org/cub.urdf": "expected a path inside the robot's folder, or package://",
    }.items():
        with pytest.raises(ModelError, match=sentence):
            load(address)


def test_a_bundled_robot_may_have_its_urdf_in_an_installed_package():
    robot = load_robot("solo12")
    assert "example-robot-data" in robot.urdf.as_posix()
    assert robot.mass == pytest.approx(2.5, abs=1e-3)
