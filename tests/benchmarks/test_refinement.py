"""The order of the integration rules, by the study of benchmarks/refinement.py."""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
import pytest

import multimodal_to as mt
import refinement
from multimodal_to import scenarios
from multimodal_to.auditing.findings import Motion
from multimodal_to.auditing.integrator import Controls
from pages import marks

ORDERS = {"backward-euler": 1, "leapfrog": 2}
"""Each rule with its order."""


@pytest.fixture(scope="module")
def flight(ironcub):
    """The robot in the air, which tumbles and moves its joints."""
    robot = ironcub.with_jets(())
    return Controls.of(Motion.of(robot, refinement.free_flight(robot)), steps=16)


@pytest.mark.parametrize(("rule", "order"), ORDERS.items())
def test_a_robot_in_the_air_is_followed_with_the_order_that_the_rule_says(flight, rule, order):
    found = refinement.errors(flight, refinement.RULES[rule], refinement.PARTS)
    base = [entry.base for entry in found]
    assert base[0] > np.radians(0.1)
    assert refinement.orders(base) == pytest.approx([order, order], abs=0.1)
    if order == 1:
        assert refinement.orders([entry.com for entry in found]) == pytest.approx([1, 1], abs=0.01)
    else:
        assert max(entry.com for entry in found) < 1e-9  # a throw is exact


@pytest.mark.parametrize(("rule", "order"), ORDERS.items())
def test_the_take_off_is_followed_with_the_order_that_the_rule_says(ironcub, take_off, rule, order):
    """Contact forces, throttles and the way of the joints are those of a plan, whichever rule it was solved by."""
    controls = Controls.of(Motion.of(ironcub, take_off.trajectory), steps=16)
    found = refinement.errors(controls, refinement.RULES[rule], refinement.PARTS, starts=6)
    com, base = [entry.com for entry in found], [entry.base for entry in found]
    assert com[0] > 1e-4
    assert refinement.orders(com)[-1] == pytest.approx(order, abs=0.2)
    assert refinement.orders(base)[-1] == pytest.approx(order, abs=0.3)


def test_steps_of_the_plans_own_length_lead_to_the_plan(ironcub, take_off):
    """So the rows of the study are those that the plan was solved with."""
    plan = take_off.trajectory
    rule = next(rule for rule in refinement.RULES.values() if rule.name == plan.rule)
    controls = Controls.of(Motion.of(ironcub, plan))
    first, intervals = np.array([0, 20, 40]), 5
    step = refinement._step(ironcub, rule, first.size)
    states = refinement._flow(controls, rule, step, first, intervals, parts=1)
    assert states[:, :3] == pytest.approx(plan.com_position[:, first + intervals].T, abs=1e-4)
    assert states[:, 13:17] == pytest.approx(plan.thrust[:, first + intervals].T, abs=1e-2)


def test_plans_on_finer_steps_are_solved_and_shown_with_their_orders(monkeypatch, capsys):
    squat = replace(
        mt.scenarios.jump(),
        name="squat",
        knots=4,
        mid_height_min=None,
        final_com=(0.0, 0.0, 0.54),
        interval_min=0.2,
        interval_max=0.2,
        allowances={},
    )
    monkeypatch.setattr(scenarios, "find", lambda name: squat)
    monkeypatch.setenv("COLUMNS", "160")
    monkeypatch.setattr(sys, "argv", ["refinement", "--solve", "squat", "--rule", "executable", "--parts", "1", "2"])
    refinement.main()
    coarse, fine = (line for line in capsys.readouterr().out.splitlines() if "│ squat" in line)
    assert "│ 4 " in coarse
    assert "│ 8 " in fine
    assert "(" in fine
    assert "optimal" in fine


def test_a_study_of_controls_prints_each_rule_on_each_step_and_fills_a_page(monkeypatch, capsys, tmp_path):
    page = tmp_path / "page.md"
    page.write_text("before\n{}\nold\n{}\nafter\n".format(*marks("refinement")), encoding="utf-8")
    monkeypatch.setenv("COLUMNS", "160")
    monkeypatch.setattr(sys, "argv", ["refinement", "free-flight", "--parts", "1", "2", "--into", str(page)])
    refinement.main()
    lines = [line for line in capsys.readouterr().out.splitlines() if "free-flight" in line]
    assert [line.split("│")[2].strip() for line in lines] == ["backward-euler"] * 2 + ["leapfrog"] * 2
    assert "(1.0)" in lines[1]
    assert "(2.0)" in lines[3]
    text = page.read_text(encoding="utf-8")
    assert text.startswith("before\n")
    assert text.endswith("after\n")
    assert "old" not in text
    first, second = (line for line in text.splitlines() if line.startswith("| free-flight"))
    assert first.endswith("; order 1.0 | – |")
    assert "| leapfrog | 50, 25 | exact | " in second
    page.write_text("no marks", encoding="utf-8")
    with pytest.raises(SystemExit, match="lacks the marks"):
        refinement.main()


def test_a_rule_that_does_not_exist_is_refused(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["refinement", "--rule", "trapezoid"])
    with pytest.raises(SystemExit):
        refinement.main()
    assert "no rule trapezoid; expected backward-euler, leapfrog" in capsys.readouterr().err
