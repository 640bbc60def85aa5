"""What is missing or wrong in a robot's folder is named in one run, and what looks odd is said of one that loads."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.collections import PathCollection

from drones import drone
from multimodal_to.models.loading import bundled_robots, load_robot
from multimodal_to.robots import check
from multimodal_to.robots.picture import draw_home


def edited(folder, **changes):
    text = (folder / "robot.toml").read_text(encoding="utf-8")
    for old, new in changes.values():
        assert old in text
        text = text.replace(old, new)
    (folder / "robot.toml").write_text(text, encoding="utf-8")
    return check(folder)


def test_all_keys_that_are_wrong_are_named_at_once(tmp_path):
    drone(tmp_path)
    found = edited(
        tmp_path,
        a=("friction = 0.5", "fricton = 0.5"),
        b=("thrust_max = 220.0\n", ""),
        c=("base_position = [0.0, 0.0, 0.4]", "base_position = [0.0, 0.4]"),
    )
    assert not found.holds
    for part in (
        "unknown key 'contact.fricton'; did you mean 'contact.friction'",
        "the robot lacks 'contact.friction'",
        "'home.base_position' is [0.0, 0.4]; expected a list of 3",
        "the robot lacks 'jet[0].thrust_max'",
        "the robot lacks 'jet[1].thrust_max'",
    ):
        assert part in found.fault


def test_all_names_that_the_urdf_lacks_are_named_at_once(tmp_path):
    drone(tmp_path)
    found = edited(
        tmp_path,
        a=('frame = "jet_left"', 'frame = "jet_lef"'),
        b=("'foot_0'", "'fot_0'"),
        c=(
            "[joint_groups]",
            "whip = { lower = -1.0, upper = 1.0, speed = 1.0, home = 0.0 }\n[joint_groups]\nall = ['x']",
        ),
    )
    for part in (
        "unknown frame 'jet_lef'",
        "unknown frame 'fot_0'",
        "unknown joint 'whip'",
        "'all': unknown joint 'x'",
    ):
        assert part in found.fault


@pytest.mark.parametrize("name", bundled_robots())
def test_every_bundled_robot_holds_and_stands(name):
    found = check(name)
    assert found.holds
    assert not [remark for remark in found.remarks if "at home" in remark]


def test_what_is_odd_at_home_is_said(tmp_path):
    drone(tmp_path, tilt="0 0 0")
    found = edited(tmp_path, a=("base_position = [0.0, 0.0, 0.4]", "base_position = [0.0, 0.0, 0.6]"))
    assert found.holds
    assert any("the lowest contact point is at z = 0.2 m" in remark for remark in found.remarks)
    assert any("these jets push the robot down: left, right" in remark for remark in found.remarks)


@pytest.mark.parametrize("name", ["solo12", "quadrotor"])
def test_a_picture_shows_every_contact_point_where_it_is(name):
    robot = load_robot(name)
    figure = draw_home(robot)
    pose = robot.home.base_transform, robot.home.joint_positions
    points = [np.array(robot.kindyn.forward_kinematics(frame, *pose))[:3, 3] for frame in robot.contact_names]
    for axes in figure.axes:
        (dots,) = (artist for artist in axes.collections if isinstance(artist, PathCollection))
        drawn = np.array(dots._offsets3d).T
        assert drawn == pytest.approx(np.array(points))
