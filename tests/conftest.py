from __future__ import annotations

import contextlib
import io
import os
import pickle
import runpy
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest
from filelock import FileLock

import multimodal_to as mt
from places import EXAMPLES

SHORT = {
    "take_off": (35, 0.2, 0.2),
    "landing": (35, 0.2, 0.2),
    "take_off_and_landing": (80, 0.1, 0.2),
    "walk_to_fly": (50, 0.2, 0.2),
}
"""Knots and range of the time step [s] of the scenarios in the examples' tests: half as many as in earnest, or less."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put the longest tests first, so that no process is left alone with one of them at the end."""
    items.sort(key=lambda item: item.path.parent.name != "solving" and item.path.stem != "test_examples")


@pytest.fixture(scope="session")
def ironcub() -> mt.Robot:
    return mt.load_robot("ironcub")


@pytest.fixture(scope="session")
def once(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Any]:
    """Make a thing once a session, whichever of the processes that run the tests needs it first; others wait for it."""
    base = tmp_path_factory.getbasetemp()
    folder = base.parent if "PYTEST_XDIST_WORKER" in os.environ else base

    def made(name: str, make: Callable[[], Any]) -> Any:
        file = folder / f"{name}.pickle"
        with FileLock(f"{file}.lock"):
            if not file.exists():
                file.write_bytes(pickle.dumps(make()))
        return pickle.loads(file.read_bytes())

    return made


@pytest.fixture(scope="session")
def take_off(ironcub: mt.Robot, once: Callable[..., Any]) -> mt.Solution:
    """The take-off with all its knots, from the plain start guess with default options."""
    return once("take-off", lambda: mt.solve(mt.build(ironcub, mt.scenarios.take_off())))


@pytest.fixture(scope="session")
def run_example(
    tmp_path_factory: pytest.TempPathFactory, once: Callable[..., Any]
) -> Callable[[str], tuple[str, mt.Trajectory]]:
    """Run an example by its name, once a session, with short scenarios; what it prints, and the trajectory it saves."""

    def run(name: str) -> tuple[str, mt.Trajectory]:
        printed, folder = io.StringIO(), tmp_path_factory.mktemp(name)
        with pytest.MonkeyPatch.context() as patch, contextlib.redirect_stdout(printed):
            for scenario, (knots, least, greatest) in SHORT.items():
                short = replace(
                    getattr(mt.scenarios, scenario)(), knots=knots, interval_min=least, interval_max=greatest
                )
                patch.setattr(mt.scenarios, scenario, lambda short=short: short)
            patch.chdir(folder)
            runpy.run_path(str(EXAMPLES / f"{name}.py"))
        (file,) = folder.rglob("trajectory.npz")
        return printed.getvalue(), mt.Trajectory.load(file)

    return lambda name: once(name, lambda: run(name))
