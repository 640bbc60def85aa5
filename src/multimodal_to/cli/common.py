"""What the commands share: the application, its options, and how files are found and written."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryFile
from typing import Annotated, Any, TypeVar

import typer
from rich.console import Console
from rich.text import Text

from multimodal_to.auditing.audit import Audit
from multimodal_to.cli.completion import robots_or_folders, scenarios_or_files
from multimodal_to.errors import InputError, OutputError, TrajectoryError, shortened
from multimodal_to.exporting.reading import flavours_of, read_motion
from multimodal_to.files.numbers import number, whole_number
from multimodal_to.models.loading import load_robot
from multimodal_to.models.robot import Robot
from multimodal_to.scenarios import find as bundled
from multimodal_to.scenarios import paper as as_in_paper
from multimodal_to.scenarios.files import change, load
from multimodal_to.scenarios.margins import Margins
from multimodal_to.scenarios.scenario import Scenario
from multimodal_to.tasks import TASKS, find
from multimodal_to.tasks.finding import refuse_unknown
from multimodal_to.trajectory import Trajectory
from multimodal_to.trajectory.archive import read_archive
from multimodal_to.trajectory.conditions import under_conditions
from multimodal_to.trajectory.importing import import_arrays
from multimodal_to.trajectory.sameness import refuse_other_robot

app = typer.Typer(
    name="multimodal-to",
    help="Whole-body trajectory optimisation of robots that walk and fly.",
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)
out = Console(highlight=False, markup=False, emoji=False)

DEFAULT_ROBOT = "ironcub"
"""The robot of the bundled scenarios, and of a task that names none."""
_Value = TypeVar("_Value", int, float)

File = Annotated[Path, typer.Argument(help="Trajectory file, as `solve` writes it.")]
ScenarioName = Annotated[
    str, typer.Argument(help="Task, as `list` shows it, or a TOML file of one.", autocompletion=scenarios_or_files)
]
OptionalName = Annotated[
    str | None,
    typer.Argument(
        metavar="NAME",
        help="Task, as `list` shows it, or a TOML file of one; needless with --resume.",
        show_default=False,
        autocompletion=scenarios_or_files,
    ),
]
Settings = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Change a value, as in --set height=0.1; repeatable."),
]
RobotOption = Annotated[
    str, typer.Option("--robot", help="Bundled robot by name, or a robot's folder.", autocompletion=robots_or_folders)
]


def chosen(name: str, settings: list[str] | None, *, robot: str = "", paper: bool = False) -> Scenario:
    """Return a starter task of the robot, a bundled scenario, or that of a file, with the changes asked for.

    Args:
        name: of the task, or its TOML file.
        settings: changes as `KEY=VALUE`; a key may be an argument of the starter task, as `height=0.1`.
        robot: name or folder; empty for the iRonCub.
        paper: as the paper's own formulation is solved with it.
    """
    if name.endswith(".toml"):
        scenario = load(name)
        scenario = replace(scenario, margins=Margins.none()) if paper else scenario
        return change(scenario, settings or ())
    if paper:
        return change(as_in_paper(name), settings or ())
    refuse_unknown(name)  # before a robot is read
    if name in TASKS or robot:
        return find(name, load_robot(robot or DEFAULT_ROBOT), settings or ())
    return change(bundled(name), settings or ())


def robot_for(scenario: Scenario, option: str, *, file: str = "") -> str:
    """Return the robot of a task: that of the option, else the one that the scenario names, else the iRonCub.

    Args:
        scenario: the task.
        option: what `--robot` says; empty where it is not given.
        file: of the task; where there is one and nothing names a robot, which one is taken is said.
    """
    if option or scenario.robot:
        return option or scenario.robot or ""
    if file.endswith(".toml"):
        say("note", "cyan", f"'{file}' names no robot: it is planned for the {DEFAULT_ROBOT}; say robot = or --robot")
    return DEFAULT_ROBOT


def loaded(file: Path, robot: str) -> tuple[Robot, Trajectory]:
    """Return a trajectory with its robot; a file of bare arrays, or of another program, needs the robot named."""
    if robot and (moved := of_others(file, robot)) is not None:
        return moved
    trajectory = Trajectory.load(file)
    if not robot and (Path(trajectory.robot).name != trajectory.robot or trajectory.robot in ("", "..")):
        raise TrajectoryError(
            f"'{file}' names its robot as the path '{trajectory.robot}', which is not followed; name the robot with "
            "--robot"
        )
    the_robot = under_conditions(load_robot(robot or trajectory.robot).with_jets(trajectory.jet_names), trajectory)
    refuse_other_robot(trajectory, the_robot, what=f"'{file}'", of=("joints", "contact points"), error=TrajectoryError)
    return the_robot, trajectory


def of_others(file: Path, robot: str, *, jets: bool = True) -> tuple[Robot, Trajectory] | None:
    """Return a motion of a tracker or a simulator, or of bare arrays, with its robot; None for the library's own files.

    Args:
        file: of the motion.
        robot: by name or folder.
        jets: read it as a motion of the robot with its jets.
    """
    stored = {} if file.suffix.lower() == ".csv" else read_archive(file, leave_out_pickled=True)
    if "format_version" in stored:
        return None
    the_robot = load_robot(robot) if jets else load_robot(robot).with_jets(())
    if not stored or flavours_of(stored):
        return the_robot, read_motion(the_robot, file)
    return the_robot, import_arrays(the_robot, file)


def writable(folder: Path) -> Path:
    """Make a folder if it is missing and make sure that files can be written there.

    A folder that was made for a command that then writes nothing goes again when it ends (`remove_unused`).
    """
    try:
        missing = [path for path in (folder, *folder.parents) if not path.exists()]
        folder.mkdir(parents=True, exist_ok=True)
        _made.extend(missing)
        with TemporaryFile(dir=folder):
            pass
    except (OSError, ValueError) as error:
        raise OutputError(
            f"cannot write to the folder '{folder}': {getattr(error, 'strerror', None) or error}"
        ) from error
    return folder


_made: list[Path] = []  # folders made for the command that runs, inner ones first


def remove_unused() -> None:
    """Remove the folders that were made for a command and are still empty."""
    while _made:
        with suppress(OSError):  # it holds something, or is gone
            _made.pop(0).rmdir()


def writable_file(path: Path, suffix: str) -> None:
    """Make sure that a file has its suffix and that its folder can be written to; the folder is made if missing."""
    if path.suffix.lower() != suffix:
        raise OutputError(f"'{path}' is no {suffix}")
    writable(path.parent)


def number_option(value: Any) -> float:
    """Return the number of an option as XML and TOML write it, not as Python does: `1_5` and `nan` are none.

    Raises:
        InputError: it is no number.
    """
    return _read(number, value, "a number")


def whole_number_option(value: Any) -> int:
    """Return the whole number of an option.

    Raises:
        InputError: it is none.
    """
    return _read(whole_number, value, "a whole number")


def _read(read: Callable[[str], _Value], value: Any, expected: str) -> _Value:
    try:
        return read(value) if isinstance(value, str) else value
    except ValueError as error:
        raise InputError(f"'{shortened(value, 60)}' is not {expected}") from error


def option_numbers(option: str, text: str) -> list[float]:
    """Return the numbers of an option that are written with commas between them."""
    try:
        return [number(word) for word in text.split(",")]
    except ValueError as error:
        raise InputError(f"{option} is '{text}'; expected numbers with commas between them") from error


def described(report: Audit) -> str:
    """Return the figures of an audit that are no verdicts, as a sentence."""
    return (
        f"{report.duration:.2f} s, longest flight {report.airborne:.2f} s, vertical thrust at the end "
        f"{100 * report.final_thrust_over_weight:.2f} % of the weight"
    )


def say(what: str, style: str, sentence: str) -> None:
    """Print to the standard error, with colour where it is a terminal.

    Args:
        what: the first word, such as `error`.
        style: of that word, as `rich` names it.
        sentence: the message.
    """
    Console(stderr=True, highlight=False).print(Text.assemble((f"{what}: ", style), sentence), soft_wrap=True)
