"""What `solve` is given to do: a scenario, or an unfinished solve; and the checkpoint that it keeps."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from rich.console import Console

from multimodal_to.cli.common import chosen, of_others, robot_for
from multimodal_to.errors import InputError, ScenarioError
from multimodal_to.models.loading import load_robot
from multimodal_to.models.state import State
from multimodal_to.ocp import Formulation
from multimodal_to.scenarios.data import stored
from multimodal_to.scenarios.files import change
from multimodal_to.scenarios.scenario import Scenario, Start
from multimodal_to.trajectory import Trajectory
from multimodal_to.trajectory.rules import BACKWARD_EULER
from multimodal_to.trajectory.states import state_at


@dataclass(frozen=True, kw_only=True, eq=False)
class Task:
    """A scenario for a robot, by its name or folder, what its problem is made of, and the motion to start from."""

    scenario: Scenario
    robot: str
    formulation: Formulation
    start: Trajectory | None
    initial: State | None = None  # that an unfinished solve with a given start starts in


def given(
    name: str | None,
    settings: list[str] | None,
    robot: str,
    *,
    paper: bool,
    warm_start: Path | None,
    resume: Path | None,
    quiet: bool = False,
) -> Task:
    """Return the task that the options of `solve` ask for.

    Args:
        name: of a bundled scenario, or its TOML file.
        settings: changes as `KEY=VALUE`.
        robot: name or folder; empty for the scenario's, the file's own, or the iRonCub.
        paper: whether it is the paper's own formulation.
        warm_start: trajectory file of a similar task.
        resume: checkpoint or trajectory file of an unfinished solve.
        quiet: whether nothing is said of which robot is taken.

    Raises:
        InputError: they contradict each other, or none of them is a task.
        ScenarioError: the file to go on from keeps no scenario.
    """
    if resume is None:
        if name is None:
            raise InputError("nothing to solve; expected the NAME of a scenario, or --resume FILE")
        formulation = Formulation.paper() if paper else Formulation.executable()
        asked = chosen(name, settings, robot=robot, paper=paper)
        start = None if warm_start is None else _motion(warm_start, robot, jets=asked.jets)
        whose = robot_for(asked, robot, file="" if quiet else name)
        return Task(scenario=asked, robot=whose, formulation=formulation, start=start)
    if warm_start is not None:
        raise InputError("--resume and --warm-start both say what to start from; expected one of them")
    start = Trajectory.load(resume)
    if unusual := start.unusual_formulation():
        raise InputError(
            f"'{resume}' is of a problem that this command does not have ({unusual}); go on from it in the script that "
            "makes these terms, with solve(problem, start=Trajectory.load(...))"
        )
    if paper and start.rule != BACKWARD_EULER:
        raise InputError(
            f"'{resume}' is integrated by {start.rule}, and --resume goes on with its own rule; --warm-start starts "
            "the paper's problem from it"
        )
    scenario = stored(start)
    if scenario is None:
        raise ScenarioError(f"'{resume}' keeps no scenario to go on with; name one and start from it by --warm-start")
    asked = (
        change(scenario, settings or ())
        if name is None
        else chosen(name, settings, robot=robot or start.robot, paper=start.rule == BACKWARD_EULER)
    )
    whose = robot or ("" if name is None else asked.robot) or start.robot  # no path that the file alone names
    asked = replace(asked.for_robot(load_robot(whose)), robot=None)
    initial = state_at(start, 0.0) if scenario.start is Start.GIVEN else None
    if initial is not None and asked.start is Start.GIVEN:
        asked = replace(asked, initial_state=None, initial_knot=None, initial_com=scenario.initial_com)
    if asked != replace(scenario, robot=None):
        raise InputError(
            f"'{resume}' is of '{scenario.name}' with other values than asked for; --resume goes on with its own, "
            "--warm-start starts a changed task from it"
        )
    formulation = Formulation.of_rule(start.rule)
    return Task(scenario=scenario, robot=whose, formulation=formulation, start=start, initial=initial)


def _motion(file: Path, robot: str, *, jets: bool) -> Trajectory:
    """Return the motion of a file, also of another program's where the robot is named.

    Args:
        file: of the motion.
        robot: name or folder; empty where it is not named.
        jets: whether the task uses them.
    """
    others = of_others(file, robot, jets=jets) if robot else None
    return Trajectory.load(file) if others is None else others[1]


def free_checkpoint(folder: Path, resume: Path | None, console: Console) -> Path:
    """Return where the checkpoint goes; one that an earlier solve left is moved aside, unless it is gone on from.

    Args:
        folder: that the checkpoint goes to.
        resume: the file that is gone on from.
        console: that says what was moved.
    """
    path = folder / "checkpoint.npz"
    if path.exists() and not (resume is not None and path.samefile(resume)):
        aside = path.replace(folder / "checkpoint-before.npz")
        console.print(f"an unfinished solve left {path}; it is kept as {aside}", soft_wrap=True)
    return path
