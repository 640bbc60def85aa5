from __future__ import annotations

import re

import numpy as np
import pytest

from places import EXAMPLES

NAMES = sorted(file.stem for file in EXAMPLES.glob("[0-9]*.py"))


def an_own_scenario_is_met(printed, trajectory):
    assert "the file says the same: True" in printed
    assert trajectory.scenario == "higher"
    assert trajectory.com_position[:, -1] == pytest.approx([0.0, 0.0, 0.8], abs=1e-8)


def it_trots(printed, trajectory):
    """Four feet step twice each, as high as asked, and none of them slips; it stands at the end in MuJoCo as well."""
    assert printed.count(" m high") == 8
    lifts = [float(lift) for lift in re.findall(r"([0-9.]+) m high", printed)]
    assert min(lifts) >= 0.07 * 0.199 - 1e-3  # a foot swings over 7 % of the standing height
    assert "MuJoCo: it stands" in printed
    points, forces = trajectory.per_contact("contact_positions"), trajectory.per_contact("contact_forces")
    stands = (forces[:, 2, 1:] > 1.0) & (forces[:, 2, :-1] > 1.0)
    assert np.abs(np.diff(points[:, :2], axis=2)).max(axis=1)[stands].max() < 1e-5
    assert trajectory.com_position[0, -1] == pytest.approx(0.3, abs=1e-5)


def it_steps_aside(printed, trajectory):
    assert printed.count(" foot from ") == 4
    assert "MuJoCo: it stands" in printed
    assert trajectory.com_position[1, -1] == pytest.approx(0.3, abs=1e-5)


def a_jet_has_failed(printed, trajectory):
    assert "left chest: 0 N in the hover" in printed
    assert np.abs(trajectory.thrust[trajectory.jet_names.index("left chest")]).max() < 1e-6


def it_lands_on_the_box(printed, trajectory):
    """Heels that land on the edge of the box slip off it in MuJoCo, so they are asked to land beyond it."""
    assert "MuJoCo: it stands" in printed
    heels = [row for row, name in enumerate(trajectory.contact_names) if name[-1] in "34"]
    landed = trajectory.per_contact("contact_positions")[heels, :, 73:]
    assert landed[:, 0].max() < -0.16 + 1e-5
    assert landed[:, 2] == pytest.approx(np.full(landed[:, 2].shape, 0.1), abs=1e-4)


def a_robot_jumps(printed, trajectory):
    assert printed.count("physically true: True") == 2
    assert "has no jets; expected some for 'take-off'" in printed
    assert trajectory.com_position[2].max() > trajectory.com_position[2, 0] + 0.1 - 1e-6


ALSO = {
    "07_own_scenario": an_own_scenario_is_met,
    "15_trot": it_trots,
    "16_sidesteps": it_steps_aside,
    "17_failed_jet": a_jet_has_failed,
    "18_jump_onto_box": it_lands_on_the_box,
    "20_first_tasks": a_robot_jumps,
}
"""What else an example shows; in the same test, since another would wait until the example has run."""

LONG = ("18_jump_onto_box",)
"""Examples that are at the edge of what motors can: after a small change they may take many times as long."""


@pytest.mark.parametrize("name", [pytest.param(name, marks=[pytest.mark.robots] * (name in LONG)) for name in NAMES])
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
