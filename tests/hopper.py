"""The hopper of the tutorial as a folder: a robot of 24 kg on four feet, with a turbine on each of two wings.

It can be asked to head elsewhere, to have another base frame, or to carry a mast on a prismatic joint.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

import multimodal_to as mt
from multimodal_to.adam.spatial import rotation_from_rpy
from multimodal_to.models.attitude import conjugate, product

UPRIGHT = (0.0, 0.0, 0.0, 1.0)
_INERTIA = '<inertia ixx="{}" iyy="{}" izz="{}" ixy="0" ixz="0" iyz="0"/>'
_WINGS = "".join(
    f"""
<link name="{side}_wing"><inertial><origin xyz="0 {sign}0.15 0"/><mass value="3"/>{_INERTIA.format(0.02, 0.01, 0.02)}
</inertial></link>
<joint name="{side}_pitch" type="{{{side}}}"><parent link="body"/><child link="{side}_wing"/>
<origin xyz="0 {sign}0.1 0"/><axis xyz="0 1 0"/><limit lower="-0.8" upper="0.8" effort="40" velocity="5"/></joint>
<link name="{side}_jet"/><joint name="{side}_jet_mount" type="fixed"><parent link="{side}_wing"/>
<child link="{side}_jet"/><origin xyz="0 {sign}0.25 0" rpy="3.14159265359 0 0"/></joint>"""
    for side, sign in (("left", ""), ("right", "-"))
)
_FEET = "".join(
    f"""
<link name="{end}_{side}"/><joint name="{end}_{side}_mount" type="fixed"><parent link="body"/>
<child link="{end}_{side}"/><origin xyz="{x} {y} -0.4"/></joint>"""
    for end, x in (("front", 0.2), ("back", -0.2))
    for side, y in (("left", 0.2), ("right", -0.2))
)
_MAST = f"""
<link name="mast"><inertial><origin xyz="0 0 0.05"/><mass value="0.6"/>{_INERTIA.format(0.001, 0.001, 0.0005)}
</inertial></link>
<joint name="mast" type="prismatic"><parent link="body"/><child link="mast"/><origin xyz="0 0 0.25"/>
<axis xyz="0 0 1"/><limit lower="0" upper="0.2" effort="50" velocity="1"/></joint>"""
_JET_MODEL = {
    "K_T": 0.237755,
    "K_TT": -0.012799,
    "K_D": -0.860374,
    "K_DD": 0.023606,
    "K_TD": 0.008599,
    "B_U": 1.139026,
    "B_T": 0.019914,
    "B_D": -0.050257,
    "B_UU": 0.000302,
    "c": -0.692913,
}


def heading(angle: float) -> np.ndarray:
    """The quaternion of a turn about the vertical."""
    return np.array([0.0, 0.0, np.sin(angle / 2), np.cos(angle / 2)])


def quaternion_of(rpy: tuple[float, float, float]) -> np.ndarray:
    """The quaternion of URDF's roll, pitch and yaw."""
    roll, pitch, yaw = (
        np.append(axis * np.sin(angle / 2), np.cos(angle / 2)) for axis, angle in zip(np.eye(3), rpy, strict=True)
    )
    return product(yaw, product(pitch, roll))


def hopper(
    folder: Path,
    *,
    turn: np.ndarray | tuple[float, ...] = UPRIGHT,
    mount: tuple[float, float, float] | None = None,
    mast: bool = False,
    kinds: tuple[str, str] = ("revolute", "revolute"),
) -> mt.Robot:
    """Return the hopper.

    Args:
        folder: where to write it.
        turn: the attitude of its body at home, x y z w.
        mount: roll, pitch and yaw of the body in a base link of its own; without it the body is the base.
        mast: whether it carries a mast on a prismatic joint.
        kinds: of the joints of the left and the right wing.
    """
    folder.mkdir(parents=True, exist_ok=True)
    home = np.asarray(turn, dtype=float)
    root = ""
    if mount is not None:
        home = product(home, conjugate(quaternion_of(mount)))
        root = (
            '<link name="base"/><joint name="mount" type="fixed"><parent link="base"/><child link="body"/>'
            f'<origin rpy="{mount[0]!r} {mount[1]!r} {mount[2]!r}"/></joint>'
        )
    body = f'<link name="body"><inertial><mass value="18"/>{_INERTIA.format(0.6, 0.5, 0.4)}</inertial></link>'
    wings = _WINGS.format(left=kinds[0], right=kinds[1])
    (folder / "hopper.urdf").write_text(
        f'<robot name="hopper">{root}{body}{wings}{_FEET}{_MAST if mast else ""}</robot>', encoding="utf-8"
    )
    (folder / "robot.toml").write_text(
        "\n".join(
            [
                'name = "hopper"',
                'urdf = "hopper.urdf"',
                "[joints]",
                "left_pitch = { lower = -0.8, upper = 0.8, speed = 3.0, home = 0.0 }",
                *(["mast = { lower = 0.0, upper = 0.2, speed = 0.2, home = 0.1 }"] if mast else []),
                "right_pitch = { lower = -0.8, upper = 0.8, speed = 3.0, home = 0.0 }",
                "[joint_groups]",
                'wings = ["left_pitch", "right_pitch"]',
                *(['masts = ["mast"]'] if mast else []),
                "[home]",
                "base_position = [0.0, 0.0, 0.4]",
                f"base_quaternion_xyzw = {home.tolist()}",
                "[contact]",
                "friction = 0.5",
                "[contact.feet]",
                'legs = ["front_left", "front_right", "back_left", "back_right"]',
                *(
                    line
                    for side in ("left", "right")
                    for line in (
                        "[[jet]]",
                        f'name = "{side}"',
                        f'frame = "{side}_jet"',
                        'model = "P220"',
                        "thrust_max = 220.0",
                        "throttle = [0.0, 100.0]",
                    )
                ),
                "[jet_models.P220]",
                *(f"{name} = {value}" for name, value in _JET_MODEL.items()),
            ]
        ),
        encoding="utf-8",
    )
    return mt.load_robot(folder)


def hop(robot: mt.Robot, **changes: object) -> mt.Scenario:
    """From standing to a hover 20 cm higher."""
    com = np.array(robot.kindyn.CoM_position(robot.home.base_transform, robot.home.joint_positions)).ravel()
    low = robot.contacts and min(
        np.array(robot.kindyn.forward_kinematics(name, robot.home.base_transform, robot.home.joint_positions))[2, 3]
        for name in robot.contact_names
    )
    values: dict[str, object] = {
        "name": "hop",
        "title": "From standing to a hover 20 cm higher",
        "knots": 30,
        "initial_com": (0.0, 0.0, float(com[2] - low)),
        "final_com": (0.0, 0.0, 0.6),
        "terminal": mt.Terminal.HOVER,
        "interval_min": 0.1,
        "interval_max": 0.2,
        "weights": mt.Weights(
            com_velocity=1e3,
            com_acceleration=1e2,
            angular_momentum=1e2,
            joint_velocities=dict.fromkeys(robot.joint_groups, 1e2),
            posture=1e2,
            contact_forces=1e-2,
            contact_force_rates=1e-3,
            throttle=1e-2,
        ),
    }
    return mt.Scenario(**{**values, **changes})


def body_rotation(robot: mt.Robot, quaternion: np.ndarray) -> np.ndarray:
    """The rotation of the body where the base has an attitude."""
    pose = replace(robot.home, base_quaternion_xyzw=quaternion / np.linalg.norm(quaternion)).base_transform
    pose[:3, 3] = 0.0
    joints = np.zeros(len(robot.joint_names))
    return np.array(robot.kindyn.forward_kinematics("body", pose, joints))[:3, :3]


def yaw_of(angle: float) -> np.ndarray:
    """The rotation of a turn about the vertical."""
    return np.array(rotation_from_rpy(0.0, 0.0, angle))
