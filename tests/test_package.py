from __future__ import annotations

import subprocess
import sys
import zipfile
from pathlib import Path

import multimodal_to

ROOT = Path(__file__).parents[1]


def test_the_wheel_holds_the_package_and_the_robots_files(tmp_path):
    subprocess.run(
        [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", tmp_path],
        cwd=ROOT,
        check=True,
        capture_output=True,
    )
    (wheel,) = tmp_path.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
    assert {
        "multimodal_to/py.typed",
        "multimodal_to/robots/ironcub/ironcub.urdf",
        "multimodal_to/robots/ironcub/robot.toml",
        "multimodal_to/robots/ironcub/README.md",
    } <= names
    assert not [name for name in names if name.startswith(("tests/", "examples/"))]


def test_every_public_name_exists_and_is_documented():
    for name in multimodal_to.__all__:
        thing = getattr(multimodal_to, name)
        assert thing.__doc__, name
