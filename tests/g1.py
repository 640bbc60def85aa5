"""Unitree's G1 of 29 joints, of example-robot-data or any other URDF, as a folder: the humanoid of trackers."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np

from multimodal_to.adam.urdf import read_urdf
from multimodal_to.models.loading import load_robot
from multimodal_to.models.robot import Robot
from places import example_robots


def g1(folder: Path, urdf: Path | None = None) -> Robot:
    """Return the G1, with a contact point at the origin of each foot's link.

    Args:
        folder: where to write it.
        urdf: of the G1; by default that of example-robot-data.
    """
    source = urdf or example_robots() / "g1_description" / "urdf" / "g1_29dof_rev_1_0.urdf"
    folder.mkdir(exist_ok=True)
    shutil.copy(source, folder / "g1.urdf")
    joints = [joint for joint in read_urdf(source)[1] if joint.kind != "fixed"]
    table = [
        f"{joint.name} = {{ lower = {joint.lower}, upper = {joint.upper}, speed = 20.0, "
        f"home = {float(np.clip(0.0, joint.lower, joint.upper))} }}"
        for joint in joints
    ]
    (folder / "robot.toml").write_text(
        "\n".join(
            [
                'name = "g1"',
                'urdf = "g1.urdf"',
                "[joints]",
                *table,
                "[joint_groups]",
                f"all = {[joint.name for joint in joints]}",
                "[home]",
                "base_position = [0.0, 0.0, 0.8]",
                "base_quaternion_xyzw = [0.0, 0.0, 0.0, 1.0]",
                "[contact]",
                "friction = 0.7",
                "[contact.feet]",
                'left = ["left_ankle_roll_link"]',
                'right = ["right_ankle_roll_link"]',
            ]
        ),
        encoding="utf-8",
    )
    return load_robot(folder)
