"""A hopper on one leg as a folder: 12.6 kg, six joints as a leg of a humanoid has them, and a sole of four points."""

from __future__ import annotations

from pathlib import Path

from multimodal_to.models.loading import load_robot
from multimodal_to.models.robot import Robot

_LINKS = {
    "body": (10.0, 0.1, 0.05),
    "hip_1": (0.1, 2e-4, 0.0),
    "hip_2": (0.1, 2e-4, 0.0),
    "thigh": (1.2, 0.01, -0.12),
    "shank": (0.8, 0.008, -0.12),
    "ankle": (0.1, 2e-4, 0.0),
    "foot": (0.3, 0.001, 0.0),
}
"""Mass [kg], inertia about each axis [kg m²], and height of the CoM in the link [m]."""
_JOINTS = {
    "hip_yaw": ("body", "hip_1", 0.0, "0 0 1", 0.0),
    "hip_roll": ("hip_1", "hip_2", 0.0, "1 0 0", 0.0),
    "hip_pitch": ("hip_2", "thigh", 0.0, "0 1 0", -0.5),
    "knee": ("thigh", "shank", -0.3, "0 1 0", 1.0),
    "ankle_pitch": ("shank", "ankle", -0.3, "0 1 0", -0.5),
    "ankle_roll": ("ankle", "foot", 0.0, "1 0 0", 0.0),
}
"""Parent, child, height in the parent [m], axis, and home [rad]."""
_BASE_HEIGHT = 0.56655  # of the body at home [m]: 2 · 0.3 cos 0.5, and the sole below the ankle
SOLE = {"front_left": (0.1, 0.05), "front_right": (0.1, -0.05), "back_right": (-0.1, -0.05), "back_left": (-0.1, 0.05)}


def one_leg(folder: Path) -> Robot:
    """Return the hopper, written into a folder."""
    parts = [
        f'<link name="{name}"><inertial><origin xyz="0 0 {height}"/><mass value="{mass}"/><inertia ixx="{inertia}" '
        f'iyy="{inertia}" izz="{inertia}" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        for name, (mass, inertia, height) in _LINKS.items()
    ]
    parts += [
        f'<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/><origin xyz="0 0 {z}"/>'
        f'<axis xyz="{axis}"/><limit lower="-2.5" upper="2.5" effort="150" velocity="20"/></joint>'
        for name, (parent, child, z, axis, _) in _JOINTS.items()
    ]
    (folder / "one_leg.urdf").write_text(f'<robot name="one_leg">{"".join(parts)}</robot>', encoding="utf-8")
    joints = [
        f"{name} = {{ lower = -2.5, upper = 2.5, speed = 20.0, home = {home} }}"
        for name, (_, _, _, _, home) in _JOINTS.items()
    ]
    frames = [f'{name} = {{ link = "foot", position = [{x}, {y}, -0.04] }}' for name, (x, y) in SOLE.items()]
    lines = ['name = "one-leg"', 'urdf = "one_leg.urdf"', "[joints]", *joints]
    lines += ["[joint_groups]", f"leg = {list(_JOINTS)}", "[frames]", *frames]
    lines += ["[home]", f"base_position = [0.0, 0.0, {_BASE_HEIGHT}]", "base_quaternion_xyzw = [0.0, 0.0, 0.0, 1.0]"]
    lines += ["[contact]", "friction = 0.6", "[contact.feet]", f"sole = {list(SOLE)}"]
    (folder / "robot.toml").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return load_robot(folder)
