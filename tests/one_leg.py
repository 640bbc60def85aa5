"""A hopper on one leg as a folder: 12.5 kg, with hip, knee and ankle that turn about y, and a sole of four points."""

from __future__ import annotations

from pathlib import Path

from multimodal_to.models.robot import Robot, load_robot

_LINKS = {
    "body": (10.0, 0.1, 0.05),
    "thigh": (1.2, 0.01, -0.12),
    "shank": (0.9, 0.008, -0.12),
    "foot": (0.4, 0.001, 0.0),
}
"""Mass [kg], inertia about each axis [kg m²], and height of the CoM in the link [m]."""
_JOINTS = {"hip": ("body", "thigh", 0.0), "knee": ("thigh", "shank", -0.3), "ankle": ("shank", "foot", -0.3)}
_HOME = {"hip": -0.4, "knee": 0.8, "ankle": -0.4}  # [rad]
_EFFORT = {"hip": 150.0, "knee": 150.0, "ankle": 80.0}  # [N m]
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
        f'<axis xyz="0 1 0"/><limit lower="-2.5" upper="2.5" effort="{_EFFORT[name]}" velocity="20"/></joint>'
        for name, (parent, child, z) in _JOINTS.items()
    ]
    (folder / "one_leg.urdf").write_text(f'<robot name="one_leg">{"".join(parts)}</robot>', encoding="utf-8")
    joints = [f"{name} = {{ lower = -2.5, upper = 2.5, speed = 20.0, home = {_HOME[name]} }}" for name in _JOINTS]
    frames = [f'{name} = {{ link = "foot", position = [{x}, {y}, -0.04] }}' for name, (x, y) in SOLE.items()]
    lines = ['name = "one-leg"', 'urdf = "one_leg.urdf"', "[joints]", *joints]
    lines += ["[joint_groups]", f"leg = {list(_JOINTS)}", "[frames]", *frames]
    lines += ["[home]", "base_position = [0.0, 0.0, 0.5927]", "base_quaternion_xyzw = [0.0, 0.0, 0.0, 1.0]"]
    lines += ["[contact]", "friction = 0.6", "[contact.feet]", f"sole = {list(SOLE)}"]
    (folder / "robot.toml").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return load_robot(folder)
