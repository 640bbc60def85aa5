"""`plot`, `replay`, `report` and `export`."""

from __future__ import annotations

import math
import time
from itertools import takewhile
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from multimodal_to import ending
from multimodal_to.cli.common import (
    File,
    RobotOption,
    app,
    loaded,
    number_option,
    option_numbers,
    out,
    writable,
    writable_file,
)
from multimodal_to.cli.completion import exports, figures, flavours
from multimodal_to.errors import InputError, ModelError, OutputError, unknown
from multimodal_to.exporting.export import EXPORTS, write_mujoco, write_pinocchio
from multimodal_to.exporting.motion import FLAVOURS, write_motion
from multimodal_to.models.loading import load_robot
from multimodal_to.models.robot import Robot
from multimodal_to.trajectory import Trajectory
from multimodal_to.trajectory.conditions import under_conditions

if TYPE_CHECKING:
    from multimodal_to.reporting.report import Carried


@app.command()
def plot(
    files: Annotated[list[Path], typer.Argument(help="Trajectory files; several are drawn in one figure.")],
    figure: Annotated[
        str,
        typer.Option(
            help="forces, com, momentum, joints, torques, contacts, margins, or all of them.", autocompletion=figures
        ),
    ] = "forces",
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="Picture: .png, .svg or .pdf; of all, the start of the names. [FILE.png]"),
    ] = None,
    robot: RobotOption = "",
) -> None:
    """Plot a trajectory, or several to compare, with limits dashed and flight in red.

    Example: multimodal-to plot results/take-off/trajectory.npz --figure com --output com.svg
    """
    from multimodal_to.plotting import FIGURES, SUFFIXES, save
    from multimodal_to.plotting import plot as draw

    target = output or files[0].with_suffix(".png")
    if target.suffix.lower() not in SUFFIXES:
        raise OutputError(f"'{target}' is no .png, .svg or .pdf")
    if figure not in (*FIGURES, "all"):
        raise InputError(unknown("figure", figure, (*FIGURES, "all")))
    opened = [loaded(file, robot) for file in files]
    the_robot = under_conditions(load_robot(robot or opened[0][1].robot), opened[0][1])
    trajectories = [trajectory for _, trajectory in opened]
    writable(target.parent)
    for name in FIGURES if figure == "all" else (figure,):
        path = target.with_stem(f"{target.stem}-{name}") if figure == "all" else target
        drawn = draw(name, the_robot, *trajectories, labels=_labels(files, trajectories))
        out.print(f"wrote {save(drawn, path)}", soft_wrap=True)


def _labels(files: list[Path], trajectories: list[Trajectory]) -> list[str]:
    """Return a short name for each file: its scenario, or what tells its path from those of others of its scenario."""
    scenarios = [trajectory.scenario for trajectory in trajectories]
    paths = [file.parts for file, scenario in zip(files, scenarios, strict=True) if scenarios.count(scenario) > 1]
    same_start = sum(1 for _ in takewhile(lambda parts: len(set(parts)) == 1, zip(*paths, strict=False)))
    return [
        scenario if scenarios.count(scenario) == 1 else "/".join(file.parts[same_start:]) or str(file)
        for scenario, file in zip(scenarios, files, strict=True)
    ]


@app.command()
def replay(
    file: File,
    html: Annotated[Path | None, typer.Option(help="Write a page that opens from disk, without a server.")] = None,
    gif: Annotated[Path | None, typer.Option(help="Write a GIF that repeats.")] = None,
    mp4: Annotated[Path | None, typer.Option(help="Write an MP4 film.")] = None,
    snapshots: Annotated[Path | None, typer.Option(help="Write a PNG of the robot at several times.")] = None,
    times: Annotated[str, typer.Option(help="Times of the snapshots [s], as 0,2.5,7.")] = "",
    fps: Annotated[
        float | None, typer.Option(parser=number_option, metavar="FLOAT", help="Frames a second. [GIF 12.5, MP4 25]")
    ] = None,
    beside: Annotated[
        Path | None,
        typer.Option("--with", metavar="OTHER", help="Draw another trajectory of the robot with it, faint."),
    ] = None,
    meshes: Annotated[bool, typer.Option(help="Draw meshes where the robot has them.")] = True,
    robot: RobotOption = "",
) -> None:
    """Replay a trajectory in the browser, live or as a page, or render it; GIF, MP4 and PNG need Chromium or Chrome.

    Example: multimodal-to replay results/take-off/trajectory.npz --html take-off.html --gif take-off.gif
    """
    the_robot, trajectory = loaded(file, robot)
    ghost = None if beside is None else loaded(beside, robot)[1]
    if ghost is not None and snapshots is not None:
        raise InputError("--with goes with pages, GIF, MP4 and the live viewer; --snapshots shows one trajectory")
    instants = option_numbers("--times", times) if times else None
    wanted = {".html": html, ".png": snapshots, ".gif": gif, ".mp4": mp4}
    targets = {suffix: path for suffix, path in wanted.items() if path is not None}
    for suffix, path in targets.items():
        writable_file(path, suffix)
    from multimodal_to.replay import serve, write_gif, write_html, write_mp4, write_snapshots

    write = {
        ".html": lambda path: write_html(the_robot, trajectory, path, ghost=ghost, meshes=meshes),
        ".png": lambda path: write_snapshots(the_robot, trajectory, path, times=instants, meshes=meshes),
        ".gif": lambda path: write_gif(
            the_robot, trajectory, path, rate=12.5 if fps is None else fps, ghost=ghost, meshes=meshes
        ),
        ".mp4": lambda path: write_mp4(
            the_robot, trajectory, path, rate=25.0 if fps is None else fps, ghost=ghost, meshes=meshes
        ),
    }
    for suffix, path in targets.items():
        out.print(f"wrote {write[suffix](path)}", soft_wrap=True)
    if targets:
        return
    visualizer = serve(the_robot, trajectory, ghost=ghost, meshes=meshes)
    out.print(f"replaying at {visualizer.url()}; Ctrl-C ends", soft_wrap=True)
    visualizer.open()
    try:
        with ending.raised():
            while True:
                time.sleep(1.0)
    except KeyboardInterrupt:
        out.print()


@app.command("report")
def report_file(
    file: File,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Page to write. [FILE.html]")] = None,
    playback: Annotated[
        bool, typer.Option(help="Show what a controller makes of it in MuJoCo, where that is installed.")
    ] = True,
    meshes: Annotated[bool, typer.Option(help="Draw meshes where the robot has them.")] = True,
    robot: RobotOption = "",
) -> None:
    """Write one page with replay, figures, audit and scenario of a trajectory; it opens from disk and prints.

    The replay shows what the controller of `simulate` makes of the plan, and the plan faint beside it.

    Example: multimodal-to report results/take-off/trajectory.npz --output take-off.html
    """
    the_robot, trajectory = loaded(file, robot)
    target = output or file.with_suffix(".html")
    writable_file(target, ".html")
    from multimodal_to.reporting.report import write_report

    carried = _carried(the_robot, trajectory) if playback else None
    out.print(f"wrote {write_report(the_robot, trajectory, target, carried=carried, meshes=meshes)}", soft_wrap=True)


def _carried(robot: Robot, plan: Trajectory) -> Carried | None:
    """Return what a controller makes of a plan; None where there is no simulator, or it does not take the robot."""
    from multimodal_to.reporting.report import Carried
    from multimodal_to.simulation import run_trial, simulated_trajectory

    try:
        playback, trial = run_trial(robot, plan, None)
    except (OutputError, ModelError) as error:
        out.print(f"no playback: {error}", soft_wrap=True)
        return None
    errors = (
        f"CoM at most {100 * trial.com_error_max:.1f} cm, base {math.degrees(trial.base_error_max):.1f}° off the plan"
    )
    end = f"The robot falls at {trial.fell:.2f} s" if trial.fell is not None else f"The robot {trial.end} at the end"
    return Carried(
        motion=simulated_trajectory(playback),
        summary=f"Carried out in MuJoCo, undisturbed; the plan is faint. {end}; {errors}.",
        fell=trial.fell,
    )


@app.command("export")
def export_file(
    file: File,
    to: Annotated[
        str, typer.Option("--to", help="csv, mat, mujoco, pinocchio, rerun or motion.", autocompletion=exports)
    ],
    output: Annotated[Path | None, typer.Option("--output", "-o", help="File to write. [FILE.csv and so on]")] = None,
    flavour: Annotated[
        str | None,
        typer.Option(
            help="Of a motion: mjlab, beyondmimic, holosoma, locomujoco, unitree-csv.", autocompletion=flavours
        ),
    ] = None,
    fps: Annotated[
        float | None,
        typer.Option(parser=number_option, metavar="FLOAT", help="Of a motion: frames a second. [that of the flavour]"),
    ] = None,
    joint_order: Annotated[
        str | None,
        typer.Option(help="Of a motion: urdf, mujoco, pinocchio, isaac, or a TOML file of joint_names and body_names."),
    ] = None,
    model: Annotated[
        Path | None,
        typer.Option(help="The reader's own model, .urdf or MuJoCo's .xml: its joints and bodies, in its order."),
    ] = None,
    robot: RobotOption = "",
) -> None:
    """Write a trajectory for another program, with names, units and conventions.

    Example: multimodal-to export results/take-off/trajectory.npz --to motion --flavour mjlab --model robot.xml
    """
    if to not in (*EXPORTS, "motion"):
        raise InputError(unknown("export", to, (*EXPORTS, "motion")))
    if to == "motion" and flavour not in FLAVOURS:
        raise InputError(unknown("flavour of motion", flavour or "", FLAVOURS))
    if to != "motion" and any(option is not None for option in (flavour, fps, joint_order)):
        raise InputError("--flavour, --fps and --joint-order go with --to motion")
    if to not in ("motion", "mujoco", "pinocchio") and model is not None:
        raise InputError("--model goes with --to motion, mujoco and pinocchio")
    the_robot, trajectory = loaded(file, robot)
    suffix = FLAVOURS[flavour].suffix if flavour else EXPORTS[to][0]
    target = output or (
        file.with_suffix(suffix)
        if to in ("csv", "mat", "rerun")
        else file.with_name(f"{file.stem}-{flavour or to}{suffix}")
    )
    writable_file(target, suffix)
    if flavour:
        write_motion(the_robot, trajectory, target, flavour=flavour, fps=fps, joint_order=joint_order, model=model)
    elif to == "mujoco":
        write_mujoco(the_robot, trajectory, target, model=model)
    elif to == "pinocchio":
        write_pinocchio(the_robot, trajectory, target, model=model)
    else:
        EXPORTS[to][1](the_robot, trajectory, target)
    out.print(f"wrote {target}", soft_wrap=True)
