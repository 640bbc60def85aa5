from __future__ import annotations

import re
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

from packaging.requirements import Requirement
from packaging.version import Version

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


def versions(file: str) -> dict[str, Version]:
    """The versions that a file of constraints names, by package."""
    lines = [line for line in (ROOT / file).read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
    assert [line for line in lines if not re.fullmatch(r"[\w.-]+==[\w.!+]+", line)] == []
    return {normal(name): Version(version) for name, version in (line.split("==") for line in lines)}


def normal(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def test_every_package_that_is_asked_for_has_a_tested_version_that_is_allowed():
    described = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    lists = (*described["project"]["optional-dependencies"].values(), *described["dependency-groups"].values())
    texts = [*described["project"]["dependencies"], *(text for texts in lists for text in texts)]
    tested = versions("constraints.txt")
    for requirement in (Requirement(text) for text in texts if isinstance(text, str)):
        assert tested[normal(requirement.name)] in requirement.specifier, requirement


def test_the_oldest_versions_are_the_lower_bounds_of_what_is_allowed():
    described = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    allowed = {requirement.name: requirement for requirement in map(Requirement, described["project"]["dependencies"])}
    for name, version in versions("oldest.txt").items():
        (bound,) = allowed[name].specifier
        assert (bound.operator, Version(bound.version)) == (">=", version)
