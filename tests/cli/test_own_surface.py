"""A motion on ground of a class of one's own: its file says so, and no command takes the ground for flat in silence."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path

import casadi as cs
import pytest

import multimodal_to as mt
from commands import run_process
from multimodal_to.errors import ScenarioError
from multimodal_to.scenarios.data import kept, stored
from odd_robots import JOINTS, at_rest, odd_robot, task


@dataclass(frozen=True, kw_only=True)
class Bowl:
    """Ground of a class that the library does not know."""

    depth: float = 0.0

    def distance(self, point):
        return point[2] + self.depth

    def normal(self, point):
        return cs.DM([0, 0, 1])

    def tangents(self, point):
        return cs.DM([[1, 0], [0, 1], [0, 0]])


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """A folder with a robot and a motion of it on such ground."""
    folder = tmp_path_factory.mktemp("own")
    (folder / "robot").mkdir()
    robot = odd_robot(folder / "robot", joints=JOINTS, feet=True, jets=True)
    (folder / "task.toml").write_text(task(robot))
    scenario = replace(mt.scenario_files.load(folder / "task.toml"), surface=Bowl())
    at_rest(robot, kept(scenario)).save(folder / "motion.npz")
    return folder


SAID = "the ground of 'at rest' is 'Bowl', a class of its author's own that no file holds"
REFUSING = {
    "audit": ["audit", "{}", "--robot", "{robot}"],
    "simulate": ["simulate", "{}", "--robot", "{robot}"],
    "report": ["report", "{}", "--robot", "{robot}"],
    "show": ["show", "{}"],
    "plot, margins": ["plot", "{}", "--robot", "{robot}", "--figure", "margins"],
    "solve --resume": ["solve", "--resume", "{}", "--robot", "{robot}"],
}


def command(folder: Path, arguments: list[str]):
    return run_process(*(part.format(folder / "motion.npz", robot=folder / "robot") for part in arguments))


@pytest.mark.parametrize("arguments", REFUSING.values(), ids=REFUSING)
def test_what_needs_the_ground_says_that_the_file_has_none(folder, arguments):
    ended = command(folder, arguments)
    assert ended.returncode == 2
    assert (ended.stdout + ended.stderr).count(SAID) == 1
    assert "Traceback" not in ended.stderr


def test_a_replay_is_drawn_on_flat_ground_and_says_so(folder):
    ended = command(folder, ["replay", "{}", "--robot", "{robot}", "--html", str(folder / "page.html")])
    assert ended.returncode == 0
    assert ended.stderr.splitlines() == [f"warning: drawn on flat ground: {SAID}"]


def test_what_does_not_need_the_ground_works(folder):
    ended = command(folder, ["export", "{}", "--robot", "{robot}", "--to", "csv", "-o", str(folder / "motion.csv")])
    assert (ended.returncode, ended.stderr) == (0, "")


def test_the_file_keeps_the_rest_of_the_task_and_python_takes_the_ground(folder):
    motion = mt.Trajectory.load(folder / "motion.npz")
    assert json.loads(motion.scenario_json)["surface"] == {"class": "Bowl"}
    assert json.loads(motion.scenario_json)["final_com"] == [0.0, 0.0, 0.4]
    with pytest.raises(ScenarioError, match="Bowl"):
        stored(motion)
    scenario = replace(mt.scenario_files.load(folder / "task.toml"), surface=Bowl())
    robot = mt.load_robot(folder / "robot")
    assert mt.audit(robot, motion, scenario)["penetration"].worst == pytest.approx(0.0, abs=1e-9)
    lower = mt.audit(robot, motion, replace(scenario, surface=Bowl(depth=-0.1)))
    assert lower["penetration"].worst == pytest.approx(0.1)
