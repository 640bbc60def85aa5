from __future__ import annotations

import pytest

from conftest import EXAMPLES

NAMES = sorted(file.stem for file in EXAMPLES.glob("[0-9]*.py"))


@pytest.mark.parametrize("name", NAMES)
def test_every_example_runs(name, run_example):
    printed, _ = run_example(name)
    assert "optimal after" in printed
    assert "physically true: True" in printed


def test_an_own_scenario_is_met(run_example):
    printed, trajectory = run_example("07_own_scenario")
    assert "the file says the same: True" in printed
    assert trajectory.scenario == "aside"
    assert trajectory.com_position[:, -1] == pytest.approx([0.0, 0.2, 0.8], abs=1e-8)


def test_every_example_is_short():
    assert max(len((EXAMPLES / f"{name}.py").read_text(encoding="utf-8").splitlines()) for name in NAMES) <= 40
