"""Small robots that lack joints, contact points or jets, or whose names are odd; a motion and a task of each."""

from __future__ import annotations

from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np

from multimodal_to.files.writing import write_text
from multimodal_to.models.loading import bundled_robots, load_robot
from multimodal_to.models.robot import Robot
from multimodal_to.trajectory import QUANTITIES, Trajectory
from multimodal_to.trajectory.derived import frame_poses

KNOTS, STEP = 4, 0.1  # of the motion
INERTIA = '<inertia ixx="0.2" iyy="0.2" izz="0.2" ixy="0" ixz="0" iyz="0"/>'
JOINTS = {"hip": "revolute", "mast": "prismatic", "wheel": "continuous"}
FEET, JETS = ("front left", "front right", "back"), ("left jet", "right jet")
CORNERS = ((0.2, 0.2), (0.2, -0.2), (-0.2, 0.0))
TASK = """
name = "task"
title = "From {start} to {terminal}"
knots = 4
initial_com = [0.0, 0.0, 0.4]
final_com = [0.0, 0.0, 0.4]
start = "{start}"
terminal = "{terminal}"
interval_min = 0.1
interval_max = 0.2
[weights]
com_velocity = 1.0
joint_velocities."alle Gelenke" = 1.0
"""


def odd_robot(folder: Path, *, joints: dict[str, str], feet: bool, jets: bool, letters: str = "") -> Robot:
    """Write a robot of a body, a link for each joint, three feet and two jets, and return it.

    Args:
        folder: where to write it.
        joints: the kind of each joint by its name.
        feet: whether it has contact points.
        jets: whether it has jets.
        letters: that stand in every name.
    """
    body, feet_used, jets_used = f"body{letters}", FEET if feet else (), JETS if jets else ()
    parts = [f"<link name={quoteattr(body)}><inertial><mass value='10'/>{INERTIA}</inertial>"]
    parts.append("<visual><geometry><box size='0.3 0.3 0.3'/></geometry></visual></link>")
    for name, kind in joints.items():
        link, limit = quoteattr(f"{name} link{letters}"), "<limit lower='-0.5' upper='0.5' effort='40' velocity='3'/>"
        parts.append(f"<link name={link}><inertial><mass value='1'/>{INERTIA}</inertial></link>")
        parts.append(f"<joint name={quoteattr(name + letters)} type='{kind}'><parent link={quoteattr(body)}/>")
        parts.append(f"<child link={link}/><axis xyz='0 1 0'/>{'' if kind == 'continuous' else limit}</joint>")
    places = [(name, f"{x} {y} -0.4", "0 0 0") for name, (x, y) in zip(feet_used, CORNERS, strict=False)]
    places += [(name, f"0 {y} 0", "3.14159265359 0 0") for name, y in zip(jets_used, (0.2, -0.2), strict=False)]
    for name, xyz, rpy in places:
        frame = quoteattr(name + letters)
        parts.append(f"<link name={frame}/><joint name={quoteattr(name + ' mount' + letters)} type='fixed'>")
        parts.append(f"<parent link={quoteattr(body)}/><child link={frame}/><origin xyz='{xyz}' rpy='{rpy}'/></joint>")
    write_text(folder / "robot.urdf", f"<robot name='odd'>{''.join(parts)}</robot>")
    lines = [f'name = "robot{letters}"', 'urdf = "robot.urdf"', "[joints]"]
    lines += [f'"{name}{letters}" = {{ lower = -0.5, upper = 0.5, speed = 3.0, home = 0.0 }}' for name in joints]
    members = ", ".join(f'"{name}{letters}"' for name in joints)
    lines += ["[joint_groups]", f'"alle Gelenke" = [{members}]', "[home]", "base_position = [0.0, 0.0, 0.4]"]
    lines += ["base_quaternion_xyzw = [0.0, 0.0, 0.0, 1.0]", "[contact]", "friction = 0.5", "[contact.feet]"]
    lines += [f'"foot{letters}" = [{", ".join(f"{chr(34)}{name}{letters}{chr(34)}" for name in feet_used)}]'] * feet
    for name in jets_used:
        lines += ["[[jet]]", f'name = "{name}{letters}"', f'frame = "{name}{letters}"', 'model = "P220"']
        lines += ["thrust_max = 220.0", "throttle = [0.0, 100.0]"]
    model = (bundled_robots()["ironcub"] / "robot.toml").read_text(encoding="utf-8")
    write_text(folder / "robot.toml", "\n".join(lines) + "\n" + model[model.index("[jet_models.P220]") :] * jets)
    return load_robot(folder)


def at_rest(robot: Robot, task: str = "") -> Trajectory:
    """Return a motion that stands still, on its feet where it has some, else carried by its jets; it keeps a task."""
    bodies = {"robot": 1, "joint": len(robot.joint_names), "contact": len(robot.contacts), "jet": len(robot.jets)}
    count = KNOTS + 1
    arrays = {name: np.zeros((quantity.rows * bodies[quantity.of], count)) for name, quantity in QUANTITIES.items()}
    arrays["base_position"][2] = arrays["com_position"][2] = 0.4
    arrays["base_quaternion_xyzw"][3] = 1.0
    arrays["contact_forces"][2::3] = robot.weight / max(len(robot.contacts), 1)
    if not robot.contacts:
        arrays["thrust"][:] = robot.weight / max(len(robot.jets), 1)

    def trajectory() -> Trajectory:
        return Trajectory(
            robot=robot.name,
            scenario="at rest",
            time=STEP * np.arange(count),
            joint_names=robot.joint_names,
            contact_names=robot.contact_names,
            jet_names=robot.jet_names,
            scenario_json=task,
            **arrays,
        )

    if robot.contacts:
        feet = [frame_poses(robot, trajectory(), name)[:, :3, 3].T for name in robot.contact_names]
        arrays["contact_positions"] = np.concatenate(feet)
    return trajectory()


def task(robot: Robot, *, other: bool = False) -> str:
    """Return a task that stands where the robot has feet, and else hovers, as the text of a file; or the other one."""
    kind = "hover" if bool(robot.contacts) is other else "standing"
    return TASK.format(start=kind, terminal=kind)
