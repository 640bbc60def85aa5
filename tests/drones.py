"""Small robots of one body on four legs, written as folders: for tests of what has to work for other robots too."""

from __future__ import annotations

from pathlib import Path

import multimodal_to as mt
from multimodal_to.models.loading import bundled_robots, load_robot
from multimodal_to.models.robot import Robot

DOWN = "3.14159265359 0 0"  # of a frame that pushes the robot up

HOP = mt.Scenario(
    name="hop",
    title="hop",
    knots=30,
    initial_com=(0.0, 0.0, 0.4),
    final_com=(0.0, 0.0, 0.6),
    terminal=mt.Terminal.HOVER,
    interval_min=0.1,
    interval_max=0.2,
    weights=mt.Weights(com_velocity=1e3, com_acceleration=1e2, contact_forces=1e-2),
)
"""From standing to a hover 20 cm higher."""


def drone(
    folder: Path,
    *,
    jets: bool = True,
    mass: float = 20.0,
    tilt: str = DOWN,
    antenna: bool = False,
    arm: float = 0.2,
    more: str = "",
) -> Robot:
    """Return a body of `mass` [kg] with rigid legs at ±`arm` [m] and, under it, a P220 at ±0.2 m of each side.

    Args:
        folder: where to write it.
        jets: whether it has any.
        mass: of the body [kg].
        tilt: of the jets' frames, roll, pitch and yaw [rad].
        antenna: whether a joint turns a link without mass.
        arm: of the feet along x and y [m].
        more: further tables of its `robot.toml`.
    """
    frames = {f"foot_{index}": (f"{x} {y} -0.4", "0 0 0") for index, (x, y) in enumerate(_corners(arm))}
    frames |= {f"jet_{side}": (f"0 {y} 0", tilt) for side, y in (("left", 0.2), ("right", -0.2))}
    links = "".join(
        f'<link name="{name}"/><joint name="{name}_mount" type="fixed"><parent link="body"/><child link="{name}"/>'
        f'<origin xyz="{xyz}" rpy="{rpy}"/></joint>'
        for name, (xyz, rpy) in frames.items()
    )
    links += antenna * (
        '<link name="whip"/><joint name="antenna" type="revolute"><parent link="body"/><child link="whip"/>'
        '<axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="1" velocity="5"/></joint>'
    )
    inertia = '<inertia ixx="0.6" iyy="0.5" izz="0.4" ixy="0" ixz="0" iyz="0"/>'
    (folder / "drone.urdf").write_text(
        f'<robot name="drone"><link name="body"><inertial><mass value="{mass}"/>{inertia}</inertial></link>{links}'
        "</robot>"
    )
    (folder / "robot.toml").write_text(
        "\n".join(
            [
                'name = "drone"',
                'urdf = "drone.urdf"',
                "[joints]",
                "antenna = { lower = -1.0, upper = 1.0, speed = 3.0, home = 0.0 }" if antenna else "",
                "[joint_groups]",
                "[home]",
                "base_position = [0.0, 0.0, 0.4]",
                "base_quaternion_xyzw = [0.0, 0.0, 0.0, 1.0]",
                "[contact]",
                "friction = 0.5",
                "[contact.feet]",
                f"legs = {[name for name in frames if name.startswith('foot')]}",
                *(_jet(side) for side in ("left", "right") if jets),
                _model() if jets else "",
                more,
            ]
        )
    )
    return load_robot(folder)


def _corners(arm: float) -> list[tuple[float, float]]:
    return [(x, y) for x in (arm, -arm) for y in (arm, -arm)]


def _jet(side: str) -> str:
    return (
        f'[[jet]]\nname = "{side}"\nframe = "jet_{side}"\nmodel = "P220"\nthrust_max = 220.0\nthrottle = [0.0, 100.0]'
    )


def _model() -> str:
    text = (bundled_robots()["ironcub"] / "robot.toml").read_text(encoding="utf-8")
    return text[text.index("[jet_models.P220]") :]
