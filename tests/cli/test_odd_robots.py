"""Every command takes every robot: without joints, without contact points, without jets, and with odd names.

A command either does what it is asked, or says in one sentence why that has no meaning for the robot.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from pathlib import Path
from typing import Any

import pytest
import typer
from typer.core import TyperGroup

from commands import run
from multimodal_to.cli.common import app
from multimodal_to.files.writing import write_text
from multimodal_to.replay.browser import find_browser
from multimodal_to.scenarios.data import to_json
from multimodal_to.scenarios.files import load
from odd_robots import JOINTS, at_rest, odd_robot, task

ALL = {
    f"{'joints' if joints else 'no_joints'} {'feet' if feet else 'no_feet'} {'jets' if jets else 'no_jets'}": {
        "joints": {"hip": "revolute"} if joints else {},
        "feet": feet,
        "jets": jets,
    }
    for joints, feet, jets in product((True, False), repeat=3)
}
ALL["a prismatic and a continuous joint"] = {"joints": JOINTS, "feet": True, "jets": True}
ALL["one prismatic joint"] = {"joints": {"mast": "prismatic"}, "feet": True, "jets": False}
ALL["letters that fonts lack"] = {"joints": JOINTS, "feet": True, "jets": True, "letters": " 机器人 $x_1$ [b]a[/b]"}
ALL["blanks and letters"] = {"joints": JOINTS, "feet": True, "jets": True, "letters": " ünd é Ω"}

COMMANDS = {
    "list": ["list"],
    "show": ["show", "task.toml"],
    "show, torques": ["show", "motion.npz", "--torques", "--robot", "robot"],
    "doctor": ["doctor", "task.toml", "--robot", "robot"],
    "doctor, json": ["doctor", "task.toml", "--robot", "robot", "--json"],
    "doctor, other task": ["doctor", "other.toml", "--robot", "robot"],
    "solve, other task": [
        "solve",
        "other.toml",
        "--robot",
        "robot",
        "--max-iterations",
        "2",
        "--force",
        "--no-pictures",
    ],
    "solve": ["solve", "task.toml", "--robot", "robot", "--max-iterations", "2", "--force", "-o", "out", "--explain"],
    "solve, paper": ["solve", "task.toml", "--robot", "robot", "--max-iterations", "2", "--paper", "--no-pictures"],
    "show, set": ["show", "task.toml", "--set", "knots=5"],
    "doctor, set": ["doctor", "task.toml", "--robot", "robot", "--set", "knots=5"],
    "solve, from a motion": [
        *("solve", "task.toml", "--robot", "robot", "--set", "knots=3", "--warm-start", "motion.npz", "--force", "-q"),
        *("--max-iterations", "1", "--time-limit", "9", "--linear-solver", "mumps", "--no-checkpoint", "-o", "warm"),
        "--no-pictures",
    ],
    "solve, go on": [
        *("solve", "--resume", "task.npz", "--robot", "robot", "--max-iterations", "1", "--force", "--no-pictures"),
        *("-o", "on"),
    ],
    "audit": ["audit", "motion.npz", "--robot", "robot"],
    "audit, task": ["audit", "task.npz", "--robot", "robot"],
    "audit, other task": ["audit", "other.npz", "--robot", "robot"],
    "audit, json": ["audit", "motion.npz", "--robot", "robot", "--json"],
    "audit, kinematic": ["audit", "motion.npz", "--robot", "robot", "--kinematic"],
    "simulate": ["simulate", "motion.npz", "--robot", "robot"],
    "simulate, plain": [
        *("simulate", "motion.npz", "--robot", "robot", "--controller", "whole-body", "--no-torque-limits"),
        *("-o", "plain.npz"),
    ],
    "simulate, trials": [
        *("simulate", "motion.npz", "--robot", "robot", "--trials", "1", "--seed", "2", "--jobs", "1", "--push", "1"),
        *("--noise", "--json", "--film", "film.html"),
    ],
    **{
        f"plot, {figure}": ["plot", "motion.npz", "--robot", "robot", "--figure", figure]
        for figure in ("joints", "forces")
    },
    "plot, all": ["plot", "motion.npz", "--robot", "robot", "--figure", "all"],
    "plot, two": ["plot", "motion.npz", "motion.npz", "--robot", "robot", "-o", "two.svg"],
    "replay": ["replay", "motion.npz", "--robot", "robot", "--html", "page.html", "--with", "motion.npz"],
    "replay, pictures": [
        *("replay", "motion.npz", "--robot", "robot", "--snapshots", "still.png", "--times", "0,0.2", "--no-meshes"),
        *("--gif", "film.gif", "--mp4", "film.mp4", "--fps", "5"),
    ],
    "report": ["report", "motion.npz", "--robot", "robot", "--no-meshes", "--no-playback", "-o", "page.html"],
    **{
        f"export, {kind}": ["export", "motion.npz", "--robot", "robot", "--to", kind]
        for kind in ("csv", "mat", "mujoco", "pinocchio")
    },
    **{
        f"export, {flavour}": [
            *("export", "motion.npz", "--robot", "robot", "--to", "motion", "--flavour", flavour, "--fps", "20"),
            *("-o", f"{flavour}.npz", *more),
        ]
        for flavour, more in (("mjlab", ("--joint-order", "urdf")), ("holosoma", ("--model", "robot/robot.urdf")))
    },
    "robot init": [
        *("robot", "init", "robot/robot.urdf", "-o", "made", "--jet", "left_jet", "--name", "mine", "--no-contacts"),
        "--no-picture",
    ],
    "robot check": ["robot", "check", "robot", "--picture", "home.png"],
    "sweep": ["sweep", "sweep.toml", "-o", "sweep", "--dry-run"],
    "sweep, all options": [
        *("sweep", "sweep.toml", "-o", "sweep", "--workers", "1", "--engine", "processes", "--time-limit", "1"),
        *("--address", "auto", "--simulate", "--cold", "-q"),
    ],
    "sweep status": ["sweep", "status", "sweep"],
    "robot info": ["robot", "info", "robot"],
    "robot info, URDF": ["robot", "info", "robot/robot.urdf"],
    "export, elsewhere": ["export", "motion.npz", "--robot", "robot", "--to", "csv", "-o", "table.csv"],
    "reproduce": ["reproduce", "no such task", "-o", "reproduced", "--published", "nowhere"],
}

SWEEP = """
scenario = "task.toml"
robot = "robot"
[grid]
knots = [3, 4]
"""

LONG = {
    "replay, pictures": ("no_joints no_feet no_jets", "blanks and letters"),
    "report": ("no_joints no_feet no_jets", "joints no_feet jets", "no_joints feet no_jets", "blanks and letters"),
    "sweep, all options": ("no_joints no_feet no_jets", "joints no_feet jets", "letters that fonts lack"),
}
"""Commands that take long, and the robots that they are tried with."""
LONG["plot, all"] = LONG["report"]
LONG["simulate, trials"] = (*LONG["report"], "a prismatic and a continuous joint")


@pytest.fixture(scope="module", params=ALL.values(), ids=ALL)
def folder(request, tmp_path_factory) -> Path:
    """A folder with a robot, a task and a motion of it."""
    folder = tmp_path_factory.mktemp("odd")
    (folder / "robot").mkdir()
    robot = odd_robot(folder / "robot", **request.param)
    write_text(folder / "task.toml", task(robot))
    write_text(folder / "other.toml", task(robot, other=True))
    write_text(folder / "sweep.toml", SWEEP)
    at_rest(robot).save(folder / "motion.npz")
    for name in ("task", "other"):
        at_rest(robot, to_json(load(folder / f"{name}.toml"))).save(folder / f"{name}.npz")
    return folder


def leaves(command: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    if isinstance(command, TyperGroup):
        for name, inner in command.commands.items():
            yield from leaves(inner, (*path, name))
    else:
        yield path, command


EVERY = dict(leaves(typer.main.get_command(app)))
"""The commands of the command line by their names, as its parser has them."""


@pytest.mark.parametrize("path", EVERY, ids=" ".join)
def test_every_command_is_tried_with_every_option(path):
    tried = [set(arguments) for arguments in COMMANDS.values() if tuple(arguments[: len(path)]) == path]
    assert tried
    options = [
        {*parameter.opts, *parameter.secondary_opts}
        for parameter in EVERY[path].params
        if parameter.param_type_name == "option" and "--help" not in parameter.opts
    ]
    assert [names for names in options if not any(names & words for words in tried)] == []


@pytest.mark.filterwarnings("ignore::multimodal_to.plotting.LetterWarning")
@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_works_or_says_in_one_sentence_why_not(folder, name, request):
    command = COMMANDS[name]
    if command[0] == "replay" and "--gif" in command and find_browser() is None:
        pytest.skip("there is no browser to take pictures with")
    if name in LONG and not any(f"[{robot}-" in request.node.name for robot in LONG[name]):
        pytest.skip("it takes long: for some robots only")
    ended = run(*command, cwd=folder)
    assert ended.returncode in (0, 1, 2)
    # In the air four intervals leave fewer variables than rows, of which CasADi warns.
    usual = ("NLP is overconstrained", "progress: ")
    errors = [line for line in ended.stderr.splitlines() if not any(part in line for part in usual)]
    assert "Traceback" not in ended.stdout + ended.stderr
    if "--json" in command or ended.returncode != 2:
        assert errors == [] or "--force" in command
        assert ended.stdout or "-q" in command
    if "doctor" not in command:
        assert [line for line in errors if not line.startswith("error: ")] == []
    if ended.returncode == 2 and "--json" not in command:
        assert "error: " in ended.stdout + ended.stderr
