"""Every command takes every robot: without joints, without contact points, without jets, and with odd names.

A command either does what it is asked, or says in one sentence why that has no meaning for the robot.
"""

from __future__ import annotations

from itertools import product
from pathlib import Path

import pytest

from commands import run
from multimodal_to.cli.common import app
from multimodal_to.files.writing import write_text
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
    "audit": ["audit", "motion.npz", "--robot", "robot"],
    "audit, task": ["audit", "task.npz", "--robot", "robot"],
    "audit, other task": ["audit", "other.npz", "--robot", "robot"],
    "audit, json": ["audit", "motion.npz", "--robot", "robot", "--json"],
    "simulate": ["simulate", "motion.npz", "--robot", "robot"],
    **{
        f"plot, {figure}": ["plot", "motion.npz", "--robot", "robot", "--figure", figure]
        for figure in ("joints", "forces")
    },
    "plot, all": ["plot", "motion.npz", "--robot", "robot", "--figure", "all"],
    "plot, two": ["plot", "motion.npz", "motion.npz", "--robot", "robot", "-o", "two.svg"],
    "replay": ["replay", "motion.npz", "--robot", "robot", "--html", "page.html", "--with", "motion.npz"],
    "report": ["report", "motion.npz", "--robot", "robot"],
    **{
        f"export, {kind}": ["export", "motion.npz", "--robot", "robot", "--to", kind]
        for kind in ("csv", "mat", "mujoco", "pinocchio")
    },
    "robot info": ["robot", "info", "robot"],
    "robot info, URDF": ["robot", "info", "robot/robot.urdf"],
    "reproduce": ["reproduce", "no such task"],
}

DRAWN = ("no_joints no_feet no_jets", "joints no_feet jets", "no_joints feet no_jets", "blanks and letters")
"""Robots that a report is made of."""


@pytest.fixture(scope="module", params=ALL.values(), ids=ALL)
def folder(request, tmp_path_factory) -> Path:
    """A folder with a robot, a task and a motion of it."""
    folder = tmp_path_factory.mktemp("odd")
    (folder / "robot").mkdir()
    robot = odd_robot(folder / "robot", **request.param)
    write_text(folder / "task.toml", task(robot))
    write_text(folder / "other.toml", task(robot, other=True))
    at_rest(robot).save(folder / "motion.npz")
    for name in ("task", "other"):
        at_rest(robot, to_json(load(folder / f"{name}.toml"))).save(folder / f"{name}.npz")
    return folder


def test_every_command_is_tried():
    known = {command.name or command.callback.__name__ for command in app.registered_commands}
    assert {arguments[0] for arguments in COMMANDS.values()} == known | {group.name for group in app.registered_groups}


@pytest.mark.parametrize("command", COMMANDS.values(), ids=COMMANDS)
def test_a_command_works_or_says_in_one_sentence_why_not(folder, command, request):
    draws_all = command[0] == "report" or "all" in command
    if draws_all and not any(f"[{name}-" in request.node.name for name in DRAWN):
        pytest.skip("to draw all figures takes long: for some robots only")
    ended = run(*command, cwd=folder)
    assert ended.returncode in (0, 1, 2)
    # In the air four intervals leave fewer variables than rows, of which CasADi warns.
    errors = [line for line in ended.stderr.splitlines() if "NLP is overconstrained" not in line]
    if "--json" in command or ended.returncode != 2:
        assert errors == [] or "--force" in command
        assert ended.stdout
    if "doctor" not in command:
        assert [line for line in errors if not line.startswith("error: ")] == []
    if ended.returncode == 2 and "--json" not in command:
        assert "error: " in ended.stdout + ended.stderr
