"""Robots that MuJoCo would not take as their URDF says: joints that follow others, links that are no bodies alone."""

from __future__ import annotations

import numpy as np
import pytest

from hopper import hopper
from multimodal_to.errors import ModelError
from multimodal_to.models.loading import load_robot
from multimodal_to.models.terrain import FlatGround
from multimodal_to.simulation import build_model, disagreement, play, random_states
from places import example_robots
from synthetic import take_off
from tied_hopper import tied_hopper

mujoco = pytest.importorskip("mujoco")
KEPT = 2e-4  # of a follower from where its leader has it, while the robot moves [rad, m]
HEAVY = '<inertia ixx="{0}" iyy="{0}" izz="{1}" ixy="0" ixz="0" iyz="0"/>'


def test_inverse_dynamics_with_followers_agrees_with_rnea(tmp_path):
    robot = tied_hopper(tmp_path)
    assert disagreement(robot, random_states(robot, 50)) < 1e-10


def test_followers_stay_with_their_leader_in_a_simulation(tmp_path, monkeypatch):
    robot, away = tied_hopper(tmp_path), []
    step = mujoco.mj_step2

    def watched(model, data):
        at = {name: float(data.qpos[model.joint(name).qposadr[0]]) for name in ("left_pitch", "right_pitch", "mast")}
        away.append([at["right_pitch"] - 0.8 * at["left_pitch"] - 0.05, at["mast"] - 0.1 * at["left_pitch"] - 0.1])
        step(model, data)

    monkeypatch.setattr(mujoco, "mj_step2", watched)
    playback = play(robot, take_off(robot))
    assert playback.qpos.shape[1] == 8
    assert len(away) > 100
    assert np.abs(away).max() < KEPT
    assert np.ptp(playback.qpos[:, 7]) > 0.02  # it did move


def folder_of(path, urdf, joints, feet):
    (path / "robot.urdf").write_text(urdf, encoding="utf-8")
    ranges = "\n".join(f"{name} = {{ lower = -1.0, upper = 1.0, speed = 5.0, home = 0.0 }}" for name in joints)
    (path / "robot.toml").write_text(
        f'name = "r"\nurdf = "robot.urdf"\n[joints]\n{ranges}\n[joint_groups]\n[home]\n'
        "base_position = [0.0, 0.0, 0.5]\nbase_quaternion_xyzw = [0.0, 0.0, 0.0, 1.0]\n"
        f"[contact]\nfriction = 0.5\n[contact.feet]\nfoot = {list(feet)}\n",
        encoding="utf-8",
    )
    return load_robot(path)


def test_the_base_of_anymal_is_merged_with_what_moves_with_it(tmp_path):
    """1e-6 kg with an inertia of rank one; the mass of the base is in a link that is fixed to it."""
    urdf = (example_robots() / "anymal_b_simple_description" / "robots" / "anymal.urdf").read_text(encoding="utf-8")
    legs = ("LF", "RF", "LH", "RH")
    robot = folder_of(
        tmp_path,
        urdf,
        [f"{leg}_{joint}" for leg in legs for joint in ("HAA", "HFE", "KFE")],
        [f"{leg}_FOOT" for leg in legs],
    )
    simulation = build_model(robot)
    assert any(note.startswith("MuJoCo takes no body like the link 'base'") for note in simulation.notes)
    assert simulation.model.body_mass.sum() == pytest.approx(robot.mass, rel=1e-12)
    assert disagreement(robot, random_states(robot, 20)) < 1e-10


def urdf_of(tip: str, extra: str = "") -> str:
    """A body with a link fixed to it and a link that turns, whose inertial is `tip`, with `extra` at the end."""
    body = f'<inertial><mass value="5"/>{HEAVY.format(0.1, 0.1)}</inertial>'
    return (
        f'<robot name="r"><link name="body">{body}</link><link name="tip">{tip}</link><joint name="j" type="revolute">'
        '<parent link="body"/><child link="tip"/><origin xyz="0 0 0.3" rpy="0.3 0 0"/><axis xyz="0 1 0"/>'
        f'<limit lower="-1" upper="1" effort="1" velocity="1"/></joint><link name="foot"/><joint name="f" type="fixed">'
        f'<parent link="body"/><child link="foot"/></joint>{extra}</robot>'
    )


PLATE = f'<inertial><mass value="0.5"/>{HEAVY.format(0.01, 0.03)}</inertial>'  # more about z than about the others
LUMP = (
    f'<link name="lump"><inertial><origin xyz="0.1 0 0"/><mass value="1"/>{HEAVY.format(0.05, 0.05)}</inertial></link>'
    '<joint name="k" type="fixed"><parent link="tip"/><child link="lump"/><origin xyz="0 0.2 0" rpy="0 1 0"/></joint>'
)


@pytest.mark.parametrize(
    "tip", [PLATE, '<inertial><mass value="1e-3"/></inertial>', PLATE.replace('izz="0.03"', 'izz="0.02"')]
)
def test_a_link_that_is_no_body_alone_is_merged_with_a_note(tmp_path, tip):
    robot = folder_of(tmp_path, urdf_of(tip, LUMP), ["j"], ["foot"])
    (note,) = build_model(robot).notes
    assert "the link 'tip'" in note
    assert "merged with lump" in note
    assert disagreement(robot, random_states(robot, 20)) < 1e-10


def test_what_cannot_be_merged_is_refused_in_one_line(tmp_path):
    robot = folder_of(tmp_path, urdf_of(PLATE), ["j"], ["foot"])
    with pytest.raises(ModelError, match=r"MuJoCo refuses .*tip") as caught:
        build_model(robot)
    assert "\\n" not in str(caught.value)
    assert "  " not in str(caught.value)


def test_a_robot_of_bodies_has_no_notes(ironcub):
    assert build_model(ironcub).notes == ()


@pytest.mark.parametrize(
    ("old", "new"), [("left_pitch", "left"), ("left_pitch", "base"), ("body", "world"), ("front_left", "ground")]
)
def test_names_of_the_robot_may_be_those_of_the_simulation(tmp_path, old, new):
    """A jet is called `left`, MuJoCo's world `world`, and the ground `ground`."""
    hopper(tmp_path)
    for file in (tmp_path / "hopper.urdf", tmp_path / "robot.toml"):
        text = file.read_text(encoding="utf-8")
        file.write_text(text.replace(f'"{old}"', f'"{new}"').replace(f"\n{old} =", f"\n{new} ="), encoding="utf-8")
    robot = load_robot(tmp_path)
    assert build_model(robot, FlatGround()).points.size == len(robot.contacts)
    assert disagreement(robot, random_states(robot, 5)) < 1e-10
