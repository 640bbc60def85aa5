"""`robot info`, `robot init` and `robot check`."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer

from multimodal_to.adam.inspection import describe
from multimodal_to.cli.common import app, out, say, writable
from multimodal_to.cli.completion import robots_or_folders, robots_or_urdfs
from multimodal_to.errors import OutputError
from multimodal_to.models.loading import load_robot
from multimodal_to.models.robot import Robot

robot_app = typer.Typer(help="Look at robots, and make folders for new ones.", no_args_is_help=True)
app.add_typer(robot_app, name="robot")
_PICTURE = "home.png"


@robot_app.command("init")
def robot_init(
    urdf: Annotated[Path, typer.Argument(help="URDF of the robot. MJCF is not read.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder to make.")],
    jet: Annotated[list[str] | None, typer.Option(help="Link that an engine sits in; repeatable.")] = None,
    name: Annotated[str, typer.Option(help="Name of the robot. [the URDF's]")] = "",
    contacts: Annotated[bool, typer.Option(help="Look for feet; without, the robot touches nothing.")] = True,
    picture: Annotated[bool, typer.Option(help=f"Draw the robot at home into {_PICTURE}.")] = True,
) -> None:
    """Make a robot's folder from a URDF: a robot.toml that loads at once, with a comment at each guess.

    Example: multimodal-to robot init my_robot.urdf --output my_robot
    """
    from multimodal_to.robots import init

    writable(output)
    made = init(urdf, output, jets=jet or (), contacts=contacts, name=name or None)
    out.print(_described(made.robot))
    for note in made.notes:
        out.print(f"guess: {note}", soft_wrap=True)
    out.print(f"wrote {output / 'robot.toml'}", soft_wrap=True)
    if picture:
        _draw(made.robot, output / _PICTURE)


@robot_app.command("check")
def robot_check(
    robot: Annotated[
        str, typer.Argument(help="A robot's folder, or the name of a bundled robot.", autocompletion=robots_or_folders)
    ],
    picture: Annotated[
        Path | None, typer.Option(help="Draw the robot at home: .png, .svg or .pdf, with contacts, frames and jets.")
    ] = None,
) -> None:
    """Name all that is missing or wrong in a robot's folder, and what looks odd. Exit status 0 where it loads, else 2.

    Example: multimodal-to robot check my_robot --picture home.png
    """
    from multimodal_to.robots import check

    found = check(robot)
    if found.robot is None:
        say("error", "bold red", found.fault)
        raise typer.Exit(2)
    out.print(_described(found.robot))
    for remark in found.remarks:
        out.print(f"odd: {remark}", soft_wrap=True)
    if not found.remarks:
        out.print("nothing looks odd")
    if picture is not None:
        _draw(found.robot, picture)


@robot_app.command("info")
def robot_info(
    path: Annotated[
        str,
        typer.Argument(
            help="URDF file, a robot's folder, or the name of a bundled robot.", autocompletion=robots_or_urdfs
        ),
    ],
) -> None:
    """Show a robot's tree, masses and frames, what was merged or locked, and what looks wrong.

    Example: multimodal-to robot info ironcub
    """
    if os.path.isfile(path):
        description = describe(path)
    else:
        the_robot = load_robot(path)
        description = describe(the_robot.urdf, the_robot.joint_names)
    out.print(str(description), markup=False, soft_wrap=True)


def _described(robot: Robot) -> str:
    feet = ", ".join(f"{name} ({len(points)})" for name, points in robot.feet.items()) or "none"
    return (
        f"{robot.name}: {robot.mass:.3f} kg, {len(robot.joint_names)} joints, feet with contact points: {feet}, "
        f"jets: {', '.join(robot.jet_names) or 'none'}, CoM {robot.standing_height:.3f} m above its contact points"
    )


def _draw(robot: Robot, path: Path) -> None:
    from multimodal_to.plotting import SUFFIXES, save
    from multimodal_to.robots.picture import draw_home

    if path.suffix.lower() not in SUFFIXES:
        raise OutputError(f"'{path}' is no .png, .svg or .pdf")
    writable(path.parent)
    out.print(f"wrote {save(draw_home(robot), path)}", soft_wrap=True)
