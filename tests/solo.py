"""Solo12 of example-robot-data as a folder: a robot of 2.5 kg on four legs, without jets."""

from __future__ import annotations

import shutil
from pathlib import Path

from multimodal_to.models.loading import load_robot
from multimodal_to.models.robot import Robot
from places import example_robots

LEGS = ("FL", "FR", "HL", "HR")
HOME = {"HAA": 0.0, "HFE": 0.8, "KFE": -1.6}
BASE_HEIGHT = 0.222946  # of the base where all feet stand on the ground at home [m]


def solo(folder: Path, more: str = "") -> Robot:
    """Return Solo12 with a contact point at each foot and knees that bend one way.

    Args:
        folder: where to write it.
        more: further tables of its `robot.toml`.
    """
    shutil.copy(example_robots() / "solo_description" / "robots" / "solo12.urdf", folder / "solo12.urdf")
    joints = [f"{leg}_{joint} = {{ {_range(joint)}, home = {home} }}" for leg in LEGS for joint, home in HOME.items()]
    (folder / "robot.toml").write_text(
        "\n".join(
            [
                'name = "solo12"',
                'urdf = "solo12.urdf"',
                "[joints]",
                *joints,
                "[joint_groups]",
                f"legs = {[f'{leg}_{joint}' for leg in LEGS for joint in HOME]}",
                "[home]",
                f"base_position = [0.0, 0.0, {BASE_HEIGHT}]",
                "base_quaternion_xyzw = [0.0, 0.0, 0.0, 1.0]",
                "[contact]",
                "friction = 0.7",
                "[contact.feet]",
                *(f'{leg} = ["{leg}_FOOT"]' for leg in LEGS),
                more,
            ]
        )
    )
    return load_robot(folder)


def _range(joint: str) -> str:
    lower, upper = (-2.5, -0.1) if joint == "KFE" else (-1.5, 1.5)
    return f"lower = {lower}, upper = {upper}, speed = 15.0"
