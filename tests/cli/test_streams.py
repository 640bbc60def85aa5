"""What a stream cannot say is said in ASCII: no command fails for its output."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from commands import run_into
from drones import drone
from synthetic import take_off

ENCODINGS = pytest.mark.parametrize("encoding", ["ascii", "cp1252", "cp437", "utf-8"])
NAME = "Größe ² ←中"
"""Letters and signs that each of the encodings lacks some of."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """A robot and a motion whose names no small encoding can say."""
    folder = tmp_path_factory.mktemp("names") / NAME
    folder.mkdir()
    robot = drone(folder)
    for file in (folder / "drone.urdf", folder / "robot.toml"):
        text = file.read_text(encoding="utf-8")
        file.write_text(text.replace("foot_0", NAME).replace('"drone"', f'"{NAME}"'), encoding="utf-8")
    (folder / "task.toml").write_text(run_into("utf-8", "show", "take-off").stdout, encoding="utf-8")
    take_off(robot).save(folder / f"{NAME}.npz")
    return folder


@ENCODINGS
@pytest.mark.parametrize(
    "arguments",
    [
        ("--help",),
        ("list",),
        ("show", "take-off"),
        ("robot", "info", "."),
        ("robot", "info", "drone.urdf"),
        ("robot", "info", "ironcub"),
        ("robot", "info", f"no {NAME}"),
        ("doctor", "take-off", "--robot", "."),
        ("doctor", "take-off", "--set", f"title={NAME}", "--json"),
        ("audit", f"{NAME}.npz", "--robot", "."),
        ("show", f"{NAME}.npz", "--torques", "--robot", "."),
        ("export", f"{NAME}.npz", "--to", "csv", "--robot", "."),
        ("simulate", f"{NAME}.npz", "--delay", NAME),
        ("solve", "take-off", f"--{NAME}"),
    ],
    ids=lambda arguments: " ".join(arguments).replace(NAME, "NAME"),
)
def test_every_command_fits_its_output_to_the_stream(folder, encoding, arguments):
    ended = run_into(encoding, *arguments, cwd=folder)
    assert "Traceback" not in ended.stderr
    assert ended.returncode in (0, 1, 2)
    assert ended.stdout or ended.stderr
    if encoding == "utf-8":
        assert "\\u" not in ended.stdout + ended.stderr


def test_signs_become_signs_of_ascii_and_letters_keep_apart(folder):
    said = run_into("ascii", "robot", "info", "drone.urdf", cwd=folder).stdout
    assert "<-" in said
    assert r"Gr\xf6\xdfe 2 <-\u4e2d" in said


@ENCODINGS
def test_what_programs_read_is_true_in_every_encoding(folder, encoding):
    task = run_into(encoding, "show", "take-off", "--set", f'title="{NAME} \\" \\\\"', cwd=folder)
    assert tomllib.loads(task.stdout)["title"] == f'{NAME} " \\'
    data = json.loads(run_into(encoding, "doctor", "take-off", "--json", "--robot", ".", cwd=folder).stdout)
    assert data["robot"] == NAME


@pytest.mark.parametrize("encoding", ["ascii", "cp1252"])
def test_a_process_writes_to_such_a_stream(folder, encoding):
    environment = {**os.environ, "PYTHONIOENCODING": encoding, "PYTHONUTF8": "0", "LC_ALL": "C"}
    command = [sys.executable, "-m", "multimodal_to", "robot", "info", "ironcub"]
    ended = subprocess.run(command, capture_output=True, check=True, timeout=300, env=environment)
    assert "<-" in ended.stdout.decode(encoding)
    assert ended.stderr == b""
