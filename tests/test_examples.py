from __future__ import annotations

import pytest

from places import EXAMPLES

NAMES = sorted(file.stem for file in EXAMPLES.glob("[0-9]*.py"))


def an_own_scenario_is_met(printed, trajectory):
    assert "the file says the same: True" in printed
    assert trajectory.scenario == "higher"
    assert trajectory.com_position[:, -1] == pytest.approx([0.0, 0.0, 0.8], abs=1e-8)


ALSO = {"07_own_scenario": an_own_scenario_is_met}
"""What else an example shows; in the same test, since another would wait until the example has run."""


@pytest.mark.parametrize("name", NAMES)
def test_every_example_runs(name, run_example):
    printed, trajectory = run_example(name)
    assert "optimal after" in printed
    assert "physically true: True" in printed
    if name in ALSO:
        ALSO[name](printed, trajectory)


def test_every_example_with_more_to_show_exists():
    assert set(ALSO) <= set(NAMES)


def test_every_example_is_short():
    assert max(len((EXAMPLES / f"{name}.py").read_text(encoding="utf-8").splitlines()) for name in NAMES) <= 40
